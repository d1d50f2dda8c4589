// chip_tb: rtds_chip between an LTC2308, a quad DAC, pads and a serial line. Clocks are made here, so that Icarus runs at full
// speed; their phase, their jitter, the PLL's lock, the pads' delays and the ADC's conversion time are the test's to set.
`default_nettype none
`timescale 1ps / 1ps

module chip_tb #(
    parameter [11:0] RESET_CODE = 12'h800,  // 800: DAC7624, 000: DAC7625
    parameter        CLKS_PER_BIT = 8       // 50 on the board; 8 to spend less time on the serial line
);

  // set by the test; times in ps
  reg         ext_rst_n;
  reg         locked;
  reg         adc_stopped;   // 1: the PLL's clocks stand
  reg         sys_stopped;   // 1: the 50 MHz stands
  reg  [31:0] phase;         // of the 40 MHz against the 50 MHz
  reg  [31:0] jitter;        // each edge of the 50 MHz moves by up to this (SCK may not: it is at its limit)
  reg  [95:0] adc_codes;
  reg  [31:0] t_conv;
  reg  [31:0] d_convst;      // pads
  reg  [31:0] d_sck;
  reg  [31:0] d_sdi;
  reg  [31:0] d_sdo;
  reg  [31:0] d_bus;
  reg  [31:0] d_cs;
  reg  [31:0] d_ldac;
  reg  [31:0] d_reset;
  reg         sdo_stuck;
  reg         sdo_level;
  reg         agent_clear;
  reg         forgive;
  reg         uart_rx;

  // looked at by the test
  reg         clk_sys;
  reg         clk_adc;
  reg         clk_cnv;
  wire        uart_tx;
  wire [ 7:0] led;
  wire [47:0] dac_codes;     // what the DAC's outputs show
  wire [31:0] dac_updates;
  wire [15:0] adc_violations;
  wire [15:0] dac_violations;
  wire [31:0] conversions;
  wire        dac_reset_n;
  wire        dac_ldac_n;
  wire [ 2:0] adc_channel;
  wire        adc_channel_known;
  wire [31:0] adc_last_convst;

  wire        convst;
  wire        sck;
  wire        sdi;
  wire        sdo_at_part;
  wire [11:0] db;
  wire [ 1:0] a;
  wire        cs_n;
  wire        rw;
  reg         convst_at_part;
  reg         sck_at_part;
  reg         sdi_at_part;
  reg         sdo;
  reg  [13:0] bus_at_part;
  reg         cs_n_at_part;
  reg         ldac_n_at_part;
  reg         reset_n_at_part;

  // Jitter moves an edge, not those after it. A change of `phase` acts once, as a delay of the half clock that begins next.
  reg  [31:0] phase_now;
  reg  [31:0] phase_next;
  integer     seed;
  integer     moved_now;
  integer     moved_before;

  initial begin
    ext_rst_n       = 1'b0;
    locked          = 1'b0;
    adc_stopped     = 1'b0;
    sys_stopped     = 1'b0;
    phase           = 0;
    phase_now       = 0;
    phase_next      = 0;
    jitter          = 0;
    adc_codes       = {8{12'h800}};
    t_conv          = 1600000;
    d_convst        = 4000;
    d_sck           = 4000;
    d_sdi           = 4000;
    d_sdo           = 4000;
    d_bus           = 4000;
    d_cs            = 4000;
    d_ldac          = 4000;
    d_reset         = 4000;
    sdo_stuck       = 1'b0;
    sdo_level       = 1'b0;
    agent_clear     = 1'b1;
    forgive         = 1'b0;
    uart_rx         = 1'b1;
    clk_sys         = 1'b0;
    clk_adc         = 1'b0;
    clk_cnv         = 1'b0;
    convst_at_part  = 1'b0;
    sck_at_part     = 1'b0;
    sdi_at_part     = 1'b0;
    sdo             = 1'b0;
    bus_at_part     = 14'd0;
    cs_n_at_part    = 1'b1;
    ldac_n_at_part  = 1'b1;
    reset_n_at_part = 1'b0;
    seed            = 7;
    moved_now       = 0;
    moved_before    = 0;
  end

  always begin
    moved_before = moved_now;
    moved_now    = (jitter == 0) ? 0 : ($random(seed) % $signed(jitter + 1));
    #(10000 + moved_now - moved_before);
    if (!sys_stopped) clk_sys = !clk_sys;
  end

  always begin
    phase_next = phase;
    #(12500 + (25000 + phase_next - phase_now) % 25000);
    phase_now = phase_next;
    if (!adc_stopped) clk_adc = !clk_adc;
  end

  always @(clk_adc) clk_cnv <= #7500 clk_adc;

  // An input buffer makes some level of a floating or undefined line: 0 here, so that no X gets past a pad.
  function level(input pin);
    level = (pin === 1'b1);
  endfunction

  // Transport delays, shorter than the shortest pulse.
  always @(convst) convst_at_part <= #(d_convst) convst;
  always @(sck) sck_at_part <= #(d_sck) sck;
  always @(sdi) sdi_at_part <= #(d_sdi) sdi;
  always @(sdo_at_part or sdo_stuck or sdo_level) sdo <= #(d_sdo) level(sdo_stuck ? sdo_level : sdo_at_part);
  always @(db or a) bus_at_part <= #(d_bus) {a, db};
  always @(cs_n) cs_n_at_part <= #(d_cs) cs_n;
  always @(dac_ldac_n) ldac_n_at_part <= #(d_ldac) dac_ldac_n;
  always @(dac_reset_n) reset_n_at_part <= #(d_reset) dac_reset_n;

  rtds_chip #(
      .UART_CLKS_PER_BIT(CLKS_PER_BIT)
  ) chip (
      .clk_sys_i   (clk_sys),
      .clk_adc_i   (clk_adc),
      .clk_cnv_i   (clk_cnv),
      .pll_locked_i(locked),
      .ext_rst_ni  (ext_rst_n),
      .adc_convst_o(convst),
      .adc_sck_o   (sck),
      .adc_sdi_o   (sdi),
      .adc_sdo_i   (sdo),
      .dac_db_o    (db),
      .dac_a_o     (a),
      .dac_cs_no   (cs_n),
      .dac_rw_o    (rw),
      .dac_ldac_no (dac_ldac_n),
      .dac_reset_no(dac_reset_n),
      .uart_rx_i   (uart_rx),
      .uart_tx_o   (uart_tx),
      .led_o       (led)
  );

  ltc2308 adc (
      .convst_i         (convst_at_part),
      .sck_i            (sck_at_part),
      .sdi_i            (sdi_at_part),
      .sdo_o            (sdo_at_part),
      .codes_i          (adc_codes),
      .t_conv_ps_i      (t_conv),
      .clear_i          (agent_clear),
      .forgive_i        (forgive),
      .violations_o     (adc_violations),
      .violation_count_o(),
      .conversions_o    (conversions),
      .channel_o        (adc_channel),
      .channel_known_o  (adc_channel_known),
      .t_last_convst_o  (adc_last_convst)
  );

  dac7624 #(
      .RESET_CODE(RESET_CODE)
  ) dac (
      .db_i             (bus_at_part[11:0]),
      .a_i              (bus_at_part[13:12]),
      .cs_ni            (cs_n_at_part),
      .rw_i             (rw),
      .ldac_ni          (ldac_n_at_part),
      .reset_ni         (reset_n_at_part),
      .forgive_i        (forgive),
      .codes_o          (dac_codes),
      .updates_o        (dac_updates),
      .violations_o     (dac_violations),
      .violation_count_o()
  );

endmodule

`default_nettype wire
