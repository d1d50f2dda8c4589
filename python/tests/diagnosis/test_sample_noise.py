"""The noise that samples show decides what a search sees; the declared one is the unit of the gap alone."""

from dataclasses import replace

import numpy as np
import pytest
from axis_machine import write_axis_case
from diagnosis_cases import changed, make_case

from rtds_host.contract import read_case
from rtds_host.diagnosis.diagnose import diagnose, taken
from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.gate.sample_noise import noise_ratio, sample_noise
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.thresholds import MINOR_SHARE, SIGNIFICANT


def declaring(case, times):
    """A case whose file declares so many times the noise, with six digits."""
    sensors = {key: float(f"{times * sigma:.6g}") for key, sigma in case.robot.sensors.items()}
    return replace(case, robot=replace(case.robot, sensors=sensors))


def answers(case):
    """Names, sides and sizes of a diagnosis, and its gap."""
    found, _ = diagnose(case, quick=True, threads=1)
    sizes = {
        (effect["id"], effect["side"], name): one["value"]
        for effect in found["effects"]
        for name, one in effect["parameters"].items()
    }
    return sizes, found["gap"]


def test_white_noise_is_measured_without_bias():
    """The median over blocks of a root mean square is less than that of all; the estimate makes up for it."""
    rng = np.random.default_rng(3)

    def white(t, columns):
        columns["w_l"] = rng.normal(0.0, 0.05, len(t))

    case = changed(make_case(seconds=20.0), white)
    assert sample_noise(case)["w_l"] == pytest.approx(0.05, rel=0.03)


@pytest.mark.parametrize("times", [1.0 / 3.0, 1.0, 3.0])
def test_the_noise_of_samples_is_measured_whatever_the_file_declares(times):
    case = declaring(make_case(seconds=20.0), times)
    for channel, sigma in sample_noise(case).items():
        if channel.startswith(("i", "w", "gyro")):
            assert sigma * times == pytest.approx(case.robot.noise(channel), rel=0.15), channel


def test_samples_that_are_held_show_no_noise():
    """A sensor that is read once in five rows: its differences are zero or a step."""

    def held(t, columns):
        columns["w_l"] = np.repeat(columns["w_l"][::5], 5)[: len(t)]

    assert "w_l" not in sample_noise(changed(make_case(seconds=20.0), held))


def test_a_ratio_that_no_channel_shows_is_one():
    case = make_case(seconds=0.1)
    assert noise_ratio(case, {}) == 1.0


def test_the_gate_hands_on_the_ratio_and_the_gap_keeps_the_declared_unit():
    """Noise that is declared three times too small makes the gap three times as large, and no other search."""
    case = make_case(seconds=8.0)
    one, third = examine(case), examine(declaring(case, 1.0 / 3.0))
    assert one.noise_ratio == pytest.approx(1.0, rel=0.1)
    assert third.noise_ratio == pytest.approx(3.0 * one.noise_ratio, rel=1e-5)


@pytest.mark.parametrize("step", [0.02, 0.1])
@pytest.mark.parametrize("times", [1.0 / 3.0, 3.0])
def test_the_search_takes_the_same_noise_of_rounded_samples_whatever_the_file_declares(times, step):
    """To the bit: a search may take another path if its noise changes in the last digit. Rounding has a known size and
    is not declared, so it is not scaled with the declared part."""

    def rounded(t, columns):
        columns["w_l"] = step * np.round(columns["w_l"] / step)

    case = changed(make_case(seconds=20.0), rounded)
    one, other = (taken(c, examine(c)).robot for c in (case, declaring(case, times)))
    assert one.rounding["w_l"] == pytest.approx(step / np.sqrt(12.0))
    for channel in ("w_l", "w_r", "i_l", "gyro_z"):
        assert other.noise(channel) == one.noise(channel), channel


@pytest.mark.parametrize("times", [1.0 / 3.0, 3.0])
def test_which_samples_were_held_does_not_depend_on_the_declared_noise(times):
    """A speed that hangs for half a second while its wheel turns."""

    def hung(t, columns):
        there = (t > 3.0) & (t < 3.5)
        columns["w_l"] = np.where(there, columns["w_l"][there][0], columns["w_l"])

    case = changed(make_case(seconds=8.0), hung)
    one, other = (examine(c).case.runs for c in (case, declaring(case, times)))
    aside = [np.flatnonzero(np.isnan(log.columns["w_l"])) for log in one]
    assert sum(map(len, aside)) > 0
    for log, rows in zip(other, aside, strict=True):
        assert np.array_equal(np.flatnonzero(np.isnan(log.columns["w_l"])), rows)


@pytest.mark.parametrize("times", [1 / 3, 3.0])
def test_whether_stamps_are_wrong_does_not_depend_on_the_declared_noise(times):
    """Angles scatter by their noise, which looks like stamps that are off where the file declares a third of it."""
    case = make_case(lambda model: model.add("coulomb", 0.02))
    plain, other = examine(case), examine(declaring(case, times))
    assert plain.timing.stamps_s == other.timing.stamps_s == 0.0
    assert not any(log.unsure for log in other.case.runs)


@pytest.mark.parametrize("size", [0.8, 2.5, 8.0, 25.0])
def test_whether_a_run_begins_at_rest_does_not_depend_on_the_declared_noise(size):
    """First samples of so many times the noise that they show."""

    def pushed(t, columns):
        columns["w_l"] = columns["w_l"].copy()
        columns["w_l"][0] = size * sigma

    case = make_case(seconds=8.0)
    sigma = case.robot.noise("w_l")
    case = changed(case, pushed)
    starts = [Problem(taken(c, examine(c)), 1).whole[0].inputs[-1] for c in (declaring(case, 1 / 3), case)]
    assert np.array_equal(*starts, equal_nan=True)
    assert bool(starts[0][5]) is (size > SIGNIFICANT)


def test_rounding_that_samples_hardly_show_leaves_the_declared_noise_a_slight_part():
    """Steps far above what changes from row to row: no ratio makes declared noise and rounding as small as that."""
    case = make_case(seconds=20.0)
    assert noise_ratio(case, {"w_l": 1e6}) == pytest.approx(MINOR_SHARE * noise_ratio(case, {}), rel=1e-9)


@pytest.mark.parametrize("times", [1.0 / 3.0, 3.0])
def test_names_and_sizes_do_not_depend_on_the_declared_noise_while_a_gap_is_left(tmp_path_factory, times):
    """An axis whose speed sensor adds a wave that no effect has: a gap of far more than noise is left, and the answer
    is the same with three times or a third of the noise (contract, section 5)."""
    folder = tmp_path_factory.mktemp("axis")
    case = read_case(write_axis_case(folder / "case", "linear", "voltage", gain=1.2, coulomb=0.05))

    def rest(t, columns):
        columns["w_l"] = columns["w_l"] + 0.5 * np.sin(0.7 * t) ** 3

    case = changed(case, rest)
    sizes, gap = answers(case)
    others, scaled = answers(declaring(case, times))
    assert gap["after"] > 2.0 < scaled["after"] and sizes
    assert others == sizes
    assert scaled["after"] * times == pytest.approx(gap["after"], rel=0.01)


def smooth(case, decay=0.8, seed=5):
    """A case whose speeds have noise of the declared size that a filter has smoothed."""
    rng, sigma = np.random.default_rng(seed), case.robot.noise("w_l")

    def filtered(t, columns):
        for channel in ("w_l", "w_r"):
            steps = rng.normal(0.0, np.sqrt(1.0 - decay**2) * sigma, len(t))
            noise = np.zeros(len(t))
            for k in range(1, len(t)):
                noise[k] = decay * noise[k - 1] + steps[k]
            columns[channel] = columns[channel] + noise

    return changed(case, filtered)


@pytest.mark.parametrize("friction", [0.0, 0.05])
def test_smooth_noise_of_the_declared_size_is_no_gap_and_adds_no_name(friction):
    """A low pass leaves noise that differences of samples hardly show: the declared one explains what is left."""
    case = make_case(lambda m: m.add("coulomb", friction, (0,)), seconds=8.0)
    quiet = replace(case, robot=replace(case.robot, sensors=case.robot.sensors | {"w_rad_s": 0.06}))
    case = smooth(quiet)
    assert examine(case).noise_ratio < 0.9
    found, _ = diagnose(case, quick=True, threads=1)
    assert [(e["id"], e["side"]) for e in found["effects"]] == ([("coulomb_friction", "left")] if friction else [])
