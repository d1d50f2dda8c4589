// dac_scale: the four outputs of the motor units to 12-bit offset-binary codes.
//
// Format     code = clamp(2048 + round(fl(fl(x * gain) + offset)), 0, 4095), round to nearest even; gain in steps
//            a unit, offset in steps; computed in binary32. gain_i and offset_i hold four binary32 words, output c at 32*c+31..32*c;
//            order of outputs, also of code_o (12 bits each), sat_o and nan_o:
//              0 i_left (A), 1 w_left (rad/s), 2 i_right, 3 w_right: DAC outputs A, B, C, D.
//            sat_o[c]: the value lay outside of the range and was clamped (infinities included).
//            nan_o[c]: the value was not a number; the code is then 2048 (the safe one), sat_o[c] is 1 too.
//
// Handshake  valid_i for one clock with the four values (taken at that edge; a valid_i while busy is ignored),
//            valid_o for one clock with the codes; codes and flags change together and hold.
//
// Latency    12 clocks: valid_i before edge n + 1, outputs after edge n + 12. One chain for all: times gain (3), plus
//            offset (3), to int (2); four operands enter it one after the other; one output register.
//
// Crossing   none; gain_i and offset_i are of this clock.
`default_nettype none

module dac_scale (
  input  wire         clk_i,     // 50 MHz
  input  wire         rst_ni,
  input  wire         valid_i,
  input  wire [ 31:0] i_l_i,
  input  wire [ 31:0] w_l_i,
  input  wire [ 31:0] i_r_i,
  input  wire [ 31:0] w_r_i,
  input  wire [127:0] gain_i,
  input  wire [127:0] offset_i,
  output wire         valid_o,
  output wire [ 47:0] code_o,
  output wire [  3:0] sat_o,
  output wire [  3:0] nan_o
);

  `include "fp_clocks.vh"

  // Of a set of values, counted from the clock of valid_i = 0. Four of them enter the chain, one a clock; FIRST_CLOCK has the
  // first one's result.
  localparam [3:0] FIRST_CLOCK = FP_MUL_CLOCKS[3:0] + FP_ADD_CLOCKS[3:0] + FP_TO_INT_CLOCKS[3:0];
  localparam [3:0] LAST_CLOCK  = FIRST_CLOCK + 4'd3;

  reg  [3:0] count_q;  // 0: idle
  wire       start = valid_i && (count_q == 4'd0);
  reg        busy_q;   // count_q is not 0: so much hangs on it that it stands in a register
  wire       run = start || busy_q;
  wire       done = (count_q == LAST_CLOCK);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni)   count_q <= 4'd0;
    else if (done) count_q <= 4'd0;
    else if (run)  count_q <= count_q + 4'd1;
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) busy_q <= 1'b0;
    else         busy_q <= run && !done;
  end

  // The values that wait their turn behind the left current.
  reg  [95:0] wait_q;
  wire [31:0] entering = start ? i_l_i : wait_q[95:64];

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni)    wait_q <= 96'd0;
    else if (start) wait_q <= {w_l_i, i_r_i, w_r_i};
    else            wait_q <= {wait_q[63:0], 32'd0};
  end

  // The gain is wanted in the clock in which the value enters, the offset three clocks later.
  wire [ 1:0] gain_place = count_q[1:0];
  wire [ 3:0] offset_place = count_q - (FP_MUL_CLOCKS[3:0] - 4'd1);
  reg  [31:0] offset_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni)     offset_q <= 32'd0;
    else if (busy_q) offset_q <= offset_i[32*offset_place[1:0]+:32];
  end

  // The chain. Between sets it stands still, but for the multiplier's first stage: what starts a set comes late in its clock.
  wire [31:0] product;
  wire [31:0] steps;
  wire [31:0] whole;
  wire        beyond;
  wire        no_number;

  fp_mul u_mul (
    .clk_i(clk_i),
    .en_i ({busy_q, busy_q, 1'b1}),
    .a_i  (entering),
    .b_i  (gain_i[32*gain_place+:32]),
    .y_o  (product)
  );

  fp_add u_add (
    .clk_i(clk_i),
    .en_i ({3{busy_q}}),
    .sub_i(1'b0),
    .a_i  (product),
    .b_i  (offset_q),
    .y_o  (steps)
  );

  fp_to_int #(
    .FRAC(0)
  ) u_to_int (
    .clk_i(clk_i),
    .en_i (busy_q),
    .x_i  (steps),
    .y_o  (whole),
    .sat_o(beyond),
    .nan_o(no_number)
  );

  // Clamp to -2048 .. 2047: in range when bits 31 to 11 agree. What fp_to_int clamped to 32 bits is out of range
  // here too, and a NaN comes as 0: mid-scale.
  wire        low = whole[31] && !(&whole[30:11]);
  wire        high = !whole[31] && (|whole[30:11]);
  wire        flagged = low || high || no_number;
  wire [11:0] code = low ? 12'h000 : high ? 12'hFFF : {!whole[11], whole[10:0]};

  // Results come from FIRST_CLOCK to LAST_CLOCK; the last one completes the set.
  reg  [35:0] part_code_q;
  reg  [ 2:0] part_sat_q;
  reg  [ 2:0] part_nan_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      part_code_q <= 36'd0;
      part_sat_q  <= 3'd0;
      part_nan_q  <= 3'd0;
    end else if (busy_q) begin
      part_code_q <= {code, part_code_q[35:12]};
      part_sat_q  <= {flagged, part_sat_q[2:1]};
      part_nan_q  <= {no_number, part_nan_q[2:1]};
    end
  end

  reg        valid_q;
  reg [47:0] code_q;
  reg [ 3:0] sat_q;
  reg [ 3:0] nan_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      valid_q <= 1'b0;
      code_q  <= 48'd0;
      sat_q   <= 4'd0;
      nan_q   <= 4'd0;
    end else begin
      valid_q <= done;
      if (done) begin
        code_q <= {code, part_code_q};
        sat_q  <= {flagged, part_sat_q};
        nan_q  <= {no_number, part_nan_q};
      end
    end
  end

  assign valid_o = valid_q;
  assign code_o  = code_q;
  assign sat_o   = sat_q;
  assign nan_o   = nan_q;

  wire unused = &{1'b0, offset_place[3:2], beyond};

endmodule

`default_nettype wire
