// Proof of the core's step: a step that is not cleared gives its valid exactly LATENCY clocks after its start, FX_LATENCY
// with effects, no valid comes otherwise, the rows take the next one SPACING (FX_SPACING) clocks after the start unless
// coefficients change, and what a step prepares for the next stands when that one needs it.
`default_nettype none

module sequencer_f (
    input wire clk,
    input wire rst_n,
    input wire clear,
    input wire start,
    input wire refresh,
    input wire fx_on,
    input wire hold
);
  localparam LATENCY = 12;
  localparam SPACING = 26;
  localparam FX_LATENCY = 16;
  localparam FX_SPACING = 50;
  localparam MORE = FX_LATENCY - LATENCY;
  localparam [6:0] ADD_C2 = 7'b0100001;  // as in rtds_sequencer
  localparam [6:0] ADD_UV = 7'b0000001;
  localparam [6:0] ADD_Z0 = 7'b0000100;

  wire idle, ready, valid;
  wire add_en_d;
  wire [6:0] add_d;
  reg [2:0] add_en = 3'b001;  // as in rtds_row
  reg [6:0] add = ADD_Z0;
  reg effects_q = 1'b0;  // from the clock after a start to the next

  always @(posedge clk) if (!rst_n) effects_q <= 1'b0; else if (start) effects_q <= fx_on;

  rtds_sequencer dut (
      .clk_i(clk), .rst_ni(rst_n), .clear_i(clear), .start_i(start), .refresh_i(refresh), .fx_on_i(fx_on), .effects_i(effects_q),
      .hold_i(hold), .idle_o(idle), .ready_o(ready), .valid_o(valid), .add_en_d_o(add_en_d), .add_d_o(add_d)
  );

  always @(posedge clk or negedge rst_n) begin
    if (!rst_n) begin
      add_en <= 3'b001;
      add <= ADD_Z0;
    end else begin
      add_en <= {add_en[1:0], add_en_d};
      add <= add_d;
    end
  end

  // Signals inside of dut, joined by Yosys when it flattens.
  (* hierconn *) wire \dut.refresh_q ;
  (* hierconn *) wire \dut.due_q ;
  (* hierconn *) wire [6:0] \dut.slot_q ;
  (* hierconn *) wire [2:0] \dut.c_later_q ;

  reg started = 1'b0;
  reg [FX_LATENCY-1:0] due = 0;  // a step on its way, one place a clock
  reg [5:0] since = NONE;        // clocks since the last start, at most MANY; NONE since the last clear
  reg held = 1'b0;               // coefficients changed since
  localparam [5:0] MANY = 6'd62;
  localparam [5:0] NONE = 6'd63;

`ifdef COVER
  (* anyconst *) reg all_fx;  // every step with effects, or none
  (* anyconst *) reg change;  // every step changes the coefficients, or none
`endif
  reg hold_q = 1'b0;
  reg refreshed = 1'b0;

  always @(posedge clk) begin
    started <= 1'b1;
    hold_q <= hold && rst_n;
    refreshed <= refresh;
    if (!rst_n || clear) due <= 0;
    else due <= {due[FX_LATENCY-2:0], start && fx_on} | (start && !fx_on) << MORE;
    if (!rst_n || clear) since <= NONE;
    else if (start) since <= 6'd1;
    else if (since < MANY) since <= since + 6'd1;
    held <= rst_n && !clear && !start && (held || hold || refresh);
  end

  // What entered the adder last, and whether it has left it: a first step with effects takes what stands there.
  reg [6:0] last_add = ADD_Z0;
  always @(posedge clk) if (add_en[0]) last_add <= add;

  always @* begin
    if (!started) assume (!rst_n);
    // The contract of the handshake: hold_i begins with a step, if at all, and a refresh ends it.
    if (hold) assume ((hold_q && !refreshed) || since == 6'd1);
    if (!ready) assume (!start);
    if (!idle) assume (!refresh);
    if (hold) assume (!start);
    if (refresh) assume (hold);
    assume (!(clear && start));
`ifdef COVER
    // What is reached this way is reached without; z3 takes very long to find it when everything may come at any time.
    if (started)
      assume (rst_n && !clear && start == (ready && !hold) && fx_on == all_fx && hold == (change && since >= 6'd1 && since <= 6'd45)
              && refresh == (change && since == 6'd45));
`endif
  end

  always @* if (started && rst_n) begin
    assert (valid == due[FX_LATENCY-1]);
    if (since >= SPACING && since != NONE && !effects_q) assert (idle || dut.refresh_q);
    if (since >= FX_SPACING && since != NONE && !held) assert (ready);
    // What a step adds first, in slot 3, was saved by then, however soon after the last step it comes.
    if (dut.slot_q == 7'd3) assert (dut.c_later_q == 3'd0);
    // With effects it stands in the adder: c, or that with the effect unit's inputs, or zero.
    if (dut.slot_q == 7'd67) assert (add_en[2:1] == 2'd0 && (last_add == ADD_C2 || last_add == ADD_UV || last_add == ADD_Z0));
    // A step with effects that was prepared leaves the sum with its inputs.
    if (since >= FX_SPACING && since != NONE && effects_q && ready && !dut.refresh_q)
      assert (add_en[0] ? add == ADD_UV : last_add == ADD_UV);
    // What ties all that to the slots, so that induction need not look back over a whole step.
    if (since != NONE) begin
      if (effects_q && since < FX_LATENCY) assert (dut.slot_q == 7'd64 + since && due == 1 << (since - 1));
      if (effects_q && since >= FX_LATENCY && since < 6'd30) assert (dut.slot_q == since - 7'd4);
      if (effects_q && since >= 6'd30 && since < 6'd44) assert (dut.slot_q == 7'd64 + since);
      if (effects_q && since >= 6'd44 && since < FX_SPACING && !held) assert (dut.slot_q == 7'd64 + since);
      if (!effects_q && since < SPACING) assert (dut.slot_q == since);
      if (!effects_q && since < LATENCY) assert (due == 1 << (since - 1 + MORE));
      if (since < (effects_q ? 6'd44 : SPACING) || !held) assert (!dut.refresh_q);
      if (!held) assert (!dut.due_q);
      if (!held && since >= (effects_q ? FX_SPACING : SPACING)) assert (dut.slot_q == 7'd0);
    end
    if (since == NONE) assert (!dut.due_q);
    if (since == NONE || since >= (effects_q ? 6'd44 : SPACING))
      assert (dut.slot_q == 7'd0 || (dut.refresh_q && dut.slot_q >= 7'd12 && dut.slot_q < 7'd26)
              || (effects_q && since != NONE && dut.slot_q >= 7'd107 && dut.slot_q <= 7'd113));
    if (since == NONE || since > (effects_q ? FX_LATENCY : LATENCY)) assert (due == 0);
    if (dut.refresh_q && dut.slot_q >= 7'd12 && dut.slot_q < 7'd26) assert (!hold);
    if (dut.slot_q >= 7'd108 || (dut.slot_q == 7'd107 && dut.due_q)) assert (!hold && !hold_q);
    // A refresh in a step with effects is one that the preparation of the next waits for.
    if (effects_q && since != NONE && since >= 6'd44 && hold_q && dut.slot_q == 7'd0) assert (dut.due_q || !hold);
    if (effects_q && since != NONE && dut.refresh_q && dut.slot_q >= 7'd12 && dut.slot_q < 7'd26) assert (dut.due_q);
    if (dut.due_q) assert (effects_q && since != NONE && since >= 6'd44 && (dut.slot_q < 7'd26 || dut.slot_q == 7'd107));
    if ((dut.slot_q == 7'd0 && !dut.due_q) || dut.slot_q == 7'd65 || dut.slot_q == 7'd66)
      assert (last_add == ADD_C2 || last_add == ADD_UV || last_add == ADD_Z0
              || (add_en[0] && (add == ADD_Z0 || (add == ADD_UV && dut.slot_q == 7'd0))));
    if (since != NONE && since >= FX_SPACING && effects_q && dut.slot_q == 7'd0 && !dut.due_q)
      assert (add_en[0] ? add == ADD_UV : last_add == ADD_UV);
    cover (dut.slot_q == 7'd2 && dut.c_later_q[2]);
    cover (valid && since == LATENCY && !effects_q);
    cover (valid && since == FX_LATENCY && effects_q);
    cover (since == FX_SPACING && ready && start && effects_q);
    cover (dut.slot_q == 7'd67 && last_add == ADD_Z0);
    cover (dut.due_q && refresh);
  end
endmodule
