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
  output reg        valid_o,     // the adders' results are the new high words, which are saved
  output wire       add_en_n_o,  // *_n_o: of the next clock, for registers of the rows
  output wire       mul_en_n_o,
  output wire [6:0] add_n_o,     // what enters the adder: see rtds_row
  output wire [3:0] mul_n_o,     // and the multiplier
  output wire       save_p_n_o,
  output wire       save_c_o,
  output wire       save_lo_n_o,
  output wire       save_last_o,  // what is saved is the new state
  output wire       save_f_o,     // products of rtds_friction
  output wire       save_b_o,
  output wire       save_taken_o,
  output wire       ahead_n_o,   // the multiplier's factor is of the effect unit
  output wire       take_o       // no step is in hand: inputs are taken, in each clock until one starts
);
  `include "rtds_ops.vh"

  localparam [6:0] SLOT_IDLE  = 7'd0;
  localparam [6:0] SLOT_FIRST = 7'd1;
  localparam [6:0] SLOT_SPLIT = 7'd11;
  localparam [6:0] SLOT_NEW   = 7'd12;
  localparam [6:0] SLOT_LAST  = 7'd25;
  localparam [6:0] E          = 7'd64;       // slot E0
  localparam [6:0] E_BACK     = E + 7'd15;   // before 12
  localparam [6:0] E_GO_ON    = E + 7'd30;   // after 25
  localparam [6:0] E_HOLD     = E + 7'd43;
  localparam [6:0] E_AHEAD    = E + 7'd44;
  localparam [6:0] E_LAST     = E + 7'd49;

  reg [6:0] slot_q;
  reg [6:0] slot_m;     // the next one, if nothing starts or ends in this clock
  reg [6:0] slot_n;
  reg       refresh_q;
  reg       due_q;      // E44 to E50 have waited for the coefficients

  always @* begin
    slot_m = slot_q + 7'd1;
    if (slot_q == E_BACK) slot_m = SLOT_NEW;
    if (slot_q == SLOT_LAST) slot_m = (effects_i & ~refresh_q) ? E_GO_ON : due_q ? E_HOLD : SLOT_IDLE;
    if (slot_q == E_HOLD && hold_i) slot_m = SLOT_IDLE;
    if (slot_q == E_LAST) slot_m = SLOT_IDLE;
    if (slot_q == SLOT_IDLE) slot_m = (due_q & ~hold_i) ? E_HOLD : SLOT_IDLE;
    slot_n = slot_m;
    if (start_i) slot_n = fx_on_i ? E + 7'd1 : SLOT_FIRST;
    if (refresh_i) slot_n = SLOT_NEW;
    if (clear_i) slot_n = SLOT_IDLE;
  end

  // What a slot does besides.
  localparam [10:0] WAIT  = 11'h480;  // in case that a step starts: inputs are taken, V enters the multiplier
  localparam [10:0] AHEAD = 11'h200;  // one of them of the effect unit
  localparam [10:0] ADD   = 11'h100;  // operands enter the adder,
  localparam [10:0] MUL   = 11'h080;  // factors the multiplier
  localparam [10:0] P     = 11'h040;  // save the first product of two
  localparam [10:0] C     = 11'h020;  // what enters the adder gives c
  localparam [10:0] LO    = 11'h010;
  localparam [10:0] LAST  = 11'h008;
  localparam [10:0] F     = 11'h004;
  localparam [10:0] B     = 11'h002;
  localparam [10:0] TAKEN = 11'h001;

  reg [6:0] add_n;
  reg [3:0] mul_n;
  reg [10:0] does_n;

  always @* begin
    add_n  = ADD_V;
    mul_n  = MUL_V;
    does_n = 11'd0;
    case (slot_m)
      SLOT_IDLE: begin  // after E49 this is E50, whether a step starts in it or not
        add_n  = ADD_UV;
        does_n = (slot_q == E_LAST) ? WAIT | ADD : WAIT;
      end
      7'd3: does_n = ADD;
      7'd4: does_n = P;
      7'd6: begin
        add_n  = ADD_T;
        does_n = ADD;
      end
      7'd9, E + 7'd3, E + 7'd13: begin
        add_n  = ADD_HI;
        does_n = ADD | LO;
      end
      SLOT_NEW: begin
        add_n  = ADD_Z;
        mul_n  = MUL_I;
        does_n = ADD | MUL | LAST;
      end
      7'd13: begin
        mul_n  = MUL_W;
        does_n = MUL;
      end
      7'd15: begin
        add_n  = ADD_LO;
        does_n = ADD | P;
      end
      7'd16: begin
        add_n  = ADD_S;
        does_n = ADD;
      end
      7'd18: does_n = refresh_q ? 11'd0 : LO | LAST;
      7'd19: begin
        mul_n  = MUL_S1;
        does_n = MUL;
      end
      7'd20: begin
        mul_n  = MUL_S2;
        does_n = MUL;
      end
      7'd22: begin
        add_n  = ADD_C1;
        does_n = ADD;
      end
      SLOT_LAST: begin
        add_n  = ADD_C2;
        does_n = ADD | C;
      end
      E + 7'd6: does_n = TAKEN;
      E + 7'd7, E + 7'd45: begin
        mul_n  = MUL_FIRST;
        does_n = MUL;
      end
      E + 7'd10: begin
        add_n  = ADD_P;
        does_n = ADD;
      end
      E_AHEAD: begin
        mul_n  = MUL_T;
        does_n = MUL | AHEAD;
      end
      E + 7'd46: begin
        mul_n  = MUL_OTHER;
        does_n = MUL;
      end
      E + 7'd47: begin
        add_n  = ADD_UT;
        mul_n  = MUL_V;
        does_n = ADD | MUL | AHEAD;
      end
      E + 7'd48: does_n = F;
      E_LAST: does_n = B;
      default: ;
    endcase
    // What starts or ends comes late in a clock and from far away: it chooses last.
    if (start_i) begin
      mul_n  = MUL_T;
      does_n = fx_on_i ? 11'd0 : MUL;
    end
    if (refresh_i) begin
      add_n  = ADD_Z;
      mul_n  = MUL_I;
      does_n = ADD | MUL | LAST;
    end
    if (clear_i) begin
      add_n  = ADD_Z0;
      mul_n  = MUL_V;
      does_n = WAIT | ADD;
    end
  end

  reg [10:0] does_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      slot_q    <= SLOT_IDLE;
      refresh_q <= 1'b0;
      valid_o   <= 1'b0;
      due_q     <= 1'b0;
      does_q    <= WAIT | ADD;
    end else begin
      slot_q  <= slot_n;
      valid_o <= next_o;
      does_q  <= does_n;
      if (start_i | refresh_i) refresh_q <= refresh_i;
      if (clear_i | slot_n == E_AHEAD) due_q <= 1'b0;
      else if (slot_q == E_HOLD) due_q <= 1'b1;
    end
  end

  // c follows what gives it.
  reg [2:0] c_later_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) c_later_q <= 3'd0;
    else c_later_q <= clear_i ? 3'd0 : {c_later_q[1:0], does_q[5]};
  end

  assign idle_o       = slot_q == SLOT_IDLE;
  assign ready_o      = idle_o & ~due_q;
  assign next_o       = (slot_q == SLOT_SPLIT | slot_q == E_BACK) & ~clear_i;
  assign add_en_n_o   = does_n[8];
  assign mul_en_n_o   = does_n[7];
  assign add_n_o      = add_n;
  assign mul_n_o      = mul_n;
  assign save_p_n_o   = does_n[6];
  assign save_c_o     = c_later_q[2];
  assign save_lo_n_o  = does_n[4];
  assign save_last_o  = does_q[3];
  assign save_f_o     = does_q[2];
  assign save_b_o     = does_q[1];
  assign save_taken_o = does_q[0];
  assign ahead_n_o    = does_n[9];
  assign take_o       = does_q[10];

  wire unused = ^{does_q[9:6], does_q[4]};
endmodule

`default_nettype wire
