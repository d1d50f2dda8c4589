// rtds_sequencer: says in each clock of a step what the adders and multipliers of the motor units do.
//
// Purpose    Slot 0 is the clock of the strobe, slot k the k-th clock after it. What enters the adder in slot k leaves
//            it in slot k + 3, a product leaves the multiplier two slots after its factors entered:
//              slot  0   add E : u, s -> e (slot 3, and it stays in slot 4)
//              slot  3   mul   : g1 e1 (slot 5, saved at its end)
//              slot  4   mul   : g2 e2 (slot 6)
//              slot  6   add D : products -> d (slot 9)
//              slot  9   add T : d + lo -> t (slot 12, saved at its end)
//              slot 12   add HI: hi + t -> hi' (slot 15, saved at its end: outputs change, valid)
//              slot 15   add Z : hi' - hi -> z (slot 18)
//              slot 16   mul   : first product of the state (slot 18, saved at its end)
//              slot 17   mul   : second product of the state (slot 19)
//              slot 18   add LO: t - z -> lo' (slot 21, saved at its end)
//              slot 19   add S : products -> s (slot 22, saved at its end)
//            refresh_i runs slots 16 to 22 alone, without LO: s anew after the coefficients have changed.
//            With effects_i slots 32 to 40 stand between 14 and 15, so that all after them is 9 clocks later:
//              slot  5   mul   : level of friction forward (slot 7, saved at its end)
//              slot  6   mul   : level of friction backward (slot 8, saved at its end)
//              slot 32   (what HI gave in slot 12 is the free speed: rtds_friction takes its part, saved at its end)
//              slot 33   mul   : rho taken (slot 35)
//              slot 35   add P : t corrected -> t' (slot 38, saved at its end)
//              slot 38   add HI: hi + t' -> hi' (slot 15)
// Handshake  start_i (in the clock of the strobe) or refresh_i only while idle_o. clear_i ends what is under way.
//            effects_i holds from the clock after start_i to the next.
// Latency    valid_o in slot 16, after the 15th edge that follows the strobe's; the next strobe may follow 23 clocks
//            after the last. With effects 9 more.
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
  output reg        valid_o,
  output wire [2:0] add_en_o,    // a bit for each stage, the first in bit 0
  output wire [1:0] mul_en_o,
  output reg  [2:0] op_o,
  output wire [2:0] mul_sel_o,
  output wire       save_p_o,
  output wire       save_s_o,
  output wire       save_hi_o,
  output wire       save_lo_o,
  output wire       save_last_o,  // what save_hi_o or save_lo_o saves is the new state
  output wire       save_f_o,     // products of rtds_friction
  output wire       save_b_o,
  output wire       save_taken_o
);
  // The same codes as in rtds_row.
  localparam [2:0] OP_E  = 3'd0;
  localparam [2:0] OP_D  = 3'd1;
  localparam [2:0] OP_T  = 3'd2;
  localparam [2:0] OP_HI = 3'd3;
  localparam [2:0] OP_Z  = 3'd4;
  localparam [2:0] OP_LO = 3'd5;
  localparam [2:0] OP_S  = 3'd6;
  localparam [2:0] OP_P  = 3'd7;

  localparam [5:0] SLOT_IDLE  = 6'd0;
  localparam [5:0] SLOT_FIRST = 6'd1;
  localparam [5:0] SLOT_MUL_S = 6'd16;
  localparam [5:0] SLOT_LAST  = 6'd22;
  localparam [5:0] SLOT_FREE  = 6'd32;  // with effects: after 14
  localparam [5:0] SLOT_BACK  = 6'd40;  // before 15

  reg [5:0] slot_q;
  reg [5:0] slot_n;
  reg       refresh_q;

  always @* begin
    slot_n = slot_q + 6'd1;
    if (slot_q == 6'd14 && effects_i) slot_n = SLOT_FREE;
    if (slot_q == SLOT_BACK) slot_n = 6'd15;
    if (slot_q == SLOT_IDLE || slot_q == SLOT_LAST) slot_n = SLOT_IDLE;
    if (start_i) slot_n = SLOT_FIRST;
    if (refresh_i) slot_n = SLOT_MUL_S;
    if (clear_i) slot_n = SLOT_IDLE;
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      slot_q    <= SLOT_IDLE;
      refresh_q <= 1'b0;
      valid_o   <= 1'b0;
    end else begin
      slot_q  <= slot_n;
      valid_o <= save_hi_o & ~clear_i;
      if (start_i | refresh_i) refresh_q <= refresh_i;
    end
  end

  // What a slot does: one word, so that a compiled simulation looks it up once.
  localparam [11:0] FX    = 12'h800;  // as MUL, but with effects only, and for friction
  localparam [11:0] MUL   = 12'h400;  // factors enter the multiplier,
  localparam [11:0] G_E   = 12'h200;  // from G and e rather than S and x,
  localparam [11:0] TWO   = 12'h100;  // the second pair rather than the first
  localparam [11:0] P     = 12'h080;  // save the first product, or s
  localparam [11:0] S     = 12'h040;  // it is s
  localparam [11:0] HI    = 12'h020;
  localparam [11:0] LO    = 12'h010;
  localparam [11:0] LAST  = 12'h008;
  localparam [11:0] F     = 12'h004;
  localparam [11:0] B     = 12'h002;
  localparam [11:0] TAKEN = 12'h001;

  reg [11:0] does;
  reg        add_first;

  always @* begin
    op_o      = OP_S;
    add_first = 1'b0;
    does      = 12'd0;
    case (slot_q)
      SLOT_IDLE: begin
        op_o      = OP_E;
        add_first = start_i;
      end
      6'd3: does = MUL | G_E;
      6'd4: does = MUL | G_E | TWO;
      6'd5: does = FX | P;
      6'd6: begin
        op_o      = OP_D;
        add_first = 1'b1;
        does      = FX | TWO;
      end
      6'd7: does = F;
      6'd8: does = B;
      6'd9: begin
        op_o      = OP_T;
        add_first = 1'b1;
      end
      6'd12: begin
        op_o      = OP_HI;
        add_first = 1'b1;
        does      = LO;
      end
      6'd15: begin
        op_o      = OP_Z;
        add_first = 1'b1;
        does      = HI | LAST;
      end
      SLOT_MUL_S: does = MUL;
      6'd17: does = MUL | TWO;
      6'd18: begin
        op_o      = OP_LO;
        add_first = 1'b1;
        does      = P;
      end
      6'd19: add_first = 1'b1;
      6'd21: does = LO | LAST;
      SLOT_LAST: does = P | S;
      SLOT_FREE: does = TAKEN;
      6'd33: does = FX;
      6'd35: begin
        op_o      = OP_P;
        add_first = 1'b1;
      end
      6'd38: begin
        op_o      = OP_HI;
        add_first = 1'b1;
        does      = LO;
      end
      default: ;
    endcase
  end

  // An operator's later stages follow its first one clock by clock.
  reg [1:0] add_later_q;
  reg       mul_later_q;
  wire      mul_fx    = effects_i & does[11];
  wire      mul_first = does[10] | mul_fx;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      add_later_q <= 2'd0;
      mul_later_q <= 1'b0;
    end else begin
      add_later_q <= {add_later_q[0], add_first};
      mul_later_q <= mul_first;
    end
  end

  wire busy = slot_q != SLOT_IDLE;

  assign idle_o       = ~busy;
  assign mul_sel_o[2] = mul_fx;
  assign mul_sel_o[1] = does[9];
  assign mul_sel_o[0] = does[8] & mul_first;
  assign add_en_o     = {add_later_q, add_first};
  assign mul_en_o     = {mul_later_q, mul_first};
  assign save_p_o     = does[7];
  assign save_s_o     = does[6];
  assign save_hi_o    = does[5];
  assign save_lo_o    = does[4] & ~(refresh_q & does[3]);
  assign save_last_o  = does[3];
  assign save_f_o     = does[2];
  assign save_b_o     = does[1];
  assign save_taken_o = does[0];
endmodule

`default_nettype wire
