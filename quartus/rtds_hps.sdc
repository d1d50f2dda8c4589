# Constraints of rtds_top_hps. Never read by Quartus. One clock: the bridge is given it on this side, and crosses to the ARM's itself.
create_clock -name clk_sys -period 20.000 [get_ports {FPGA_CLK1_50}]
derive_clock_uncertainty

# The button comes at any time, and so does the HPS' reset, which no clock of this design launches: both enter the clears of one
# reset synchroniser only. All other resets are timed.
set_false_path -from [get_ports {KEY[*]}]
set_false_path -to [get_ports {LED[*]}]
