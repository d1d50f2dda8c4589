// rtds_ctrl: one ADC record in, one step of the core, one write to the DAC; and what happens when that goes wrong.
//
// Purpose     admits records to the pipeline scaling -> core -> scaling -> DAC, chooses the source of every
//             parameter (adc_scale that of V and T), decides when the DAC has to show its safe value, and reports events.
// Handshake   record_valid_i one clock a record. The stages start each other (adc_scale's valid starts the core,
//             the core's valid starts dac_scale, and so on); each has a fixed latency, so the whole has one:
//             measured here from record_valid_i to the falling edge of LDAC (latency_o).
//             idle_o: no step is in hand, a new configuration may be taken over, the next record is admitted. It is low
//             in the clock of a record, for BUSY_CLOCKS from its admission, longer than the way to the DAC, and as long as the
//             core is not ready for another step (with effects longer than that). Both end by themselves: no lost answer can block
//             it for ever. So the core is never strobed while it is busy.
// Latency     scale_start_o: combinational from record_valid_i; core_strobe_o: combinational from scale_valid_i.
// Faults      silent ADC: a record whose codes are all 0 or all 4095, silent_i, or none for SILENT_CLOCKS while
//             run_i: no step is made, the DAC shows the safe value until a good record comes.
//             NaN or infinity: steps stop and the DAC shows the safe value until clear_i.
// Format      words are binary32, codes 12 bits; motor_i, motor_o: rtds_core_records.vh.
`default_nettype none

module rtds_ctrl #(
  parameter SILENT_CLOCKS = 1023,  // 20.46 us: the time of two records and some, so that one lost is not late as well
  parameter BUSY_CLOCKS = 127
) (
  input  wire         clk_i,
  input  wire         rst_ni,

  input  wire         run_i,
  input  wire         blank_i,
  input  wire         clear_i,
  input  wire [191:0] motor_i,        // as the registers have it
  input  wire [  3:0] from_adc_i,     // parameters, see adc_record.vh
  output wire         idle_o,

  input  wire         record_valid_i,
  input  wire [ 59:0] record_codes_i, // the record's codes
  input  wire         silent_i,       // the sequencer saw a dead line
  input  wire         dropped_i,      // the crossing or the DAC lost one

  output wire         scale_start_o,
  input  wire         scale_valid_i,
  input  wire [127:0] scale_values_i, // the same, a word each
  input  wire         scale_params_i, // every parameter channel has been read

  output wire         core_strobe_o,
  output wire [191:0] motor_o,        // each parameter from its source
  input  wire         core_ready_i,
  input  wire         core_nonfinite_i,

  input  wire         codes_valid_i,  // dac_scale is done
  output wire         dac_write_o,
  output wire         dac_fault_o,
  input  wire         dac_ldac_ni,    // low from the falling edge of LDAC on, for a clock or more

  output wire         alive_o,
  output wire         halted_o,
  output wire         silent_event_o,
  output wire         dropped_event_o,
  output wire [ 31:0] latency_o       // {largest, last}
);

  // A value that the widths here cannot hold ends the elaboration, with its name.
  generate
    if (SILENT_CLOCKS < 1 || SILENT_CLOCKS > 1023) begin : g_bad_silent_clocks
      SILENT_CLOCKS_must_be_1_to_1023 u_error ();
    end
    if (BUSY_CLOCKS < 1 || BUSY_CLOCKS > 127) begin : g_bad_busy_clocks
      BUSY_CLOCKS_must_be_1_to_127 u_error ();
    end
  endgenerate

  `include "adc_record.vh"
  `include "rtds_core_records.vh"

  // --- admission -----------------------------------------------------------------------------------------
  // A dead line reads as all zeros or all ones. The sequencer keeps such records to itself; a second look here
  // costs a few cells and does not depend on the other clock.
  wire plausible = (|record_codes_i) && !(&record_codes_i);

  reg [6:0] busy_q;
  reg       halted_q;
  reg       alive_q;

  wire counting = (busy_q != 7'd0);
  wire busy = counting || !core_ready_i;
  wire admit = record_valid_i && plausible && run_i && !halted_q && !busy;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) busy_q <= 7'd0;
    else if (admit) busy_q <= BUSY_CLOCKS;
    else if (counting) busy_q <= busy_q - 7'd1;
  end

  assign idle_o          = !busy && !record_valid_i;
  assign scale_start_o   = admit;
  assign dropped_event_o = dropped_i || (record_valid_i && busy);

  // --- silent ADC ----------------------------------------------------------------------------------------
  reg [9:0] watch_q;
  reg       late_q;
  reg       bad_record_q;
  reg       silent_prev_q;

  // "Not alive yet" between the start of a run and its first record is not silence.
  wire      silent = run_i && (silent_i || late_q || bad_record_q);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      watch_q       <= 10'd0;
      late_q        <= 1'b0;
      bad_record_q  <= 1'b0;
      alive_q       <= 1'b0;
      silent_prev_q <= 1'b0;
    end else begin
      if (record_valid_i || !run_i) watch_q <= 10'd0;
      else if (watch_q != SILENT_CLOCKS) watch_q <= watch_q + 10'd1;
      late_q <= run_i && (watch_q == SILENT_CLOCKS);
      if (!run_i) bad_record_q <= 1'b0;
      else if (record_valid_i) bad_record_q <= !plausible;
      if (record_valid_i) alive_q <= plausible;
      else if (!run_i || silent_i || late_q) alive_q <= 1'b0;
      silent_prev_q <= silent;
    end
  end

  assign alive_o        = alive_q;
  assign silent_event_o = silent && !silent_prev_q;

  // --- sources -------------------------------------------------------------------------------------------
  assign motor_o[MOTOR_R+:32]  = motor_i[MOTOR_R+:32];
  assign motor_o[MOTOR_L+:32]  = motor_i[MOTOR_L+:32];
  assign motor_o[MOTOR_B+:32]  = from_adc_i[PARAM_B] ? scale_values_i[32*PARAM_B+:32] : motor_i[MOTOR_B+:32];
  assign motor_o[MOTOR_J+:32]  = from_adc_i[PARAM_J] ? scale_values_i[32*PARAM_J+:32] : motor_i[MOTOR_J+:32];
  assign motor_o[MOTOR_KM+:32] = from_adc_i[PARAM_KM] ? scale_values_i[32*PARAM_KM+:32] : motor_i[MOTOR_KM+:32];
  assign motor_o[MOTOR_KB+:32] = from_adc_i[PARAM_KB] ? scale_values_i[32*PARAM_KB+:32] : motor_i[MOTOR_KB+:32];

  // Until each parameter channel has been read once there is nothing to compute coefficients from.
  assign core_strobe_o = scale_valid_i && (scale_params_i || from_adc_i == 4'd0);

  // --- halt, safe value ----------------------------------------------------------------------------------
  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) halted_q <= 1'b0;
    else if (clear_i) halted_q <= 1'b0;  // the level of core_nonfinite_i falls with this very edge
    else if (core_nonfinite_i) halted_q <= 1'b1;
  end

  reg blank_q;
  reg fault_q;

  // `blank` acts between two steps, so that its release cannot show half a transfer either.
  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      blank_q <= 1'b0;
      fault_q <= 1'b0;
    end else begin
      if (!busy) blank_q <= blank_i;
      fault_q <= halted_q || blank_q || silent;
    end
  end

  assign halted_o    = halted_q;
  assign dac_fault_o = fault_q;
  assign dac_write_o = codes_valid_i && !fault_q && !halted_q;

  // --- latency from the record to the LDAC edge ----------------------------------------------------------
  reg  [ 7:0] count_q;
  reg         timing_q;
  reg  [ 7:0] last_q;
  reg  [ 7:0] largest_q;
  reg         written_q;    // this step's codes went to the DAC
  reg         ldac_prev_q;
  wire        ldac_edge = ldac_prev_q && !dac_ldac_ni;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      count_q     <= 8'd0;
      timing_q    <= 1'b0;
      last_q      <= 8'd0;
      largest_q   <= 8'd0;
      written_q   <= 1'b0;
      ldac_prev_q <= 1'b1;
    end else begin
      ldac_prev_q <= dac_ldac_ni;
      count_q     <= count_q + 8'd1;
      if (dac_write_o) written_q <= 1'b1;
      if (admit) begin
        count_q   <= 8'd1;
        timing_q  <= 1'b1;
        written_q <= 1'b0;
      end else if (timing_q && written_q && ldac_edge) begin
        timing_q <= 1'b0;
        last_q   <= count_q;
        if (count_q > largest_q) largest_q <= count_q;
      end else if (!busy) begin
        timing_q <= 1'b0;
      end
    end
  end

  assign latency_o = {8'd0, largest_q, 8'd0, last_q};  // never more than BUSY_CLOCKS

endmodule

`default_nettype wire
