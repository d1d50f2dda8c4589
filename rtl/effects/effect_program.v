// effect_program: what both sides of the effect unit do in each clock of a step. Made by
//   python -m rtds_host.motor.effect_program rtl/effects/effect_program.v
// from the list of operations there, which also says what the fields mean; a test fails when the two differ.
//
// Purpose    a read-only memory: a clock in, counted from the strobe's, out in the next one what is to be done then.
// Handshake  rest_i: nothing is done in the next clock. Latency 1.
// Format     each field is an output; nothing is done where it is 0. Codes of what an operand is:
//            mul_a register, slope, sum; mul_b register, direct, sum, product;
//            add_a register, sum, limited, other; add_b register, product, intercept, wrap;
//            direct i, w, vc; source product, sum, T, R, Kb, vc; which u_v, u_t, level_f, level_b;
//            table command, drop, torque, ripple, forward, backward.
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
  reg [61:0] word;
  reg [61:0] word_q;

  assign last_o = clock_i == 6'd50;
  assign {mul_o, mul_a_o, mul_b_o, add_o, add_a_o, add_b_o, minus_a_o, minus_b_o,
          direct_o, look_o, table_o, limit_o, put_o, which_o, write_o,
          source_o, target_o, read_mul_a_o, by_sign_o, read_mul_b_o, read_add_a_o, read_add_b_o} = word_q;

  always @* begin
    case (clock_i)
      6'd1:  word = 62'h000000A2000003F6;
      6'd2:  word = 62'h000200D263A40000;
      // command.u = mul command_k, vc
      // fall.t = add decline, fall_lo
      6'd3:  word = 62'h230000B223640000;
      // more_b = by_sign load_driven, T
      6'd4:  word = 62'h200000C242DC0074;
      // more_f = by_sign load_driving, T
      6'd5:  word = 62'h2000000000000000;
      // fall.sum = add fall.t, fall
      // cooled = mul heat_out, rise
      6'd6:  word = 62'h2140809280003F80;
      6'd7:  word = 62'h0002008480000008;
      // command.product = mul command.slope, vc
      // command.offset = add zero, command.intercept
      6'd8:  word = 62'h2B20008420000074;
      // full = sub nominal, fall.sum
      6'd9:  word = 62'h01480083A0000000;
      // fall.z = sub fall.sum, fall
      6'd10: word = 62'h0144009EA0000000;
      // bridge = add command.offset, command.product
      6'd11: word = 62'h0150000000000014;
      6'd12: word = 62'h00000092A1800000;
      // fall_lo.new = sub fall.t, fall.z
      6'd13: word = 62'h0148000005400000;
      // per_draw = mul sag, bridge
      6'd14: word = 62'h2400000004C00000;
      // unsagged = mul full, bridge
      6'd15: word = 62'h2400000003000000;
      // draw = mul vc, i
      6'd16: word = 62'h2201009EE4400000;
      // turned = mul phase, w
      6'd17: word = 62'h22000082C1000000;
      // copper = mul R, i
      6'd18: word = 62'h22010082E4803D00;
      // draws = add other.draw, draw
      // forward.u = mul forward_k, w
      6'd19: word = 62'h23D100001C000000;
      // emf = mul Kb, w
      // angle.t = add turned, angle_lo
      6'd20: word = 62'h2310000005800000;
      // hot = mul rise, copper
      6'd21: word = 62'h2600008380800078;
      // sagged = mul per_draw, draws
      6'd22: word = 62'h2401C00001400E00;
      // torque.u = mul torque_k, w
      // angle.sum = add angle.t, angle
      6'd23: word = 62'h2341008300000B80;
      // all_copper = add copper, hot
      // backward.u = mul backward_k, w
      6'd24: word = 62'h2311008340000000;
      // scaled = sub unsagged, sagged
      // forward.product = mul forward.slope, w
      6'd25: word = 62'h2B14009400001080;
      // angle.new = wrap angle.sum
      6'd26: word = 62'h0170A093E0000809;
      // power = mul all_copper, i
      // forward.offset = add more_f, forward.intercept
      6'd27: word = 62'h3321D00000C00018;
      // limited = limit scaled, limit
      // torque.product = mul torque.slope, w
      // load = add T, torque.intercept
      6'd28: word = 62'h2B20088462801200;
      // driving = sub limited, emf
      // ripple.u = mul ripple_k, angle.new
      6'd29: word = 62'h2584009F20000000;
      // heated = mul heat_in, power
      // backward.offset = sub more_b, backward.intercept
      6'd30: word = 62'h272500944040001A;
      // loaded = add load, torque.product
      // backward.product = mul backward.slope, w
      6'd31: word = 62'h2B50000000000E80;
      // drop.u = mul drop_k, driving
      // cooler = sub limited, hot
      6'd32: word = 62'h2584B093201E4000;
      // warmed = sub heated, cooled
      6'd33: word = 62'h01180094A0001123;
      // ripple.product = mul ripple.slope, angle.new
      // loaded.less = sub loaded, ripple.intercept
      6'd34: word = 62'h29640084C0000072;
      // level_f = add forward.offset, forward.product
      6'd35: word = 62'h0100909360064000;
      // rise.t = add warmed, rise_lo
      6'd36: word = 62'h0140000000000D80;
      // drop.product = mul drop.slope, driving
      // u_t = sub loaded.less, ripple.product
      6'd37: word = 62'h2954000000000070;
      // cooler.less = sub cooler, drop.intercept
      6'd38: word = 62'h01240600000012A6;
      // rise.sum = add rise.t, rise
      6'd39: word = 62'h01400093C0000000;
      // level_b = sub backward.offset, backward.product
      6'd40: word = 62'h0104050000000070;
      // u_v = sub cooler.less, drop.product
      6'd41: word = 62'h0154000000000FF8;
      // rise.z = sub rise.sum, rise
      6'd42: word = 62'h0144009E20000000;
      // angle.z = sub angle.sum, angle
      6'd43: word = 62'h010407000000001E;
      6'd44: word = 62'h0000040000000020;
      // rise_lo.new = sub rise.t, rise.z
      6'd45: word = 62'h0148000000000000;
      // angle_lo.new = sub angle.t, angle.z
      6'd46: word = 62'h0148000000000000;
      6'd48: word = 62'h0000009E60000000;
      6'd49: word = 62'h0000009F60000000;
      default: word = 62'h0;
    endcase
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) word_q <= 62'h0;
    else word_q <= rest_i ? 62'h0 : word;
  end
endmodule

`default_nettype wire
