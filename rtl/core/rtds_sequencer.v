// rtds_sequencer: says in each clock of a step what the adders and multipliers of the motor units do.
//
// Purpose    Slot 0 is the clock of the strobe, slot k the k-th clock after it. What enters the adder or the multiplier in
//            slot k leaves it in slot k + 3:
//              slot  0   mul   : g1 V (slot 3)
//              slot  1   mul   : g2 T (slot 4, saved at its end)
//              slot  3   add V : c + g1 V (slot 6)
//              slot  6   add T : and g2 T -> t (slot 9, saved at its end)
//              slot  9   add HI: hi + t -> hi' (slot 12: outputs change, valid; saved at its end)
//              slot 12   add Z : hi' - hi -> z (slot 15)
//              slot 12   mul   : first product of the state (slot 15, saved at its end)
//              slot 13   mul   : second product of the state (slot 16)
//              slot 15   add LO: t - z -> lo' (slot 18, saved at its end)
//              slot 16   add S : products -> s (slot 19, and it stays to slot 24)
//              slot 19   mul   : g1 s1 (slot 22)
//              slot 20   mul   : g2 s2 (slot 23, and it stays)
//              slot 22   add C1: lo' - g1 s1 (slot 25)
//              slot 25   add C2: and g2 s2 -> c of the next step (slot 28, saved at its end, which may be slot 2 of that step)
//            refresh_i runs slots 12 to 25 alone, without outputs and LO: c anew after the coefficients have changed.
//            With effects_i slots 32 to 41 stand between 11 and 12, so that all after them is 10 clocks later:
//              slot  2   mul   : level of friction forward (slot 5, saved at its end)
//              slot  3   mul   : level of friction backward (slot 6, saved at its end)
//              slot 32   (what HI gave in slot 9 is the free speed: rtds_friction takes its part, saved at its end)
//              slot 33   mul   : rho taken (slot 36)
//              slot 36   add P : t corrected -> t' (slot 39, saved at its end)
//              slot 39   add HI: hi + t' -> hi' (slot 12)
// Handshake  start_i (in the clock of the strobe) or refresh_i only while idle_o. clear_i ends what is under way.
//            effects_i holds from the clock after start_i to the next.
// Latency    valid_o in slot 12, after the 11th edge that follows the strobe's; the next strobe may follow 26 clocks
//            after the last. With effects 10 more.
// Style      What a slot does is looked up in the slot before and stands in registers, so that nothing but the strobe itself
//            is decoded in the clock in which operands are chosen.
// Crossing   none.
`default_nettype none

module rtds_sequencer (
  input  wire       clk_i,
  input  wire       rst_ni,
  input  wire       clear_i,
  input  wire       start_i,
  input  wire       refresh_i,
  input  wire       effects_i,
  output wire       idle_o,
  output wire       next_o,      // valid_o in the next clock
  output reg        valid_o,     // the adders' results are the new high words, which are saved
  output wire [2:0] add_en_o,    // a bit for each stage, the first in bit 0
  output wire [2:0] mul_en_o,
  output wire [6:0] add_o,       // what enters the adder: see rtds_row
  output wire [3:0] mul_o,       // and the multiplier
  output wire       save_p_o,
  output wire       save_c_o,
  output wire       save_lo_o,
  output wire       save_last_o,  // what is saved is the new state
  output wire       save_f_o,     // products of rtds_friction
  output wire       save_b_o,
  output wire       save_taken_o
);
  // The same codes as in rtds_row: {minus in the mechanical row, in the electrical row, second operand, first operand}.
  localparam [1:0] A_C  = 2'd0;
  localparam [1:0] A_Y  = 2'd1;
  localparam [1:0] A_P  = 2'd2;
  localparam [1:0] A_LO = 2'd3;
  localparam [2:0] B_M     = 3'd0;
  localparam [2:0] B_P     = 3'd1;
  localparam [2:0] B_HI    = 3'd2;
  localparam [2:0] B_Y     = 3'd3;
  localparam [2:0] B_TAKEN = 3'd4;

  localparam [6:0] ADD_V  = {2'b00, B_M, A_C};
  localparam [6:0] ADD_T  = {2'b10, B_P, A_Y};
  localparam [6:0] ADD_HI = {2'b00, B_HI, A_Y};
  localparam [6:0] ADD_Z  = {2'b11, B_HI, A_Y};
  localparam [6:0] ADD_LO = {2'b11, B_Y, A_LO};
  localparam [6:0] ADD_S  = {2'b10, B_M, A_P};
  localparam [6:0] ADD_C1 = {2'b11, B_M, A_LO};
  localparam [6:0] ADD_C2 = {2'b01, B_M, A_Y};
  localparam [6:0] ADD_P  = {2'b10, B_TAKEN, A_LO};

  // {friction, input, G rather than S, second rather than first}
  localparam [3:0] MUL_V     = 4'b0110;
  localparam [3:0] MUL_T     = 4'b0111;
  localparam [3:0] MUL_I     = 4'b0000;
  localparam [3:0] MUL_W     = 4'b0001;
  localparam [3:0] MUL_S1    = 4'b0010;
  localparam [3:0] MUL_S2    = 4'b0011;
  localparam [3:0] MUL_FIRST = 4'b1000;
  localparam [3:0] MUL_OTHER = 4'b1001;

  localparam [5:0] SLOT_IDLE  = 6'd0;
  localparam [5:0] SLOT_FIRST = 6'd1;
  localparam [5:0] SLOT_SPLIT = 6'd11;
  localparam [5:0] SLOT_NEW   = 6'd12;
  localparam [5:0] SLOT_LAST  = 6'd25;
  localparam [5:0] SLOT_FREE  = 6'd32;  // with effects: after 11
  localparam [5:0] SLOT_BACK  = 6'd41;  // before 12

  reg [5:0] slot_q;
  reg [5:0] slot_n;
  reg       refresh_q;

  always @* begin
    slot_n = slot_q + 6'd1;
    if (slot_q == SLOT_SPLIT && effects_i) slot_n = SLOT_FREE;
    if (slot_q == SLOT_BACK) slot_n = SLOT_NEW;
    if (slot_q == SLOT_IDLE || slot_q == SLOT_LAST) slot_n = SLOT_IDLE;
    if (start_i) slot_n = SLOT_FIRST;
    if (refresh_i) slot_n = SLOT_NEW;
    if (clear_i) slot_n = SLOT_IDLE;
  end

  // What a slot does besides.
  localparam [8:0] ADD   = 9'h100;  // operands enter the adder,
  localparam [8:0] MUL   = 9'h080;  // factors the multiplier
  localparam [8:0] P     = 9'h040;  // save the first product of two
  localparam [8:0] C     = 9'h020;  // what enters the adder gives c
  localparam [8:0] LO    = 9'h010;
  localparam [8:0] LAST  = 9'h008;
  localparam [8:0] F     = 9'h004;
  localparam [8:0] B     = 9'h002;
  localparam [8:0] TAKEN = 9'h001;

  reg [6:0] add_n;
  reg [3:0] mul_n;
  reg [8:0] does_n;

  always @* begin
    add_n  = ADD_V;
    mul_n  = MUL_V;
    does_n = 9'd0;
    case (slot_n)
      SLOT_FIRST: begin
        mul_n  = MUL_T;
        does_n = MUL;
      end
      6'd2: begin
        mul_n  = MUL_FIRST;
        does_n = effects_i ? MUL : 9'd0;
      end
      6'd3: begin
        mul_n  = MUL_OTHER;
        does_n = effects_i ? ADD | MUL : ADD;
      end
      6'd4: does_n = P;
      6'd5: does_n = F;
      6'd6: begin
        add_n  = ADD_T;
        does_n = ADD | B;
      end
      6'd9: begin
        add_n  = ADD_HI;
        does_n = ADD | LO;
      end
      SLOT_NEW: begin
        add_n  = ADD_Z;
        mul_n  = MUL_I;
        does_n = ADD | MUL | LAST;
      end
      6'd13: begin
        mul_n  = MUL_W;
        does_n = MUL;
      end
      6'd15: begin
        add_n  = ADD_LO;
        does_n = ADD | P;
      end
      6'd16: begin
        add_n  = ADD_S;
        does_n = ADD;
      end
      6'd18: does_n = refresh_q ? 9'd0 : LO | LAST;
      6'd19: begin
        mul_n  = MUL_S1;
        does_n = MUL;
      end
      6'd20: begin
        mul_n  = MUL_S2;
        does_n = MUL;
      end
      6'd22: begin
        add_n  = ADD_C1;
        does_n = ADD;
      end
      SLOT_LAST: begin
        add_n  = ADD_C2;
        does_n = ADD | C;
      end
      SLOT_FREE: does_n = TAKEN;
      6'd33: begin
        mul_n  = MUL_FIRST;
        does_n = MUL;
      end
      6'd36: begin
        add_n  = ADD_P;
        does_n = ADD;
      end
      6'd39: begin
        add_n  = ADD_HI;
        does_n = ADD | LO;
      end
      default: ;
    endcase
  end

  reg [6:0] add_q;
  reg [3:0] mul_q;
  reg [8:0] does_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      slot_q    <= SLOT_IDLE;
      refresh_q <= 1'b0;
      valid_o   <= 1'b0;
      add_q     <= ADD_V;
      mul_q     <= MUL_V;
      does_q    <= 9'd0;
    end else begin
      slot_q  <= slot_n;
      valid_o <= next_o;
      add_q   <= add_n;
      mul_q   <= mul_n;
      does_q  <= does_n;
      if (start_i | refresh_i) refresh_q <= refresh_i;
    end
  end

  // An operator's later stages follow its first one clock by clock; c follows what gives it.
  reg [1:0] add_later_q;
  reg [1:0] mul_later_q;
  reg [2:0] c_later_q;
  wire      add_first = does_q[8];
  wire      mul_first = start_i | does_q[7];

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      add_later_q <= 2'd0;
      mul_later_q <= 2'd0;
      c_later_q   <= 3'd0;
    end else begin
      add_later_q <= {add_later_q[0], add_first};
      mul_later_q <= {mul_later_q[0], mul_first};
      c_later_q   <= clear_i ? 3'd0 : {c_later_q[1:0], does_q[5]};
    end
  end

  assign idle_o       = slot_q == SLOT_IDLE;
  assign next_o       = ((slot_q == SLOT_SPLIT & ~effects_i) | slot_q == SLOT_BACK) & ~clear_i;
  assign add_en_o     = {add_later_q, add_first};
  assign mul_en_o     = {mul_later_q, mul_first};
  assign add_o        = add_q;
  assign mul_o        = mul_q;
  assign save_p_o     = does_q[6];
  assign save_c_o     = c_later_q[2];
  assign save_lo_o    = does_q[4];
  assign save_last_o  = does_q[3];
  assign save_f_o     = does_q[2];
  assign save_b_o     = does_q[1];
  assign save_taken_o = does_q[0];
endmodule

`default_nettype wire
