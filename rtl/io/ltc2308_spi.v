// ltc2308_spi: one conversion cycle of an LTC2308, exactly 80 clocks of 40 MHz (2 us, 500 kSPS).
//
// Purpose    Makes CONVST, SCK and SDI, and reads SDO. It knows nothing of the order of channels: the
//            sequencer gives the channel of the NEXT conversion, because the word that is sent while a
//            result is read selects the conversion that follows.
//
// Handshake  run_i is looked at in the last clock of a cycle (and in every clock while idle). next_ch_i is
//            taken at edge 64, valid_o is 1 for one clock (edge 77 to 78) with code_o, the result of THIS
//            cycle's conversion; code_o holds until edge 66 of the next cycle.
//
// Latency    From the edge that starts a cycle: valid_o from edge 77, the next cycle starts at edge 80.
//            After reset the first cycle starts no earlier than 80 clocks later: a conversion that a
//            reset cut in two has then ended (1.6 us), and the cycle time of 2 us is kept.
//
// Clocks     clk_i     40 MHz, phase 0: everything but the CONVST output register.
//            clk_cnv_i 40 MHz, 7.5 ns (108 degrees) later, from the same PLL: the CONVST output register.
//            Why two: at 500 kSPS the first of the SCK edges must come 1600 to 1610 ns after CONVST (the
//            conversion takes up to 1600, the acquisition after the 7th edge at least 240 of 2000 ns). Both
//            on one clock leave 0 and 10 ns: a pad skew of 1 ns breaks it, and the half clock is 12.5 ns
//            away. With this phase SCK rises 1605 ns after CONVST: 5 ns on either side, 3 ns of it left
//            with pad delays that differ from 3 to 5 ns.
//
// Pin edges  (clk_i period = 25 ns; edge n is at 25*n ns after the start of the cycle, at the registers)
//            CONVST  rises at 7.5, falls at 32.5
//            SDI     bit k (0..5: S/D O/S S1 S0 UNI SLP) from edge 64+k to edge 65+k
//            SCK     k-th pulse (0..11): rises at 25*(64+k) + 12.5, falls at edge 65+k
//            SDO     bit 11-k is caught at edge 65+k: the falling edge that asks for the next bit, a full
//                    period after the one that asked for this one (12.5 ns of the device and twice 5 ns of
//                    pad leave 2.5 ns; half a period would leave -10)
//
// SDC        ADC_SCK is a generated clock: clk_i inverted, through the output cell of ltc2308_spi_sck.
//            ADC_SDI: output delay against it (set-up 0, hold 2.5). ADC_SDO: input delay against its
//            falling edge (max 12.5, min 4). ADC_CONVST: output delay against it, 5 ns earlier or later than with equal
//            pads. clk_i -> clk_cnv_i is a synchronous path of 7.5 ns.
`default_nettype none

module ltc2308_spi (
  input  wire        clk_i,         // 40 MHz
  input  wire        clk_cnv_i,     // 40 MHz, 7.5 ns after clk_i
  input  wire        rst_ni,        // asserted asynchronously, released with clk_i
  input  wire        run_i,         // 1: start another cycle
  input  wire [ 2:0] next_ch_i,     // channel of the next conversion
  output wire        valid_o,       // one clock: code_o is new
  output wire [11:0] code_o,        // straight binary, 1 mV a step
  output wire        adc_convst_o,
  output wire        adc_sck_o,
  output wire        adc_sdi_o,
  input  wire        adc_sdo_i
);

  localparam [6:0] CYCLE = 7'd80;       // 2 us
  localparam [6:0] CONVERSION = 7'd64;  // 1.6 us, the longest conversion
  localparam [6:0] BITS = 7'd12;

  // A cycle. Out of reset one cycle passes without a pin moving (active_q = 0).
  reg [6:0] count_q;
  reg       active_q;
  wire      last = (count_q == CYCLE - 7'd1);
  wire      start = last && run_i;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      count_q  <= 7'd0;
      active_q <= 1'b0;
    end else if (last) begin
      active_q <= run_i;
      if (run_i) count_q <= 7'd0;
    end else begin
      count_q <= count_q + 7'd1;
    end
  end

  // CONVST: high for the first clock of a cycle, moved to its own phase by the output register.
  reg cnv_q;
  reg convst_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) cnv_q <= 1'b0;
    else         cnv_q <= start;
  end

  always @(posedge clk_cnv_i or negedge rst_ni) begin
    if (!rst_ni) convst_q <= 1'b0;
    else         convst_q <= cnv_q;
  end

  assign adc_convst_o = convst_q;

  // SCK: the enable is high in the clocks before edges 64 to 75.
  wire sck_en = active_q && (count_q >= CONVERSION - 7'd1) && (count_q < CONVERSION + BITS - 7'd1);

  ltc2308_spi_sck u_sck (
    .clk_i (clk_i),
    .rst_ni(rst_ni),
    .en_i  (sck_en),
    .sck_o (adc_sck_o)
  );

  // SDI: single ended, channel, unipolar, awake; the part wants the odd bit of the channel first.
  reg  [5:0] word_q;
  wire       load = active_q && (count_q == CONVERSION - 7'd1);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni)   word_q <= 6'd0;
    else if (load) word_q <= {1'b1, next_ch_i[0], next_ch_i[2:1], 2'b10};
    else           word_q <= {word_q[4:0], 1'b0};
  end

  assign adc_sdi_o = word_q[5];

  // SDO: caught in the input register at every edge, shifted in one clock later.
  reg         sdo_q;
  reg  [11:0] code_q;
  reg         valid_q;
  wire        shift = active_q && (count_q > CONVERSION) && (count_q <= CONVERSION + BITS);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) sdo_q <= 1'b0;
    else         sdo_q <= adc_sdo_i;
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      code_q  <= 12'd0;
      valid_q <= 1'b0;
    end else begin
      if (shift) code_q <= {code_q[10:0], sdo_q};
      valid_q <= active_q && (count_q == CONVERSION + BITS);
    end
  end

  assign code_o  = code_q;
  assign valid_o = valid_q;

`ifdef FORMAL
  // For tb/formal: pulses of SCK and results of the present cycle, counted.
  reg [3:0] f_pulses;
  reg [1:0] f_results;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      f_pulses  <= 4'd0;
      f_results <= 2'd0;
    end else if (last) begin
      f_pulses  <= 4'd0;
      f_results <= 2'd0;
    end else begin
      if (sck_en) f_pulses <= f_pulses + 4'd1;
      if (valid_q) f_results <= f_results + 2'd1;
    end
  end

  always @* begin
    assert (count_q < CYCLE);
    assert (valid_q == (active_q && count_q == CONVERSION + BITS + 7'd1));
    assert (!cnv_q || (active_q && count_q == 7'd0));
    if (!active_q || count_q < CONVERSION) assert (f_pulses == 4'd0);
    else if (count_q < CONVERSION + BITS) assert ({3'd0, f_pulses} == count_q - CONVERSION + 7'd1);
    else assert (f_pulses == BITS[3:0]);
    assert (f_results == {1'b0, active_q && count_q > CONVERSION + BITS + 7'd1});
    // Every cycle that ends has had its twelve pulses and its one result.
    if (last && active_q) assert (f_pulses == BITS[3:0] && f_results == 2'd1);
  end
`endif

endmodule

`default_nettype wire
