"""Waveforms of the RTL, read back by a library of another program: they hold what the link answered."""

from __future__ import annotations

import bisect
import re
import sys

import numpy as np
import pytest
import pywellen
from link_cases import BURGER, STEP_S

from rtds_host.cli.commands import main
from rtds_host.errors import InputError, OutputError
from rtds_host.link import open_link
from rtds_host.link.waves import TOP, VIEW, Waves

STEPS, SAMPLE_STEPS = 300, 5
VOLTAGES = ((3.0, -2.0), (6.5, 1.25), (-1.0, 0.5))
NAMES = ("current_left_a", "speed_left_rad_s", "current_right_a", "speed_right_rad_s")
CLOCKS = 500
TICK_S = 1e-8


def driven(waves: Waves | None = None, said: list[str] | None = None, **options):
    """Three exchanges of 100 steps each; (currents, speeds), (60, 2) at the motor shaft, and the clocks they took."""
    if said is not None:
        options["progress"] = said.append
    with open_link("rtl", step_clocks=CLOCKS, waves=waves, **options) as link:
        link.set_parameters(**BURGER)
        got = [link.exchange(v, (0.0, 1e-3), 100 * STEP_S, SAMPLE_STEPS * STEP_S) for v in VOLTAGES]
        return np.concatenate([g.currents for g in got]), np.concatenate([g.speeds for g in got]), link.clocks


def changes(path) -> dict[str, list]:
    """Of a waveform file: full name of each signal -> its (time in ticks, value)."""
    return {var.full_name: list(var.tv) for var in pywellen.Waveform(str(path)).all_vars()}


def at(signal: list, ticks: int):
    """A signal's value at a time."""
    return signal[bisect.bisect_right(signal, ticks, key=lambda change: change[0]) - 1][1]


@pytest.fixture(scope="module")
def plain():
    return driven()


@pytest.fixture(scope="module")
def motors(tmp_path_factory):
    """(path, what was driven) of the default set of signals over the whole run."""
    path = tmp_path_factory.mktemp("waves") / "out.fst"
    return path, driven(Waves(path))


@pytest.fixture(scope="module")
def everything(tmp_path_factory):
    path = tmp_path_factory.mktemp("waves") / "all.fst"
    driven(Waves(path, ("all",), start_s=1e-3, end_s=1.5e-3))
    return path


def test_no_result_depends_on_waveforms(plain, motors):
    for without, with_waves in zip(plain, motors[1], strict=True):
        assert np.array_equal(without, with_waves)


def test_the_file_holds_what_the_link_answered_at_each_sample(motors):
    path, (currents, speeds, _) = motors
    seen = changes(path)
    valid = [ticks for ticks, value in seen[f"{VIEW}.valid"] if value in (1, "1")]
    assert len(valid) == STEPS
    ends = valid[SAMPLE_STEPS - 1 :: SAMPLE_STEPS]
    read = np.array([[at(seen[f"{VIEW}.{name}"], ticks) for name in NAMES] for ticks in ends])
    assert np.array_equal(read, np.column_stack([currents[:, 0], speeds[:, 0], currents[:, 1], speeds[:, 1]]))


def test_ten_microseconds_of_a_waveform_are_a_step_of_the_motors(motors):
    valid = np.array([ticks for ticks, value in changes(motors[0])[f"{VIEW}.valid"] if value in (1, "1")])
    assert np.allclose(np.diff(valid) * TICK_S, STEP_S, rtol=1e-12)


def test_inputs_stand_in_the_file_as_numbers(motors):
    voltages = [value for _, value in changes(motors[0])[f"{VIEW}.voltage_left_v"]]
    assert voltages[-3:] == [v[0] for v in VOLTAGES]


def test_a_window_holds_its_steps_and_every_clock_of_them(everything):
    seen = changes(everything)
    steps = {int(value) if not isinstance(value, str) else int(value, 2) for _, value in seen[f"{TOP}.u_view.step"]}
    assert steps == set(range(100, 151))  # the last clock written is the one that ends step 149
    rising = [ticks for ticks, value in seen[f"{TOP}.clk_i"] if value in (1, "1")]
    assert set(np.diff(rising)) == {2}  # 20 ns, none left out
    assert abs(len(rising) - 50 * CLOCKS) <= 1


def test_all_signals_of_the_core_are_there_with_the_operators_in_it(everything):
    names = changes(everything)
    assert len(names) > 500
    assert any(".g_side[0].u_motor.u_electrical.u_mul." in name for name in names)


def test_a_file_ends_at_its_size_and_says_where(tmp_path):
    said: list[str] = []
    path = tmp_path / "small.fst"
    driven(Waves(path, ("all",), limit_bytes=100_000), said)
    assert 100_000 <= path.stat().st_size < 1_000_000
    end = re.search(r"has reached 0.1 MB and ends at ([\d.]+) s of the run", said[-1])
    last = max(ticks for ticks, _ in changes(path)[f"{TOP}.step_count_o"])
    assert end and float(end[1]) == pytest.approx(last * TICK_S, abs=5e-5)


def test_views_name_signals_that_are_in_the_file_and_no_other(motors, everything):
    for path in (motors[0], everything):
        names = set(changes(path))
        surfer = path.with_suffix(".sucl").read_text().splitlines()
        gtkwave = path.with_suffix(".gtkw").read_text().splitlines()
        assert {line.split()[1] for line in surfer if line.startswith("variable_add")} == names
        shown = {re.sub(r"\[\d+:\d+\]$", "", line) for line in gtkwave if line.startswith(f"{TOP}.")}
        assert shown == names
        assert f'[dumpfile] "{path}"' in gtkwave


def test_with_effects_the_file_is_that_of_the_top_with_the_effect_unit(tmp_path):
    from rtds_host.motor.effects import UnitEffects

    path = tmp_path / "effects.fst"
    with open_link("rtl", waves=Waves(path, (f"{TOP}.u_core.*word*", "motors"))) as link:
        link.set_effects(UnitEffects(limit_v=1.0), None)
        link.set_parameters(**BURGER)
        got = link.exchange((3.0, 3.0), (0.0, 0.0), 50 * STEP_S, STEP_S)
    seen = changes(path)
    assert at(seen[f"{VIEW}.current_left_a"], 10**12) == got.currents[-1, 0] != got.currents[-1, 1]


def test_a_window_after_the_run_leaves_no_file(tmp_path):
    said: list[str] = []
    driven(Waves(tmp_path / "none.fst", start_s=5.0), said)
    assert "no step in the window" in said[-1]
    assert not list(tmp_path.iterdir())


def test_a_pattern_that_chooses_no_signal_is_refused_before_the_run(tmp_path):
    with pytest.raises(InputError, match=r"--wave-signals rtds_sim_top\.u_cor\.\*: no such signal"):
        driven(Waves(tmp_path / "out.fst", (f"{TOP}.u_cor.*",)))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"path": "out.vcd"}, "must end in .fst"),
        ({"path": "nowhere/out.fst"}, "there is no folder"),
        ({"path": "out.fst", "start_s": 2.0, "end_s": 1.0}, "the window 2:1.0 s"),
        ({"path": "out.fst", "limit_bytes": 10}, "too small"),
    ],
)
def test_what_cannot_be_written_is_refused_in_one_line(tmp_path, options, line):
    with pytest.raises((InputError, OutputError), match=line):
        Waves(tmp_path / options.pop("path"), **options)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["linear", "--link", "model"], "--link model has none"),
        (["linear", "--sim", "icarus"], "written by verilator only"),
        (["all"], "one scenario at a time"),
        (["linear", "--wave-window", "3"], "START:END in s is needed"),
    ],
)
def test_the_command_refuses_what_has_no_waveforms(tmp_path, monkeypatch, capsys, options, line):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["rtds", "run", *options, "--waves", "out.fst"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert line in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
