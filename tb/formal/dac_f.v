// Proof of the DAC's set-up and hold at its pins, in whole clocks of 20 ns: address and data stand one clock before CS
// falls, while it is low and one clock after; CS and LDAC are low for three clocks; LDAC falls three clocks after CS has
// risen at the earliest and only after all four outputs were written; CS falls four clocks after LDAC at the earliest;
// a write that was taken reaches LDAC exactly 22 clocks later.
`default_nettype none

module dac_f (
    input wire        clk,
    input wire        rst_n,
    input wire        write,
    input wire [47:0] code,
    input wire        fault
);
  wire ready, dropped, safe, updated, cs_n, rw, ldac_n, reset_n;
  wire [11:0] db;
  wire [1:0] a;

  dac_parallel dut (
      .clk_i(clk), .rst_ni(rst_n), .rst_pin_ni(rst_n), .write_i(write), .code_i(code), .fault_i(fault), .ready_o(ready), .dropped_o(dropped),
      .safe_o(safe), .updated_o(updated), .dac_db_o(db), .dac_a_o(a), .dac_cs_no(cs_n), .dac_rw_o(rw), .dac_ldac_no(ldac_n), .dac_reset_no(reset_n)
  );

  // Signals inside of dut, joined by Yosys when it flattens.
  (* hierconn *) wire \dut.busy_q ;
  (* hierconn *) wire \dut.ldac_slot ;
  (* hierconn *) wire [2:0] \dut.phase_q ;
  (* hierconn *) wire [2:0] \dut.slot_q ;

  reg started = 1'b0;
  reg cs_q = 1'b1, ldac_q = 1'b1;
  reg [13:0] bus_q, bus_qq;
  reg [2:0] cs_low = 3'd0, ldac_low = 3'd0, cs_high = 3'd7, since_ldac = 3'd7;
  reg [3:0] written = 4'd0;
  reg [22:0] due = 23'd0;
  reg rst_q = 1'b0;

  always @(posedge clk) begin
    started <= 1'b1;
    rst_q   <= rst_n;
    cs_q    <= cs_n;
    ldac_q  <= ldac_n;
    bus_q   <= {a, db};
    if (!rst_n) begin
      cs_low     <= 3'd0;
      ldac_low   <= 3'd0;
      cs_high    <= 3'd7;
      since_ldac <= 3'd7;
      written    <= 4'd0;
      due        <= 23'd0;
    end else begin
      cs_low     <= cs_n ? 3'd0 : cs_low + 3'd1;
      ldac_low   <= ldac_n ? 3'd0 : ldac_low + 3'd1;
      cs_high    <= !cs_n ? 3'd0 : (cs_high != 3'd7) ? cs_high + 3'd1 : cs_high;
      since_ldac <= !ldac_n && ldac_q ? 3'd1 : (since_ldac != 3'd7) ? since_ldac + 3'd1 : since_ldac;
      if (!ldac_n) written <= 4'd0;
      else if (!cs_n) written[a] <= 1'b1;
      due <= {due[21:0], write && ready};
    end
  end

  always @* if (!started) assume (!rst_n);

  always @* if (started && rst_n && rst_q) begin
    if (!cs_n || !cs_q) assert ({a, db} == bus_q);                        // set-up, during, hold
    if (cs_n && cs_low != 3'd0) assert (cs_low == 3'd3);
    assert (cs_low <= 3'd3 && ldac_low <= 3'd3);
    if (ldac_n && ldac_low != 3'd0) assert (ldac_low == 3'd3);
    if (!ldac_n && ldac_q) assert (cs_high >= 3'd2 && cs_n && written == 4'b1111);
    if (!cs_n && cs_q) assert (since_ldac >= 3'd4);
    assert (!rw);
    assert (updated == (!ldac_n && ldac_q));
    if (due[22]) assert (!ldac_n && ldac_q);
    cover (due[22]);
    cover (!ldac_n && safe && fault);
    cover (dropped);
  end

  // Ties between what is counted here and the transfer's counters, for the induction.
  wire [4:0] place = {2'd0, dut.slot_q} * 5'd5 + {2'd0, dut.phase_q};
  always @* if (started && rst_n && rst_q) begin
    if (dut.busy_q && !dut.ldac_slot) begin
      assert (cs_low == (dut.phase_q == 3'd0 ? 3'd0 : dut.phase_q - 3'd1));
      assert (written == (4'd1 << dut.slot_q[1:0]) - 4'd1 + ((dut.phase_q >= 3'd2) ? (4'd1 << dut.slot_q[1:0]) : 4'd0));
      assert (ldac_low == 3'd0 || (ldac_low == 3'd3 && place == 5'd0));
      assert (since_ldac >= 3'd4);
      if (dut.phase_q == 3'd4) assert (cs_high == 3'd0);
    end
    if (dut.busy_q && dut.ldac_slot) begin
      assert (cs_high == dut.phase_q + 3'd1 && cs_low == 3'd0);
      assert (written == (dut.phase_q <= 3'd2 ? 4'b1111 : 4'b0000));
      assert (ldac_low == (dut.phase_q <= 3'd2 ? 3'd0 : dut.phase_q - 3'd2));
      if (dut.phase_q >= 3'd3) assert (since_ldac == dut.phase_q - 3'd2);
    end
    if (!dut.busy_q) assert (written == 4'd0 && cs_low == 3'd0 && since_ldac >= 3'd3 && (ldac_low == 3'd0 || ldac_low == 3'd3));
    if (!dut.busy_q) assert (due == 23'd0);
    else if (place <= 5'd22) assert ((due & ~(23'd1 << place)) == 23'd0);
    else assert (due == 23'd0);
  end
endmodule
