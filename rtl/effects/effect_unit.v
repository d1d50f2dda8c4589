// effect_unit: what makes both motor units differ from ideal ones; the delay, the engine, and the way to load them.
//
// Purpose    Keeps the inputs of a strobe, and prepares from them, from the new state and from the tables what the next step
//            works with (see effect_engine). So inputs act one step later than without it.
// Handshake  strobe_i with the inputs, at the edge that starts a step; state_i is the new one from the 16th clock after it.
//            rest_i: effects off, or state cleared.
//            word_valid_i for one clock while word_ready_o: a word for a table or a constant; it is written as soon as no
//            run is in hand, so a run sees it either before or after.
// Latency    outputs: see effect_engine.
// Format     binary32; pairs have left in the lower half; records: rtds_core_records.vh. Addresses: see effect_engine.
// Crossing   none.
`default_nettype none

module effect_unit (
  input  wire         clk_i,
  input  wire         rst_ni,
  input  wire         rest_i,
  input  wire         strobe_i,
  input  wire [127:0] inputs_i,
  input  wire  [11:0] delay_i,
  input  wire  [15:0] stride_i,
  input  wire  [63:0] r_i,
  input  wire  [63:0] kb_i,
  input  wire [127:0] state_i,
  output wire  [63:0] u_v_o,
  output wire  [63:0] u_t_o,
  output wire  [63:0] level_f_o,
  output wire  [63:0] level_b_o,
  input  wire         word_valid_i,
  input  wire  [45:0] word_i,
  output wire         word_ready_o
);
  `include "rtds_core_records.vh"

  // ---- inputs of the strobe --------------------------------------------------------------------------------------
  reg  [63:0] t_q;
  wire [63:0] v_late;
  wire        busy;
  wire        take;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) t_q <= 64'd0;
    // In every clock until a strobe, which comes late in its own.
    else if (take) t_q <= {inputs_i[INPUTS_T_R+:32], inputs_i[INPUTS_T_L+:32]};
  end

  effect_delay u_delay (
    .clk_i   (clk_i),
    .rst_ni  (rst_ni),
    .rest_i  (rest_i),
    .strobe_i(strobe_i),
    .delay_i (delay_i),
    .stride_i(stride_i),
    .v_i     ({inputs_i[INPUTS_V_R+:32], inputs_i[INPUTS_V_L+:32]}),
    .v_o     (v_late)
  );

  // ---- words on their way in ---------------------------------------------------------------------------------------
  reg         pending_q;
  reg  [45:0] word_q;
  wire        write = pending_q & ~busy;

  assign word_ready_o = ~pending_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      pending_q <= 1'b0;
      word_q    <= 46'd0;
    end else if (word_valid_i & ~pending_q) begin
      pending_q <= 1'b1;
      word_q    <= word_i;
    end else if (write) begin
      pending_q <= 1'b0;
    end
  end

  effect_engine u_engine (
    .clk_i     (clk_i),
    .rst_ni    (rst_ni),
    .rest_i    (rest_i),
    .start_i   (strobe_i),
    .busy_o    (busy),
    .take_o    (take),
    .r_i       (r_i),
    .kb_i      (kb_i),
    .state_i   (state_i),
    .v_i       (v_late),
    .t_i       (t_q),
    .u_v_o     (u_v_o),
    .u_t_o     (u_t_o),
    .level_f_o (level_f_o),
    .level_b_o (level_b_o),
    .wr_valid_i(write),
    .wr_addr_i (word_q[WORD_ADDRESS+:14]),
    .wr_data_i (word_q[WORD_DATA+:32])
  );
endmodule

`default_nettype wire
