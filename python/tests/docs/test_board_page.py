"""The wiring on the board's page is that of the project that is compiled."""

import re
from pathlib import Path

from rtds_host.compat import tomllib

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "board.md").read_text()
PINS = dict(re.findall(r"set_location_assignment PIN_(\w+) -to (\S+)", (ROOT / "quartus" / "rtds.qsf").read_text()))
SIGNALS = {signal: pin for pin, signal in PINS.items()}


def rows(header):
    """Rows of (signal, index on the header, header's pin, FPGA's pin) of one table."""
    section = PAGE.split(f"### {header}")[1].split("\n### ")[0]
    found = re.findall(r"\| `([\w\[\]]+)`[^|]*\| (\d+) \| (\d+) \| (\w+) \|", section)
    return [(signal, int(index), int(pin), fpga) for signal, index, pin, fpga in found]


def header_pin(index):
    """Pin of a 40-pin header of Terasic's, where 11, 12, 29 and 30 are supplies and ground."""
    return index + 1 + 2 * (index >= 10) + 2 * (index >= 26)


def test_every_wire_of_both_headers_is_on_the_page_with_its_pin():
    board = tomllib.loads((ROOT / "quartus" / "de10_nano.toml").read_text())
    for header, title in (("GPIO_0", "DAC board on GPIO_0"), ("GPIO_1", "Serial adapter on GPIO_1")):
        table = rows(title)
        assert {signal for signal, *_ in table} == {
            s for s in SIGNALS if board["headers"].get(s.split("[")[0], [""])[0] == header
        }
        for signal, index, pin, fpga in table:
            assert SIGNALS[signal] == fpga == board[header][index], signal
            assert pin == header_pin(index), signal


def test_the_adcs_pins_are_those_of_the_board():
    for signal in ("CONVST", "SCK", "SDI", "SDO"):
        assert re.search(rf"{signal}\s+{SIGNALS['ADC_' + signal]}\b", PAGE)


def test_the_leds_mean_what_the_chip_drives():
    report = (ROOT / "rtl" / "top" / "rtds_report.v").read_text()
    order = re.search(r"// --- LEDs: (.+?) -+\n", report)[1].split(", ")
    table = re.findall(r"^\| ([0-7]) \| ([^|]+) \|", PAGE, re.MULTILINE)
    assert [int(number) for number, _ in table] == list(range(8))
    words = ["alive", "locked", "halted", "safe value", "parameter set refused", "ADC alive", "serial", "running"]
    assert len(order) == 8 and all(word in text for word, (_, text) in zip(words, table))
