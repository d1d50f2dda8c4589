// the whole design with the board around it
-f top.f
../io/pll_restart.v
../io/pll_adc.v
rtds_top.v
