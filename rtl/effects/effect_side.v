// effect_side: one side of the effect unit: multiplier, adder, registers, tables.
//
// Purpose    Carries out what effect_program says, clock by clock; both sides do the same at the same time. A result can be
//            taken by an operation in the clock in which it leaves its operator, while it stands there, and through the
//            registers, three clocks after the clock of its write.
// Handshake  none of its own: the fields of the program, all valid in the clock in which they act.
// Latency    multiplier and adder 3 clocks, a table 2 from its argument to the line, registers 2 from address to operand,
//            i, w and the command (direct_i) and both products (across_i) 1. An output stands a clock after put_i.
// Format     binary32. Memories have no reset: see effect_engine.
// Crossing   none.
`default_nettype none

module effect_side (
  input  wire        clk_i,
  input  wire        run_i,       // a clock of the program
  // the program's fields
  input  wire  [2:0] mul_en_i,    // a bit for each stage, the first in bit 0
  input  wire  [1:0] mul_a_i,
  input  wire  [1:0] mul_b_i,
  input  wire  [2:0] add_en_i,
  input  wire  [1:0] add_a_i,
  input  wire  [1:0] add_b_i,
  input  wire        across_i,    // both sides' products are the adder's operands from the registers
  input  wire        minus_a_i,
  input  wire        minus_b_i,
  input  wire  [1:0] direct_i,
  input  wire        look_i,
  input  wire  [2:0] table_i,
  input  wire        limit_i,
  input  wire        put_i,
  input  wire  [1:0] which_i,
  input  wire        write_i,
  input  wire  [2:0] source_i,
  input  wire  [6:0] target_i,
  // addresses of operands, and whether they read as zero
  input  wire  [6:0] read_mul_a_i,
  input  wire        by_sign_i,
  input  wire  [6:0] read_mul_b_i,
  input  wire  [6:0] read_add_a_i,
  input  wire  [6:0] read_add_b_i,
  input  wire  [3:0] zero_i,      // of the addresses of the clock before: mul a, mul b, add a, add b
  // what comes from outside
  input  wire [31:0] r_i,
  input  wire [31:0] kb_i,
  input  wire [31:0] i_i,
  input  wire [31:0] w_i,
  input  wire [31:0] v_i,
  input  wire [31:0] t_i,
  input  wire [31:0] other_i,     // product_o of the other side
  output wire [31:0] product_o,
  output wire [31:0] u_v_o,
  output wire [31:0] u_t_o,
  output wire [31:0] level_f_o,
  output wire [31:0] level_b_o,
  // words from the host, while run_i is 0
  input  wire        wr_constant_i,
  input  wire        wr_table_i,
  input  wire [11:0] wr_addr_i,
  input  wire [31:0] wr_data_i
);
  `include "effect_codes.vh"

  reg  [31:0] u_v_q;
  reg  [31:0] u_t_q;
  reg  [31:0] level_f_q;
  reg  [31:0] level_b_q;

  wire [31:0] product;
  wire [31:0] sum;

  assign product_o = product;

  // ---- registers: a copy for each operand ------------------------------------------------------------------------
  reg  [31:0] copy_mul_a [0:127];
  reg  [31:0] copy_mul_b [0:127];
  reg  [31:0] copy_add_a [0:127];
  reg  [31:0] copy_add_b [0:127];
  reg  [31:0] written;

  always @* begin
    case (source_i)
      SOURCE_PRODUCT: written = product;
      SOURCE_SUM:     written = sum;
      SOURCE_T:       written = t_i;
      SOURCE_R:       written = r_i;
      SOURCE_KB:      written = kb_i;
      default:        written = v_i;
    endcase
  end

  wire        write      = run_i ? write_i : wr_constant_i;
  wire  [6:0] write_addr = run_i ? target_i : wr_addr_i[6:0];
  wire [31:0] write_data = run_i ? written : wr_data_i;

  reg  [31:0] read_mul_a_q;
  reg  [31:0] read_mul_b_q;
  reg  [31:0] read_add_a_q;
  reg  [31:0] read_add_b_q;

  wire [6:0] mul_a_addr = read_mul_a_i ^ ({7{by_sign_i & t_i[31]}} & OTHER_LOAD);

  always @(posedge clk_i) begin
    if (write) copy_mul_a[write_addr] <= write_data;
    if (run_i) read_mul_a_q <= copy_mul_a[mul_a_addr];
  end

  always @(posedge clk_i) begin
    if (write) copy_mul_b[write_addr] <= write_data;
    if (run_i) read_mul_b_q <= copy_mul_b[read_mul_b_i];
  end

  always @(posedge clk_i) begin
    if (write) copy_add_a[write_addr] <= write_data;
    if (run_i) read_add_a_q <= copy_add_a[read_add_a_i];
  end

  always @(posedge clk_i) begin
    if (write) copy_add_b[write_addr] <= write_data;
    if (run_i) read_add_b_q <= copy_add_b[read_add_b_i];
  end

  reg  [31:0] reg_mul_a_q;
  reg  [31:0] reg_mul_b_q;
  reg  [31:0] reg_add_a_q;
  reg  [31:0] reg_add_b_q;
  reg  [31:0] direct_q;

  always @(posedge clk_i) begin
    if (run_i) begin
      reg_mul_a_q <= zero_i[3] ? 32'd0 : read_mul_a_q;
      reg_mul_b_q <= zero_i[2] ? 32'd0 : read_mul_b_q;
      reg_add_a_q <= across_i ? other_i : zero_i[1] ? 32'd0 : read_add_a_q;
      reg_add_b_q <= across_i ? product : zero_i[0] ? 32'd0 : read_add_b_q;
      direct_q    <= (direct_i == DIRECT_VC) ? v_i : (direct_i == DIRECT_W) ? w_i : i_i;
    end
  end

  // ---- tables ------------------------------------------------------------------------------------------------------
  reg  [31:0] slopes     [0:2047];
  reg  [31:0] intercepts [0:2047];
  reg  [31:0] read_slope_q;
  reg  [31:0] read_intercept_q;
  reg  [31:0] slope_q;
  reg  [31:0] intercept_q;
  reg         look_q;
  wire  [7:0] table_cell;

  effect_index u_index (
    .u_i     (product),
    .signed_i(table_i < TABLE_UNSIGNED),
    .cell_o  (table_cell)
  );

  always @(posedge clk_i) begin
    if (wr_table_i & wr_addr_i[0]) slopes[wr_addr_i[11:1]] <= wr_data_i;
    if (look_i) read_slope_q <= slopes[{table_i, table_cell}];
  end

  always @(posedge clk_i) begin
    if (wr_table_i & ~wr_addr_i[0]) intercepts[wr_addr_i[11:1]] <= wr_data_i;
    if (look_i) read_intercept_q <= intercepts[{table_i, table_cell}];
  end

  always @(posedge clk_i) begin
    look_q <= look_i;
    if (look_q) begin
      slope_q     <= read_slope_q;
      intercept_q <= read_intercept_q;
    end
  end

  // ---- operators ---------------------------------------------------------------------------------------------------
  reg  [31:0] limited_q;
  reg  [31:0] mul_a;
  reg  [31:0] mul_b;
  reg  [31:0] add_a;
  reg  [31:0] add_b;

  // What brings a sum of periods back to 0 .. 1: one more below it, one less above; else zero. No -0 comes here.
  wire wraps = sum[31] | sum[30] | (&sum[29:23]);

  always @* begin
    case (mul_a_i)
      MUL_A_REGISTER: mul_a = reg_mul_a_q;
      MUL_A_SLOPE:    mul_a = slope_q;
      default:        mul_a = sum;
    endcase
    case (mul_b_i)
      MUL_B_REGISTER: mul_b = reg_mul_b_q;
      MUL_B_DIRECT:   mul_b = direct_q;
      MUL_B_SUM:      mul_b = sum;
      default:        mul_b = product;
    endcase
    case (add_a_i)
      ADD_A_REGISTER: add_a = reg_add_a_q;
      ADD_A_SUM:      add_a = sum;
      default:        add_a = limited_q;
    endcase
    case (add_b_i)
      ADD_B_REGISTER:  add_b = reg_add_b_q;
      ADD_B_PRODUCT:   add_b = product;
      ADD_B_INTERCEPT: add_b = intercept_q;
      default:         add_b = {wraps & ~sum[31], 1'b0, {7{wraps}}, 23'd0};
    endcase
  end

  fp_mul u_mul (
    .clk_i(clk_i),
    .en_i (mul_en_i),
    .a_i  (mul_a),
    .b_i  (mul_b),
    .y_o  (product)
  );

  fp_add u_add (
    .clk_i(clk_i),
    .en_i (add_en_i),
    .sub_i(minus_b_i),
    .a_i  ({add_a[31] ^ minus_a_i, add_a[30:0]}),
    .b_i  (add_b),
    .y_o  (sum)
  );

  // ---- limit and outputs -------------------------------------------------------------------------------------------
  function automatic nan;
    input  [30:0] x;
    nan = (&x[30:23]) & (|x[22:0]);
  endfunction

  function automatic [31:0] limited;  // of size most, but for its sign; a NaN on either side limits nothing
    input  [31:0] x;
    input  [30:0] most;
    limited = ((x[30:0] > most) & ~nan(x[30:0]) & ~nan(most)) ? {x[31], most} : x;
  endfunction

  always @(posedge clk_i) begin
    if (limit_i) limited_q <= limited(sum, reg_add_b_q[30:0]);
    if (put_i) begin
      case (which_i)
        WHICH_U_V:     u_v_q <= sum;
        WHICH_U_T:     u_t_q <= sum;
        WHICH_LEVEL_F: level_f_q <= sum;
        default:       level_b_q <= sum;
      endcase
    end
  end

  assign u_v_o     = u_v_q;
  assign u_t_o     = u_t_q;
  assign level_f_o = level_f_q;
  assign level_b_o = level_b_q;
endmodule

`default_nettype wire
