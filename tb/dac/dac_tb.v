// dac_tb: dac_parallel, a DAC7624 (or 7625) and the pads between them. Delays in ps: one for the strobes CS and LDAC, one
// for address and data, one for RESET.
`default_nettype none
`timescale 1ps / 1ps

module dac_tb #(
    parameter [11:0] RESET_CODE = 12'h800
);

  // set by the test
  reg         rst_n;
  reg         write;
  reg  [47:0] code;
  reg         fault;
  reg  [31:0] d_cs;
  reg  [31:0] d_ldac;
  reg  [31:0] d_data;
  reg  [31:0] d_reset;
  reg         forgive;

  // looked at by the test
  reg         clk;
  wire        ready;
  wire        dropped;
  wire        safe;
  wire [47:0] codes;
  wire [31:0] updates;
  wire [15:0] violations;
  wire [31:0] violation_count;
  wire        ldac_n;

  wire [11:0] db;
  wire [ 1:0] a;
  wire        cs_n;
  wire        rw;
  wire        reset_n;
  reg  [13:0] bus_at_part;
  reg         cs_n_at_part;
  reg         ldac_n_at_part;
  reg         reset_n_at_part;

  initial begin
    clk             = 1'b0;
    rst_n           = 1'b0;
    write           = 1'b0;
    code            = 48'd0;
    fault           = 1'b0;
    d_cs            = 4000;
    d_ldac          = 4000;
    d_data          = 4000;
    d_reset         = 4000;
    forgive         = 1'b0;
    bus_at_part     = 14'd0;
    cs_n_at_part    = 1'b1;
    ldac_n_at_part  = 1'b1;
    reset_n_at_part = 1'b0;
  end

  always #10000 clk = !clk;

  always @(db or a) bus_at_part <= #(d_data) {a, db};
  always @(cs_n) cs_n_at_part <= #(d_cs) cs_n;
  always @(ldac_n) ldac_n_at_part <= #(d_ldac) ldac_n;
  always @(reset_n) reset_n_at_part <= #(d_reset) reset_n;

  dac_parallel dut (
      .clk_i       (clk),
      .rst_ni      (rst_n),
      .rst_pin_ni  (rst_n),
      .write_i     (write),
      .code_i      (code),
      .fault_i     (fault),
      .ready_o     (ready),
      .dropped_o   (dropped),
      .updated_o   (),
      .safe_o      (safe),
      .dac_db_o    (db),
      .dac_a_o     (a),
      .dac_cs_no   (cs_n),
      .dac_rw_o    (rw),
      .dac_ldac_no (ldac_n),
      .dac_reset_no(reset_n)
  );

  dac7624 #(
      .RESET_CODE(RESET_CODE)
  ) part (
      .db_i             (bus_at_part[11:0]),
      .a_i              (bus_at_part[13:12]),
      .cs_ni            (cs_n_at_part),
      .rw_i             (rw),
      .ldac_ni          (ldac_n_at_part),
      .reset_ni         (reset_n_at_part),
      .forgive_i        (forgive),
      .codes_o          (codes),
      .updates_o        (updates),
      .violations_o     (violations),
      .violation_count_o(violation_count)
  );

endmodule

`default_nettype wire
