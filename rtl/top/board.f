// the whole design with the board around it
-f chip.f
../io/pll_restart.v
../io/pll_adc.v
rtds_top.v
