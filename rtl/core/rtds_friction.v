// rtds_friction: what dry friction takes of the speed that a step without it would give.
//
// Purpose    most_f, most_b = G22 level: the most speed that friction can take of a motion forward or backward, with the sign of
//            that motion. It takes all of the free speed if that is no more (the shaft is held), else the most. A level of
//            the other sign holds nothing and adds to the motion. A NaN is not held, so that it stays one.
// Handshake  none of its own: the saves of rtds_sequencer. clear_i: no friction until the next saves.
// Latency    taken_o and held_o from the clock after save_taken_i to the next.
// Format     binary32, rad/s.
// Crossing   none.
`default_nettype none

module rtds_friction (
  input  wire        clk_i,
  input  wire        rst_ni,
  input  wire        clear_i,
  input  wire        save_f_i,      // product_i is most_f
  input  wire        save_b_i,      // product_i is most_b
  input  wire        save_taken_i,  // free_i is the free speed
  input  wire [31:0] product_i,
  input  wire [31:0] free_i,
  output wire [31:0] taken_o,
  output wire        held_o
);
  reg  [31:0] taken_q;
  reg         held_q;
  reg  [31:0] most_f_q;
  reg  [31:0] most_b_q;
  reg         holds_f_q;  // the level holds what moves so: it is of that sign, and no NaN
  reg         holds_b_q;

  function automatic nan;
    input [30:0] x;
    nan = (&x[30:23]) & (|x[22:0]);
  endfunction

  // {held, taken}. Both ways are compared before the sign chooses: the free speed comes late and from far away.
  function automatic [32:0] take;
    input [31:0] free;
    input [31:0] most_f;
    input [31:0] most_b;
    input        holds_f;
    input        holds_b;
    reg          zero;
    reg          stuck_f;
    reg          stuck_b;
    reg          stuck;
    begin
      zero    = ~(|free[30:0]);  // its sign does not matter
      stuck_f = holds_f & (free[30:0] <= most_f[30:0]);
      stuck_b = holds_b & (free[30:0] <= most_b[30:0]);
      stuck   = zero | (free[31] ? stuck_b : stuck_f);
      take    = {stuck, stuck ? free : free[31] ? most_b : most_f};
    end
  endfunction

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      most_f_q  <= 32'd0;
      most_b_q  <= 32'd0;
      holds_f_q <= 1'b1;
      holds_b_q <= 1'b0;
      taken_q   <= 32'd0;
      held_q    <= 1'b0;
    end else begin
      holds_f_q <= ~most_f_q[31] & ~nan(most_f_q[30:0]);  // the levels are saved long before they are needed
      holds_b_q <= most_b_q[31] & ~nan(most_b_q[30:0]);
      if (clear_i) most_f_q <= 32'd0;
      else if (save_f_i) most_f_q <= product_i;
      if (clear_i) most_b_q <= 32'd0;
      else if (save_b_i) most_b_q <= product_i;
      if (save_taken_i) {held_q, taken_q} <= take(free_i, most_f_q, most_b_q, holds_f_q, holds_b_q);
    end
  end

  assign taken_o = taken_q;
  assign held_o  = held_q;
endmodule

`default_nettype wire
