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
//            With effects a step has 50 slots, E0 to E49. What stands for its inputs is known before its strobe
//            (effect_unit), so all up to the sum that HI adds is done in the step before; V and T of the strobe go to the
//            effect unit. Slots E16 to E29 are 12 to 25.
//              slot E3   add HI: hi + t -> free speed (E6; t is saved at the end of E3)
//              slot E6   (rtds_friction takes its part, saved at its end)
//              slot E7   mul   : rho taken (E10)
//              slot E10  add P : t corrected -> t' (E13, saved at its end)
//              slot E13  add HI: hi + t' -> hi' (12)
//            and for the next step
//              slot E44  mul   : g2 u_t (E47)
//              slot E45  mul   : level of friction forward (E48, saved at its end)
//              slot E46  mul   : level of friction backward (E49, saved at its end)
//              slot E47  mul   : g1 u_v (E50)
//              slot E47  add UT: c and g2 u_t (E50)
//              slot E50  add UV: and g1 u_v -> t (E53, where it stays); at the earliest E50 is E0 of the next step, E53 its E3
//            These wait for hold_i to end, in slot E43, and come after the refresh if there is one.
//            The first step after clear_i, or after one without effects, finds t there, too: zero (Z0, in the slot after
//            clear_i), or c, which is t without inputs.
// Handshake  start_i (in the clock of the strobe, with fx_on_i: a step with effects) only while ready_o, refresh_i only while
//            idle_o. clear_i ends what is under way. effects_i holds from the clock after start_i to the next: fx_on_i.
// Latency    valid_o in slot 12, after the 11th edge that follows the strobe's; the next strobe may follow 26 clocks
//            after the last. With effects in slot E16, after the 15th edge, and 50.
// Style      What a slot does is looked up in the slot before and stands in registers. The strobe enables no operand: while no
//            step is in hand V enters the multiplier in every clock, and what came of it is not saved unless a step started.
// Crossing   none.
`default_nettype none

module rtds_sequencer (
  input  wire       clk_i,
  input  wire       rst_ni,
  input  wire       clear_i,
  input  wire       start_i,
  input  wire       refresh_i,
  input  wire       fx_on_i,
  input  wire       effects_i,
  input  wire       hold_i,      // coefficients are about to change
  output wire       idle_o,
  output wire       ready_o,     // idle, and nothing to be done before the next strobe
  output wire       next_o,      // valid_o in the next clock
  output wire       valid_o,     // the adders' results are the new high words, which are saved
  output wire       add_en_d_o,  // *_d_o: of the next clock, for registers of the rows
  output wire       mul_en_d_o,
  output wire [6:0] add_d_o,     // what enters the adder: see rtds_row
  output wire [3:0] mul_d_o,     // and the multiplier
  output wire       save_p_d_o,
  output wire       save_c_o,
  output wire       save_lo_d_o,
  output wire       save_last_o,  // what is saved is the new state
  output wire       save_f_o,     // products of rtds_friction
  output wire       save_b_o,
  output wire       save_taken_o,
  output wire       ahead_d_o,   // the multiplier's factor is of the effect unit
  output wire       take_o       // no step is in hand: inputs are taken, in each clock until one starts
);
  `include "fp_clocks.vh"
  `include "rtds_ops.vh"

  // A slot is named by what enters an operator in it, or by what is saved at its end.
  localparam [6:0] SLOT_IDLE    = 7'd0;
  localparam [6:0] SLOT_FIRST   = SLOT_IDLE + 7'd1;
  localparam [6:0] SLOT_V       = SLOT_IDLE + FP_MUL_CLOCKS;
  localparam [6:0] SLOT_SAVE_T  = SLOT_FIRST + FP_MUL_CLOCKS;
  localparam [6:0] SLOT_T       = SLOT_V + FP_ADD_CLOCKS;
  localparam [6:0] SLOT_HI      = SLOT_T + FP_ADD_CLOCKS;
  localparam [6:0] SLOT_NEW     = SLOT_HI + FP_ADD_CLOCKS;  // the new high words stand
  localparam [6:0] SLOT_SPLIT   = SLOT_NEW - 7'd1;
  localparam [6:0] SLOT_W       = SLOT_NEW + 7'd1;
  localparam [6:0] SLOT_LO      = SLOT_NEW + FP_ADD_CLOCKS;
  localparam [6:0] SLOT_S       = SLOT_W + FP_MUL_CLOCKS;
  localparam [6:0] SLOT_SAVE_LO = SLOT_LO + FP_ADD_CLOCKS;
  localparam [6:0] SLOT_S1      = SLOT_S + FP_ADD_CLOCKS;
  localparam [6:0] SLOT_S2      = SLOT_S1 + 7'd1;
  localparam [6:0] SLOT_C1      = SLOT_S1 + FP_MUL_CLOCKS;
  localparam [6:0] SLOT_LAST    = SLOT_C1 + FP_ADD_CLOCKS;

  localparam [6:0] E        = 7'd64;                          // slot E0
  localparam [6:0] E_FIRST  = E + 7'd1;
  localparam [6:0] E_FREE   = E + FP_ADD_CLOCKS;              // after UV of E50
  localparam [6:0] E_TAKEN  = E_FREE + FP_ADD_CLOCKS;
  localparam [6:0] E_RHO    = E_TAKEN + 7'd1;
  localparam [6:0] E_P      = E_RHO + FP_MUL_CLOCKS;
  localparam [6:0] E_HI     = E_P + FP_ADD_CLOCKS;
  localparam [6:0] E_NEW    = E_HI + FP_ADD_CLOCKS;           // SLOT_NEW stands for it, and so on to SLOT_LAST
  localparam [6:0] E_BACK   = E_NEW - 7'd1;
  localparam [6:0] E_GO_ON  = E_NEW + (SLOT_LAST - SLOT_NEW) + 7'd1;
  localparam [6:0] E_AHEAD  = E + 7'd44;                      // u_t stands, then levels and u_v: effect_engine
  localparam [6:0] E_HOLD   = E_AHEAD - 7'd1;
  localparam [6:0] E_F      = E_AHEAD + 7'd1;
  localparam [6:0] E_B      = E_F + 7'd1;
  localparam [6:0] E_UT     = E_AHEAD + FP_MUL_CLOCKS;
  localparam [6:0] E_SAVE_F = E_F + FP_MUL_CLOCKS;
  localparam [6:0] E_LAST   = E_B + FP_MUL_CLOCKS;

  // Where a slot has a sum and a product, or a sum and a save of a product, it has both for this reason.
  generate
    if (FP_ADD_CLOCKS != FP_MUL_CLOCKS) begin : g_bad_clocks
      FP_ADD_CLOCKS_must_be_FP_MUL_CLOCKS u_error ();
    end
  endgenerate

  reg [6:0] slot_q;
  reg [6:0] slot_next;  // the next one, if nothing starts or ends in this clock
  reg [6:0] slot_d;
  reg       refresh_q;
  reg       due_q;      // E44 to E50 have waited for the coefficients
  reg       valid_q;

  always @* begin
    slot_next = slot_q + 7'd1;
    if (slot_q == E_BACK) slot_next = SLOT_NEW;
    if (slot_q == SLOT_LAST) slot_next = (effects_i & ~refresh_q) ? E_GO_ON : due_q ? E_HOLD : SLOT_IDLE;
    if (slot_q == E_HOLD && hold_i) slot_next = SLOT_IDLE;
    if (slot_q == E_LAST) slot_next = SLOT_IDLE;
    if (slot_q == SLOT_IDLE) slot_next = (due_q & ~hold_i) ? E_HOLD : SLOT_IDLE;
    slot_d = slot_next;
    if (start_i) slot_d = fx_on_i ? E_FIRST : SLOT_FIRST;
    if (refresh_i) slot_d = SLOT_NEW;
    if (clear_i) slot_d = SLOT_IDLE;
  end

  // What a slot does besides: the place of each bit, and the bits.
  localparam integer AT_TAKEN = 0;
  localparam integer AT_B     = 1;
  localparam integer AT_F     = 2;
  localparam integer AT_LAST  = 3;
  localparam integer AT_LO    = 4;
  localparam integer AT_C     = 5;
  localparam integer AT_P     = 6;
  localparam integer AT_MUL   = 7;
  localparam integer AT_ADD   = 8;
  localparam integer AT_AHEAD = 9;
  localparam integer AT_TAKE  = 10;

  localparam [10:0] TAKEN = 11'd1 << AT_TAKEN;
  localparam [10:0] B     = 11'd1 << AT_B;
  localparam [10:0] F     = 11'd1 << AT_F;
  localparam [10:0] LAST  = 11'd1 << AT_LAST;
  localparam [10:0] LO    = 11'd1 << AT_LO;
  localparam [10:0] C     = 11'd1 << AT_C;      // what enters the adder gives c
  localparam [10:0] P     = 11'd1 << AT_P;      // save the first product of two
  localparam [10:0] MUL   = 11'd1 << AT_MUL;    // factors enter the multiplier,
  localparam [10:0] ADD   = 11'd1 << AT_ADD;    // operands the adder
  localparam [10:0] AHEAD = 11'd1 << AT_AHEAD;  // one of the factors is of the effect unit
  // In case that a step starts: inputs are taken, V enters the multiplier.
  localparam [10:0] WAIT  = (11'd1 << AT_TAKE) | MUL;

  reg  [6:0] add_d;
  reg  [3:0] mul_d;
  reg [10:0] does_d;

  always @* begin
    add_d  = ADD_V;
    mul_d  = MUL_V;
    does_d = 11'd0;
    case (slot_next)
      SLOT_IDLE: begin  // after E49 this is E50, whether a step starts in it or not
        add_d  = ADD_UV;
        does_d = (slot_q == E_LAST) ? WAIT | ADD : WAIT;
      end
      SLOT_V: does_d = ADD;
      SLOT_SAVE_T: does_d = P;
      SLOT_T: begin
        add_d  = ADD_T;
        does_d = ADD;
      end
      SLOT_HI, E_FREE, E_HI: begin
        add_d  = ADD_HI;
        does_d = ADD | LO;
      end
      SLOT_NEW: begin
        add_d  = ADD_Z;
        mul_d  = MUL_I;
        does_d = ADD | MUL | LAST;
      end
      SLOT_W: begin
        mul_d  = MUL_W;
        does_d = MUL;
      end
      SLOT_LO: begin
        add_d  = ADD_LO;
        does_d = ADD | P;
      end
      SLOT_S: begin
        add_d  = ADD_S;
        does_d = ADD;
      end
      SLOT_SAVE_LO: does_d = refresh_q ? 11'd0 : LO | LAST;
      SLOT_S1: begin
        mul_d  = MUL_S1;
        does_d = MUL;
      end
      SLOT_S2: begin
        mul_d  = MUL_S2;
        does_d = MUL;
      end
      SLOT_C1: begin
        add_d  = ADD_C1;
        does_d = ADD;
      end
      SLOT_LAST: begin
        add_d  = ADD_C2;
        does_d = ADD | C;
      end
      E_TAKEN: does_d = TAKEN;
      E_RHO, E_F: begin
        mul_d  = MUL_FIRST;
        does_d = MUL;
      end
      E_P: begin
        add_d  = ADD_P;
        does_d = ADD;
      end
      E_AHEAD: begin
        mul_d  = MUL_T;
        does_d = MUL | AHEAD;
      end
      E_B: begin
        mul_d  = MUL_OTHER;
        does_d = MUL;
      end
      E_UT: begin
        add_d  = ADD_UT;
        mul_d  = MUL_V;
        does_d = ADD | MUL | AHEAD;
      end
      E_SAVE_F: does_d = F;
      E_LAST: does_d = B;
      default: ;
    endcase
    // What starts or ends comes late in a clock and from far away: it chooses last.
    if (start_i) begin
      mul_d  = MUL_T;
      does_d = fx_on_i ? 11'd0 : MUL;
    end
    if (refresh_i) begin
      add_d  = ADD_Z;
      mul_d  = MUL_I;
      does_d = ADD | MUL | LAST;
    end
    if (clear_i) begin
      add_d  = ADD_Z0;
      mul_d  = MUL_V;
      does_d = WAIT | ADD;
    end
  end

  reg [10:0] does_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      slot_q    <= SLOT_IDLE;
      refresh_q <= 1'b0;
      valid_q   <= 1'b0;
      due_q     <= 1'b0;
      does_q    <= WAIT | ADD;
    end else begin
      slot_q  <= slot_d;
      valid_q <= next_o;
      does_q  <= does_d;
      if (start_i | refresh_i) refresh_q <= refresh_i;
      if (clear_i | slot_d == E_AHEAD) due_q <= 1'b0;
      else if (slot_q == E_HOLD) due_q <= 1'b1;
    end
  end

  // c follows what gives it.
  reg [2:0] c_later_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) c_later_q <= 3'd0;
    else c_later_q <= clear_i ? 3'd0 : {c_later_q[1:0], does_q[AT_C]};
  end

  assign idle_o       = slot_q == SLOT_IDLE;
  assign ready_o      = idle_o & ~due_q;
  assign next_o       = (slot_q == SLOT_SPLIT | slot_q == E_BACK) & ~clear_i;
  assign add_en_d_o   = does_d[AT_ADD];
  assign mul_en_d_o   = does_d[AT_MUL];
  assign add_d_o      = add_d;
  assign mul_d_o      = mul_d;
  assign save_p_d_o   = does_d[AT_P];
  assign save_c_o     = c_later_q[2];
  assign save_lo_d_o  = does_d[AT_LO];
  assign save_last_o  = does_q[AT_LAST];
  assign save_f_o     = does_q[AT_F];
  assign save_b_o     = does_q[AT_B];
  assign save_taken_o = does_q[AT_TAKEN];
  assign ahead_d_o    = does_d[AT_AHEAD];
  assign take_o       = does_q[AT_TAKE];

  wire unused = ^{does_q[AT_AHEAD:AT_P], does_q[AT_LO]};

  assign valid_o = valid_q;
endmodule

`default_nettype wire
