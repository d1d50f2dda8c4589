// effect_delay: both commands, later.
//
// Purpose    An entry of the memory is written at every stride_i-th strobe; what comes out is the entry delay_i entries
//            back, and zero until there is one. With a stride of 1 the delay is exact to the step.
// Handshake  strobe_i for one clock, v_i valid in it; strobes at least 3 clocks apart. rest_i: empty, output zero.
//            delay_i and stride_i are held; delay_i 0 .. 4095, stride_i 1 .. 65535.
// Latency    v_o belongs to a strobe from the third clock after it until the next strobe's.
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
  output reg  [63:0] v_o
);
  reg [63:0] memory [0:4095];
  reg [63:0] read_q;
  reg [11:0] at_q;
  reg [11:0] from_q;    // the entry wanted
  reg [11:0] filled_q;  // entries before the one in hand, at most as many as the delay needs
  reg [15:0] phase_q;
  reg        read1_q;   // an entry was written in the last clock
  reg        read2_q;   // the one wanted stands in read_q
  reg        there_q;

  wire entry = strobe_i & (phase_q == 16'd0) & ~rest_i;
  wire there = filled_q >= delay_i;

  always @(posedge clk_i) begin
    if (entry) begin
      memory[at_q] <= v_i;
      from_q       <= at_q - delay_i;
    end
    if (read1_q) read_q <= memory[from_q];
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      at_q     <= 12'd0;
      filled_q <= 12'd0;
      phase_q  <= 16'd0;
      read1_q  <= 1'b0;
      read2_q  <= 1'b0;
      there_q  <= 1'b0;
      v_o      <= 64'd0;
    end else if (!rest_i) begin
      if (strobe_i | read1_q | read2_q) begin
        read2_q <= read1_q;
        read1_q <= entry;
        if (strobe_i) phase_q <= (phase_q + 16'd1 < stride_i) ? phase_q + 16'd1 : 16'd0;
        if (entry) begin
          at_q    <= at_q + 12'd1;
          there_q <= there;
          if (!there) filled_q <= filled_q + 12'd1;
        end
        if (read2_q) v_o <= there_q ? read_q : 64'd0;
      end
    end else begin
      at_q     <= 12'd0;
      filled_q <= 12'd0;
      phase_q  <= 16'd0;
      read1_q  <= 1'b0;
      read2_q  <= 1'b0;
      v_o      <= 64'd0;
    end
  end
endmodule

`default_nettype wire
