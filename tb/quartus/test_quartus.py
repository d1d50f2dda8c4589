"""quartus/ against the design: every port has its pin, every constraint matches something, no crossing is forgotten.

Quartus itself is not run: these tests compare its input files with the top as Yosys elaborates it.
"""

import os
import re
import subprocess

import pytest
from common.runner import ROOT, read_file_list

from quartus import board_files as files


@pytest.fixture(scope="module")
def elaborated(tmp_path_factory):
    return files.elaborate(tmp_path_factory.mktemp("elaborate"))


@pytest.fixture(scope="module")
def design(elaborated):
    return elaborated[0]


@pytest.fixture(scope="module")
def flat(elaborated):
    return elaborated[1]


@pytest.fixture(scope="module")
def qsf():
    return files.read_qsf(files.QSF.read_text())


@pytest.fixture(scope="module")
def sdc():
    return files.sdc_commands(files.SDC.read_text())


def pin_problems(ports, qsf, board):
    """What is wrong with the pins: the tests below want an empty list, and a list for each deliberate fault."""
    problems = []
    placed = dict(qsf.pins)
    standards = {port: value for name, value, port in qsf.instances if name == "IO_STANDARD"}
    problems += [f"{port}: no pin" for port in ports if port not in placed]
    problems += [f"{port}: no I/O standard" for port in ports if standards.get(port) != "3.3-V LVTTL"]
    names = [port for port, _ in qsf.pins] + [port for _, _, port in qsf.instances]
    problems += [f"{port}: no such port" for port in sorted(set(names) - set(ports))]
    used = [pin for _, pin in qsf.pins]
    problems += [f"{pin}: used {used.count(pin)} times" for pin in sorted(set(used)) if used.count(pin) > 1]
    assigned = [port for port, _ in qsf.pins]
    problems += [f"{port}: placed {assigned.count(port)} times" for port in sorted(set(assigned)) if assigned.count(port) > 1]
    for port, pin in qsf.pins:
        name, index = re.fullmatch(r"(\w+?)(?:\[(\d+)\])?", port).groups()
        signal, first = board["headers"].get(name, (name, 0))
        wanted = board.get(signal, [])
        position = first + int(index or 0)
        if position >= len(wanted) or wanted[position] != pin:
            problems.append(f"{port}: at {pin}, the board has it elsewhere")
    return problems


def test_every_port_has_its_pin_of_the_board(design, qsf):
    assert pin_problems(design.ports, qsf, files.board()) == []


@pytest.mark.parametrize(
    "fault, finds",
    [
        (("-to LED[7]", "-to LED[8]"), "LED[7]: no pin"),
        (("PIN_U9 -to ADC_CONVST", "PIN_V10 -to ADC_CONVST"), "V10: used 2 times"),
        (("PIN_V12 -to DAC_DB[0]", "PIN_E8 -to DAC_DB[0]"), "DAC_DB[0]: at E8, the board has it elsewhere"),
        (('"3.3-V LVTTL" -to KEY[0]', '"2.5 V" -to KEY[0]'), "KEY[0]: no I/O standard"),
        (("set_location_assignment PIN_AC4 -to ADC_SDI\n", ""), "ADC_SDI: no pin"),
    ],
)
def test_a_wrong_pin_is_found(design, fault, finds):
    text = files.QSF.read_text()
    assert fault[0] in text
    assert finds in pin_problems(design.ports, files.read_qsf(text.replace(*fault)), files.board())


def test_project_lists_exactly_the_design(qsf):
    listed = [(ROOT / "quartus" / name).resolve() for name in qsf.values("VERILOG_FILE")]
    assert listed == read_file_list(files.FILE_LIST)
    assert qsf.values("TOP_LEVEL_ENTITY") == [files.TOP]
    assert qsf.values("DEVICE") == ["5CSEBA6U23I7"]
    assert [(ROOT / "quartus" / name).exists() for name in qsf.values("SDC_FILE")] == [True]
    assert "PROJECT_REVISION" in (ROOT / "quartus" / "rtds.qpf").read_text()


def unmatched(commands, design):
    """Patterns of constraints that match nothing."""
    clocks = {m[1] for c in commands if (m := re.search(r"create\w*_clock -name (\w+)", c))}
    problems = []
    for command in commands:
        for kind, pattern in files.sdc_patterns(command):
            if kind == "get_ports":
                ok = any(files.matches(pattern, port) for port in design.ports)
            elif kind == "get_registers":
                ok = any(files.matches(pattern, register) for register in design.registers)
            elif kind == "get_clocks":
                ok = pattern in clocks
            elif "PLL_OUTPUT_COUNTER" in pattern:  # made by the fitter inside the primitive
                head = re.fullmatch(r"\*(\w+)\|(\w+)\|\*general\[(\d)\]\.gpll~PLL_OUTPUT_COUNTER\|divclk", pattern)
                paths = [p for p, module in design.instances.items() if module == "altera_pll"]
                ok = bool(head) and any(p.endswith(f":{head[1]}|altera_pll:{head[2]}") for p in paths)
            else:
                register, _, pin = pattern.rpartition("|")
                ok = pin == "clrn" and any(files.matches(register, r) for r in design.registers)
            if not ok:
                problems.append(f"{kind} {pattern}")
        for clock in re.findall(r"-clock (\w+)", command):
            if clock not in clocks:
                problems.append(f"clock {clock}")
    return problems


def test_every_constraint_matches_something(design, sdc):
    assert unmatched(sdc, design) == []


@pytest.mark.parametrize(
    "fault, finds",
    [
        (("{ADC_SDI}", "{ADC_SDA}"), "get_ports ADC_SDA"),
        (("cdc_meta_q", "cdc_meta_r"), "get_registers *cdc_sync:*|cdc_meta_r"),
        (("rst_out_q|clrn", "rst_end_q|clrn"), "get_pins *reset_sync:*|rst_end_q|clrn"),
        (("-clock adc_sck", "-clock adc_clk"), "clock adc_clk"),
        (("*u_pll_adc|u_pll|", "*u_pll_adc|u_pll2|"), "get_pins *u_pll_adc|u_pll2|*general[0].gpll~PLL_OUTPUT_COUNTER|divclk"),
    ],
)
def test_a_constraint_that_matches_nothing_is_found(design, fault, finds):
    text = files.SDC.read_text()
    assert fault[0] in text
    assert finds in unmatched(files.sdc_commands(text.replace(*fault)), design)


def test_every_pin_is_constrained(design, sdc):
    """Each port is a clock, has an input or output delay or a bound, or is cut on purpose."""
    patterns = [pattern for command in sdc for kind, pattern in files.sdc_patterns(command) if kind == "get_ports"]
    missing = [port for port in design.ports if not any(files.matches(pattern, port) for pattern in patterns)]
    assert missing == []


def test_clocks_are_those_of_the_pll(sdc):
    source = (ROOT / "rtl/io/pll_adc.v").read_text()
    settings = dict(re.findall(r'\.(\w+)\("([^"]*)"\)', source))
    board_clock = next(c for c in sdc if c.startswith("create_clock"))
    assert 1000 / float(re.search(r"-period ([\d.]+)", board_clock)[1]) == float(
        settings["reference_clock_frequency"].removesuffix(" MHz")
    )
    outputs = [c for c in sdc if c.startswith("create_generated_clock") and "-multiply_by" in c]
    assert len(outputs) == int(re.search(r"\.number_of_clocks\((\d)\)", source)[1])
    for number, command in enumerate(outputs):
        multiply, divide = (int(re.search(rf"-{key} (\d+)", command)[1]) for key in ("multiply_by", "divide_by"))
        phase = float(m[1]) if (m := re.search(r"-phase ([\d.]+)", command)) else 0.0
        frequency = float(settings[f"output_clock_frequency{number}"].removesuffix(" MHz"))
        assert 50.0 * multiply / divide == frequency
        assert phase / 360.0 * 1e6 / frequency == float(settings[f"phase_shift{number}"].removesuffix(" ps"))
        assert f"general[{number}]" in command


def test_every_crossing_goes_through_a_synchroniser(flat):
    """No register of one clock is read by another one but through cdc_sync or the held word of cdc_handshake."""
    found = files.crossings(flat)
    assert found, "there are crossings in this design"
    for source, from_clock, destination, to_clock in found:
        if destination.endswith("convst_q"):
            assert source.endswith("cnv_q"), source  # clk_adc -> clk_cnv: synchronous, 7.5 ns, timed as it is
        elif re.search(r"cdc_data_q", destination):
            # The word, or its destination's own request (which decides when it is taken).
            assert source.endswith("cdc_hold_q"), f"{source} -> {destination}"
        else:
            assert re.search(r"cdc_meta_q$", destination), f"{source} ({from_clock}) -> {destination} ({to_clock})"


def test_compile_script_says_what_is_missing(tmp_path):
    """Without Quartus: one line that names it, and a status that is not success."""
    for tool in ("dirname", "sh", "git", "cut"):
        (tmp_path / tool).symlink_to(f"/usr/bin/{tool}" if os.path.exists(f"/usr/bin/{tool}") else f"/bin/{tool}")
    done = subprocess.run(
        [ROOT / "quartus" / "compile.sh"], env={"PATH": str(tmp_path)}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr.strip() == "quartus_sh is not on PATH: install Quartus Prime Lite with Cyclone V support"
