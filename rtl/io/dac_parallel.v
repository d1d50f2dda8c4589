// dac_parallel: writes four codes to a DAC7624 or DAC7625 and updates its outputs with one LDAC.
//
// Handshake  write_i for one clock while ready_o is 1 takes code_i (output c at 12*c+11..12*c, c = A B C D). A
//            write_i while ready_o is 0 is not taken: dropped_o is 1 in that clock.
//
// Latency    22 clocks of 50 MHz from the edge that takes write_i to the falling edge of LDAC. At the pins' registers,
//            in clocks from that edge:
//              5c      address and data of output c (20 ns before CS, 20 ns after it)
//              5c+1    CS low, 5c+4 CS high (60 ns; the part wants 50)
//              22      LDAC low: 60 ns after the last CS high (50 wanted)
//              25      LDAC high (60 ns; 50 wanted), ready_o; the next CS is 80 ns or more after 22 (70 wanted)
//            The four outputs move with that one edge of LDAC: never torn.
//
// Safe value SAFE_CODE (mid-scale: 0 A, 0 rad/s). While rst_pin_ni is 0 (reset, lock lost) /RESET is low, at once and
//            without a clock: a DAC7624 then shows mid-scale by itself, a DAC7625 zero-scale. rst_ni may follow a few
//            clocks later and has to last longer than that; it is released no earlier. After release
//            /RESET stays low for 5 clocks more, then the safe codes are written, then ready_o rises. fault_i
//            (level, or a pulse of one clock): a running transfer is finished, its values being whole; then the
//            safe codes are written once, and ready_o stays 0 until fault_i falls. From fault_i to the LDAC of
//            the safe value: 22 clocks when idle, at most 47. safe_o: the outputs show the written safe value.
//
// updated_o  one clock, that of the falling edge of LDAC: what is inside looks at it and not at the pin.
//
// SDC        Output delays against the 50 MHz clock; each pin is a register that feeds its pin alone, as it stands at the pin, so
//            that it can be placed in the pin's cell. R/W is tied low: output only.
`default_nettype none

module dac_parallel #(
  parameter [11:0] SAFE_CODE = 12'h800
) (
  input  wire        clk_i,        // 50 MHz
  input  wire        rst_ni,       // everything but the pin's register
  input  wire        rst_pin_ni,   // asserted asynchronously, also on lost lock
  input  wire        write_i,
  input  wire [47:0] code_i,
  input  wire        fault_i,      // in the clk_i domain
  output wire        ready_o,
  output wire        dropped_o,
  output wire        safe_o,
  output wire        updated_o,
  // pins
  output wire [11:0] dac_db_o,
  output wire [ 1:0] dac_a_o,
  output wire        dac_cs_no,
  output wire        dac_rw_o,
  output wire        dac_ldac_no,
  output wire        dac_reset_no
);

  localparam [2:0] LAST_PHASE = 3'd4;
  localparam [2:0] SLOT_LDAC = 3'd4;    // slots 0 to 3: outputs A to D
  localparam [2:0] RESET_CLOCKS = 3'd4;

  // The part's reset outlasts ours by a few clocks: 100 ns where 50 are wanted, however short ours was.
  reg  [2:0] boot_q;
  reg        reset_off_q;
  reg        pin_q;        // the same, for the pin alone
  wire       booted = (boot_q == RESET_CLOCKS);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      boot_q      <= 3'd0;
      reset_off_q <= 1'b0;
    end else begin
      if (!booted) boot_q <= boot_q + 3'd1;
      reset_off_q <= booted;
    end
  end

  always @(posedge clk_i or negedge rst_pin_ni) begin
    if (!rst_pin_ni) pin_q <= 1'b0;
    else             pin_q <= booted;
  end

  // What to write next. calm_q: no safe write is owed (0 after reset, and after a fault has begun).
  reg  busy_q;
  reg  calm_q;
  reg  fault_q;
  wire fault_begins = fault_i && !fault_q;
  wire idle = reset_off_q && !busy_q;
  wire start_safe = idle && (!calm_q || fault_begins);
  wire start_write = write_i && ready_o;
  wire start = start_safe || start_write;

  assign ready_o   = idle && calm_q && !fault_i;
  assign dropped_o = write_i && !ready_o;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      calm_q  <= 1'b0;
      fault_q <= 1'b0;
    end else begin
      fault_q <= fault_i;
      if (start_safe)        calm_q <= 1'b1;
      else if (fault_begins) calm_q <= 1'b0;
    end
  end

  // One transfer: clock number 5 * slot + phase.
  reg  [2:0] slot_q;
  reg  [2:0] phase_q;
  wire       phase_last = (phase_q == LAST_PHASE);
  wire       ldac_slot = (slot_q == SLOT_LDAC);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      busy_q  <= 1'b0;
      slot_q  <= 3'd0;
      phase_q <= 3'd0;
    end else if (start) begin
      busy_q  <= 1'b1;
      slot_q  <= 3'd0;
      phase_q <= 3'd0;
    end else if (busy_q) begin
      phase_q <= phase_last ? 3'd0 : phase_q + 3'd1;
      if (phase_last) slot_q <= slot_q + 3'd1;
      if (phase_last && ldac_slot) busy_q <= 1'b0;
    end
  end

  // Address and data: the output being written at the pins, the others behind it.
  reg  [47:0] data_q;
  reg  [ 1:0] address_q;
  wire        next_output = busy_q && phase_last && (slot_q < 3'd3);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      data_q    <= 48'd0;
      address_q <= 2'd0;
    end else if (start) begin
      data_q    <= start_safe ? {4{SAFE_CODE}} : code_i;
      address_q <= 2'd0;
    end else if (next_output) begin
      data_q    <= {12'd0, data_q[47:12]};
      address_q <= slot_q[1:0] + 2'd1;
    end
  end

  // Strobes: registers, so that no decoding glitch reaches a pin.
  reg  cs_n_q;
  reg  ldac_n_q;
  wire cs = busy_q && !ldac_slot && (phase_q < 3'd3);
  wire ldac = busy_q && ldac_slot && (phase_q != 3'd0) && !phase_last;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      cs_n_q   <= 1'b1;
      ldac_n_q <= 1'b1;
    end else begin
      cs_n_q   <= !cs;
      ldac_n_q <= !ldac;
    end
  end

  // Which value the outputs show: it changes when LDAC falls.
  reg  writing_safe_q;
  reg  safe_q;
  reg  updated_q;
  wire update = busy_q && ldac_slot && (phase_q == 3'd1);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      writing_safe_q <= 1'b0;
      safe_q         <= 1'b0;
      updated_q      <= 1'b0;
    end else begin
      updated_q      <= update;
      if (start) writing_safe_q <= start_safe;
      if (update) safe_q <= writing_safe_q;
    end
  end

  assign safe_o       = safe_q;
  assign updated_o    = updated_q;
  assign dac_db_o     = data_q[11:0];
  assign dac_a_o      = address_q;
  assign dac_cs_no    = cs_n_q;
  assign dac_rw_o     = 1'b0;
  assign dac_ldac_no  = ldac_n_q;
  assign dac_reset_no = pin_q;

`ifdef FORMAL
  // Invariants for tb/formal: the counters stay within a transfer, the strobes follow them.
  always @* begin
    assert (phase_q <= LAST_PHASE && slot_q <= (busy_q ? SLOT_LDAC : SLOT_LDAC + 3'd1) && boot_q <= RESET_CLOCKS);
    if (!booted) assert (!reset_off_q);
    if (!reset_off_q) assert (!busy_q && cs_n_q && ldac_n_q && !calm_q);
    assert (cs_n_q || ldac_n_q);
    if (!busy_q) assert (cs_n_q && ldac_n_q);
    if (busy_q && !ldac_slot) begin
      assert (cs_n_q == !(phase_q >= 3'd1 && phase_q <= 3'd3) && ldac_n_q && address_q == slot_q[1:0]);
    end
    if (busy_q && ldac_slot) assert (cs_n_q && ldac_n_q == (phase_q < 3'd2));
    assert (updated_q == (busy_q && ldac_slot && phase_q == 3'd2));
  end
`endif

endmodule

`default_nettype wire
