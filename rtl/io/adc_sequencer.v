// adc_sequencer: reads the LTC2308 for ever, one sequence each 400 clocks of 40 MHz (10 us).
//
// Purpose    A sequence is five conversions: one of the four parameter channels (in turn: B, J, Km, Kb), then
//            T_left, T_right, V_left, V_right: the voltages are the freshest when the step starts.
//            Channel of the device: 0 V_l, 1 V_r, 2 T_l, 3 T_r, 4 B, 5 J, 6 Km, 7 Kb.
//
// Handshake  At the end of a sequence the whole record (code_*_o, index_p_o) changes at one edge of clk_i;
//            done_toggle_o changes with it and valid_o is 1 for the one clock that follows. The record then
//            holds for 400 clocks, which is what the crossing to 50 MHz relies on. With enable_i = 0 the
//            running sequence is finished, then the device is left alone; it keeps the word it was sent, so
//            the next sequence goes on with the next parameter in turn.
//
// Silence    A sequence in which all five codes are 000 or all are FFF is what a dead line gives: the record
//            and the toggle then stay as they were (no step is made from it) and silent_o is 1 from that end
//            of sequence until the next good one, or until enable_i is 0: what the line was before a rest says
//            nothing of the line after it.
//
// Latency    The toggle changes 78 clocks after the start of the fifth cycle: V_right was sampled 1.94 us before,
//            the parameter 9.94 us. First toggle after reset with enable_i = 1: after 558 clocks (80 of
//            waiting, 80 of a cycle whose result is dropped because the device's channel is not known, and
//            a sequence up to its clock 398).
//
// Crossing   Outputs are registers of clk_i; enable_i must be synchronous to clk_i.
`default_nettype none

module adc_sequencer (
  input  wire        clk_i,          // 40 MHz
  input  wire        clk_cnv_i,      // 40 MHz, 7.5 ns after clk_i (see ltc2308_spi)
  input  wire        rst_ni,         // asserted asynchronously, released with clk_i
  input  wire        enable_i,       // level, in the clk_i domain
  // the record, held from one end of sequence to the next
  output wire [11:0] code_v_l_o,
  output wire [11:0] code_v_r_o,
  output wire [11:0] code_t_l_o,
  output wire [11:0] code_t_r_o,
  output wire [11:0] code_p_o,
  output wire [ 1:0] index_p_o,      // 0 B, 1 J, 2 Km, 3 Kb
  output wire        done_toggle_o,  // changes with every new record
  output wire        valid_o,        // one clock: the record is new
  output wire        silent_o,       // level: the last sequence was all zeros or all ones
  // pins
  output wire        adc_convst_o,
  output wire        adc_sck_o,
  output wire        adc_sdi_o,
  input  wire        adc_sdo_i
);

  localparam [2:0] SLOT_P = 3'd0;
  localparam [2:0] SLOT_T_L = 3'd1;
  localparam [2:0] SLOT_T_R = 3'd2;
  localparam [2:0] SLOT_V_L = 3'd3;
  localparam [2:0] SLOT_V_R = 3'd4;  // the last one of a sequence

  // now_*: the conversion of this cycle. next_*: the one that the word sent in this cycle selects. After reset
  // the device converts an unknown channel while it is told P: both stand at P, and the second result replaces
  // the first.
  reg  [ 2:0] now_slot_q;
  reg  [ 1:0] now_param_q;
  reg  [ 2:0] next_slot_q;
  reg  [ 1:0] next_param_q;

  wire        spi_valid;
  wire [11:0] spi_code;
  wire        next_is_last = (next_slot_q == SLOT_V_R);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      now_slot_q   <= SLOT_P;
      now_param_q  <= 2'd0;
      next_slot_q  <= SLOT_P;
      next_param_q <= 2'd0;
    end else if (spi_valid) begin
      now_slot_q  <= next_slot_q;
      now_param_q <= next_param_q;
      next_slot_q <= next_is_last ? SLOT_P : next_slot_q + 3'd1;
      if (next_is_last) next_param_q <= next_param_q + 2'd1;
    end
  end

  reg [2:0] next_ch;

  always @* begin
    case (next_slot_q)
      SLOT_V_L: next_ch = 3'd0;
      SLOT_V_R: next_ch = 3'd1;
      SLOT_T_L: next_ch = 3'd2;
      SLOT_T_R: next_ch = 3'd3;
      default:  next_ch = {1'b1, next_param_q};
    endcase
  end

  // A sequence that was begun is finished whatever enable_i does.
  wire run = enable_i || (now_slot_q != SLOT_P);

  ltc2308_spi u_spi (
    .clk_i       (clk_i),
    .clk_cnv_i   (clk_cnv_i),
    .rst_ni      (rst_ni),
    .run_i       (run),
    .next_ch_i   (next_ch),
    .valid_o     (spi_valid),
    .code_o      (spi_code),
    .adc_convst_o(adc_convst_o),
    .adc_sck_o   (adc_sck_o),
    .adc_sdi_o   (adc_sdi_o),
    .adc_sdo_i   (adc_sdo_i)
  );

  // Codes of the running sequence, and whether all of them so far were 000 or FFF.
  wire        opening = (now_slot_q == SLOT_P);
  wire        at_end = spi_valid && (now_slot_q == SLOT_V_R);
  reg  [11:0] part_p_q;
  reg  [11:0] part_t_l_q;
  reg  [11:0] part_t_r_q;
  reg  [11:0] part_v_l_q;
  reg         zeros_q;
  reg         ones_q;
  wire        zeros = (opening || zeros_q) && (spi_code == 12'h000);
  wire        ones = (opening || ones_q) && (spi_code == 12'hFFF);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      part_p_q   <= 12'd0;
      part_t_l_q <= 12'd0;
      part_t_r_q <= 12'd0;
      part_v_l_q <= 12'd0;
      zeros_q    <= 1'b0;
      ones_q     <= 1'b0;
    end else if (spi_valid) begin
      zeros_q <= zeros;
      ones_q  <= ones;
      case (now_slot_q)
        SLOT_T_L: part_t_l_q <= spi_code;
        SLOT_T_R: part_t_r_q <= spi_code;
        SLOT_V_L: part_v_l_q <= spi_code;
        default:  if (opening) part_p_q <= spi_code;
      endcase
    end
  end

  // The record: one edge for all of it.
  reg [11:0] code_v_l_q;
  reg [11:0] code_v_r_q;
  reg [11:0] code_t_l_q;
  reg [11:0] code_t_r_q;
  reg [11:0] code_p_q;
  reg [ 1:0] index_p_q;
  reg        toggle_q;
  reg        valid_q;
  reg        silent_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      code_v_l_q <= 12'd0;
      code_v_r_q <= 12'd0;
      code_t_l_q <= 12'd0;
      code_t_r_q <= 12'd0;
      code_p_q   <= 12'd0;
      index_p_q  <= 2'd0;
      toggle_q   <= 1'b0;
      valid_q    <= 1'b0;
      silent_q   <= 1'b0;
    end else begin
      valid_q <= at_end && !zeros && !ones;
      if (at_end) silent_q <= zeros || ones;
      else if (!enable_i) silent_q <= 1'b0;
      if (at_end && !zeros && !ones) begin
        code_v_l_q <= part_v_l_q;
        code_v_r_q <= spi_code;
        code_t_l_q <= part_t_l_q;
        code_t_r_q <= part_t_r_q;
        code_p_q   <= part_p_q;
        index_p_q  <= now_param_q;
        toggle_q   <= !toggle_q;
      end
    end
  end

  assign code_v_l_o    = code_v_l_q;
  assign code_v_r_o    = code_v_r_q;
  assign code_t_l_o    = code_t_l_q;
  assign code_t_r_o    = code_t_r_q;
  assign code_p_o      = code_p_q;
  assign index_p_o     = index_p_q;
  assign done_toggle_o = toggle_q;
  assign valid_o       = valid_q;
  assign silent_o      = silent_q;

endmodule

`default_nettype wire
