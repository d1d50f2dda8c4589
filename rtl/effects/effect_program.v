// effect_program: what both sides of the effect unit do in each clock of a step. Made by
//   python -m rtds_host.motor.effect_program rtl/effects
// from the list of operations there, which also says what the fields mean; a test fails when the two differ.
//
// Purpose    a read-only memory: a clock in, counted from the strobe's, out in the next one what is to be done then.
// Handshake  rest_i: nothing is done in the next clock. Latency 1.
// Format     each field is an output; nothing is done where it is 0. Codes are those of effect_codes.vh.
// Crossing   none.
`default_nettype none

module effect_program (
  input  wire        clk_i,
  input  wire        rst_ni,
  input  wire        rest_i,
  input  wire  [5:0] clock_i,
  output wire        last_o,       // clock_i is the last clock with something to do
  output wire        mul_o,
  output wire  [1:0] mul_a_o,
  output wire  [1:0] mul_b_o,
  output wire        add_o,
  output wire  [1:0] add_a_o,
  output wire  [1:0] add_b_o,
  output wire        across_o,
  output wire        minus_a_o,
  output wire        minus_b_o,
  output wire  [1:0] direct_o,
  output wire        look_o,
  output wire  [2:0] table_o,
  output wire        limit_o,
  output wire        put_o,
  output wire  [1:0] which_o,
  output wire        write_o,
  output wire  [2:0] source_o,
  output wire  [6:0] target_o,
  output wire  [6:0] read_mul_a_o,
  output wire        by_sign_o,
  output wire  [6:0] read_mul_b_o,
  output wire  [6:0] read_add_a_o,
  output wire  [6:0] read_add_b_o
);
  reg [62:0] word;
  reg [62:0] word_q;

  assign last_o = clock_i == 6'd50;
  assign {mul_o, mul_a_o, mul_b_o, add_o, add_a_o, add_b_o, across_o, minus_a_o, minus_b_o,
          direct_o, look_o, table_o, limit_o, put_o, which_o, write_o,
          source_o, target_o, read_mul_a_o, by_sign_o, read_mul_b_o, read_add_a_o, read_add_b_o} = word_q;

  always @* begin
    case (clock_i)
      6'd1:  word = 63'h000000A2000003F6;
      6'd2:  word = 63'h000200D262DC0000;
      // command.u = mul command_k, vc
      // fall.t = add decline, fall_lo
      6'd3:  word = 63'h460000B223640000;
      // cooled = mul heat_out, rise
      6'd4:  word = 63'h400000C243A40074;
      // more_f = by_sign load_driving, T
      6'd5:  word = 63'h4000000000000000;
      // fall.sum = add fall.t, fall
      // more_b = by_sign load_driven, T
      6'd6:  word = 63'h4280809280003F80;
      6'd7:  word = 63'h0002008380000008;
      // command.product = mul command.slope, vc
      // command.offset = add zero, command.intercept
      6'd8:  word = 63'h5640008400000000;
      // full = sub nominal, fall.sum
      6'd9:  word = 63'h0288008460000000;
      6'd10: word = 63'h0000009EA0000000;
      // bridge = add command.offset, command.product
      6'd11: word = 63'h02A0000000000000;
      6'd12: word = 63'h00000092A0003AF4;
      6'd13: word = 63'h0000000005400000;
      // fall.z = sub fall.sum, fall
      6'd14: word = 63'h02040092C4C00000;
      // unsagged = mul full, bridge
      6'd15: word = 63'h4800000001400014;
      // draw = mul vc, i
      6'd16: word = 63'h4401000003000000;
      // fall_lo.new = sub fall.t, fall.z
      // backward.u = mul backward_k, w
      6'd17: word = 63'h4689000004400000;
      // turned = mul phase, w
      6'd18: word = 63'h44000082E1858000;
      // copper = mul R, i
      6'd19: word = 63'h4410000001003D00;
      // per_draw = mul sag, bridge
      // draws = add other.draw, draw
      6'd20: word = 63'h4201D09EFC001180;
      // angle.t = add turned, angle_lo
      // forward.u = mul forward_k, w
      6'd21: word = 63'h4620000000000000;
      // hot = mul rise, copper
      // backward.offset = sub more_b, backward.intercept
      6'd22: word = 63'h4E44008360800078;
      // sagged = mul per_draw, draws
      6'd23: word = 63'h6C01000000000D80;
      // torque.u = mul torque_k, w
      // angle.sum = add angle.t, angle
      6'd24: word = 63'h4681C093E0000B80;
      // all_copper = add copper, hot
      // backward.product = mul backward.slope, w
      6'd25: word = 63'h5621008324800000;
      // scaled = sub unsagged, sagged
      // forward.product = mul forward.slope, w
      6'd26: word = 63'h5625009480001000;
      // emf = mul Kb, w
      // angle.new = wrap angle.sum
      6'd27: word = 63'h46E0A093C0000809;
      // power = mul all_copper, i
      // forward.offset = add more_f, forward.intercept
      6'd28: word = 63'h66410084A0C00000;
      // limited = limit scaled, limit
      // torque.product = mul torque.slope, w
      // load = add T, torque.intercept
      6'd29: word = 63'h5640088442801225;
      // driving = sub limited, emf
      // ripple.u = mul ripple_k, angle.new
      6'd30: word = 63'h4B24009F20000000;
      // heated = mul heat_in, power
      // level_b = sub backward.offset, backward.product
      6'd31: word = 63'h4E04009420400019;
      // loaded = add load, torque.product
      6'd32: word = 63'h02A0000000000E00;
      // drop.u = mul drop_k, driving
      // cooler = sub limited, hot
      6'd33: word = 63'h4B04B093001E4000;
      // warmed = sub heated, cooled
      6'd34: word = 63'h02280700000010A2;
      // ripple.product = mul ripple.slope, angle.new
      // loaded.less = sub loaded, ripple.intercept
      6'd35: word = 63'h52C4000000000072;
      // level_f = add forward.offset, forward.product
      6'd36: word = 63'h0200909340000000;
      // rise.t = add warmed, rise_lo
      6'd37: word = 63'h0280000000060D00;
      // u_t = sub loaded.less, ripple.product
      6'd38: word = 63'h02A4000000000070;
      // drop.product = mul drop.slope, driving
      // cooler.less = sub cooler, drop.intercept
      6'd39: word = 63'h5244060000000F78;
      // rise.sum = add rise.t, rise
      6'd40: word = 63'h02800093A0000000;
      // angle.z = sub angle.sum, angle
      6'd41: word = 63'h0204050000000070;
      // u_v = sub cooler.less, drop.product
      6'd42: word = 63'h02A400000000001F;
      // rise.z = sub rise.sum, rise
      6'd43: word = 63'h0284009E20000000;
      // angle_lo.new = sub angle.t, angle.z
      6'd44: word = 63'h028800000000001D;
      6'd45: word = 63'h0000040000000000;
      // rise_lo.new = sub rise.t, rise.z
      6'd46: word = 63'h0288000000000000;
      6'd47: word = 63'h0000009F60000000;
      6'd49: word = 63'h0000009E60000000;
      default: word = 63'h0;
    endcase
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) word_q <= 63'h0;
    else word_q <= rest_i ? 63'h0 : word;
  end
endmodule

`default_nettype wire
