// the motors driven by the processor of the board, without the cells of the vendor
-f ../hps/hps.f
../io/reset_sync.v
rtds_top_hps.v
