"""ADC path: the LTC2308 model against its data sheet, the sequencer against the model, faults against both."""

from __future__ import annotations

from pathlib import Path

import pytest
from common.runner import BUILD, ROOT, SIMULATORS, run_cocotb

RTL = ("rtl/vendor/altddio_out.v", "rtl/io/ltc2308_spi_sck.v", "rtl/io/ltc2308_spi.v", "rtl/io/adc_sequencer.v")
BENCH = ("tb/agents/ltc2308.v", "tb/adc/adc_tb.v")

# name: (file, text of the right design, text of the fault, what must be noticed)
FAULTS = {
    "lsb_first": (
        "ltc2308_spi.v",
        "{1'b1, next_ch_i[0], next_ch_i[2:1], 2'b10}",
        "{2'b01, next_ch_i[1], next_ch_i[2], next_ch_i[0], 1'b1}",
        "WORD_MODE",
    ),
    "short_convst": (
        "ltc2308_spi.v",
        "assign adc_convst_o = convst_q;",
        "assign adc_convst_o = convst_q && cnv_q;",
        "CONVST_SHORT",
    ),
    "late_convst_low": (
        "ltc2308_spi.v",
        "else         cnv_q <= start;",
        "else         cnv_q <= start || (cnv_q && count_q == 7'd0);",
        "CONVST_LATE_LOW",
    ),
    "early_sck": ("ltc2308_spi.v", "CONVERSION = 7'd64", "CONVERSION = 7'd60", "SCK_EARLY"),
    "one_phase_for_convst_and_sck": (
        "ltc2308_spi.v",
        "always @(posedge clk_cnv_i or",
        "always @(negedge clk_i or",
        "SCK_EARLY",
    ),
    "too_fast_a_cycle": ("ltc2308_spi.v", "CYCLE = 7'd80", "CYCLE = 7'd79", "CYCLE_SHORT"),
    "acquisition_too_short": ("ltc2308_spi.v", "CONVERSION = 7'd64", "CONVERSION = 7'd65", "ACQUISITION"),
    "one_pulse_missing": ("ltc2308_spi.v", "BITS = 7'd12", "BITS = 7'd11", "SCK_COUNT"),
    "sdi_moves_with_rising_sck": (
        "ltc2308_spi.v",
        "always @(posedge clk_i or negedge rst_ni) begin\n    if (!rst_ni)   word_q",
        "always @(negedge clk_i or negedge rst_ni) begin\n    if (!rst_ni)   word_q",
        "SDI_HOLD",
    ),
    "half_period_capture": (
        "ltc2308_spi.v",
        "always @(posedge clk_i or negedge rst_ni) begin\n    if (!rst_ni) sdo_q",
        "always @(negedge clk_i or negedge rst_ni) begin\n    if (!rst_ni) sdo_q",
        "WRONG_CODE",
    ),
    "pipeline_off_by_one": (
        "adc_sequencer.v",
        "now_slot_q  <= next_slot_q;",
        "now_slot_q  <= next_is_last ? SLOT_P : next_slot_q + 3'd1;",
        "WRONG_CODE",
    ),
    "channel_bits_swapped": (
        "ltc2308_spi.v",
        "next_ch_i[0], next_ch_i[2:1]",
        "next_ch_i[2], next_ch_i[1:0]",
        "WRONG_CODE",
    ),
    "first_word_assumed_known": (
        "adc_sequencer.v",
        "next_slot_q  <= SLOT_P;",
        "next_slot_q  <= SLOT_T_L;",
        "WRONG_CODE",
    ),
}


def bench(simulator: str, test_module: str, top: str = "adc_tb", sources=(*BENCH, *RTL), **more) -> None:
    run_cocotb(
        top,
        sources,
        test_module,
        Path("tb/adc"),
        simulator,
        build_args=["--timing", "-CFLAGS", "-std=c++20 -O0"],  # coroutines
        **more,
    )


def test_model_of_the_part():
    bench(SIMULATORS[-1], "tb_ltc2308", top="ltc2308", sources=("tb/agents/ltc2308.v",))


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_sequencer(simulator):
    bench(simulator, "tb_adc")


def mutate(name: str) -> list[Path]:
    """Copies of the RTL with one fault in them."""
    file, right, wrong, _ = FAULTS[name]
    folder = BUILD / "adc-faults" / name
    folder.mkdir(parents=True, exist_ok=True)
    copies = []
    for source in RTL:
        text = (ROOT / source).read_text()
        if source.endswith("/" + file):
            assert text.count(right) == 1, f"{name}: the design has changed, this fault no longer fits"
            text = text.replace(right, wrong)
        copies.append(folder / Path(source).name)
        copies[-1].write_text(text)
    return copies


# A mutated copy is built in 0.1 s by Icarus and in 10 s by Verilator, which alone gets two of them.
@pytest.mark.parametrize("name", FAULTS if "icarus" in SIMULATORS else ("early_sck", "pipeline_off_by_one"))
def test_fault_is_caught(name):
    bench(
        SIMULATORS[-1],
        "tb_adc",
        sources=(*BENCH, *mutate(name)),
        testcase="a_fault_is_caught",
        defines={f"FAULT_{name}": 1},
        extra_env={"FAULT_EXPECTED": FAULTS[name][3]},
    )
