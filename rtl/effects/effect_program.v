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
  // The lowest bit of each field in the word.
  localparam AT_MUL = 62;
  localparam AT_MUL_A = 60;
  localparam AT_MUL_B = 58;
  localparam AT_ADD = 57;
  localparam AT_ADD_A = 55;
  localparam AT_ADD_B = 53;
  localparam AT_ACROSS = 52;
  localparam AT_MINUS_A = 51;
  localparam AT_MINUS_B = 50;
  localparam AT_DIRECT = 48;
  localparam AT_LOOK = 47;
  localparam AT_TABLE = 44;
  localparam AT_LIMIT = 43;
  localparam AT_PUT = 42;
  localparam AT_WHICH = 40;
  localparam AT_WRITE = 39;
  localparam AT_SOURCE = 36;
  localparam AT_TARGET = 29;
  localparam AT_READ_MUL_A = 22;
  localparam AT_BY_SIGN = 21;
  localparam AT_READ_MUL_B = 14;
  localparam AT_READ_ADD_A = 7;
  localparam AT_READ_ADD_B = 0;

  reg [62:0] word;
  reg [62:0] word_q;

  assign last_o = clock_i == 6'd50;
  assign {mul_o, mul_a_o, mul_b_o, add_o, add_a_o, add_b_o, across_o, minus_a_o, minus_b_o,
          direct_o, look_o, table_o, limit_o, put_o, which_o, write_o,
          source_o, target_o, read_mul_a_o, by_sign_o, read_mul_b_o, read_add_a_o, read_add_b_o} = word_q;

  always @* begin
    case (clock_i)
      6'd1:
        word = 63'd1 << AT_WRITE
             | 63'd2 << AT_SOURCE         // T
             | 63'd16 << AT_TARGET        // T
             | 63'd0 << AT_READ_MUL_A     // command_k
             | 63'd7 << AT_READ_ADD_A     // decline
             | 63'd118 << AT_READ_ADD_B;  // fall_lo
      6'd2:
        word = 63'd2 << AT_DIRECT         // vc
             | 63'd1 << AT_WRITE
             | 63'd5 << AT_SOURCE         // vc
             | 63'd19 << AT_TARGET        // vc
             | 63'd11 << AT_READ_MUL_A    // heat_out
             | 63'd112 << AT_READ_MUL_B;  // rise
      // command.u = mul command_k, vc
      // fall.t = add decline, fall_lo
      6'd3:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A         // register
             | 63'd1 << AT_MUL_B         // direct
             | 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A         // register
             | 63'd0 << AT_ADD_B         // register
             | 63'd1 << AT_WRITE
             | 63'd3 << AT_SOURCE        // R
             | 63'd17 << AT_TARGET       // R
             | 63'd13 << AT_READ_MUL_A   // load_driving
             | 63'd1 << AT_BY_SIGN
             | 63'd16 << AT_READ_MUL_B;  // T
      // cooled = mul heat_out, rise
      6'd4:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A          // register
             | 63'd0 << AT_MUL_B          // register
             | 63'd1 << AT_WRITE
             | 63'd4 << AT_SOURCE         // Kb
             | 63'd18 << AT_TARGET        // Kb
             | 63'd14 << AT_READ_MUL_A    // load_driven
             | 63'd1 << AT_BY_SIGN
             | 63'd16 << AT_READ_MUL_B    // T
             | 63'd116 << AT_READ_ADD_B;  // fall
      // more_f = by_sign load_driving, T
      6'd5:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A   // register
             | 63'd0 << AT_MUL_B;  // register
      // fall.sum = add fall.t, fall
      // more_b = by_sign load_driven, T
      6'd6:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A          // register
             | 63'd0 << AT_MUL_B          // register
             | 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A          // sum
             | 63'd0 << AT_ADD_B          // register
             | 63'd1 << AT_LOOK
             | 63'd0 << AT_TABLE          // command
             | 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE         // sum
             | 63'd20 << AT_TARGET        // temporary 0
             | 63'd127 << AT_READ_ADD_A;  // zero
      6'd7:
        word = 63'd2 << AT_DIRECT       // vc
             | 63'd1 << AT_WRITE
             | 63'd0 << AT_SOURCE       // product
             | 63'd28 << AT_TARGET      // temporary 8
             | 63'd8 << AT_READ_ADD_B;  // nominal
      // command.product = mul command.slope, vc
      // command.offset = add zero, command.intercept
      6'd8:
        word = 63'd1 << AT_MUL
             | 63'd1 << AT_MUL_A     // slope
             | 63'd1 << AT_MUL_B     // direct
             | 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A     // register
             | 63'd2 << AT_ADD_B     // intercept
             | 63'd1 << AT_WRITE
             | 63'd0 << AT_SOURCE    // product
             | 63'd32 << AT_TARGET;  // temporary 12
      // full = sub nominal, fall.sum
      6'd9:
        word = 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A     // sum
             | 63'd0 << AT_ADD_B     // register
             | 63'd1 << AT_MINUS_A
             | 63'd1 << AT_WRITE
             | 63'd0 << AT_SOURCE    // product
             | 63'd35 << AT_TARGET;  // temporary 15
      6'd10:
        word = 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE     // sum
             | 63'd117 << AT_TARGET;  // fall
      // bridge = add command.offset, command.product
      6'd11:
        word = 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A   // sum
             | 63'd1 << AT_ADD_B;  // product
      6'd12:
        word = 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE         // sum
             | 63'd21 << AT_TARGET        // temporary 1
             | 63'd117 << AT_READ_ADD_A   // fall
             | 63'd116 << AT_READ_ADD_B;  // fall
      6'd13:
        word = 63'd21 << AT_READ_MUL_A;  // temporary 1
      // fall.z = sub fall.sum, fall
      6'd14:
        word = 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A         // register
             | 63'd0 << AT_ADD_B         // register
             | 63'd1 << AT_MINUS_B
             | 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE        // sum
             | 63'd22 << AT_TARGET       // temporary 2
             | 63'd19 << AT_READ_MUL_A;  // vc
      // unsagged = mul full, bridge
      6'd15:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A         // register
             | 63'd2 << AT_MUL_B         // sum
             | 63'd5 << AT_READ_MUL_A    // backward_k
             | 63'd20 << AT_READ_ADD_B;  // temporary 0
      // draw = mul vc, i
      6'd16:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A         // register
             | 63'd1 << AT_MUL_B         // direct
             | 63'd1 << AT_DIRECT        // w
             | 63'd12 << AT_READ_MUL_A;  // phase
      // fall_lo.new = sub fall.t, fall.z
      // backward.u = mul backward_k, w
      6'd17:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A         // register
             | 63'd1 << AT_MUL_B         // direct
             | 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A         // sum
             | 63'd0 << AT_ADD_B         // register
             | 63'd1 << AT_MINUS_A
             | 63'd1 << AT_DIRECT        // w
             | 63'd17 << AT_READ_MUL_A;  // R
      // turned = mul phase, w
      6'd18:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A         // register
             | 63'd1 << AT_MUL_B         // direct
             | 63'd1 << AT_WRITE
             | 63'd0 << AT_SOURCE        // product
             | 63'd23 << AT_TARGET       // temporary 3
             | 63'd6 << AT_READ_MUL_A    // sag
             | 63'd22 << AT_READ_MUL_B;  // temporary 2
      // copper = mul R, i
      6'd19:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A          // register
             | 63'd1 << AT_MUL_B          // direct
             | 63'd1 << AT_ACROSS
             | 63'd4 << AT_READ_MUL_A     // forward_k
             | 63'd122 << AT_READ_ADD_A;  // angle_lo
      // per_draw = mul sag, bridge
      // draws = add other.draw, draw
      6'd20:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A          // register
             | 63'd0 << AT_MUL_B          // register
             | 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A          // register
             | 63'd0 << AT_ADD_B          // register
             | 63'd1 << AT_DIRECT         // w
             | 63'd1 << AT_LOOK
             | 63'd5 << AT_TABLE          // backward
             | 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE         // sum
             | 63'd119 << AT_TARGET       // fall_lo
             | 63'd112 << AT_READ_MUL_A   // rise
             | 63'd35 << AT_READ_ADD_A;   // temporary 15
      // angle.t = add turned, angle_lo
      // forward.u = mul forward_k, w
      6'd21:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A   // register
             | 63'd1 << AT_MUL_B   // direct
             | 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A   // register
             | 63'd1 << AT_ADD_B;  // product
      // hot = mul rise, copper
      // backward.offset = sub more_b, backward.intercept
      6'd22:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A          // register
             | 63'd3 << AT_MUL_B          // product
             | 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A          // register
             | 63'd2 << AT_ADD_B          // intercept
             | 63'd1 << AT_MINUS_B
             | 63'd1 << AT_WRITE
             | 63'd0 << AT_SOURCE         // product
             | 63'd27 << AT_TARGET        // temporary 7
             | 63'd2 << AT_READ_MUL_A     // torque_k
             | 63'd120 << AT_READ_ADD_B;  // angle
      // sagged = mul per_draw, draws
      6'd23:
        word = 63'd1 << AT_MUL
             | 63'd2 << AT_MUL_A         // sum
             | 63'd3 << AT_MUL_B         // product
             | 63'd1 << AT_DIRECT        // w
             | 63'd27 << AT_READ_ADD_A;  // temporary 7
      // torque.u = mul torque_k, w
      // angle.sum = add angle.t, angle
      6'd24:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A         // register
             | 63'd1 << AT_MUL_B         // direct
             | 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A         // sum
             | 63'd0 << AT_ADD_B         // register
             | 63'd1 << AT_DIRECT        // w
             | 63'd1 << AT_LOOK
             | 63'd4 << AT_TABLE         // forward
             | 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE        // sum
             | 63'd31 << AT_TARGET       // temporary 11
             | 63'd23 << AT_READ_ADD_A;  // temporary 3
      // all_copper = add copper, hot
      // backward.product = mul backward.slope, w
      6'd25:
        word = 63'd1 << AT_MUL
             | 63'd1 << AT_MUL_A         // slope
             | 63'd1 << AT_MUL_B         // direct
             | 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A         // register
             | 63'd1 << AT_ADD_B         // product
             | 63'd1 << AT_DIRECT        // w
             | 63'd1 << AT_WRITE
             | 63'd0 << AT_SOURCE        // product
             | 63'd25 << AT_TARGET       // temporary 5
             | 63'd18 << AT_READ_MUL_A;  // Kb
      // scaled = sub unsagged, sagged
      // forward.product = mul forward.slope, w
      6'd26:
        word = 63'd1 << AT_MUL
             | 63'd1 << AT_MUL_A         // slope
             | 63'd1 << AT_MUL_B         // direct
             | 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A         // register
             | 63'd1 << AT_ADD_B         // product
             | 63'd1 << AT_MINUS_B
             | 63'd1 << AT_DIRECT        // w
             | 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE        // sum
             | 63'd36 << AT_TARGET       // temporary 16
             | 63'd32 << AT_READ_ADD_A;  // temporary 12
      // emf = mul Kb, w
      // angle.new = wrap angle.sum
      6'd27:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A         // register
             | 63'd1 << AT_MUL_B         // direct
             | 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A         // sum
             | 63'd3 << AT_ADD_B         // wrap
             | 63'd1 << AT_LOOK
             | 63'd2 << AT_TABLE         // torque
             | 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE        // sum
             | 63'd30 << AT_TARGET       // temporary 10
             | 63'd16 << AT_READ_ADD_A   // T
             | 63'd9 << AT_READ_ADD_B;   // limit
      // power = mul all_copper, i
      // forward.offset = add more_f, forward.intercept
      6'd28:
        word = 63'd1 << AT_MUL
             | 63'd2 << AT_MUL_A        // sum
             | 63'd1 << AT_MUL_B        // direct
             | 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A        // register
             | 63'd2 << AT_ADD_B        // intercept
             | 63'd1 << AT_DIRECT       // w
             | 63'd1 << AT_WRITE
             | 63'd0 << AT_SOURCE       // product
             | 63'd37 << AT_TARGET      // temporary 17
             | 63'd3 << AT_READ_MUL_A;  // ripple_k
      // limited = limit scaled, limit
      // torque.product = mul torque.slope, w
      // load = add T, torque.intercept
      6'd29:
        word = 63'd1 << AT_MUL
             | 63'd1 << AT_MUL_A         // slope
             | 63'd1 << AT_MUL_B         // direct
             | 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A         // register
             | 63'd2 << AT_ADD_B         // intercept
             | 63'd1 << AT_LIMIT
             | 63'd1 << AT_WRITE
             | 63'd0 << AT_SOURCE        // product
             | 63'd34 << AT_TARGET       // temporary 14
             | 63'd10 << AT_READ_MUL_A   // heat_in
             | 63'd36 << AT_READ_ADD_A   // temporary 16
             | 63'd37 << AT_READ_ADD_B;  // temporary 17
      // driving = sub limited, emf
      // ripple.u = mul ripple_k, angle.new
      6'd30:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A      // register
             | 63'd2 << AT_MUL_B      // sum
             | 63'd1 << AT_ADD
             | 63'd2 << AT_ADD_A      // limited
             | 63'd1 << AT_ADD_B      // product
             | 63'd1 << AT_MINUS_B
             | 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE     // sum
             | 63'd121 << AT_TARGET;  // angle
      // heated = mul heat_in, power
      // level_b = sub backward.offset, backward.product
      6'd31:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A         // register
             | 63'd3 << AT_MUL_B         // product
             | 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A         // register
             | 63'd0 << AT_ADD_B         // register
             | 63'd1 << AT_MINUS_B
             | 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE        // sum
             | 63'd33 << AT_TARGET       // temporary 13
             | 63'd1 << AT_READ_MUL_A    // drop_k
             | 63'd25 << AT_READ_ADD_B;  // temporary 5
      // loaded = add load, torque.product
      6'd32:
        word = 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A         // sum
             | 63'd1 << AT_ADD_B         // product
             | 63'd28 << AT_READ_ADD_A;  // temporary 8
      // drop.u = mul drop_k, driving
      // cooler = sub limited, hot
      6'd33:
        word = 63'd1 << AT_MUL
             | 63'd0 << AT_MUL_A          // register
             | 63'd2 << AT_MUL_B          // sum
             | 63'd1 << AT_ADD
             | 63'd2 << AT_ADD_A          // limited
             | 63'd0 << AT_ADD_B          // register
             | 63'd1 << AT_MINUS_B
             | 63'd1 << AT_LOOK
             | 63'd3 << AT_TABLE          // ripple
             | 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE         // sum
             | 63'd24 << AT_TARGET        // temporary 4
             | 63'd121 << AT_READ_MUL_B;  // angle
      // warmed = sub heated, cooled
      6'd34:
        word = 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A         // register
             | 63'd1 << AT_ADD_B         // product
             | 63'd1 << AT_MINUS_A
             | 63'd1 << AT_PUT
             | 63'd3 << AT_WHICH         // level_b
             | 63'd33 << AT_READ_ADD_A   // temporary 13
             | 63'd34 << AT_READ_ADD_B;  // temporary 14
      // ripple.product = mul ripple.slope, angle.new
      // loaded.less = sub loaded, ripple.intercept
      6'd35:
        word = 63'd1 << AT_MUL
             | 63'd1 << AT_MUL_A          // slope
             | 63'd0 << AT_MUL_B          // register
             | 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A          // sum
             | 63'd2 << AT_ADD_B          // intercept
             | 63'd1 << AT_MINUS_B
             | 63'd114 << AT_READ_ADD_B;  // rise_lo
      // level_f = add forward.offset, forward.product
      6'd36:
        word = 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A     // register
             | 63'd0 << AT_ADD_B     // register
             | 63'd1 << AT_LOOK
             | 63'd1 << AT_TABLE     // drop
             | 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE    // sum
             | 63'd26 << AT_TARGET;  // temporary 6
      // rise.t = add warmed, rise_lo
      6'd37:
        word = 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A         // sum
             | 63'd0 << AT_ADD_B         // register
             | 63'd24 << AT_READ_MUL_B   // temporary 4
             | 63'd26 << AT_READ_ADD_A;  // temporary 6
      // u_t = sub loaded.less, ripple.product
      6'd38:
        word = 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A          // sum
             | 63'd1 << AT_ADD_B          // product
             | 63'd1 << AT_MINUS_B
             | 63'd112 << AT_READ_ADD_B;  // rise
      // drop.product = mul drop.slope, driving
      // cooler.less = sub cooler, drop.intercept
      6'd39:
        word = 63'd1 << AT_MUL
             | 63'd1 << AT_MUL_A          // slope
             | 63'd0 << AT_MUL_B          // register
             | 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A          // register
             | 63'd2 << AT_ADD_B          // intercept
             | 63'd1 << AT_MINUS_B
             | 63'd1 << AT_PUT
             | 63'd2 << AT_WHICH          // level_f
             | 63'd30 << AT_READ_ADD_A    // temporary 10
             | 63'd120 << AT_READ_ADD_B;  // angle
      // rise.sum = add rise.t, rise
      6'd40:
        word = 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A     // sum
             | 63'd0 << AT_ADD_B     // register
             | 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE    // sum
             | 63'd29 << AT_TARGET;  // temporary 9
      // angle.z = sub angle.sum, angle
      6'd41:
        word = 63'd1 << AT_ADD
             | 63'd0 << AT_ADD_A          // register
             | 63'd0 << AT_ADD_B          // register
             | 63'd1 << AT_MINUS_B
             | 63'd1 << AT_PUT
             | 63'd1 << AT_WHICH          // u_t
             | 63'd112 << AT_READ_ADD_B;  // rise
      // u_v = sub cooler.less, drop.product
      6'd42:
        word = 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A         // sum
             | 63'd1 << AT_ADD_B         // product
             | 63'd1 << AT_MINUS_B
             | 63'd31 << AT_READ_ADD_B;  // temporary 11
      // rise.z = sub rise.sum, rise
      6'd43:
        word = 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A      // sum
             | 63'd0 << AT_ADD_B      // register
             | 63'd1 << AT_MINUS_B
             | 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE     // sum
             | 63'd113 << AT_TARGET;  // rise
      // angle_lo.new = sub angle.t, angle.z
      6'd44:
        word = 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A         // sum
             | 63'd0 << AT_ADD_B         // register
             | 63'd1 << AT_MINUS_A
             | 63'd29 << AT_READ_ADD_B;  // temporary 9
      6'd45:
        word = 63'd1 << AT_PUT
             | 63'd0 << AT_WHICH;  // u_v
      // rise_lo.new = sub rise.t, rise.z
      6'd46:
        word = 63'd1 << AT_ADD
             | 63'd1 << AT_ADD_A     // sum
             | 63'd0 << AT_ADD_B     // register
             | 63'd1 << AT_MINUS_A;
      6'd47:
        word = 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE     // sum
             | 63'd123 << AT_TARGET;  // angle_lo
      6'd49:
        word = 63'd1 << AT_WRITE
             | 63'd1 << AT_SOURCE     // sum
             | 63'd115 << AT_TARGET;  // rise_lo
      default: word = 63'h0;
    endcase
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) word_q <= 63'h0;
    else word_q <= rest_i ? 63'h0 : word;
  end
endmodule

`default_nettype wire
