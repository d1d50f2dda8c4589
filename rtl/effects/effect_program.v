// effect_program: what the effect unit does in each pair of clocks. Made by
//   python -m rtds_host.motor.effect_program rtl/effects/effect_program.v
// from the list of operations there; a test fails when the two differ.
//
// Purpose    a read-only memory: pair of clocks in, one operation out, for effect_engine.
// Handshake  none. Latency 0 (logic).
// Format     {output, which (2), op (4), across, a outside, a (7), b outside, b (7), target (7)}; valid_o is 0
//            in a pair in which nothing is issued; last_o marks the last pair.
// Crossing   none.
`default_nettype none

module effect_program (
  input  wire  [6:0] pair_i,
  output reg         valid_o,
  output reg  [30:0] word_o,
  output wire        last_o
);
  assign last_o = pair_i == 7'd72;

  always @* begin
    valid_o = 1'b1;
    word_o  = 31'd0;
    case (pair_i)
      7'd0:   word_o = 31'h00414010;  // draw = mul vc, i
      7'd1:   word_o = 31'h0103B993;  // fall.t = add decline, fall_lo
      7'd2:   word_o = 31'h00410018;  // bridge.u = mul vc, command_k
      7'd3:   word_o = 31'h00404027;  // copper = mul R, i
      7'd4:   word_o = 31'h01880811;  // draws = add left.draw, right.draw
      7'd5:   word_o = 31'h01390994;  // fall.new = add fall, fall.t
      7'd6:   word_o = 31'h080C0099;  // bridge.slope = look bridge.u, command.slope
      7'd7:   word_o = 31'h00030892;  // sagged = mul sag, draws
      7'd8:   word_o = 31'h02040A16;  // full = sub nominal, fall.new
      7'd9:   word_o = 31'h080C001A;  // bridge.intercept = look bridge.u, command.intercept
      7'd10:  word_o = 31'h00410C9B;  // bridge.product = mul vc, bridge.slope
      7'd11:  word_o = 31'h020B0917;  // bus = sub full, sagged
      7'd12:  word_o = 31'h003813A8;  // hot = mul rise, copper
      7'd13:  word_o = 31'h010D8D1C;  // bridge = add bridge.product, bridge.intercept
      7'd14:  word_o = 31'h000640B7;  // turned = mul phase, w
      7'd15:  word_o = 31'h0040C09F;  // emf = mul Kb, w
      7'd16:  word_o = 31'h000E0B9D;  // scaled = mul bridge, bus
      7'd17:  word_o = 31'h0113942A;  // all_copper = add copper, hot
      7'd18:  word_o = 31'h011BBAB8;  // angle.t = add turned, angle_lo
      7'd19:  word_o = 31'h060E849E;  // limited = clamp scaled, limit
      7'd20:  word_o = 31'h0015402B;  // power = mul all_copper, i
      7'd21:  word_o = 31'h013A1C39;  // angle.new = add angle, angle.t
      7'd22:  word_o = 31'h020F0FA0;  // driving = sub limited, emf
      7'd23:  word_o = 31'h000515AC;  // heated = mul heat_in, power
      7'd24:  word_o = 31'h0005B82D;  // cooled = mul heat_out, rise
      7'd25:  word_o = 31'h00009021;  // dropped.u = mul drop_k, driving
      7'd26:  word_o = 31'h000140B2;  // resisting.u = mul torque_k, w
      7'd27:  word_o = 31'h071C803B;  // angle.wrapped = wrap angle.new
      7'd28:  word_o = 31'h081081A2;  // dropped.slope = look dropped.u, drop.slope
      7'd29:  word_o = 31'h021616AE;  // warmed = sub heated, cooled
      7'd30:  word_o = 31'h081902B3;  // resisting.slope = look resisting.u, torque.slope
      7'd31:  word_o = 31'h00019DBC;  // driven.u = mul ripple_k, angle.wrapped
      7'd32:  word_o = 31'h000240C3;  // forward.u = mul forward_k, w
      7'd33:  word_o = 31'h0002C0C8;  // backward.u = mul backward_k, w
      7'd34:  word_o = 31'h08108123;  // dropped.intercept = look dropped.u, drop.intercept
      7'd35:  word_o = 31'h00111024;  // dropped.product = mul dropped.slope, driving
      7'd36:  word_o = 31'h011738AF;  // rise.t = add warmed, rise_lo
      7'd37:  word_o = 31'h08190234;  // resisting.intercept = look resisting.u, torque.intercept
      7'd38:  word_o = 31'h0019C0B5;  // resisting.product = mul resisting.slope, w
      7'd39:  word_o = 31'h081E03BD;  // driven.slope = look driven.u, ripple.slope
      7'd40:  word_o = 31'h082184C4;  // forward.slope = look forward.u, forward.slope
      7'd41:  word_o = 31'h082405C9;  // backward.slope = look backward.u, backward.slope
      7'd42:  word_o = 31'h011211A5;  // dropped = add dropped.product, dropped.intercept
      7'd43:  word_o = 31'h013817B0;  // rise.new = add rise, rise.t
      7'd44:  word_o = 31'h011A9A36;  // resisting = add resisting.product, resisting.intercept
      7'd45:  word_o = 31'h081E033E;  // driven.intercept = look driven.u, ripple.intercept
      7'd46:  word_o = 31'h001E9DBF;  // driven.product = mul driven.slope, angle.wrapped
      7'd47:  word_o = 31'h08218445;  // forward.intercept = look forward.u, forward.intercept
      7'd48:  word_o = 31'h002240C6;  // forward.product = mul forward.slope, w
      7'd49:  word_o = 31'h0824054A;  // backward.intercept = look backward.u, backward.intercept
      7'd50:  word_o = 31'h0024C0CB;  // backward.product = mul backward.slope, w
      7'd51:  word_o = 31'h004186CD;  // driving_loss = mul T, load_driving
      7'd52:  word_o = 31'h0041874E;  // driven_loss = mul T, load_driven
      7'd53:  word_o = 31'h020A3915;  // fall.z = sub fall.new, fall
      7'd54:  word_o = 31'h020F12A6;  // left_over = sub limited, dropped
      7'd55:  word_o = 31'h02183831;  // rise.z = sub rise.new, rise
      7'd56:  word_o = 31'h021CBA3A;  // angle.z = sub angle.new, angle
      7'd57:  word_o = 31'h011F9F40;  // driven = add driven.product, driven.intercept
      7'd58:  word_o = 31'h01419B41;  // load = add T, resisting
      7'd59:  word_o = 31'h012322C7;  // forward = add forward.product, forward.intercept
      7'd60:  word_o = 31'h0125A54C;  // backward = add backward.product, backward.intercept
      7'd61:  word_o = 31'h0426A74F;  // more_f = pos driving_loss, driven_loss
      7'd62:  word_o = 31'h0526A750;  // more_b = neg driving_loss, driven_loss
      7'd63:  word_o = 31'h02098AF3;  // fall_lo = sub fall.t, fall.z
      7'd64:  word_o = 31'h030A0072;  // fall = mov fall.new
      7'd65:  word_o = 31'h42131429;  // u_v = sub left_over, hot
      7'd66:  word_o = 31'h021798F1;  // rise_lo = sub rise.t, rise.z
      7'd67:  word_o = 31'h03180070;  // rise = mov rise.new
      7'd68:  word_o = 31'h021C1D75;  // angle_lo = sub angle.t, angle.z
      7'd69:  word_o = 31'h031D8074;  // angle = mov angle.wrapped
      7'd70:  word_o = 31'h5220A042;  // u_t = sub load, driven
      7'd71:  word_o = 31'h6123A7D1;  // level_f = add forward, more_f
      7'd72:  word_o = 31'h72262852;  // level_b = sub backward, more_b
      default: valid_o = 1'b0;
    endcase
  end
endmodule

`default_nettype wire
