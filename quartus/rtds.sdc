# Timing constraints of rtds_top. Every pattern is checked against the elaborated design by tb/quartus, under each way in
# which Quartus may name a cell (with and without the modules' names, a copy of a register, a register of its own output):
# one that matches nothing, or something else as well, fails the test. So do a port, a crossing and a reset for which there is
# no constraint. `*` crosses levels of hierarchy in names of registers; that is why the registers' own names are unique.

# --- clocks -------------------------------------------------------------------------------------------------------
create_clock -name clk_sys -period 20.000 [get_ports {FPGA_CLK1_50}]

# 40 MHz for the ADC and the same 7.5 ns later for CONVST, as u_pll_adc is set up. Counter 0 and 1 of the PLL.
create_generated_clock -name clk_adc -source [get_ports {FPGA_CLK1_50}] -multiply_by 4 -divide_by 5 \
    [get_pins -compatibility_mode {*u_pll_adc|u_pll|*general[0].gpll~PLL_OUTPUT_COUNTER|divclk}]
create_generated_clock -name clk_cnv -source [get_ports {FPGA_CLK1_50}] -multiply_by 4 -divide_by 5 -phase 108.0 \
    [get_pins -compatibility_mode {*u_pll_adc|u_pll|*general[1].gpll~PLL_OUTPUT_COUNTER|divclk}]

# SCK leaves through a double-data-rate output cell: high in the low half of clk_adc.
create_generated_clock -name adc_sck -invert \
    -source [get_pins -compatibility_mode {*u_pll_adc|u_pll|*general[0].gpll~PLL_OUTPUT_COUNTER|divclk}] \
    [get_ports {ADC_SCK}]

derive_clock_uncertainty

# --- LTC2308 --------------------------------------------------------------------------------------------------------
# SDI is taken at the rising SCK: set-up 0, hold 2.5 ns, 0.5 ns of board skew either way.
set_output_delay -clock adc_sck -max 0.5 [get_ports {ADC_SDI}]
set_output_delay -clock adc_sck -min -3.0 [get_ports {ADC_SDI}]
# SDO changes 4 to 12.5 ns after the falling SCK, caught a full period later; 0.5 ns of board each way.
set_input_delay -clock adc_sck -clock_fall -max 13.5 [get_ports {ADC_SDO}]
set_input_delay -clock adc_sck -clock_fall -min 4.0 [get_ports {ADC_SDO}]
# CONVST against SCK, pad against pad, clock trees included: with equal delays SCK rises 1605 ns after CONVST (64 clocks of
# 25 ns, 12.5 - 7.5), the data sheet wants 1600 (the longest conversion) to 1610 (240 ns of acquisition within 2 us). Seen
# from the SCK edge that follows CONVST by 5 ns: CONVST has to come 0 to 10 ns before it, 0.5 ns of board skew either way.
# ADC_SCK is a clock, so this bounds SCK's way to its pad as well.
set_output_delay -clock adc_sck -max 0.5 [get_ports {ADC_CONVST}]
set_output_delay -clock adc_sck -min -15.5 [get_ports {ADC_CONVST}]

# --- DAC7624/7625 -----------------------------------------------------------------------------------------------------
# Whole clocks (20 ns) separate data, CS and LDAC; 3 clocks are CS and LDAC low (50 ns wanted). So pins may leave
# anywhere within 10 ns of each other: clock to pin between 2 and 12 ns.
set_output_delay -clock clk_sys -max 8.0 \
    [get_ports {DAC_DB[*] DAC_A[*] DAC_CS_N DAC_LDAC_N DAC_RESET_N}]
set_output_delay -clock clk_sys -min -2.0 \
    [get_ports {DAC_DB[*] DAC_A[*] DAC_CS_N DAC_LDAC_N DAC_RESET_N}]

# --- crossings ----------------------------------------------------------------------------------------------------------
# First flop of every level synchroniser: its input has no timing.
set_false_path -to [get_registers {*cdc_meta_q*}]
# Held words: they stand at least one destination clock before they are taken; 15 ns keep them well inside of it.
set_max_delay -from [get_registers {*cdc_hold_q*}] -to [get_registers {*cdc_data_q*}] 15.0
set_min_delay -from [get_registers {*cdc_hold_q*}] -to [get_registers {*cdc_data_q*}] -15.0

# --- resets -------------------------------------------------------------------------------------------------------------
# The accepted lock falls at any time; it enters the clears of reset synchronisers only (and u_ok, a cdc_sync). The button does
# the same (cut below, with its port), and the PLL's lock, which no clock launches. All other resets are timed.
set_false_path -from [get_registers {*lock_ok_q*}] -to [get_registers {*rst_meta_q* *rst_sync_q* *rst_out_q*}]

# --- people and a slow serial line ------------------------------------------------------------------------------------------
set_false_path -from [get_ports {KEY[*] UART_RX}]
set_false_path -to [get_ports {LED[*] UART_TX DAC_RW}]
