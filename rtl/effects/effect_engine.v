// effect_engine: carries out the program of effect_program after a step, for both motors.
//
// Purpose    From the state after a step, the inputs and the tables: what the next step works with, that is the voltage
//            across winding and back-EMF (u_v), the torque against the rotor (u_t), and the levels of dry friction forward
//            and backward. Equations: docs/effect-unit.md.
//            In each pair of clocks one operation is issued, first for the left motor, then for the right: one multiplier,
//            one adder, one memory of registers a side (two copies, for two operands), one memory of tables.
// Handshake  start_i for one clock while not busy_o; everything read (state, coefficients, inputs) holds while busy_o.
//            rest_i: ends a run, outputs zero, the state of the effects zero.
//            wr_valid_i with address and word, while not busy_o and without start_i: a word of a table or a constant.
// Latency    an operation six clocks from issue to the end of its write; a run 151 clocks, always.
// Format     binary32. Addresses: 0 .. 8191 tables {side, table (3), cell (8), slope rather than intercept};
//            8192 + 128 side + k: constant k.
// Crossing   none. The memories have no reset: a run after rest_i reads its state as zero, temporaries are written
//            before they are read, tables and constants have to be loaded before a run.
`default_nettype none

module effect_engine (
  input  wire         clk_i,
  input  wire         rst_ni,
  input  wire         rest_i,
  input  wire         start_i,
  output wire         busy_o,
  input  wire  [31:0] r_l_i,
  input  wire  [31:0] r_r_i,
  input  wire  [31:0] kb_l_i,
  input  wire  [31:0] kb_r_i,
  input  wire  [31:0] i_l_i,
  input  wire  [31:0] i_r_i,
  input  wire  [31:0] w_l_i,
  input  wire  [31:0] w_r_i,
  // left in the lower half
  input  wire  [63:0] v_i,
  input  wire  [63:0] t_i,
  output reg   [63:0] u_v_o,
  output reg   [63:0] u_t_o,
  output reg   [63:0] level_f_o,
  output reg   [63:0] level_b_o,
  input  wire         wr_valid_i,
  input  wire  [13:0] wr_addr_i,
  input  wire  [31:0] wr_data_i
);
  // The order of rtds_host.motor.effect_program.OPS.
  localparam [3:0] OP_MUL   = 4'd0;
  localparam [3:0] OP_SUB   = 4'd2;
  localparam [3:0] OP_MOV   = 4'd3;
  localparam [3:0] OP_POS   = 4'd4;
  localparam [3:0] OP_NEG   = 4'd5;
  localparam [3:0] OP_CLAMP = 4'd6;
  localparam [3:0] OP_WRAP  = 4'd7;
  localparam [3:0] OP_LOOK  = 4'd8;

  localparam [31:0] ONE = 32'h3F80_0000;

  // ---- issue -----------------------------------------------------------------------------------------------------
  reg         run_q;
  reg   [6:0] pair_q;
  reg         side_q;
  reg         fresh_q;   // no run has been finished since rest_i

  wire        valid;
  wire [30:0] word;
  wire        last;

  effect_program u_program (
    .pair_i (pair_q),
    .valid_o(valid),
    .word_o (word),
    .last_o (last)
  );

  reg         valid1_q;
  reg         valid2_q;
  reg         valid3_q;
  reg         valid4_q;
  reg         valid5_q;

  assign busy_o = run_q | valid1_q | valid2_q | valid3_q | valid4_q | valid5_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      run_q    <= 1'b0;
      pair_q   <= 7'd0;
      side_q   <= 1'b0;
      fresh_q  <= 1'b1;
      valid1_q <= 1'b0;
      valid2_q <= 1'b0;
      valid3_q <= 1'b0;
      valid4_q <= 1'b0;
      valid5_q <= 1'b0;
    end else if (rest_i) begin
      run_q    <= 1'b0;
      fresh_q  <= 1'b1;
      valid1_q <= 1'b0;
      valid2_q <= 1'b0;
      valid3_q <= 1'b0;
      valid4_q <= 1'b0;
      valid5_q <= 1'b0;
    end else if (start_i | busy_o) begin
      if (valid5_q & ~valid4_q & ~run_q) fresh_q <= 1'b0;
      valid5_q <= valid4_q;
      valid4_q <= valid3_q;
      valid3_q <= valid2_q;
      valid2_q <= valid1_q;
      valid1_q <= run_q & valid;
      if (start_i) begin
        run_q  <= 1'b1;
        pair_q <= 7'd0;
        side_q <= 1'b0;
      end else if (run_q) begin
        side_q <= ~side_q;
        if (side_q) pair_q <= pair_q + 7'd1;
        if (side_q & last) run_q <= 1'b0;
      end
    end
  end

  // ---- registers: constants, temporaries, state; 128 a side --------------------------------------------------------
  wire        output_v = word[30];
  wire  [1:0] output_k = word[29:28];
  wire  [3:0] op       = word[27:24];
  wire        across   = word[23];
  wire        outer_a  = word[22];
  wire  [6:0] addr_a   = word[21:15];
  wire        outer_b  = word[14];
  wire  [6:0] addr_b   = word[13:7];
  wire  [6:0] target   = word[6:0];

  reg  [31:0] copy_a [0:255];
  reg  [31:0] copy_b [0:255];
  reg  [31:0] reg_a_q;
  reg  [31:0] reg_b_q;

  wire        write;
  wire  [7:0] write_addr;
  wire [31:0] write_data;

  always @(posedge clk_i) begin
    if (write) copy_a[write_addr] <= write_data;
    if (run_q) reg_a_q <= copy_a[{side_q & ~across, addr_a}];
  end

  always @(posedge clk_i) begin
    if (write) copy_b[write_addr] <= write_data;
    if (run_q) reg_b_q <= copy_b[{side_q | across, addr_b}];
  end

  reg         side1_q;
  reg   [3:0] op1_q;
  reg         outer_a1_q;
  reg         outer_b1_q;
  reg         zero_a1_q;
  reg         zero_b1_q;
  reg   [1:0] code_a1_q;
  reg   [3:0] code_b1_q;
  reg   [6:0] target1_q;
  reg   [2:0] output1_q;

  always @(posedge clk_i) begin
    if (run_q) begin
      side1_q    <= side_q;
      op1_q      <= op;
      outer_a1_q <= outer_a;
      outer_b1_q <= outer_b;
      zero_a1_q  <= fresh_q & (&addr_a[6:4]);
      zero_b1_q  <= fresh_q & (&addr_b[6:4]);
      code_a1_q  <= addr_a[1:0];
      code_b1_q  <= addr_b[3:0];
      target1_q  <= target;
      output1_q  <= {output_v, output_k};
    end
  end

  // ---- operands ----------------------------------------------------------------------------------------------------
  function automatic [31:0] half;
    input         upper;
    input  [63:0] pair;
    half = upper ? pair[63:32] : pair[31:0];
  endfunction

  function automatic nan;
    input  [30:0] x;
    nan = (&x[30:23]) & (|x[22:0]);
  endfunction

  function automatic less;  // than zero
    input  [31:0] x;
    less = x[31] & (|x[30:0]);
  endfunction

  function automatic [31:0] operand;
    input         outer;
    input         zero;
    input  [31:0] outside;
    input  [31:0] stored;
    operand = outer ? outside : zero ? 32'd0 : stored;
  endfunction

  // First operand of the adder; it is the multiplier's and the look-up's, too, for which nothing is done to it.
  function automatic [31:0] first;
    input   [3:0] what;
    input  [31:0] a;
    input  [31:0] b;
    case (what)
      OP_POS:   first = less(a) ? b : a;
      OP_NEG:   first = less(a) ? a : b;
      OP_CLAMP: first = ((a[30:0] > b[30:0]) & ~nan(a[30:0]) & ~nan(b[30:0])) ? {a[31], b[30:0]} : a;
      default:  first = a;
    endcase
  endfunction

  function automatic [31:0] second;
    input   [3:0] what;
    input  [31:0] a;
    input  [31:0] b;
    case (what)
      OP_MOV, OP_POS, OP_NEG, OP_CLAMP: second = 32'd0;
      OP_WRAP: second = less(a) ? ONE : (~a[31] & (a[30:0] >= ONE[30:0])) ? {1'b1, ONE[30:0]} : 32'd0;
      default: second = b;
    endcase
  endfunction

  function automatic [63:0] both;
    input   [3:0] what;
    input  [31:0] a;
    input  [31:0] b;
    both = {first(what, a, b), second(what, a, b)};
  endfunction

  reg  [31:0] a2_q;
  reg  [31:0] b2_q;
  reg   [3:0] op2_q;
  reg         side2_q;
  reg   [3:0] look2_q;
  reg   [6:0] target2_q;
  reg   [2:0] output2_q;

  always @(posedge clk_i) begin
    if (valid1_q) begin
      {a2_q, b2_q} <= both(op1_q,
                           operand(outer_a1_q, zero_a1_q,
                                   code_a1_q[1] ? half(side1_q, code_a1_q[0] ? t_i : v_i)
                                   : code_a1_q[0] ? (side1_q ? kb_r_i : kb_l_i) : (side1_q ? r_r_i : r_l_i), reg_a_q),
                           operand(outer_b1_q, zero_b1_q,
                                   code_b1_q[0] ? (side1_q ? w_r_i : w_l_i) : (side1_q ? i_r_i : i_l_i), reg_b_q));
      op2_q     <= op1_q;
      side2_q   <= side1_q;
      look2_q   <= code_b1_q;
      target2_q <= target1_q;
      output2_q <= output1_q;
    end
  end

  // ---- operators: a stage works where there is something for it ------------------------------------------------------
  reg   [2:0] mul_q;  // stages at work, the first in bit 0
  reg   [2:0] add_q;
  wire [31:0] mul_y;
  wire [31:0] add_y;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      mul_q <= 3'd0;
      add_q <= 3'd0;
    end else if (busy_o) begin
      mul_q <= {mul_q[1:0], valid1_q & (op1_q == OP_MUL)};
      add_q <= {add_q[1:0], valid1_q & (op1_q != OP_MUL) & (op1_q != OP_LOOK)};
    end
  end

  fp_mul u_mul (
    .clk_i(clk_i),
    .en_i (mul_q),
    .a_i  (a2_q),
    .b_i  (b2_q),
    .y_o  (mul_y)
  );
  fp_add u_add (
    .clk_i(clk_i),
    .en_i (add_q),
    .sub_i(op2_q == OP_SUB),
    .a_i  (a2_q),
    .b_i  (b2_q),
    .y_o  (add_y)
  );

  // ---- tables ------------------------------------------------------------------------------------------------------
  wire  [7:0] cell3_q;
  reg         side3_q;   // of the operation that looks up

  effect_index u_index (
    .clk_i   (clk_i),
    .en_i    (valid2_q),
    .u_i     (a2_q),
    .signed_i(look2_q[3:1] < 3'd3),
    .cell_o  (cell3_q)
  );

  reg  [31:0] tables [0:8191];
  reg   [3:0] look3_code_q;
  reg  [31:0] look4_q;
  reg         look3_q;

  always @(posedge clk_i) begin
    look3_q <= valid2_q & (op2_q == OP_LOOK);
    if (valid2_q) look3_code_q <= look2_q;
  end

  always @(posedge clk_i) begin
    if (wr_valid_i & ~wr_addr_i[13]) tables[wr_addr_i[12:0]] <= wr_data_i;
    if (look3_q) look4_q <= tables[{side3_q, look3_code_q[3:1], cell3_q, look3_code_q[0]}];
  end

  // ---- results: what came out of the tables waits a clock for the operators ---------------------------------------------
  reg   [3:0] op3_q;
  reg   [3:0] op4_q;
  reg   [3:0] op5_q;
  reg         side4_q;
  reg         side5_q;
  reg   [6:0] target3_q;
  reg   [6:0] target4_q;
  reg   [6:0] target5_q;
  reg   [2:0] output3_q;
  reg   [2:0] output4_q;
  reg   [2:0] output5_q;
  reg  [31:0] look5_q;

  always @(posedge clk_i) begin
    if (valid2_q) begin
      op3_q     <= op2_q;
      side3_q   <= side2_q;
      target3_q <= target2_q;
      output3_q <= output2_q;
    end
    if (valid3_q) begin
      op4_q     <= op3_q;
      side4_q   <= side3_q;
      target4_q <= target3_q;
      output4_q <= output3_q;
    end
    if (valid4_q) begin
      op5_q     <= op4_q;
      side5_q   <= side4_q;
      target5_q <= target4_q;
      output5_q <= output4_q;
      look5_q   <= look4_q;
    end
  end

  wire [31:0] result   = (op5_q == OP_LOOK) ? look5_q : (op5_q == OP_MUL) ? mul_y : add_y;
  wire        constant = wr_valid_i & wr_addr_i[13] & (wr_addr_i[6:4] == 3'd0);

  assign write      = valid5_q | constant;
  assign write_addr = valid5_q ? {side5_q, target5_q} : wr_addr_i[7:0];
  assign write_data = valid5_q ? result : wr_data_i;

  wire        put = valid5_q & output5_q[2];

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      u_v_o     <= 64'd0;
      u_t_o     <= 64'd0;
      level_f_o <= 64'd0;
      level_b_o <= 64'd0;
    end else if (rest_i) begin
      u_v_o     <= 64'd0;
      u_t_o     <= 64'd0;
      level_f_o <= 64'd0;
      level_b_o <= 64'd0;
    end else if (put) begin
      case (output5_q[1:0])
        2'd0:    if (side5_q) u_v_o[63:32] <= result; else u_v_o[31:0] <= result;
        2'd1:    if (side5_q) u_t_o[63:32] <= result; else u_t_o[31:0] <= result;
        2'd2:    if (side5_q) level_f_o[63:32] <= result; else level_f_o[31:0] <= result;
        default: if (side5_q) level_b_o[63:32] <= result; else level_b_o[31:0] <= result;
      endcase
    end
  end
endmodule

`default_nettype wire
