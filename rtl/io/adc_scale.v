// adc_scale: the record of one ADC sequence to binary32 (V, N.m at the motor shaft, parameters in SI).
//
// Format     y = fl(fl(n * gain) + offset), binary32, round to nearest even, with
//              n = code - 2048 for V and T (offset binary), n = code for the parameters (straight binary).
//            gain_i and offset_i hold eight binary32 words, channel c at bits 32*c+31..32*c, numbered as the
//            ADC's channels: 0 V_l, 1 V_r, 2 T_l, 3 T_r, 4 B, 5 J, 6 Km, 7 Kb.
//            Defaults: registers.toml.
//
// Handshake  valid_i for one clock with the record (taken at that edge). valid_o for one clock when everything
//            stands; outputs hold until the next valid_o and change together with it.
//            A valid_i while busy is ignored (records come 500 clocks apart). The parameters that were not in
//            the record keep their value; params_valid_o is 1 once each of the four was read since reset.
//
//            V and T that do not come from the ADC follow v_*_i and t_*_i a clock later. The choice stands before the output
//            registers, so that nothing stands between these and the motors, which may be far away.
//
// Latency    13 clocks: valid_i before edge n + 1, outputs after edge n + 13. One chain for all: from int (2),
//            times gain (3), plus offset (3); five operands enter it one after the other; one output register.
//
// Crossing   none; gain_i and offset_i are of this clock. Each quantity reads its pair 1 and 4 clocks after it
//            enters, so a pair rewritten in that moment may act in two steps, as two writes do anyway.
`default_nettype none

module adc_scale (
  input  wire         clk_i,          // 50 MHz
  input  wire         rst_ni,
  input  wire         valid_i,
  input  wire [ 11:0] code_v_l_i,
  input  wire [ 11:0] code_v_r_i,
  input  wire [ 11:0] code_t_l_i,
  input  wire [ 11:0] code_t_r_i,
  input  wire [ 11:0] code_p_i,
  input  wire [  1:0] index_p_i,      // 0 B, 1 J, 2 Km, 3 Kb
  input  wire [  1:0] from_adc_i,     // {T, V}: else
  input  wire [ 31:0] v_l_i,          // those that do not come from the ADC
  input  wire [ 31:0] v_r_i,
  input  wire [ 31:0] t_l_i,
  input  wire [ 31:0] t_r_i,
  input  wire [255:0] gain_i,
  input  wire [255:0] offset_i,
  output wire         valid_o,
  output wire [ 31:0] v_l_o,
  output wire [ 31:0] v_r_o,
  output wire [ 31:0] t_l_o,
  output wire [ 31:0] t_r_o,
  output wire [ 31:0] p_b_o,
  output wire [ 31:0] p_j_o,
  output wire [ 31:0] p_km_o,
  output wire [ 31:0] p_kb_o,
  output wire         params_valid_o
);

  `include "adc_record.vh"
  `include "fp_clocks.vh"

  // Of a record, counted from the clock of valid_i = 0. Five operands enter the chain, one a clock; FIRST_CLOCK has the first
  // one's result.
  localparam [3:0] FIRST_CLOCK = FP_FROM_INT_CLOCKS[3:0] + FP_MUL_CLOCKS[3:0] + FP_ADD_CLOCKS[3:0];
  localparam [3:0] LAST_CLOCK  = FIRST_CLOCK + 4'd4;

  reg  [ 3:0] count_q;  // 0: idle
  wire        start = valid_i && (count_q == 4'd0);
  reg         busy_q;   // count_q is not 0: so much hangs on it that it stands in a register
  wire        busy = busy_q;
  wire        run = start || busy;
  wire        done = (count_q == LAST_CLOCK);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni)   count_q <= 4'd0;
    else if (done) count_q <= 4'd0;
    else if (run)  count_q <= count_q + 4'd1;
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) busy_q <= 1'b0;
    else         busy_q <= run && !done;
  end

  // The operands that wait their turn: T_l, T_r, V_l, V_r as signed numbers behind the parameter.
  reg  [47:0] wait_q;
  reg  [ 1:0] index_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      wait_q  <= 48'd0;
      index_q <= 2'd0;
    end else if (start) begin
      wait_q  <= {code_t_l_i, code_t_r_i, code_v_l_i, code_v_r_i};
      index_q <= index_p_i;
    end else begin
      wait_q <= wait_q << CODE_BITS;
    end
  end

  // Offset binary to two's complement: the top bit is inverted.
  wire [31:0] parameter_int = {20'd0, code_p_i};
  wire [31:0] signed_int = {{21{!wait_q[47]}}, wait_q[46:36]};
  wire [31:0] entering = busy ? signed_int : parameter_int;

  // Channel whose gain (one clock after the operand entered) and offset (four clocks after) is looked up; chosen a clock before.
  function [2:0] channel;
    input [2:0] place;
    input [1:0] index;
    begin
      case (place)
        3'd1:    channel = 3'd2;  // T_l
        3'd2:    channel = 3'd3;  // T_r
        3'd3:    channel = 3'd0;  // V_l
        3'd4:    channel = 3'd1;  // V_r
        default: channel = {1'b1, index};
      endcase
    end
  endfunction

  wire [ 3:0] offset_place = count_q - (FP_FROM_INT_CLOCKS[3:0] + FP_MUL_CLOCKS[3:0] - 4'd2);
  reg  [ 2:0] gain_channel_q;
  reg  [ 2:0] offset_channel_q;
  reg  [31:0] gain_q;
  reg  [31:0] offset_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      gain_channel_q   <= 3'd0;
      offset_channel_q <= 3'd0;
      gain_q           <= 32'd0;
      offset_q         <= 32'd0;
    end else begin
      gain_channel_q   <= channel(count_q[2:0], busy ? index_q : index_p_i);
      offset_channel_q <= channel(offset_place[2:0], index_q);
      if (busy) begin
        gain_q   <= gain_i[32*gain_channel_q+:32];
        offset_q <= offset_i[32*offset_channel_q+:32];
      end
    end
  end

  // The chain. Between records it stands still, but for its first operator: whether a record is admitted is known late in
  // the clock, and enables nothing of so many cells.
  wire [31:0] number;
  wire [31:0] product;
  wire [31:0] value;

  fp_from_int #(
    .FRAC(0)
  ) u_from_int (
    .clk_i(clk_i),
    .en_i (1'b1),
    .x_i  (entering),
    .y_o  (number)
  );

  // A code has 12 bits, so of a number's fraction the last 12 are zero: where a product is made of small blocks, it takes fewer.
  fp_mul u_mul (
    .clk_i(clk_i),
    .en_i ({3{busy}}),
    .a_i  ({number[31:12], 12'd0}),
    .b_i  (gain_q),
    .y_o  (product)
  );

  fp_add u_add (
    .clk_i(clk_i),
    .en_i ({3{busy}}),
    .sub_i(1'b0),
    .a_i  (product),
    .b_i  (offset_q),
    .y_o  (value)
  );

  // Results come from FIRST_CLOCK to LAST_CLOCK; the last one completes the record.
  reg [31:0] part_p_q;
  reg [31:0] part_t_l_q;
  reg [31:0] part_t_r_q;
  reg [31:0] part_v_l_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      part_p_q   <= 32'd0;
      part_t_l_q <= 32'd0;
      part_t_r_q <= 32'd0;
      part_v_l_q <= 32'd0;
    end else begin
      if (count_q == FIRST_CLOCK) part_p_q <= value;
      if (count_q == FIRST_CLOCK + 4'd1) part_t_l_q <= value;
      if (count_q == FIRST_CLOCK + 4'd2) part_t_r_q <= value;
      if (count_q == FIRST_CLOCK + 4'd3) part_v_l_q <= value;
    end
  end

  reg         valid_q;
  reg [ 31:0] v_l_q;
  reg [ 31:0] v_r_q;
  reg [ 31:0] t_l_q;
  reg [ 31:0] t_r_q;
  reg [127:0] param_q;
  reg [  3:0] seen_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      valid_q <= 1'b0;
      v_l_q   <= 32'd0;
      v_r_q   <= 32'd0;
      t_l_q   <= 32'd0;
      t_r_q   <= 32'd0;
      param_q <= 128'd0;
      seen_q  <= 4'd0;
    end else begin
      valid_q <= done;
      if (done) begin
        param_q[32*index_q+:32] <= part_p_q;
        seen_q[index_q]         <= 1'b1;
      end
      if (done || !from_adc_i[0]) begin
        v_l_q <= from_adc_i[0] ? part_v_l_q : v_l_i;
        v_r_q <= from_adc_i[0] ? value : v_r_i;
      end
      if (done || !from_adc_i[1]) begin
        t_l_q <= from_adc_i[1] ? part_t_l_q : t_l_i;
        t_r_q <= from_adc_i[1] ? part_t_r_q : t_r_i;
      end
    end
  end

  assign valid_o        = valid_q;
  assign v_l_o          = v_l_q;
  assign v_r_o          = v_r_q;
  assign t_l_o          = t_l_q;
  assign t_r_o          = t_r_q;
  assign p_b_o          = param_q[32*PARAM_B+:32];
  assign p_j_o          = param_q[32*PARAM_J+:32];
  assign p_km_o         = param_q[32*PARAM_KM+:32];
  assign p_kb_o         = param_q[32*PARAM_KB+:32];
  assign params_valid_o = &seen_q;

  wire unused = &{1'b0, offset_place[3], number[11:0]};

endmodule

`default_nettype wire
