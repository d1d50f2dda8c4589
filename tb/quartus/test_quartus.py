"""quartus/ against the design: every port has its pin, every constraint matches something, nothing is without one.

Quartus itself is not run: these tests compare its input files with the top as Yosys elaborates it.
"""

import os
import re
import shutil
import subprocess

import pytest
from common.own_registers import OWN_REGISTERS
from common.runner import ROOT, headers, read_file_list

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
def gated(elaborated):
    return elaborated[2]


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
    names = [port for port, _ in qsf.pins] + [port for name, _, port in qsf.instances if name != "DONT_MERGE_REGISTER"]
    problems += [f"{port}: no such port" for port in sorted(set(names) - set(ports))]
    used = [pin for _, pin in qsf.pins]
    problems += [f"{pin}: used {used.count(pin)} times" for pin in sorted(set(used)) if used.count(pin) > 1]
    assigned = [port for port, _ in qsf.pins]
    problems += [
        f"{port}: placed {assigned.count(port)} times" for port in sorted(set(assigned)) if assigned.count(port) > 1
    ]
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


def own_register_problems(registers, qsf):
    """Registers that Quartus may join with those of other instances, and assignments for none."""
    patterns = [place for name, value, place in qsf.instances if (name, value) == ("DONT_MERGE_REGISTER", "ON")]
    wanted = {
        register
        for register in registers
        for module, names in OWN_REGISTERS.items()
        if re.search(rf"\b{module}:\w+(?:\[\d+\]\.\w+)?\|(?:{'|'.join(names)})(?:\[|$)", register)
    }
    found = {register for register in registers if any(files.matches(pattern, register) for pattern in patterns)}
    idle = [pattern for pattern in patterns if not any(files.matches(pattern, register) for register in registers)]
    problems = [f"{register}: may be joined" for register in sorted(wanted - found)]
    problems += [f"{register}: is kept without need" for register in sorted(found - wanted)]
    return problems + [f"{pattern}: no such register" for pattern in idle]


def test_each_instance_keeps_its_own_control_registers(design, qsf):
    assert own_register_problems(design.registers, qsf) == []
    names = {register for names in OWN_REGISTERS.values() for register in names}
    assert names <= {re.sub(r"\[\d+\]$", "", register.rsplit("|", 1)[1]) for register in design.registers}


@pytest.mark.parametrize(
    "fault, finds",
    [
        (("|mul_q[*]", "|mull_q[*]"), "*|rtds_row:*|mull_q[*]: no such register"),
        (("*|rtds_motor:*|ahead_q", "*|rtds_row:*|p_q[*]"), "may be joined"),
        (("|save_lo_q", "|lo_q[*]"), "is kept without need"),
    ],
)
def test_a_register_that_may_be_joined_is_found(design, fault, finds):
    text = files.QSF.read_text()
    assert text.count(fault[0]) == 1
    assert any(
        finds in problem for problem in own_register_problems(design.registers, files.read_qsf(text.replace(*fault)))
    )


# What Quartus Prime 20 to 23 leaves behind: the lines it adds at a first compilation, and how it writes those it knows.
LEFT_BY_QUARTUS = """# -------------------------------------------------------------------------- #
#
# Copyright (C) 2020  Intel Corporation. All rights reserved.
# Quartus Prime
# Version 20.1.1 Build 720 11/11/2020 SJ Lite Edition
#
# -------------------------------------------------------------------------- #

set_global_assignment -name ORIGINAL_QUARTUS_VERSION 20.1.1
set_global_assignment -name PROJECT_CREATION_TIME_DATE "20:12:44  NOVEMBER 26, 2026"
set_global_assignment -name LAST_QUARTUS_VERSION "20.1.1 Lite Edition"
set_global_assignment -name MIN_CORE_JUNCTION_TEMP "-40"
set_global_assignment -name MAX_CORE_JUNCTION_TEMP 100
set_global_assignment -name ERROR_CHECK_FREQUENCY_DIVISOR 256
set_global_assignment -name POWER_PRESET_COOLING_SOLUTION "23 MM HEAT SINK WITH 200 LFPM AIRFLOW"
set_global_assignment -name PARTITION_NETLIST_TYPE SOURCE -section_id Top
set_global_assignment -name PARTITION_FITTER_PRESERVATION_LEVEL PLACEMENT_AND_ROUTING -section_id Top
set_global_assignment -name PARTITION_COLOR 16764057 -section_id Top
set_parameter -name BUILD_ID 64146125
set_instance_assignment -name PARTITION_HIERARCHY root_partition -to | -section_id Top
"""


def as_quartus_leaves_it():
    """rtds.qsf after a first compilation: with Quartus's own lines, its own order of quotes, and an entity's name."""
    text = files.QSF.read_text().replace("-to ADC_SDI", '-to "ADC_SDI" -entity rtds_top')
    return text.replace(" -name DEVICE 5CSEBA6U23I7", ' -name DEVICE "5CSEBA6U23I7"') + "\n" + LEFT_BY_QUARTUS


def test_a_project_that_quartus_has_compiled_is_read_as_the_one_before(design, qsf):
    left = files.read_qsf(as_quartus_leaves_it())
    assert left.pins == [(port, pin) for port, pin in qsf.pins] and left.instances == qsf.instances
    assert pin_problems(design.ports, left, files.board()) == []
    assert [item for item in left.globals if item in qsf.globals] == qsf.globals
    assert left.values("LAST_QUARTUS_VERSION") == ["20.1.1 Lite Edition"]
    assert left.parameters == [("BUILD_ID", "64146125")]
    assert len(left.partitions) == 4


@pytest.mark.parametrize("line", ["set_location_assignment PIN_ -to LED[0]", "set_parameter BUILD_ID 5", "puts hello"])
def test_a_line_that_is_no_assignment_is_refused(line):
    with pytest.raises(ValueError, match="cannot read"):
        files.read_qsf(line)


def test_registers_at_the_pins_can_be_placed_in_the_pins_cells(elaborated, qsf):
    """No inverter and no second reader, or FAST_OUTPUT_REGISTER and FAST_INPUT_REGISTER would be wishes."""
    assert files.packing_problems(elaborated[3], qsf) == []


@pytest.mark.parametrize(
    "file, fault, finds",
    [
        ("dac_parallel.v", ("dac_cs_no    = cs_n_q", "dac_cs_no    = !cs_n_q"), "DAC_CS_N: logic between"),
        ("dac_parallel.v", ("slot_q[1:0] + 2'd1;", "address_q + 2'd1;"), "DAC_A[0]: its register feeds"),
        (
            "rtds_chip.v",
            (".dac_ldac_ni     (!dac_updated)", ".dac_ldac_ni     (dac_ldac_no)"),
            "DAC_LDAC_N: its register feeds",
        ),
        ("ltc2308_spi.v", ("sdo_q <= adc_sdo_i;", "sdo_q <= !adc_sdo_i;"), "ADC_SDO: does not go straight"),
    ],
)
def test_a_register_that_cannot_be_placed_in_its_pins_cell_is_found(tmp_path, qsf, file, fault, finds):
    _, _, _, enabled = files.elaborate(tmp_path, {file: fault})
    assert any(problem.startswith(finds) for problem in files.packing_problems(enabled, qsf))


def test_project_lists_exactly_the_design(qsf):
    listed = [(ROOT / "quartus" / name).resolve() for name in qsf.values("VERILOG_FILE")]
    assert listed == read_file_list(files.FILE_LIST)
    assert qsf.values("TOP_LEVEL_ENTITY") == [files.TOP]
    assert qsf.values("DEVICE") == ["5CSEBA6U23I7"]
    assert [(ROOT / "quartus" / name).exists() for name in qsf.values("SDC_FILE")] == [True]
    assert "PROJECT_REVISION" in (ROOT / "quartus" / "rtds.qpf").read_text()
    found = {(ROOT / "quartus" / name).resolve() for name in qsf.values("SEARCH_PATH")}
    assert found == {header.parent for header in headers([files.FILE_LIST])}


# What Quartus may make of the name of a register: with the modules' names or the instances' alone, its copy (the
# fitter's), or the one in an output cell.
NAMINGS = {
    "modules and instances": lambda name: name,
    "instances": lambda name: re.sub(r"\w+:", "", name),
    "a copy": lambda name: f"{name}~DUPLICATE",
    "an output's register": lambda name: re.sub(r"\w+:", "", re.sub(r"(\[\d+\])?$", r"~reg0\1", name)),
}


def own_name(register):
    """Of u_chip|u_record|cdc_hold_q[3]: cdc_hold_q."""
    return re.sub(r"\[\d+\]$", "", register.rpartition("|")[2])


def unmatched(commands, design):
    """Patterns of constraints that match nothing, or registers of several names."""
    clocks = {m[1] for c in commands if (m := re.search(r"create\w*_clock -name (\w+)", c))}
    problems = []
    for command in commands:
        for kind, pattern in files.sdc_patterns(command):
            if kind == "get_ports":
                ok = any(files.matches(pattern, port) for port in design.ports)
            elif kind == "get_registers":
                found = [{r for r in design.registers if files.matches(pattern, name(r))} for name in NAMINGS.values()]
                ok = len({own_name(r) for r in found[0]}) == 1 and all(f == found[0] for f in found)
            elif kind == "get_clocks":
                ok = pattern in clocks
            else:  # made by the fitter inside the PLL
                head = re.fullmatch(r"\*(\w+)\|(\w+)\|\*general\[(\d)\]\.gpll~PLL_OUTPUT_COUNTER\|divclk", pattern)
                paths = [p for p, module in design.instances.items() if module == "altera_pll"]
                ok = bool(head) and any(p.endswith(f":{head[1]}|altera_pll:{head[2]}") for p in paths)
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
        (("*cdc_meta_q*", "*cdc_meta_r*"), "get_registers *cdc_meta_r*"),
        (
            ("*cdc_meta_q*", "*cdc_sync:*|cdc_meta_q"),
            "get_registers *cdc_sync:*|cdc_meta_q",
        ),  # Quartus may leave `cdc_sync:` out
        (("*cdc_hold_q*", "*cdc_*_q*"), "get_registers *cdc_*_q*"),
        (("*rst_out_q*", "*rst_out_q|clrn"), "get_registers *rst_out_q|clrn"),
        (("-clock adc_sck", "-clock adc_clk"), "clock adc_clk"),
        (
            ("*u_pll_adc|u_pll|", "*u_pll_adc|u_pll2|"),
            "get_pins *u_pll_adc|u_pll2|*general[0].gpll~PLL_OUTPUT_COUNTER|divclk",
        ),
    ],
)
def test_a_constraint_that_matches_nothing_is_found(design, fault, finds):
    text = files.SDC.read_text()
    assert fault[0] in text
    assert finds in unmatched(files.sdc_commands(text.replace(*fault)), design)


def unbounded(commands, design):
    """Ports without a constraint: each is a clock, has the longest and the shortest delay, or is cut on purpose."""
    problems = []
    for port, direction in design.ports.items():
        mine = [
            c for c in commands if any(k == "get_ports" and files.matches(p, port) for k, p in files.sdc_patterns(c))
        ]
        delays = {d for c in mine for d in ("-max", "-min") if c.startswith(f"set_{direction}_delay") and d in c}
        if not (delays == {"-max", "-min"} or any(re.match("create|set_false_path", c) for c in mine)):
            problems.append(port)
    return problems


def test_every_pin_is_constrained(design, sdc):
    assert unbounded(sdc, design) == []


@pytest.mark.parametrize("port", ["ADC_CONVST", "ADC_SDO", "DAC_LDAC_N", "UART_RX", "ADC_SCK"])
def test_a_pin_without_a_bound_is_found(design, sdc, port):
    """Either bound taken away, or the only constraint."""
    for number, command in enumerate(sdc):
        if re.search(rf"[{{ ]{port}\b", command):
            assert port in unbounded([*sdc[:number], command.replace(port, "LED[0]"), *sdc[number + 1 :]], design)


def test_convst_stays_in_its_window(sdc):
    """Whatever the pads' delays within the bounds: SCK rises 1600 to 1610 ns after CONVST, 0.5 ns of board either way.

    The bounds are those of ADC_CONVST against the clock at ADC_SCK's pad. With equal delays CONVST stands at the pad
    7.5 ns after clk_adc's edge, SCK rises 12.5 ns after it and then every 25 ns; the first pulse of a cycle is that of
    edge 64.
    """
    period, cnv, sck = 25.0, 7.5, 12.5
    largest, smallest = (
        float(re.search(rf"-{bound} (\S+)", c)[1])
        for bound in ("max", "min")
        for c in sdc
        if "{ADC_CONVST}" in c and f"-{bound}" in c
    )
    assert all("-clock adc_sck" in c for c in sdc if "{ADC_CONVST}" in c)
    most_late = (sck - cnv) - largest  # of CONVST's delay over SCK's: the edge that follows is caught `largest` early
    most_early = -((sck - period - cnv) - smallest)  # and CONVST stays away `-smallest` after the edge before
    board = 0.5
    nominal = 64 * period + sck - cnv
    assert nominal - (most_late + board) == pytest.approx(1600.0)
    assert nominal + (most_early + board) == pytest.approx(1610.0)


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


def covers(command, source, destination):
    """Does a cut or a bound between registers apply to the path? Names as Yosys gives them, of instances."""
    if not re.match("set_false_path|set_max_delay", command):
        return False
    ends = {"-from": source, "-to": destination}
    sides = re.findall(r"(-from|-to) \[get_registers \{([^}]*)\}\]", command)
    names = {side: name.replace(".", "|") for side, name in ends.items()}
    return bool(sides) and all(any(files.matches(p, names[side]) for p in patterns.split()) for side, patterns in sides)


def test_every_crossing_goes_through_a_synchroniser(flat, sdc):
    """No register of one clock is read by another one but through cdc_sync or the held word of cdc_handshake, and each
    of these paths has its constraint."""
    found = files.crossings(flat)
    assert found, "there are crossings in this design"
    for source, from_clock, destination, to_clock in found:
        if destination.endswith("convst_q"):
            assert source.endswith("cnv_q"), source  # clk_adc -> clk_cnv: synchronous, 7.5 ns, timed as it is
            continue
        if re.search(r"cdc_data_q", destination):
            # The word, or its destination's own request (which decides when it is taken).
            assert source.endswith("cdc_hold_q"), f"{source} -> {destination}"
        else:
            assert re.search(r"cdc_meta_q$", destination), f"{source} ({from_clock}) -> {destination} ({to_clock})"
        assert any(covers(c, source, destination) for c in sdc), f"{source} -> {destination}: no constraint"


def clear_problems(flat, sdc):
    """Asynchronous clears that nothing synchronises, or that are cut nowhere."""
    problems = []
    for source, from_clock, destination, to_clock in files.clears(flat):
        entry = re.search(
            r"\brst_(meta|sync|out)_q$", destination
        )  # a reset synchroniser is there to be cleared at any time
        if source.endswith("rst_out_q"):
            # clk_adc's reset clears CONVST's register, too: the same PLL, timed.
            if from_clock != to_clock and not destination.endswith("convst_q"):
                problems.append(f"{source} ({from_clock}) clears {destination} ({to_clock})")
        elif not entry:
            problems.append(f"{source} clears {destination}")
        elif source.endswith("ok_prev_q"):
            assert from_clock == to_clock  # falls with the clock: timed
        elif from_clock and not any(covers(c, source, destination) for c in sdc):
            problems.append(f"{source} clears {destination}: no constraint")
        elif not from_clock and source not in (
            "KEY",
            "locked",
        ):  # the button's port is cut, the PLL's lock has no clock
            problems.append(f"{source} clears {destination}: unknown")
    return problems


def test_every_reset_is_released_with_its_clock(flat, sdc):
    assert clear_problems(flat, sdc) == []
    assert any("-from [get_ports {KEY[*]" in c for c in sdc)


def test_a_reset_without_a_constraint_is_found(flat, sdc):
    kept = [c for c in sdc if "lock_ok_q" not in c]
    assert any("lock_ok_q clears" in p and "u_adc" in p for p in clear_problems(flat, kept))


def reset_problems(gated):
    """Paths on which a register hears of another one's reset while it lives on itself."""
    problems = []
    for source, reset, destination, other in files.reset_crossings(gated):
        if reset.endswith("u_sys.rst_out_q"):
            continue  # the button: whatever it resets, all else is reset at the same time
        if destination.endswith("cdc_meta_q"):
            continue
        if destination.endswith("u_record.cdc_data_q") and source.endswith("cdc_hold_q"):
            continue  # taken only when a request has passed two flops; the word is older than that
        if destination.endswith("u_dac.pin_q") and reset.endswith("u_run.rst_out_q"):
            continue  # whenever that reset comes, this one has come before and lasts
        problems.append(f"{source} ({reset}) -> {destination} ({other})")
    return problems


def test_no_register_hears_of_anothers_reset(gated):
    """Between two resets of one clock stands a reset_gate or a synchroniser: nothing is torn when one of them comes."""
    assert files.reset_crossings(gated), "there are several resets in this design"
    assert reset_problems(gated) == []


@pytest.mark.parametrize(
    "file, fault, finds",
    [
        (
            "rtds_report.v",
            ("assign idle_o  = idle_gated || held_i;", "assign idle_o  = idle_i || held_i;"),
            "u_regs.take_q",
        ),
        ("rtds_regs.v", ("readdata_d = observed_word_q;", "readdata_d = codes_i[31:0];"), "u_regs.readdata_q"),
    ],
)
def test_a_path_between_resets_is_found(tmp_path, file, fault, finds):
    _, _, gated, _ = files.elaborate(tmp_path, {file: fault})
    assert any(finds in problem for problem in reset_problems(gated))


def test_compile_script_says_what_is_missing(tmp_path):
    """Without Quartus: one line that names it, and a status that is not success."""
    for tool in ("dirname", "sh", "git", "cut"):
        (tmp_path / tool).symlink_to(f"/usr/bin/{tool}" if os.path.exists(f"/usr/bin/{tool}") else f"/bin/{tool}")
    done = subprocess.run(
        [ROOT / "quartus" / "compile.sh"], env={"PATH": str(tmp_path)}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr.strip() == "quartus_sh is not on PATH: install Quartus Prime Lite with Cyclone V support"


TOOLS = {
    "quartus_sh": "#!/bin/sh\nmkdir -p ../build/quartus\n"
    "echo 'Logic utilization : 1' >../build/quartus/rtds.fit.summary\n",
    "quartus_sta": "#!/bin/sh\necho 'worst setup slack 1.0 ns'\n",
}


@pytest.mark.parametrize(
    "says, status, finds",
    [
        ("", 0, ""),
        ("exit 1\n", 1, "timing is not met"),
        ("echo 'Warning (332174): Ignored filter at rtds.sdc(44): *cdc_meta_q*'\n", 1, "a constraint matched nothing"),
        ("echo 'Warning (332049): Ignored set_max_delay at rtds.sdc(46)'\n", 1, "a constraint matched nothing"),
        (
            "echo 'Warning (332060): Node: x was determined to be a clock but was found without one'\n",
            1,
            "a clock has none",
        ),
    ],
)
def test_compile_ends_with_an_error_on_missed_timing_and_unmatched_constraints(tmp_path, says, status, finds):
    """With stand-ins for Quartus: what its timing analyser says and returns decides."""
    (tmp_path / "bin").mkdir()
    for name, text in TOOLS.items():
        (tmp_path / "bin" / name).write_text(text + (says if name == "quartus_sta" else ""))
        (tmp_path / "bin" / name).chmod(0o755)
    shutil.copytree(ROOT / "quartus", tmp_path / "quartus")
    done = subprocess.run(
        [tmp_path / "quartus" / "compile.sh"],
        env={"PATH": f"{tmp_path / 'bin'}:/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == status, done.stderr
    assert finds in done.stderr and "worst setup slack" in done.stdout and "Logic utilization" in done.stdout


# The part of quartus_sh's Tcl that compile.tcl uses: what was set, in what order, and a flow that may fail.
FLOW = """
package provide ::quartus::project 1.0
package provide ::quartus::flow 1.0
foreach name {project_open project_close export_assignments} { proc $name args "lappend ::log [list $name] \\$args" }
proc set_parameter args { lappend ::log set_parameter $args }
proc execute_flow args {
    lappend ::log execute_flow $args
    if {$::fails} {error "Error (11802): Can't fit design in device."}
}
set quartus(args) [list $build rtds]
"""


@pytest.mark.skipif(shutil.which("tclsh") is None, reason="compile.tcl needs tclsh to be run without Quartus")
@pytest.mark.parametrize(
    "build, number", [("3d2cacd9", 64146125), ("00000000", 0), ("1234e567", 19091030), ("ffffffff", 0xFFFFFFF)]
)
@pytest.mark.parametrize("fails", [0, 1])
def test_the_build_identity_is_a_plain_number_and_does_not_stay_in_the_project(tmp_path, build, number, fails):
    """A decimal number below 2^31, whatever the commit's digits look like; taken out again also when the flow fails."""
    script = tmp_path / "run.tcl"
    compile_tcl = ROOT / "quartus" / "compile.tcl"
    script.write_text(
        f"set build {build}\nset fails {fails}\nset log {{}}\n{FLOW}\n"
        f"set status [catch {{source {{{compile_tcl}}}}} message]\n"
        "puts [join $log \\n]\nputs stderr $message\nexit $status\n"
    )
    done = subprocess.run(["tclsh", script], capture_output=True, text=True, check=False)
    lines = [" ".join(pair) for pair in zip(*[iter(done.stdout.splitlines())] * 2, strict=True)]
    assert done.returncode == fails, done.stderr
    assert ("fit design" in done.stderr) == bool(fails)
    assert lines[1:4] == [
        f"set_parameter -name BUILD_ID {number}",
        "execute_flow -compile",
        "set_parameter -name BUILD_ID -remove",
    ]
    assert lines[-1].startswith("project_close")


# The part of quartus_sta's Tcl that report.tcl uses, with the documented collections: opaque, and only
# foreach_in_collection looks into one.
STAND_IN = """
set quartus(args) [list rtds]
package provide ::quartus::project 1.0
package provide ::quartus::sta 1.0
foreach name {
    project_open create_timing_netlist read_sdc set_operating_conditions update_timing_netlist project_close
} {
    proc $name args {}
}
proc get_available_operating_conditions {} { return _col1 }
proc get_operating_conditions_info args { return slow }
proc get_clock_fmax_info {} { return {{clk_sys 61.5 61.5 x}} }
proc get_timing_paths args { return [lindex $args 0] }
proc get_path_info {path what} { if {$path eq "-recovery"} { return $::worst }; return 1.5 }
proc foreach_in_collection {name collection body} {
    upvar 1 $name item
    if {$collection eq "-removal"} return
    set item $collection
    uplevel 1 $body
}
"""


@pytest.mark.skipif(shutil.which("tclsh") is None, reason="report.tcl needs tclsh to be run without Quartus")
@pytest.mark.parametrize("worst, status", [("0.25", 0), ("-0.001", 1)])
def test_report_fails_on_a_negative_slack(tmp_path, worst, status):
    """Of any kind; a kind without a path is passed over."""
    script = tmp_path / "run.tcl"
    script.write_text(f"set worst {worst}\n{STAND_IN}\nsource {{{ROOT / 'quartus/report.tcl'}}}\n")
    done = subprocess.run(["tclsh", script], capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stderr
    assert (
        "Fmax clk_sys       61.50 MHz" in done.stdout and f"worst recovery slack {float(worst):7.3f} ns" in done.stdout
    )
    assert "removal" not in done.stdout
    assert ("a slack is negative" in done.stderr) == (status == 1)


# ---- the project of the board's own processor -----------------------------------------------------------------------


@pytest.fixture(scope="module")
def hps(tmp_path_factory):
    """Its elaborated top, its assignments and its constraints."""
    project = files.HPS_PROJECT
    elaborated = files.elaborate(tmp_path_factory.mktemp("hps"), project=project)
    return elaborated, files.read_qsf(project.text("qsf")), files.sdc_commands(project.text("sdc"))


def test_the_project_of_the_boards_processor_has_every_pin_and_lists_its_design(hps):
    (design, *_), qsf, sdc = hps
    assert pin_problems(design.ports, qsf, files.board()) == []
    listed = [(ROOT / "quartus" / name).resolve() for name in qsf.values("VERILOG_FILE")]
    assert listed == read_file_list(files.HPS_PROJECT.file_list)
    assert qsf.values("TOP_LEVEL_ENTITY") == ["rtds_top_hps"] and qsf.values("DEVICE") == ["5CSEBA6U23I7"]
    assert qsf.values("SDC_FILE") == ["rtds_hps.sdc"]
    assert 'PROJECT_REVISION = "rtds_hps"' in files.HPS_PROJECT.text("qpf")
    found = {(ROOT / "quartus" / name).resolve() for name in qsf.values("SEARCH_PATH")}
    assert found == {header.parent for header in headers([files.HPS_PROJECT.file_list])}
    assert unmatched(sdc, design) == [] and unbounded(sdc, design) == []


def test_a_wrong_pin_of_that_project_is_found(hps):
    (design, *_), _, _ = hps
    text = files.HPS_PROJECT.text("qsf")
    fault = text.replace("PIN_AH17 -to KEY[0]", "PIN_AH16 -to KEY[0]")
    assert fault != text
    assert pin_problems(design.ports, files.read_qsf(fault), files.board()) == [
        "KEY[0]: at AH16, the board has it elsewhere"
    ]


def test_that_project_is_read_as_quartus_leaves_it(hps):
    (design, *_), qsf, _ = hps
    text = files.HPS_PROJECT.text("qsf").replace("-to KEY[0]", '-to "KEY[0]" -entity rtds_top_hps') + LEFT_BY_QUARTUS
    left = files.read_qsf(text)
    assert left.pins == qsf.pins and left.instances == qsf.instances
    assert pin_problems(design.ports, left, files.board()) == []


def test_that_project_has_one_clock_and_resets_that_come_with_it(hps):
    """No crossing, and every asynchronous clear comes out of the one synchroniser, which only button and HPS clear."""
    (_, flat, _, _), _, sdc = hps
    assert files.crossings(flat) == set()
    outside = set()
    for source, from_clock, destination, to_clock in files.clears(flat):
        if source.endswith("rst_out_q"):
            assert from_clock == to_clock
        else:
            assert re.search(r"\brst_(meta|sync|out)_q$", destination) and not from_clock, (source, destination)
            outside.add(source)
    assert outside == {"KEY", "hps_rst_n"}
    assert any("-from [get_ports {KEY[*]" in c for c in sdc)


def test_an_unknown_project_ends_in_one_line(tmp_path):
    (tmp_path / "dirname").symlink_to(shutil.which("dirname"))
    done = subprocess.run(
        [ROOT / "quartus" / "compile.sh", "rtds_hsp"],
        env={"PATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (2, "rtds_hsp: no such project (known: rtds, rtds_hps)\n")
