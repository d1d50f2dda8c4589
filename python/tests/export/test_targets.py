"""Each effect is mapped for each target or listed as not expressible, and what is mapped is what the replay does."""

import json
import math
import runpy
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from export_cases import ROBOT, SERVO, apart, diagnosis_of, model_of_one, model_with

from rtds_host.contract.robot import Robot
from rtds_host.diagnosis.effects import CATALOGUE, catalogue
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.errors import InputError
from rtds_host.export import mjcf, python, sdf, urdf, usd
from rtds_host.export.export import WRITERS, Source, export
from rtds_host.export.figures import figures_of
from rtds_host.export.mujoco_replay import ExportedRobot
from rtds_host.export.table import AS_NUMBER, LEFT_OUT, OWN, TABLE, TARGETS, markdown
from rtds_host.plant.schema import OUTPUTS
from rtds_host.studies.agreement import designed_run

LOG = designed_run(3.3)
# Units of noise. MuJoCo steps 0.5 ms by a rule of first order and has no inductance: 0.4 without any effect.
MUJOCO_BOUND, PYTHON_BOUND = 0.6, 0.4
WIDER = {
    "backlash": (4.0,
        "a sample that falls on an impact shows the speed before it in the one and after it in the other"),
    "gear_compliance": (1.0, "the spring's swing, in steps of first order"),
}  # fmt: skip
NEW_MUJOCO = tuple(map(int, mujoco.__version__.split(".")[:2])) >= (4, 0)


PAGE = Path(__file__).resolve().parents[3] / "docs" / "export.md"


def of_kind(target, *kinds):
    """Effects of a robot that is driven by volts; `test_servo.py` has those before a speed loop."""
    there = catalogue(ROBOT)
    return sorted(name for name, row in TABLE.items() if row[target].kind in kinds and name in there)


def test_every_effect_has_a_place_or_a_reason_for_each_target():
    assert TABLE.keys() == CATALOGUE.keys()
    for effect, row in TABLE.items():
        assert tuple(row) == TARGETS == tuple(WRITERS), effect
        for target, how in row.items():
            assert how.kind in (OWN, AS_NUMBER, LEFT_OUT) and len(how.where) > 3, (effect, target)


def test_the_page_shows_the_table():
    assert markdown() in PAGE.read_text()


@pytest.mark.parametrize("effect", ["nominal", *of_kind("mjcf", OWN, AS_NUMBER)])
def test_the_mujoco_robot_does_what_the_replay_does(effect, tmp_path):
    needs = TABLE[effect]["mjcf"].needs if effect in TABLE else ""
    if needs and not NEW_MUJOCO:
        pytest.skip(f"{effect}: {needs}")
    model = nominal_model(ROBOT) if effect == "nominal" else model_of_one(effect)
    file = tmp_path / "robot.xml"
    file.write_text(mjcf.write(figures_of(model, ROBOT), ""))
    out = ExportedRobot(file).replay(LOG, run_inputs(LOG, ROBOT)[-1])
    far, size = apart(LOG, model, out)
    assert far <= WIDER.get(effect, (MUJOCO_BOUND,))[0]
    # What no bound shows: that the effect is there at all.
    assert effect == "nominal" or far < 0.7 * size


@pytest.mark.parametrize("effect", ["nominal", *of_kind("python", OWN, AS_NUMBER)])
def test_the_python_robot_does_what_the_replay_does(effect, tmp_path):
    model = nominal_model(ROBOT) if effect == "nominal" else model_of_one(effect)
    file = tmp_path / "robot.py"
    file.write_text(python.write(figures_of(model, ROBOT), "a robot"))
    robot_class = runpy.run_path(str(file))["Robot"]
    log = designed_run(1.65)
    start = run_inputs(log, ROBOT)[-1]
    robot = robot_class(
        pose=tuple(start[:5]),
        payload_kg=log.meta.payload_kg,
        slope_rad=log.meta.slope_rad,
        uphill_yaw_rad=log.meta.uphill_yaw_rad,
    )
    rows = []
    for k, volts in enumerate(log.commands("voltage")):
        rows.append([robot.sensors()[name] for name in OUTPUTS])
        if k + 1 < len(log.t):
            robot.step(*volts, log.t[k + 1] - log.t[k])
    far, size = apart(log, model, np.array(rows))
    assert far <= PYTHON_BOUND
    assert effect == "nominal" or far < 0.7 * size


@pytest.mark.parametrize(
    ("target", "writer"),
    [("urdf", urdf.write), ("sdf", sdf.write), ("usd-json", usd.write), ("mjcf", mjcf.write), ("python", python.write)],
)
def test_what_is_in_a_file_changes_it_and_what_is_left_out_does_not(target, writer):
    there = catalogue(ROBOT)
    for effect, row in TABLE.items():
        robot = ROBOT if effect in there else SERVO
        plain = writer(figures_of(nominal_model(robot), robot), "")
        text = writer(
            figures_of(
                model_of_one(effect, robot)
                if effect != "friction_asymmetry"
                else model_with((effect, "both", {"torque_nm": 0.02, "nm_s_per_rad": 0.004})),
                robot,
            ),
            "",
        )
        if row[target].kind != LEFT_OUT:
            # An asymmetry needs dry friction next to it in MuJoCo; `test_the_mujoco_robot…` has both.
            assert text != plain or (effect, target) == ("friction_asymmetry", "mjcf"), effect
        elif target in ("urdf", "sdf"):
            assert text == plain, effect


def test_urdf_and_sdf_say_what_drives_a_wheel():
    model = model_with(
        ("coulomb_friction", "left", {"torque_nm": 0.05}), ("wheel_radius_error", "both", {"ratio": 1.1})
    )
    figures, motor = figures_of(model, ROBOT), ROBOT.motor
    constant = motor.gear_ratio * motor.torque_constant_nm_per_a
    braking = constant * motor.gear_ratio * motor.back_emf_constant_v_s_per_rad / motor.resistance_ohm
    viscous = motor.gear_ratio**2 * motor.viscous_friction_nm_s_per_rad
    root = ElementTree.fromstring(urdf.write(figures, "by a test\n"))
    left, right = root.findall("joint")
    assert (
        float(left.find("dynamics").get("friction")) == pytest.approx(0.05)
        and float(right.find("dynamics").get("friction")) == 0
    )
    assert float(right.find("dynamics").get("damping")) == pytest.approx(braking + viscous)
    assert float(right.find("limit").get("effort")) == pytest.approx(constant * 12.0 / motor.resistance_ohm)
    assert float(root.find("link[@name='wheel_left']/collision/geometry/sphere").get("radius")) == pytest.approx(0.0363)
    masses = [float(mass.get("value")) for mass in root.iter("mass")]
    assert sum(masses) == pytest.approx(ROBOT.chassis.mass_kg)
    model = ElementTree.fromstring(sdf.write(figures, "by a test\n")).find("model")
    axis = model.find("joint[@name='wheel_left']/axis")
    assert float(axis.find("dynamics/friction").text) == pytest.approx(0.05)
    assert float(axis.find("dynamics/damping").text) == pytest.approx(braking + viscous)
    assert sum(float(mass.text) for mass in model.iter("mass")) == pytest.approx(ROBOT.chassis.mass_kg)


def test_mujoco_reads_the_urdf_with_the_same_masses(tmp_path):
    model = mujoco.MjModel.from_xml_string(urdf.write(figures_of(nominal_model(ROBOT), ROBOT), ""))
    friction = [model.joint(f"wheel_{side}").frictionloss[0] for side in ("left", "right")]
    # MuJoCo makes the root link part of the world: the wheels are left.
    assert model.njnt == 2 and friction == [0.0, 0.0]


def test_usd_attributes_are_in_degrees_where_the_schema_says_so():
    model = model_with(("viscous_friction", "both", {"nm_s_per_rad": 0.01}))
    content = json.loads(usd.write(figures_of(model, ROBOT), "one\ntwo\n"))
    joint = content["prims"]["/robot/joints/wheel_left"]
    viscous = ROBOT.motor.gear_ratio**2 * ROBOT.motor.viscous_friction_nm_s_per_rad + 0.01
    assert joint["physxJointAxis:angular:viscousFrictionCoefficient"] == pytest.approx(viscous * math.pi / 180)
    assert joint["physxJointAxis:angular:armature"] == pytest.approx(
        ROBOT.motor.gear_ratio**2 * ROBOT.motor.rotor_inertia_kg_m2
    )
    assert content["notes"] == ["one", "two"]


def source_of(*effects, robot: Robot = ROBOT):
    return Source(diagnosis_of(effects), model_with(*effects), robot, "diagnosis.json")


def test_what_a_target_cannot_have_stands_in_its_file_and_in_the_list():
    source = source_of(
        ("load_friction", "left", {"ratio": 0.2}),
        ("coulomb_friction", "both", {"torque_nm": 0.05}),
        ("speed_gain", "right", {"ratio": 1.02}),
    )
    text, parts = export(source, "mjcf")
    assert {part.effect: part.kind for part in parts} == {
        "load_friction": LEFT_OUT,
        "coulomb_friction": OWN,
        "speed_gain": AS_NUMBER,
    }
    head = text.partition("-->")[0]
    assert "Not expressible, left out:\n  load_friction (left) ratio = 0.2: friction there" in head
    text, parts = export(source, "urdf")
    assert [part.effect for part in parts if part.kind == LEFT_OUT] == ["load_friction", "speed_gain"]
    ElementTree.fromstring(text)


@pytest.mark.parametrize(("effects", "kind", "reason"), [
    ([("friction_asymmetry", "both", {"torque_nm": 0.02, "nm_s_per_rad": 0.0})], LEFT_OUT,
     "larger than the dry friction"),
    ([("friction_asymmetry", "both", {"torque_nm": 0.02, "nm_s_per_rad": 0.001}),
      ("coulomb_friction", "both", {"torque_nm": 0.03})], OWN, "its part by speed is left out"),
    ([("winding_heating", "left", {"rise_per_watt": 0.1, "time_constant_s": 9.0}),
      ("driver_gain", "left", {"ratio": 0.9})], LEFT_OUT, "a driver without a gain"),
    ([("backlash", "left", {"angle_rad": 0.01, "restitution": 0.0}),
      ("gear_compliance", "left", {"stiffness_nm_per_rad": 6.0, "damping_nm_s_per_rad": 0.03})], LEFT_OUT,
      "the gear's spring"),
])  # fmt: skip
def test_numbers_that_mujoco_cannot_have_are_named_with_their_reason(effects, kind, reason):
    text, parts = export(source_of(*effects), "mjcf")
    assert parts[0].kind == kind and reason in parts[0].where and reason in text


def test_a_comment_never_ends_an_xml_comment():
    text, _ = export(Source(diagnosis_of([]), nominal_model(ROBOT), ROBOT, "a--b-->.json"), "sdf")
    ElementTree.fromstring(text)


def test_a_target_or_robot_that_cannot_be_exported_is_refused():
    with pytest.raises(InputError, match=r"--to mjfc: unknown .*; did you mean 'mjcf'\?"):
        export(source_of(), "mjfc")


@pytest.mark.parametrize("effect", ["backlash", "gear_compliance"])
def test_the_mujoco_robots_encoder_sits_behind_what_gives_where_the_robot_has_it_there(effect, tmp_path):
    model = model_of_one(effect)
    model.put("encoder_at_wheel", 1.0)
    file = tmp_path / "robot.xml"
    file.write_text(mjcf.write(figures_of(model, ROBOT), ""))
    out = ExportedRobot(file).replay(LOG, run_inputs(LOG, ROBOT)[-1])
    truth, before = replay_run(model, run_inputs(LOG, ROBOT)), replay_run(model_of_one(effect), run_inputs(LOG, ROBOT))
    angle = OUTPUTS.index("th_l")
    # Nearer to the wheel's angle than to the gear's.
    right, wrong = (np.sqrt(np.mean((out - one)[:, angle] ** 2)) for one in (truth, before))
    assert right < 0.5 * wrong
