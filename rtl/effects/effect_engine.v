// effect_engine: carries out the program of effect_program in every step, for both motors.
//
// Purpose    From the inputs of a strobe, the state that the step makes and the tables: what the next step works with, that is
//            the voltage across winding and back-EMF (u_v), the torque against the rotor (u_t), and the levels of dry friction
//            forward and backward, the latter with a minus. Equations: docs/effect-unit.md.
// Handshake  start_i with the strobe, while not busy_o. v_i from the third clock after it, state_i from the 16th, t_i, r_i, kb_i
//            from the first are read and hold while busy_o.
//            rest_i: ends a run; the state of the effects is zero.
//            wr_valid_i with address and word, while not busy_o: a word of a table or a constant.
// Latency    counted as in rtds_core: u_t from the 43rd clock, level_f, level_b and u_v from the 44th, 45th and 46th, to the
//            next run's; busy_o from the first to the 49th at most.
// Format     binary32; pairs have left in the lower half; state_i: rtds_core_records.vh. Addresses: 0 .. 8191 tables {side, table (3), cell (8), slope
//            rather than intercept}; 8192 + 128 side + k: constant k.
// Crossing   none. The memories have no reset: a run after rest_i reads its state as zero, temporaries are written
//            before they are read, tables and constants have to be loaded before a run.
`default_nettype none

module effect_engine (
  input  wire         clk_i,
  input  wire         rst_ni,
  input  wire         rest_i,
  input  wire         start_i,
  output wire         busy_o,
  output wire         take_o,     // no run reads t_i after this clock
  input  wire  [63:0] r_i,
  input  wire  [63:0] kb_i,
  input  wire [127:0] state_i,
  input  wire  [63:0] v_i,
  input  wire  [63:0] t_i,
  output wire  [63:0] u_v_o,
  output wire  [63:0] u_t_o,
  output wire  [63:0] level_f_o,
  output wire  [63:0] level_b_o,
  input  wire         wr_valid_i,
  input  wire  [13:0] wr_addr_i,
  input  wire  [31:0] wr_data_i
);
  `include "rtds_core_records.vh"

  // ---- the clock of the step, and what is to be done in it ---------------------------------------------------------
  wire       last;
  wire       mul;
  wire       add;
  wire [1:0] mul_a;
  wire [1:0] mul_b;
  wire [1:0] add_a;
  wire [1:0] add_b;
  wire       across;
  wire       minus_a;
  wire       minus_b;
  wire [1:0] direct;
  wire       look;
  wire [2:0] table_code;
  wire       limit;
  wire       put;
  wire [1:0] which;
  wire       write;
  wire [2:0] source;
  wire [6:0] target;
  wire [6:0] read_mul_a;
  wire       by_sign;
  wire [6:0] read_mul_b;
  wire [6:0] read_add_a;
  wire [6:0] read_add_b;

  reg  [5:0] clock_q;  // since the strobe; 0: no run
  reg        run_q;    // it is not 0: so much hangs on it that it stands in a register
  reg        fresh_q;  // no run has been finished since rest_i
  reg        newer_q;  // which of the two places of a state the run reads; it writes the other
  reg  [1:0] mul_later_q;
  reg  [1:0] add_later_q;
  reg  [3:0] zero_q;

  effect_program u_program (
    .clk_i       (clk_i),
    .rst_ni      (rst_ni),
    .rest_i      (rest_i),
    .clock_i     (clock_q),
    .last_o      (last),
    .mul_o       (mul),
    .mul_a_o     (mul_a),
    .mul_b_o     (mul_b),
    .add_o       (add),
    .add_a_o     (add_a),
    .add_b_o     (add_b),
    .across_o    (across),
    .minus_a_o   (minus_a),
    .minus_b_o   (minus_b),
    .direct_o    (direct),
    .look_o      (look),
    .table_o     (table_code),
    .limit_o     (limit),
    .put_o       (put),
    .which_o     (which),
    .write_o     (write),
    .source_o    (source),
    .target_o    (target),
    .read_mul_a_o(read_mul_a),
    .by_sign_o   (by_sign),
    .read_mul_b_o(read_mul_b),
    .read_add_a_o(read_add_a),
    .read_add_b_o(read_add_b)
  );

  wire run = run_q;

  assign busy_o = run;
  assign take_o = ~run | last;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      clock_q     <= 6'd0;
      run_q       <= 1'b0;
      fresh_q     <= 1'b1;
      newer_q     <= 1'b0;
      mul_later_q <= 2'd0;
      add_later_q <= 2'd0;
    end else begin
      // The last results of a run may be written in the clock of the next strobe.
      if (rest_i) clock_q <= 6'd0;
      else if (start_i) clock_q <= 6'd1;
      else if (run) clock_q <= last ? 6'd0 : clock_q + 6'd1;
      run_q <= ~rest_i & (start_i | (run & ~last));
      if (rest_i) fresh_q <= 1'b1;
      else if (last) fresh_q <= 1'b0;
      if (last) newer_q <= ~newer_q;
      mul_later_q <= {mul_later_q[0], mul};
      add_later_q <= {add_later_q[0], add};
    end
  end

  // ---- addresses: states have two places each, the lower one here the old value's ----------------------------------------
  function automatic [6:0] place;
    input [6:0] address;
    input       newer;
    place = address ^ {6'd0, (&address[6:4]) & newer};
  endfunction

  function automatic zero;  // address 127, and a state that has none yet
    input [6:0] address;
    input       fresh;
    zero = (&address[6:4]) & ((&address[3:0]) | (fresh & ~address[0]));
  endfunction

  always @(posedge clk_i) begin
    if (run) zero_q <= {zero(read_mul_a, fresh_q), zero(read_mul_b, fresh_q),
                        zero(read_add_a, fresh_q), zero(read_add_b, fresh_q)};
  end

  // ---- both sides ----------------------------------------------------------------------------------------------------
  wire        constant = wr_valid_i & wr_addr_i[13] & (wr_addr_i[6:4] == 3'd0);
  wire        line     = wr_valid_i & ~wr_addr_i[13];
  wire [63:0] product;

  genvar side;
  generate
    for (side = LEFT; side <= RIGHT; side = side + 1) begin : g_side
      effect_side u_side (
        .clk_i        (clk_i),
        .run_i        (run),
        .mul_en_i     ({mul_later_q, mul}),
        .mul_a_i      (mul_a),
        .mul_b_i      (mul_b),
        .add_en_i     ({add_later_q, add}),
        .add_a_i      (add_a),
        .add_b_i      (add_b),
        .across_i     (across),
        .minus_a_i    (minus_a),
        .minus_b_i    (minus_b),
        .direct_i     (direct),
        .look_i       (look),
        .table_i      (table_code),
        .limit_i      (limit),
        .put_i        (put),
        .which_i      (which),
        .write_i      (write),
        .source_i     (source),
        .target_i     (place(target, newer_q)),
        .read_mul_a_i (place(read_mul_a, newer_q)),
        .by_sign_i    (by_sign),
        .read_mul_b_i (place(read_mul_b, newer_q)),
        .read_add_a_i (place(read_add_a, newer_q)),
        .read_add_b_i (place(read_add_b, newer_q)),
        .zero_i       (zero_q),
        .r_i          (r_i[32*side+:32]),
        .kb_i         (kb_i[32*side+:32]),
        .i_i          (state_i[(side == LEFT ? STATE_I_L : STATE_I_R)+:32]),
        .w_i          (state_i[(side == LEFT ? STATE_W_L : STATE_W_R)+:32]),
        .v_i          (v_i[32*side+:32]),
        .t_i          (t_i[32*side+:32]),
        .other_i      (product[32*(RIGHT-side)+:32]),
        .product_o    (product[32*side+:32]),
        .u_v_o        (u_v_o[32*side+:32]),
        .u_t_o        (u_t_o[32*side+:32]),
        .level_f_o    (level_f_o[32*side+:32]),
        .level_b_o    (level_b_o[32*side+:32]),
        .wr_constant_i(constant & (wr_addr_i[7] == side)),
        .wr_table_i   (line & (wr_addr_i[12] == side)),
        .wr_addr_i    (wr_addr_i[11:0]),
        .wr_data_i    (wr_data_i)
      );
    end
  endgenerate
endmodule

`default_nettype wire
