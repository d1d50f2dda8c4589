// rtds_regs: the register file, an Avalon-MM slave.
//
// Purpose     parameters, scalings, sources, control, sticky status, identity and counters (docs/registers.md;
//             addresses and reset values come from rtds_regs_map.vh, made from the one description).
// Handshake   Avalon-MM, word addresses, never a wait state: a read or write is taken at any clock with
//             avs_read_i or avs_write_i high. readdatavalid (reads) or writeresponsevalid (writes) follow three
//             clocks later together with response: 0 okay, 2 refused (read only), 3 no such register.
//             A commit waits until idle_i is high and then replaces the whole of config_o at one clock edge, the second one
//             after that: a step that starts in the clock after idle_i must not have read it by then. clear_o pulses under
//             the same condition, in the clock before that edge. A second command while one waits joins it.
//             A write to FX_DATA passes on to the effect unit in the same clock; it has no wait state either, and is lost
//             (FX_ADDRESS stays) while the unit still holds the word before.
// Latency     read 3 clocks: the first finds the kind of the word and its number, for an address comes from afar and chooses among
//             many; in the second it is chosen among those of its kind, in the third among kinds. Write 1 clock, into the shadow 3
//             as its response is; sticky bits 1 clock after their event. An event at the clock in which its bit is cleared wins.
// Format      floats are opaque words here.
// Reset       rst_ni is the board's reset, not the PLL's: registers survive a lost lock. latency_i, now_i and codes_i come
//             from registers that do not: they read as zero while open_i is 0 (reset_gate). idle_i, fx_ready_i, event_i,
//             live_i and step_i have passed such a gate before they come here.
`default_nettype none

module rtds_regs #(
  parameter [31:0] BUILD_ID = 32'd0
) (
  input  wire          clk_i,
  input  wire          rst_ni,

  input  wire [   7:0] avs_address_i,
  input  wire          avs_read_i,
  input  wire          avs_write_i,
  input  wire [  31:0] avs_writedata_i,
  output wire [  31:0] avs_readdata_o,
  output wire          avs_readdatavalid_o,
  output wire          avs_writeresponsevalid_o,
  output wire [   1:0] avs_response_o,

  // to the chip
  output wire          run_o,
  output wire          blank_o,
  output wire [1407:0] config_o,        // CFG_WORDS words of the config group in force
  output wire          clear_o,
  output wire          fx_valid_o,      // a word for the effect unit
  output wire [  13:0] fx_address_o,
  output wire [  31:0] fx_data_o,
  input  wire          fx_ready_i,      // it takes one
  input  wire          idle_i,          // no step is in hand

  // from the chip
  input  wire          open_i,          // latency_i, now_i and codes_i may be looked at
  input  wire [  10:0] event_i,         // set the sticky bit of the same number
  input  wire [   5:0] live_i,          // bits 5:0 of LIVE
  input  wire          step_i,          // one step done
  input  wire          serial_error_i,
  input  wire [  31:0] latency_i,
  input  wire [ 383:0] now_i,           // NOW_I_L (lowest word) .. NOW_KB
  input  wire [ 159:0] codes_i          // CODES_V (lowest word) .. CODES_R
);

  `include "rtds_regs_map.vh"

  localparam [1:0] RESP_OKAY = 2'd0;
  localparam [1:0] RESP_REFUSED = 2'd2;
  localparam [1:0] RESP_NONE = 2'd3;

  localparam [7:0] NOW_WORDS = ADDR_NOW_KB - ADDR_NOW_I_L + 8'd1;
  localparam [7:0] CODE_WORDS = ADDR_CODES_R - ADDR_CODES_V + 8'd1;

  wire [7:0] address = avs_address_i;
  wire       write = avs_write_i;
  wire       read = avs_read_i;

  // Of the clock before: what was asked for, of which kind it is, and its number among them.
  reg [ 7:0] address_q;
  reg        read_q;
  reg        write_q;
  reg        config_q;
  reg        now_q;
  reg        codes_q;
  reg [ 5:0] cfg_word_q;
  reg [ 3:0] now_word_q;
  reg [ 2:0] code_word_q;
  reg [31:0] writedata_q;
  // Of the clock before that: the words of long rows at that address.
  reg [ 7:0] address2_q;
  reg        read2_q;
  reg        write2_q;
  reg        config2_q;
  reg        observed2_q;
  reg [31:0] shadow_word_q;
  reg [31:0] observed_word_q;

  wire [7:0] cfg_index = address - CFG_FIRST;
  wire       in_config = (address >= CFG_FIRST) && (cfg_index < CFG_WORDS[7:0]);
  wire [7:0] now_index = address - ADDR_NOW_I_L;
  wire       in_now = (address >= ADDR_NOW_I_L) && (now_index < NOW_WORDS);
  wire [7:0] code_index = address - ADDR_CODES_V;
  wire       in_codes = (address >= ADDR_CODES_V) && (code_index < CODE_WORDS);

  // --- config group: shadow and the set in force -------------------------------------------------------
  reg [32*CFG_WORDS-1:0] shadow_q;
  reg [32*CFG_WORDS-1:0] active_q;
  reg                    commit_pending_q;
  reg                    take_q;  // what is known late in a clock does not enable so many registers
  reg                    clear_pending_q;
  reg                    clear_q;

  wire command = write && (address == ADDR_COMMAND);
  wire commit_now = commit_pending_q && idle_i;
  wire clear_now = clear_pending_q && idle_i;

  // A word's enable stands beside the word, not behind a choice among all of them.
  reg [CFG_WORDS-1:0] chosen_q;
  reg          [31:0] writedata2_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) writedata2_q <= 32'd0;
    else writedata2_q <= writedata_q;
  end

  genvar k;
  generate
    for (k = 0; k < CFG_WORDS; k = k + 1) begin : g_config
      always @(posedge clk_i or negedge rst_ni) begin
        if (!rst_ni) chosen_q[k] <= 1'b0;
        else chosen_q[k] <= write_q && config_q && cfg_word_q == k;
      end

      always @(posedge clk_i or negedge rst_ni) begin
        if (!rst_ni) begin
          shadow_q[32*k+:32] <= CFG_RESET[32*k+:32];
          active_q[32*k+:32] <= CFG_RESET[32*k+:32];
        end else begin
          if (chosen_q[k]) shadow_q[32*k+:32] <= writedata2_q;
          if (take_q) active_q[32*k+:32] <= shadow_q[32*k+:32];
        end
      end
    end
  endgenerate

  // What a read gives comes from a memory beside the shadow (a multiplexer over all its words would take as many
  // cells as a motor's adder); a word that was not written since reset still has its reset value.
  reg  [         31:0] mirror[0:63];
  reg  [CFG_WORDS-1:0] written_q;
  wire [         31:0] mirrored = mirror[cfg_word_q];
  wire [         31:0] shadow_d = written_q[cfg_word_q] ? mirrored : CFG_RESET[32*cfg_word_q+:32];

  always @(posedge clk_i) if (write_q && config_q) mirror[cfg_word_q] <= writedata_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) written_q <= {CFG_WORDS{1'b0}};
    else if (write_q && config_q) written_q[cfg_word_q] <= 1'b1;
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      commit_pending_q <= 1'b0;
      take_q           <= 1'b0;
      clear_pending_q  <= 1'b0;
      clear_q          <= 1'b0;
    end else begin
      take_q <= commit_now;
      if (command && avs_writedata_i[BIT_COMMAND_COMMIT]) commit_pending_q <= 1'b1;
      else if (commit_now) commit_pending_q <= 1'b0;
      if (command && avs_writedata_i[BIT_COMMAND_CLEAR]) clear_pending_q <= 1'b1;
      else if (clear_now) clear_pending_q <= 1'b0;
      clear_q <= clear_now;
    end
  end

  // --- words for the effect unit ---------------------------------------------------------------------------
  reg [13:0] fx_address_q;

  assign fx_valid_o   = write && (address == ADDR_FX_DATA) && fx_ready_i;
  assign fx_address_o = fx_address_q;
  assign fx_data_o    = avs_writedata_i;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) fx_address_q <= 14'd0;
    else if (write && address == ADDR_FX_ADDRESS) fx_address_q <= avs_writedata_i[13:0];
    else if (fx_valid_o) fx_address_q <= fx_address_q + 14'd1;
  end

  // --- control, scratch ----------------------------------------------------------------------------------
  reg [ 1:0] control_q;
  reg [31:0] scratch_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      control_q <= CONTROL_RESET[1:0];
      scratch_q <= 32'd0;
    end else begin
      if (write && address == ADDR_CONTROL) control_q <= avs_writedata_i[1:0];
      if (write && address == ADDR_SCRATCH) scratch_q <= avs_writedata_i;
    end
  end

  // --- sticky status -------------------------------------------------------------------------------------
  reg  [10:0] status_q;
  wire [10:0] status_clear = (write && address == ADDR_STATUS) ? avs_writedata_i[10:0] : 11'd0;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) status_q <= 11'd0;
    else         status_q <= (status_q & ~status_clear) | event_i;
  end

  // --- counters; reading the lowest word freezes the other three -------------------------------------------
  reg [63:0] cycles_q;
  reg [63:0] steps_q;
  reg [31:0] cycles_hi_q;
  reg [63:0] steps_seen_q;
  reg [15:0] serial_errors_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      cycles_q        <= 64'd0;
      steps_q         <= 64'd0;
      cycles_hi_q     <= 32'd0;
      steps_seen_q    <= 64'd0;
      serial_errors_q <= 16'd0;
    end else begin
      cycles_q <= cycles_q + 64'd1;
      if (clear_q) steps_q <= 64'd0;
      else if (step_i) steps_q <= steps_q + 64'd1;
      if (serial_error_i) serial_errors_q <= serial_errors_q + 16'd1;
      if (read2_q && address2_q == ADDR_CYCLES_LO) begin
        cycles_hi_q  <= cycles_q[63:32];
        steps_seen_q <= steps_q;
      end
    end
  end

  // --- read ----------------------------------------------------------------------------------------------
  wire [31:0] observed_d;

  reset_gate #(
    .WIDTH(32)
  ) u_observed (
    .open_i(open_i),
    .d_i   (now_q ? now_i[32*now_word_q+:32] : codes_q ? codes_i[32*code_word_q+:32] : latency_i),
    .q_o   (observed_d)
  );

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      address_q       <= 8'd0;
      read_q          <= 1'b0;
      write_q         <= 1'b0;
      config_q        <= 1'b0;
      now_q           <= 1'b0;
      codes_q         <= 1'b0;
      cfg_word_q      <= 6'd0;
      now_word_q      <= 4'd0;
      code_word_q     <= 3'd0;
      writedata_q     <= 32'd0;
      address2_q      <= 8'd0;
      read2_q         <= 1'b0;
      write2_q        <= 1'b0;
      config2_q       <= 1'b0;
      observed2_q     <= 1'b0;
      shadow_word_q   <= 32'd0;
      observed_word_q <= 32'd0;
    end else begin
      address_q       <= address;
      read_q          <= read;
      write_q         <= write;
      config_q        <= in_config;
      now_q           <= in_now;
      codes_q         <= in_codes;
      cfg_word_q      <= cfg_index[5:0];
      now_word_q      <= now_index[3:0];
      code_word_q     <= code_index[2:0];
      writedata_q     <= avs_writedata_i;
      address2_q      <= address_q;
      read2_q         <= read_q;
      write2_q        <= write_q;
      config2_q       <= config_q;
      observed2_q     <= now_q || codes_q;
      shadow_word_q   <= shadow_d;
      observed_word_q <= observed_d;
    end
  end

  reg  [31:0] readdata_d;
  reg  [ 1:0] response_d;
  reg  [31:0] readdata_q;
  reg  [ 1:0] response_q;
  reg         readdatavalid_q;
  reg         writeresponsevalid_q;

  wire [ 6:0] live = {commit_pending_q || take_q || clear_pending_q, live_i};

  always @* begin
    readdata_d = 32'd0;
    response_d = RESP_OKAY;
    if (config2_q) begin
      readdata_d = shadow_word_q;
    end else if (observed2_q) begin
      readdata_d = observed_word_q;
      if (write2_q) response_d = RESP_REFUSED;
    end else begin
      case (address2_q)
        ADDR_SCRATCH: readdata_d = scratch_q;
        ADDR_CONTROL: readdata_d = {30'd0, control_q};
        ADDR_COMMAND, ADDR_FX_DATA: readdata_d = 32'd0;
        ADDR_FX_ADDRESS: readdata_d = {18'd0, fx_address_q};
        ADDR_STATUS: readdata_d = {21'd0, status_q};
        default: begin
          if (write2_q) response_d = RESP_REFUSED;
          case (address2_q)
            ADDR_ID:            readdata_d = MAP_ID;
            ADDR_VERSION:       readdata_d = MAP_VERSION;
            ADDR_BUILD:         readdata_d = BUILD_ID;
            ADDR_LIVE:          readdata_d = {25'd0, live};
            ADDR_CYCLES_LO:     readdata_d = cycles_q[31:0];
            ADDR_CYCLES_HI:     readdata_d = cycles_hi_q;
            ADDR_STEPS_LO:      readdata_d = steps_seen_q[31:0];
            ADDR_STEPS_HI:      readdata_d = steps_seen_q[63:32];
            ADDR_SERIAL_ERRORS: readdata_d = {16'd0, serial_errors_q};
            ADDR_LATENCY:       readdata_d = observed_word_q;
            default:            response_d = RESP_NONE;
          endcase
        end
      endcase
    end
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      readdata_q           <= 32'd0;
      response_q           <= 2'd0;
      readdatavalid_q      <= 1'b0;
      writeresponsevalid_q <= 1'b0;
    end else begin
      readdata_q           <= read2_q ? readdata_d : 32'd0;
      response_q           <= response_d;
      readdatavalid_q      <= read2_q;
      writeresponsevalid_q <= write2_q;
    end
  end

  assign avs_readdata_o           = readdata_q;
  assign avs_readdatavalid_o      = readdatavalid_q;
  assign avs_writeresponsevalid_o = writeresponsevalid_q;
  assign avs_response_o           = response_q;
  assign run_o                    = control_q[BIT_CONTROL_RUN];
  assign blank_o                  = control_q[BIT_CONTROL_BLANK];
  assign config_o                 = active_q;
  assign clear_o                  = clear_q;

endmodule

`default_nettype wire
