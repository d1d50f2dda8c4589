"""Single axes: a pendulum, a linear axis and an inertia, by voltage, torque and speed, each with one thing wrong.

The machines are integrated by `axis_machine.py`, apart from the replay. In speed mode the servo is proportional: what a
servo's integrator holds in the middle of a run, no log tells.
"""

import dataclasses
import json

import numpy as np
import pytest
from axis_machine import AXES, GEAR, MOTOR, write_axis_case

from rtds_host.contract import read_case
from rtds_host.diagnosis import diagnose as diagnose_module
from rtds_host.diagnosis.diagnose import diagnose, investigate
from rtds_host.diagnosis.predict import predicted_columns, read_diagnosis
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.structurally_indistinguishable import structurally_indistinguishable
from rtds_host.errors import InputError
from rtds_host.plant.schema import OUTPUT_INDEX

WRONG = {
    ("pendulum", "voltage"): ({"load": 1.3}, "payload_error", 0.3 * AXES["pendulum"]["mass_kg"]),
    ("pendulum", "torque"): ({"viscous": 0.02}, "viscous_friction", 0.02),
    ("pendulum", "speed"): ({"coulomb": 0.08, "ki": 0.0}, "coulomb_friction", 0.08),
    ("linear", "voltage"): ({"gain": 1.2}, "driver_gain", 1.2),
    ("linear", "torque"): ({"gain": 0.85}, "driver_gain", 0.85),
    ("linear", "speed"): ({"coulomb": 0.05, "ki": 0.0}, "coulomb_friction", 0.05),
    ("inertia", "voltage"): ({"constant": 0.85}, "torque_constant_error", 0.85),
    ("inertia", "speed"): ({"coulomb": 0.05, "ki": 0.0}, "coulomb_friction", 0.05),
}


@pytest.mark.parametrize(("kind", "mode"), list(WRONG), ids=lambda key: key)
def test_what_is_wrong_with_an_axis_is_named(tmp_path, kind, mode):
    truth, effect, size = WRONG[kind, mode]
    found, _ = diagnose(read_case(write_axis_case(tmp_path / "case", kind, mode, **truth)), quick=True)
    assert found["verdict"] == "known"
    (included,) = found["effects"]
    # Turned by torque and measured by its encoder alone, a machine's drive and its encoder are one scale.
    alike = {"speed_gain"} if (kind, mode) == ("linear", "torque") else set()
    assert included["id"] in {effect} | alike
    if included["id"] != effect:
        assert any({effect, included["id"]} <= {m["id"] for m in members} for members in found["indistinguishable"])
    (value,) = included["parameters"].values()
    assert value["value"] == pytest.approx(size, rel=0.03)
    assert found["gap"]["before"] > 20
    # A pendulum driven by torque alone runs away from any replay, however small what is missed.
    assert found["gap"]["after"] < (0.05 * found["gap"]["before"] if (kind, mode) == ("pendulum", "torque") else 1.5)


def axis_case(tmp_path, kind, mode):
    return read_case(write_axis_case(tmp_path / "case", kind, mode))


FRICTION = ("coulomb_friction", "left")


@pytest.mark.parametrize(
    ("kind", "mode", "member", "beside", "expected"),
    [
        (
            "linear",
            "torque",
            ("driver_gain", "left"),
            FRICTION,
            [("speed_gain", "left"), ("payload_error", "both"), ("rotor_inertia_error", "left")],
        ),
        (
            "linear",
            "torque",
            ("payload_error", "both"),
            FRICTION,
            [("rotor_inertia_error", "left"), ("driver_gain", "left"), ("speed_gain", "left")],
        ),
        ("linear", "torque", ("payload_error", "both"), ("gyro_bias", "both"), [("rotor_inertia_error", "left")]),
        ("linear", "voltage", ("payload_error", "both"), FRICTION, [("rotor_inertia_error", "left")]),
        ("pendulum", "torque", ("driver_gain", "left"), FRICTION, [("speed_gain", "left")]),
        ("inertia", "torque", ("payload_error", "both"), ("gyro_bias", "both"), [("rotor_inertia_error", "left")]),
        ("pendulum", "voltage", ("payload_error", "both"), FRICTION, []),
    ],
    ids=str,
)
def test_without_gravity_what_drives_cannot_be_told_from_what_is_driven(tmp_path, kind, mode, member, beside, expected):
    """m w' = g T - friction: with friction free, g and 1 / m make the same replays; the rotor's inertia adds to the
    load's, and is like what the load is like."""
    assert structurally_indistinguishable(axis_case(tmp_path, kind, mode), member, (member, beside)) == expected


@pytest.mark.parametrize(
    ("kind", "mode"),
    [
        ("pendulum", "voltage"),
        ("pendulum", "speed"),
        ("linear", "torque"),
        ("inertia", "voltage"),
        ("inertia", "speed"),
    ],
    ids=lambda key: key,
)
def test_nothing_is_blamed_where_nothing_is_wrong(tmp_path, kind, mode):
    """Also with a servo whose integrator no log shows: whole runs begin where it does."""
    found, _ = diagnose(read_case(write_axis_case(tmp_path / "case", kind, mode)), quick=True)
    assert found["verdict"] == "none" and found["effects"] == []
    assert found["gap"]["refit"] < 1.05


def test_a_servo_that_answers_some_milliseconds_late_is_no_fault(tmp_path):
    """Buses and boards take their time; what they take is refitted, said in `setup` and predicted with."""
    case = read_case(write_axis_case(tmp_path / "case", "inertia", "speed", ki=0.0, delay_s=0.012))
    found, _ = diagnose(case, quick=True)
    assert found["verdict"] == "none" and found["gap"]["before"] > 1.5
    assert found["setup"]["latency_s"] == pytest.approx(0.012, abs=0.001)
    (tmp_path / "diagnosis.json").write_text(json.dumps(found))
    assert read_diagnosis(tmp_path / "diagnosis.json", case.robot).get("latency") == pytest.approx(0.012, abs=0.001)


def test_dry_friction_is_not_dressed_up_as_stribeck(tmp_path):
    found, _ = diagnose(read_case(write_axis_case(tmp_path / "case", "linear", "voltage", coulomb=0.05)), quick=True)
    (included,) = found["effects"]
    assert included["id"] == "coulomb_friction"


def test_without_gravity_load_and_rotor_are_told_to_be_alike(tmp_path):
    found, _ = diagnose(read_case(write_axis_case(tmp_path / "case", "inertia", "torque", load=1.5)), quick=True)
    (included,) = found["effects"]
    assert {e["side"] for group in found["indistinguishable"] for e in group} == {included["side"]} == {"left"}
    (alike,) = [{e["id"] for e in group} for group in found["indistinguishable"]]
    assert alike == {"payload_error", "rotor_inertia_error"} and included["id"] in alike
    # Half the declared inertia, seen from the output, is the rotor's own once more.
    extra = 0.5 * AXES["inertia"]["inertia_kg_m2"]
    wanted = {
        "rotor_inertia_error": ("ratio", 1 + extra / (GEAR**2 * MOTOR["rotor_inertia_kg_m2"])),
        "payload_error": ("inertia_kg_m2", extra),
    }[included["id"]]
    ((name, value),) = [(n, v["value"]) for n, v in included["parameters"].items()]
    assert (name, value) == (wanted[0], pytest.approx(wanted[1], rel=0.02))


@pytest.mark.parametrize(
    ("kind", "name"), [("inertia", "inertia_kg_m2"), ("pendulum", "mass_kg"), ("linear", "mass_kg")]
)
def test_a_load_beyond_the_declared_one_is_predicted_in_the_unit_of_its_kind(tmp_path, kind, name):
    """Half of the declared load more in a diagnosis replays like a machine whose file declares half as much again."""
    case = read_case(write_axis_case(tmp_path / "case", kind, "voltage", seconds=1.0))
    path = tmp_path / "diagnosis.json"
    entry = {
        "id": "payload_error",
        "side": "left",
        "parameters": {name: {"value": 0.5 * AXES[kind][name], "ci90": None}},
    }
    path.write_text(json.dumps({"schema": "rtds-diagnosis/1", "effects": [entry]}))
    declared = dataclasses.replace(
        case.robot, axis=dataclasses.replace(case.robot.axis, **{name: 1.5 * AXES[kind][name]})
    )
    assert read_diagnosis(path, case.robot).common == pytest.approx(nominal_model(declared).common)


def test_a_size_found_by_the_speeds_of_runs_is_read_where_no_run_is_known(tmp_path):
    """Torque has no speed without load: a Stribeck speed of 22 rad/s, found on runs that were that fast, is no absurd
    one.
    """
    robot = axis_case(tmp_path, "linear", "torque").robot
    parameters = {"torque_nm": {"value": 0.0}, "extra_torque_nm": {"value": 0.001}, "speed_rad_s": {"value": 22.5}}
    path = tmp_path / "diagnosis.json"
    path.write_text(
        json.dumps(
            {
                "schema": "rtds-diagnosis/2",
                "effects": [{"id": "stribeck_friction", "side": "left", "parameters": parameters}],
            }
        )
    )
    assert read_diagnosis(path, robot).get("stribeck_speed") == 22.5


def test_a_load_in_another_kinds_unit_is_refused(tmp_path):
    case = read_case(write_axis_case(tmp_path / "case", "inertia", "voltage", seconds=1.0))
    path = tmp_path / "diagnosis.json"
    path.write_text(
        json.dumps(
            {
                "schema": "rtds-diagnosis/1",
                "effects": [{"id": "payload_error", "side": "left", "parameters": {"mass_kg": {"value": 0.1}}}],
            }
        )
    )
    with pytest.raises(InputError, match="mass_kg: is not a parameter of payload_error .known: inertia_kg_m2"):
        read_diagnosis(path, case.robot)


@pytest.mark.parametrize("mode", ["voltage", "torque", "speed"])
@pytest.mark.parametrize("kind", ["inertia", "pendulum", "linear"])
def test_a_nominal_axis_replays_within_a_fraction_of_its_noise(tmp_path, kind, mode):
    """Gravity, transmission, inertia, servo and driver mean the same here as in a machine that shares no code."""
    case = read_case(write_axis_case(tmp_path / "case", kind, mode, seconds=1.5, noisy=False))
    # Without a motor's damping nothing forgets what either integrator's steps leave.
    free = 4.0 if (kind, mode) == ("pendulum", "torque") else 1.0
    for run in case.runs:
        out = replay_run(nominal_model(case.robot), run_inputs(run, case.robot), 5e-4)
        for channel, share in (("i_l", 0.5), ("w_l", 0.5), ("th_l", 10.0)):  # 1 mrad, after turns
            if run.has(channel):
                error = (out[:, OUTPUT_INDEX[channel]] - run.columns[channel]) / case.robot.noise(channel)
                assert np.sqrt(np.mean(error**2)) < free * share, (run.name, channel)


def test_a_prediction_of_an_axis_has_one_side_and_no_pose(tmp_path):
    case = read_case(write_axis_case(tmp_path / "case", "linear", "torque", seconds=0.5))
    columns = predicted_columns(case.runs[0], case.robot)
    assert set(columns) == {"t", "v_cmd_l", "v_bus", "i_l", "w_l", "th_l"}


def test_a_measured_bus_is_the_drives_supply(tmp_path):
    """Half the bus is half the voltage; the nominal bus would not care."""
    case = read_case(write_axis_case(tmp_path / "case", "inertia", "voltage", seconds=1.0, bus="measured"))
    run = case.runs[0]
    full = replay_run(nominal_model(case.robot), run_inputs(run, case.robot))[:, OUTPUT_INDEX["w_l"]]
    run.columns["v_bus"][:] = 6.0
    half = replay_run(nominal_model(case.robot), run_inputs(run, case.robot))[:, OUTPUT_INDEX["w_l"]]
    assert half == pytest.approx(0.5 * full, abs=0.05)


@pytest.mark.parametrize(("wrong", "pieces"), [({}, False), ({"load": 1.3}, False)], ids=["sound", "another load"])
def test_an_axis_is_searched_in_pieces_only_where_a_gap_remains(tmp_path, monkeypatch, wrong, pieces):
    """Where an explanation of whole runs leaves nothing but noise, no other search is worth its time."""
    asked = []
    monkeypatch.setattr(diagnose_module, "explanations", lambda *_: asked.append("pieces"))
    case = read_case(write_axis_case(tmp_path / "case", "pendulum", "voltage", **wrong))
    found = investigate(case, quick=True)
    assert bool(asked) is pieces and found.gap < 1.1


def test_a_delay_of_a_servo_is_known_no_better_than_the_latency_next_to_it(tmp_path):
    """How much of what comes late is the board's latency, of some ten milliseconds, no log of commands and speeds
    tells.
    """
    case, rows = axis_case(tmp_path, "linear", "speed"), 38
    late = tuple(
        dataclasses.replace(
            log,
            columns={
                c: v if c == "w_cmd_l" else np.concatenate([np.full(rows, v[0]), v[:-rows]])
                for c, v in log.columns.items()
            },
        )
        for log in case.runs
    )
    seconds = rows * float(case.runs[0].t[1] - case.runs[0].t[0])
    found, _ = diagnose(dataclasses.replace(case, runs=late), quick=True)
    (delay,) = [e for e in found["effects"] if e["subsystem"] == "timing"]
    low, high = delay["parameters"]["seconds"]["ci90"]
    assert low < seconds < high
    assert high - low > 2.0 * 0.01
