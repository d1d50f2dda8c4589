"""The gap of the contract's section 4, from cases whose value is known beforehand."""

import math
from dataclasses import replace

import numpy as np
from diagnosis_cases import make_case

from rtds_host.contract import RunLog
from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.plant.schema import OUTPUT_INDEX


def truth(case):
    return [replay_run(nominal_model(case.robot), run_inputs(run, case.robot)) for run in case.runs]


def test_sensor_noise_alone_gives_one():
    case = make_case(seed=11, seconds=12.0)
    parts = [gaps.errors(run, case.robot, out) for run, out in zip(case.runs, truth(case))]
    channels = gaps.pooled(parts)
    assert set(channels) == {"i_l", "i_r", "w_l", "w_r", "gyro_z", "x", "y", "yaw"}
    for channel, value in channels.items():
        samples = sum(len(p[channel]) for p in parts)
        assert abs(value - 1) < 4 / math.sqrt(2 * samples), channel


def test_a_constant_error_counts_in_units_of_noise_and_a_shifted_start_does_not_count():
    case = make_case(seed=12)
    run, out = case.runs[0], truth(case)[0]
    clean = RunLog(run.name, run.meta, run.t, {**run.columns, **{c: out[:, k].copy() for c, k in OUTPUT_INDEX.items()}})
    moved = out.copy()
    moved[:, OUTPUT_INDEX["w_l"]] += 3 * case.robot.noise("w_l")
    moved[:, OUTPUT_INDEX["x"]] += 5.0
    errors = gaps.errors(clean, case.robot, moved)
    assert np.allclose(errors["w_l"], 3.0) and np.allclose(errors["x"], 0.0)


def test_pose_is_compared_by_moves_over_whole_seconds_in_the_heading_at_their_start():
    t = np.linspace(0, 3.5, 351)
    rows = gaps.window_rows(t, np.arange(351))
    assert list(t[rows]) == [0.0, 1.0, 2.0, 3.0]
    # Driving along +y with heading 90 degrees is driving forward.
    forward, left, turn = gaps.displacements(np.zeros(351), 0.2 * t, np.full(351, math.pi / 2), rows)
    assert np.allclose(forward, 0.2) and np.allclose(left, 0) and np.allclose(turn, 0)


def test_angles_count_only_on_a_side_without_speeds():
    case = make_case(seed=13)
    run = case.runs[0]
    names = gaps.gap_channels(run, case.robot)
    assert "th_l" not in names
    lean = replace(run, columns={c: v for c, v in run.columns.items() if c != "w_l"})
    assert "th_l" in gaps.gap_channels(lean, case.robot) and "th_r" not in gaps.gap_channels(lean, case.robot)


def test_closed_is_null_where_there_is_hardly_a_gap():
    assert gaps.closed(1.09, 1.0) is None
    assert gaps.closed(11.0, 2.0) == 0.9
