// ltc2308: the LTC2308 at its pins, with every time of its data sheet checked in real time.
//
// Behaviour  A rising CONVST samples the channel selected by the last complete word and converts for
//            t_conv_ps_i. SDO floats from there; at the end of the conversion it shows bit 11 before any clock
//            (if CONVST is low by then), the rest on falling SCK. The first six rising SCK edges take the word; it
//            selects the next conversion. After power-up the channel is undefined: the first result is BAD.
//            After a falling SCK edge SDO keeps its bit for 4 ns, is undefined up to 12.5 ns, then valid: a
//            master that looks at any other time gets a wrong bit.
// Checks     Each violation sets its bit in violations_o for ever, is counted in violation_count_o and printed. The
//            limits are the data sheet's worst case whatever t_conv_ps_i is: a master must not rely on a
//            fast specimen.
// Use        Simulation only. Times in ps on the inputs so that a test can change them while it runs;
//            clear_i (level) forgets the history, e.g. around a reset of the master; forgive_i (level) clears the
//            violations.
`default_nettype none
`timescale 1ps / 1ps

module ltc2308 (
    input  wire        convst_i,
    input  wire        sck_i,
    input  wire        sdi_i,
    output wire        sdo_o,
    input  wire [95:0] codes_i,            // what each channel would read, channel c at 12*c+11..12*c
    input  wire [31:0] t_conv_ps_i,        // 1300000 typical, 1600000 at most
    input  wire        clear_i,
    input  wire        forgive_i,
    output reg  [15:0] violations_o,
    output reg  [31:0] violation_count_o,
    output reg  [31:0] conversions_o,      // conversions started
    output reg  [ 2:0] channel_o,          // channel of the last conversion
    output reg         channel_known_o,
    output reg  [31:0] t_last_convst_o     // time of the last rising CONVST, ps modulo 2^32
);

  localparam [63:0] T_CONVST_HIGH = 20000;
  localparam [63:0] T_CONVST_LATE = 40000;
  localparam [63:0] T_CONV_MAX = 1600000;
  localparam [63:0] T_CYCLE = 2000000;
  localparam [63:0] T_SCK_PERIOD = 25000;
  localparam [63:0] T_SCK_HIGH = 10000;
  localparam [63:0] T_SCK_LOW = 10000;
  localparam [63:0] T_SDI_HOLD = 2500;
  localparam [63:0] T_ACQUIRE = 240000;
  localparam [63:0] T_SCK_TO_CONVST = 20000;
  localparam T_SDO_HOLD = 4000;
  localparam T_SDO_VALID = 12500;

  // Bits of violations_o; tb/agents/ltc2308.py names them in the same order.
  localparam CONVST_SHORT = 0;     // high for less than 20 ns
  localparam CONVST_LATE_LOW = 1;  // falls between 40 ns and the end of the longest conversion
  localparam CYCLE_SHORT = 2;      // less than 2 us from CONVST to CONVST
  localparam SCK_EARLY = 3;        // SCK moves before the longest conversion has ended
  localparam SCK_FAST = 4;         // period below 25 ns
  localparam SCK_HIGH_SHORT = 5;   // below 10 ns
  localparam SCK_LOW_SHORT = 6;    // below 10 ns
  localparam SDI_SETUP = 7;        // changes with the rising SCK edge (set-up 0 ns)
  localparam SDI_HOLD = 8;         // changes less than 2.5 ns after it
  localparam ACQUISITION = 9;      // less than 240 ns from the 7th rising SCK to CONVST
  localparam SCK_TO_CONVST = 10;   // less than 20 ns from the last falling SCK to CONVST
  localparam SCK_COUNT = 11;       // a result was not read with exactly 12 pulses
  localparam WORD_MODE = 12;       // not single ended, unipolar, awake
  localparam PIN_UNKNOWN = 13;     // CONVST, SCK or a used SDI bit is X or Z

  time          t_convst;
  time          t_sck_rise;
  time          t_sck_fall;
  time          t_sck_7th;
  time          t_sdi;
  reg           any_convst;
  reg           any_sck_rise;
  reg           any_sck_fall;
  integer       pulses;         // rising SCK edges since CONVST
  reg           converting;
  reg           bus_on;
  reg    [ 5:0] word;
  reg    [ 2:0] select;
  reg           select_known;
  reg    [11:0] result;
  reg           sdo;
  integer       run;            // number of the conversion: an old one's end must not touch a new one's SDO

  // The least (and where there is an upper limit, the largest) of each time seen so far, ps.
  reg    [31:0] convst_high_min;
  reg    [31:0] convst_high_max;
  reg    [31:0] cycle_min;
  reg    [31:0] first_sck_min;
  reg    [31:0] sck_period_min;
  reg    [31:0] sck_high_min;
  reg    [31:0] sck_low_min;
  reg    [31:0] sdi_setup_min;
  reg    [31:0] sdi_hold_min;
  reg    [31:0] acquisition_min;
  reg    [31:0] sck_to_convst_min;

  function [31:0] least(input [31:0] known, input [63:0] seen);
    least = (seen < {32'd0, known}) ? seen[31:0] : known;
  endfunction

  task violate(input integer which);
    begin
      violations_o[which] = 1'b1;
      violation_count_o = violation_count_o + 1;
      $display("%0t ps: LTC2308 violation %0d", $time, which);
    end
  endtask

  task forget;
    begin
      any_convst   = 1'b0;
      any_sck_rise = 1'b0;
      any_sck_fall = 1'b0;
      pulses       = 0;
      converting   = 1'b0;
      bus_on       = 1'b0;
      run          = run + 1;
    end
  endtask

  initial begin
    violations_o      = 16'd0;
    violation_count_o = 0;
    conversions_o     = 0;
    channel_o         = 3'd0;
    channel_known_o   = 1'b0;
    t_last_convst_o   = 0;
    t_convst          = 0;
    t_sck_rise        = 0;
    t_sck_fall        = 0;
    t_sck_7th         = 0;
    t_sdi             = 0;
    word              = 6'd0;
    select            = 3'd0;
    select_known      = 1'b0;
    result            = 12'd0;
    sdo               = 1'b0;
    run               = 0;
    convst_high_min   = 32'hFFFF_FFFF;
    convst_high_max   = 0;
    cycle_min         = 32'hFFFF_FFFF;
    first_sck_min     = 32'hFFFF_FFFF;
    sck_period_min    = 32'hFFFF_FFFF;
    sck_high_min      = 32'hFFFF_FFFF;
    sck_low_min       = 32'hFFFF_FFFF;
    sdi_setup_min     = 32'hFFFF_FFFF;
    sdi_hold_min      = 32'hFFFF_FFFF;
    acquisition_min   = 32'hFFFF_FFFF;
    sck_to_convst_min = 32'hFFFF_FFFF;
    forget;
  end

  assign sdo_o = bus_on ? sdo : 1'bz;

  always @(posedge clear_i) forget;

  always @(posedge forgive_i) begin
    violations_o      = 16'd0;
    violation_count_o = 0;
  end

  // Undefined levels. At time 0 nothing is driven yet.
  always @(convst_i or sck_i)
    if ($time != 0 && !clear_i && ((convst_i ^ convst_i) !== 1'b0 || (sck_i ^ sck_i) !== 1'b0))
      violate(PIN_UNKNOWN);

  always @(posedge convst_i)
    if (!clear_i) begin
      if (any_convst && $time - t_convst < T_CYCLE) violate(CYCLE_SHORT);
      if (any_convst && pulses != 12) violate(SCK_COUNT);
      if (any_convst) cycle_min = least(cycle_min, $time - t_convst);
      if (pulses >= 7) acquisition_min = least(acquisition_min, $time - t_sck_7th);
      if (any_sck_fall) sck_to_convst_min = least(sck_to_convst_min, $time - t_sck_fall);
      if (pulses >= 7 && $time - t_sck_7th < T_ACQUIRE) violate(ACQUISITION);
      if (sck_i !== 1'b0 || (any_sck_fall && $time - t_sck_fall < T_SCK_TO_CONVST)) violate(SCK_TO_CONVST);
      any_convst      = 1'b1;
      t_convst        = $time;
      t_last_convst_o = t_convst[31:0];
      pulses          = 0;
      any_sck_rise    = 1'b0;
      any_sck_fall    = 1'b0;
      bus_on          = 1'b0;
      converting      = 1'b1;
      conversions_o   = conversions_o + 1;
      channel_o       = select;
      channel_known_o = select_known;
      result          = select_known ? codes_i[12*select+:12] : 12'hBAD;
      run             = run + 1;
    end

  // The end of the conversion that began at this edge.
  always @(posedge convst_i)
    if (!clear_i) begin : conversion
      integer mine;
      #1 mine = run;
      #(t_conv_ps_i - 1);
      if (mine == run) begin
        converting = 1'b0;
        sdo        = result[11];
        bus_on     = !convst_i;
      end
    end

  always @(negedge convst_i)
    if (!clear_i && any_convst) begin
      convst_high_min = least(convst_high_min, $time - t_convst);
      if ($time - t_convst > {32'd0, convst_high_max}) convst_high_max = $time - t_convst;
      if ($time - t_convst < T_CONVST_HIGH) violate(CONVST_SHORT);
      if ($time - t_convst > T_CONVST_LATE && $time - t_convst < T_CONV_MAX) violate(CONVST_LATE_LOW);
      if (!converting) bus_on = 1'b1;
    end

  always @(sdi_i) begin
    if (!clear_i && any_sck_rise && pulses >= 1 && pulses <= 6) begin
      sdi_hold_min = least(sdi_hold_min, $time - t_sck_rise);
      if ($time == t_sck_rise) violate(SDI_SETUP);
      else if ($time - t_sck_rise < T_SDI_HOLD) violate(SDI_HOLD);
    end
    t_sdi = $time;
  end

  always @(posedge sck_i)
    if (!clear_i) begin
      if (any_convst && pulses == 0) first_sck_min = least(first_sck_min, $time - t_convst);
      if (any_sck_rise) sck_period_min = least(sck_period_min, $time - t_sck_rise);
      if (any_sck_fall) sck_low_min = least(sck_low_min, $time - t_sck_fall);
      if (pulses < 6 && t_sdi != 0) sdi_setup_min = least(sdi_setup_min, $time - t_sdi);
      if (any_convst && $time - t_convst < T_CONV_MAX) violate(SCK_EARLY);
      if (any_sck_rise && $time - t_sck_rise < T_SCK_PERIOD) violate(SCK_FAST);
      if (any_sck_fall && $time - t_sck_fall < T_SCK_LOW) violate(SCK_LOW_SHORT);
      t_sck_rise   = $time;
      any_sck_rise = 1'b1;
      if (pulses < 6) begin
        if (t_sdi == $time && t_sdi != 0) violate(SDI_SETUP);
        if ((sdi_i ^ sdi_i) !== 1'b0) violate(PIN_UNKNOWN);
        word = {word[4:0], sdi_i};
        if (pulses == 5) begin
          // S/D, O/S, S1, S0, UNI, SLP
          if (word[5] !== 1'b1 || word[1] !== 1'b1 || word[0] !== 1'b0) violate(WORD_MODE);
          select       = {word[3], word[2], word[4]};
          select_known = 1'b1;
        end
      end
      pulses = pulses + 1;
      if (pulses == 7) t_sck_7th = $time;
    end

  always @(negedge sck_i)
    if (!clear_i && any_sck_rise) begin
      sck_high_min = least(sck_high_min, $time - t_sck_rise);
      if ($time - t_sck_rise < T_SCK_HIGH) violate(SCK_HIGH_SHORT);
      t_sck_fall   = $time;
      any_sck_fall = 1'b1;
    end

  // SDO after a falling edge: the old bit, then undefined, then the new bit (0 after the last).
  always @(negedge sck_i)
    if (!clear_i && bus_on) begin : shift
      integer mine;
      reg     next;
      mine = run;
      next = (pulses < 12) ? result[11-pulses] : 1'b0;
      #(T_SDO_HOLD);
`ifdef VERILATOR
      if (mine == run) sdo = !next;  // two states only: the opposite of what comes
`else
      if (mine == run) sdo = 1'bx;
`endif
      #(T_SDO_VALID - T_SDO_HOLD);
      if (mine == run) sdo = next;
    end

endmodule

`default_nettype wire
