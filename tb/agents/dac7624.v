// dac7624: a DAC7624 (RESET_CODE 800) or DAC7625 (RESET_CODE 000) at its pins, with its times checked in real time.
//
// Behaviour  Level-triggered latches: the input register at address a_i follows db_i while CS and R/W are low; all four
//            DAC registers follow their input registers while LDAC is low; RESET low clears both ranks.
// Checks     Each violation sets its bit in violations_o, is counted in violation_count_o and printed; forgive_i (level)
//            clears them. Nothing is checked while RESET is low. TORN: LDAC falls although not all four input
//            registers were written since the last time, so outputs of different sets would meet.
// Use        Simulation only.
`default_nettype none
`timescale 1ps / 1ps

module dac7624 #(
    parameter [11:0] RESET_CODE = 12'h800
) (
    input  wire [11:0] db_i,
    input  wire [ 1:0] a_i,
    input  wire        cs_ni,
    input  wire        rw_i,
    input  wire        ldac_ni,
    input  wire        reset_ni,
    input  wire        forgive_i,
    output wire [47:0] codes_o,           // what the outputs show, output c at 12*c+11..12*c
    output reg  [31:0] updates_o,         // falling edges of LDAC
    output reg  [15:0] violations_o,
    output reg  [31:0] violation_count_o
);

  localparam [63:0] T_CS = 50000;
  localparam [63:0] T_LDAC = 50000;
  localparam [63:0] T_CS_TO_LDAC = 50000;
  localparam [63:0] T_LDAC_TO_CS = 70000;
  localparam [63:0] T_RESET = 50000;

  // Bits of violations_o; tb/agents/dac7624.py names them in the same order.
  localparam CS_SHORT = 0;       // below 50 ns
  localparam DATA_MOVED = 1;     // DB moves while CS is low
  localparam ADDRESS_MOVED = 2;  // A moves while CS is low
  localparam RW_MOVED = 3;       // R/W moves while CS is low, or is high
  localparam LDAC_SHORT = 4;     // below 50 ns
  localparam CS_TO_LDAC = 5;     // less than 50 ns from CS high to LDAC low, or CS still low
  localparam LDAC_TO_CS = 6;     // less than 70 ns from LDAC low to CS low
  localparam RESET_SHORT = 7;    // below 50 ns
  localparam TORN = 8;
  localparam PIN_UNKNOWN = 9;    // X or Z on a strobe, or on DB or A while CS is low

  reg  [47:0] inputs;
  reg  [47:0] outputs;
  reg  [ 3:0] written;
  time        t_cs_low;
  time        t_cs_high;
  time        t_ldac_low;
  time        t_reset_low;
  reg         any_cs;
  reg         any_ldac;
  wire        alive = (reset_ni === 1'b1);

  assign codes_o = outputs;

  task violate(input integer which);
    begin
      violations_o[which] = 1'b1;
      violation_count_o = violation_count_o + 1;
      $display("%0t ps: DAC7624 violation %0d", $time, which);
    end
  endtask

  initial begin
    inputs            = 48'hDEAD_BEEF_DEAD;  // undefined until written or reset
    outputs           = 48'hDEAD_BEEF_DEAD;
    written           = 4'd0;
    updates_o         = 0;
    violations_o      = 16'd0;
    violation_count_o = 0;
    t_cs_low          = 0;
    t_cs_high         = 0;
    t_ldac_low        = 0;
    t_reset_low       = 0;
    any_cs            = 1'b0;
    any_ldac          = 1'b0;
  end

  always @(posedge forgive_i) begin
    violations_o      = 16'd0;
    violation_count_o = 0;
  end

  always @(reset_ni) begin
    if (reset_ni === 1'b0) begin
      t_reset_low = $time;
      inputs      = {4{RESET_CODE}};
      outputs     = {4{RESET_CODE}};
      written     = 4'd0;
      any_cs      = 1'b0;
      any_ldac    = 1'b0;
    end else if (reset_ni === 1'b1) begin
      if ($time - t_reset_low < T_RESET) violate(RESET_SHORT);
      if (cs_ni !== 1'b1 || ldac_ni !== 1'b1) violate(PIN_UNKNOWN);
    end else if ($time != 0) violate(PIN_UNKNOWN);
  end

  always @(cs_ni or ldac_ni)
    if (alive && ((cs_ni ^ cs_ni) !== 1'b0 || (ldac_ni ^ ldac_ni) !== 1'b0)) violate(PIN_UNKNOWN);

  always @(negedge cs_ni)
    if (alive) begin
      t_cs_low = $time;
      any_cs   = 1'b1;
      if (any_ldac && $time - t_ldac_low < T_LDAC_TO_CS) violate(LDAC_TO_CS);
      if (rw_i !== 1'b0) violate(RW_MOVED);
    end

  always @(posedge cs_ni)
    if (alive && any_cs) begin
      if ($time - t_cs_low < T_CS) violate(CS_SHORT);
      if ((^{db_i, a_i}) === 1'bx) violate(PIN_UNKNOWN);
      t_cs_high    = $time;
      written[a_i] = 1'b1;
    end

  // Set-up and hold are 0 ns: moving at the very time of an edge is allowed, inside the pulse it is not.
  always @(db_i) if (alive && cs_ni === 1'b0 && $time != t_cs_low) violate(DATA_MOVED);
  always @(a_i) if (alive && cs_ni === 1'b0 && $time != t_cs_low) violate(ADDRESS_MOVED);
  always @(rw_i) if (alive && cs_ni === 1'b0 && $time != t_cs_low) violate(RW_MOVED);

  always @(negedge ldac_ni)
    if (alive) begin
      t_ldac_low = $time;
      any_ldac   = 1'b1;
      updates_o  = updates_o + 1;
      if (cs_ni !== 1'b1 || (any_cs && $time - t_cs_high < T_CS_TO_LDAC)) violate(CS_TO_LDAC);
      if (written != 4'b1111) violate(TORN);
      written = 4'd0;
    end

  always @(posedge ldac_ni) if (alive && any_ldac && $time - t_ldac_low < T_LDAC) violate(LDAC_SHORT);

  // The two ranks of latches.
  always @(cs_ni or rw_i or a_i or db_i or alive)
    if (alive && cs_ni === 1'b0 && rw_i === 1'b0) inputs[12*a_i+:12] = db_i;
  always @(ldac_ni or inputs or alive) if (alive && ldac_ni === 1'b0) outputs = inputs;

endmodule

`default_nettype wire
