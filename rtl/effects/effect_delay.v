// effect_delay: both commands, later.
//
// Purpose    An entry of the memory is written at every stride_i-th strobe; what comes out is the entry delay_i entries
//            back, and zero until there is one. With a stride of 1 the delay is exact to the step.
// Handshake  strobe_i for one clock, v_i valid in it; strobes at least 3 clocks apart. rest_i: empty, output zero.
//            delay_i and stride_i are taken at the strobe; delay_i 0 .. 4095, stride_i 1 .. 65535.
// Latency    v_o belongs to a strobe from the third clock after it until the next strobe's. A strobe comes late in its clock
//            and the memory is many blocks, far apart: what a strobe brings goes into registers first, in every clock, and into
//            the memory a clock later, while the entry wanted, whose place needs no strobe to be known, is read.
// Format     two words {right, left}.
// Crossing   none. The memory has no reset: what was not written since rest_i is not shown.
`default_nettype none

module effect_delay (
  input  wire        clk_i,
  input  wire        rst_ni,
  input  wire        rest_i,
  input  wire        strobe_i,
  input  wire [11:0] delay_i,
  input  wire [15:0] stride_i,
  input  wire [63:0] v_i,
  output wire [63:0] v_o
);
  reg [63:0] v_out_q;
  reg [63:0] memory [0:4095];
  reg [63:0] entry_q;
  reg [63:0] v_q;       // what there was in the last clock,
  reg [63:0] v_later_q; // in the one before it
  reg [11:0] delay_q;
  reg [15:0] stride_q;
  reg        strobe_q;  // it was in the last clock
  reg [11:0] at_q;
  reg [11:0] from_q;    // the entry that a strobe in the last clock wants
  reg [11:0] filled_q;  // entries before the one in hand, at most as many as the delay needs
  reg [15:0] phase_q;
  reg        read_q;    // the entry wanted stands in entry_q,
  reg        there_q;   // if there is one,
  reg        now_q;     // unless it is the one in hand

  wire entry = strobe_q & (phase_q == 16'd0);
  wire there = filled_q >= delay_q;

  always @(posedge clk_i) begin
    v_q       <= v_i;
    v_later_q <= v_q;
    delay_q   <= delay_i;
    stride_q  <= stride_i;
    from_q    <= at_q - delay_i;
  end

  always @(posedge clk_i) begin
    if (entry) begin
      memory[at_q] <= v_q;
      entry_q      <= memory[from_q];
    end
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      strobe_q <= 1'b0;
      at_q     <= 12'd0;
      filled_q <= 12'd0;
      phase_q  <= 16'd0;
      read_q   <= 1'b0;
      there_q  <= 1'b0;
      now_q    <= 1'b0;
      v_out_q  <= 64'd0;
    end else if (!rest_i) begin
      strobe_q <= strobe_i;
      read_q   <= entry;
      if (strobe_q) phase_q <= (phase_q + 16'd1 < stride_q) ? phase_q + 16'd1 : 16'd0;
      if (entry) begin
        at_q    <= at_q + 12'd1;
        there_q <= there;
        now_q   <= delay_q == 12'd0;
        if (!there) filled_q <= filled_q + 12'd1;
      end
      if (read_q) v_out_q <= now_q ? v_later_q : there_q ? entry_q : 64'd0;
    end else begin
      strobe_q <= 1'b0;
      at_q     <= 12'd0;
      filled_q <= 12'd0;
      phase_q  <= 16'd0;
      read_q   <= 1'b0;
      v_out_q  <= 64'd0;
    end
  end

  assign v_o = v_out_q;
endmodule

`default_nettype wire
