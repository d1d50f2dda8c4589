// binary32 operators; no dependencies
fp_add.v
fp_mul.v
fp_div.v
fp_from_int.v
fp_to_int.v
