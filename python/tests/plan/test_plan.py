"""`rtds plan`: a manoeuvre that keeps to its floor, speed and supply, and three ways to send it that say the same."""

import csv
import json
import math
import runpy
import sys
import types
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from rtds_host.cli.plan import app
from rtds_host.contract import RunLog, RunMeta, builtin_robot, builtin_robot_path
from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.errors import InputError, RtdsError
from rtds_host.plan.commands import knots
from rtds_host.plan.make import Floor, alike_pairs, choose, fit
from rtds_host.plan.write import script
from rtds_host.plant.schema import OUTPUT_INDEX
from rtds_host.scenario import find_scenario

ROBOT = builtin_robot("burger")
RUNNER = CliRunner()
FLAT = ("steps", "prbs", "spin", "teleop", "coast", "crawl")


def rtds_plan(*words):
    return RUNNER.invoke(app, [str(w) for w in words], catch_exceptions=True)


def drive(t, volts, model=None, robot=ROBOT):
    """x, y (n,) of a replay of voltages from the origin."""
    log = RunLog("check", RunMeta(), t, {"v_cmd_l": volts[:, 0], "v_cmd_r": volts[:, 1]})
    out = replay_run(model or nominal_model(robot), run_inputs(log, robot))
    return out[:, OUTPUT_INDEX["x"]], out[:, OUTPUT_INDEX["y"]]


@pytest.mark.parametrize("name", FLAT)
@pytest.mark.parametrize("kind", ["voltage", "cmd_vel"])
def test_a_manoeuvre_stays_on_its_floor(name, kind):
    floor = Floor(1.4, 1.0, 0.2)
    made = fit(find_scenario(name), ROBOT, kind, floor, [nominal_model(ROBOT)])
    x, y = made.path[:, 1], made.path[:, 2]
    assert x.min() >= 0.2 - 1e-6 and x.max() <= 1.2 + 1e-6 and y.min() >= 0.2 - 1e-6 and y.max() <= 0.8 + 1e-6
    assert made.path[0, 1:] == pytest.approx(made.start[:2])
    assert made.tops["voltage_v"] <= ROBOT.supply_v + 1e-9
    assert made.commands.at(np.array([made.commands.duration_s])) == pytest.approx(np.zeros((1, 2)))


def test_a_path_is_that_of_the_commands_that_are_sent():
    made = fit(find_scenario("steps"), ROBOT, "voltage", Floor(3, 3, 0.2), [nominal_model(ROBOT)])
    t = np.arange(round(made.commands.duration_s / 0.005) + 1) * 0.005
    x, y = drive(t, made.commands.at(t))
    c, s = math.cos(made.start[2]), math.sin(made.start[2])
    end = (made.start[0] + c * x[-1] - s * y[-1], made.start[1] + s * x[-1] + c * y[-1])
    assert made.path[-1, 1:] == pytest.approx(end, abs=0.01)


def test_a_smaller_floor_makes_a_smaller_manoeuvre_and_too_small_a_one_is_refused():
    model = [nominal_model(ROBOT)]
    wide = fit(find_scenario("teleop"), ROBOT, "cmd_vel", Floor(6, 6, 0.2), model)
    small = fit(find_scenario("teleop"), ROBOT, "cmd_vel", Floor(0.55, 0.55, 0.2), model)
    assert wide.scale == 1.0 and 0.2 <= small.scale < 1.0
    with pytest.raises(
        InputError, match=r"teleop: at a fifth of its size it needs about .* the floor has 0.45 x 0.45 m"
    ):
        fit(find_scenario("teleop"), ROBOT, "cmd_vel", Floor(0.45, 0.45, 0.2), model)


def test_a_speed_that_is_not_allowed_is_not_driven():
    made = fit(find_scenario("steps"), ROBOT, "voltage", Floor(9, 9, 0.2), [nominal_model(ROBOT)], speed_m_s=0.08)
    assert made.tops["forward_m_s"] <= 0.08 and made.scale < 1.0


def test_the_diagnosed_robot_stays_on_the_floor_too():
    """One wheel smaller than said: the robot drives in curves where the nominal one drives straight."""
    odd = nominal_model(ROBOT)
    CATALOGUE["wheel_radius_error"].apply(odd, (0,), {"ratio": 0.8})
    floor = Floor(1.2, 1.2, 0.2)
    made = fit(find_scenario("teleop"), ROBOT, "voltage", floor, [nominal_model(ROBOT), odd])
    t = np.arange(round(made.commands.duration_s / 0.01) + 1) * 0.01
    x, y = drive(t, made.commands.at(t), odd)
    c, s = math.cos(made.start[2]), math.sin(made.start[2])
    for values, room in ((made.start[0] + c * x - s * y, 1.2), (made.start[1] + s * x + c * y, 1.2)):
        assert values.min() >= 0.2 - 0.01 and values.max() <= room - 0.2 + 0.01


def test_of_the_menu_the_one_is_taken_that_parts_most():
    floor, models = Floor(3, 3, 0.25), [nominal_model(ROBOT)]
    best = choose(ROBOT, "voltage", floor, models, math.inf)
    _, alike, pairs = alike_pairs(best, ROBOT)
    for name in ("standstill", "coast"):
        _, more, of = alike_pairs(fit(find_scenario(name), ROBOT, "voltage", floor, models), ROBOT)
        assert pairs - alike >= of - more


def test_a_robot_that_names_no_noise_still_gets_a_plan():
    bare = replace(ROBOT, sensors={})
    made = choose(bare, "voltage", Floor(3, 3, 0.25), [nominal_model(bare)], math.inf)
    assert alike_pairs(made, bare) == (0, 0, 0) and made.commands.duration_s > 1.0


def test_knots_keep_steps_and_curves():
    t = np.arange(0, 2, 0.01)
    square = np.column_stack([np.where(t < 1.0, 2.0, -2.0), np.zeros(len(t))])
    found = knots(t, square, ("a", "b"), held=True)
    assert len(found.t) == 4 and found.at(np.array([0.995, 1.0]))[:, 0] == pytest.approx([2.0, -2.0])
    wave = np.column_stack([np.sin(3 * t), np.cos(3 * t)])
    found = knots(t, wave, ("a", "b"))
    assert len(found.t) < len(t) / 4 and np.abs(found.at(t) - wave).max() <= 0.011


class FakeRos:
    """As much of rclpy as the script uses; time goes on by a tick whenever the timer is called."""

    def __init__(self, stamped=False):
        self.sent, self.now, self.stamped = [], 0.0, stamped

    def modules(self):
        ros = self

        class Message:
            def __init__(self, data=None):
                self.data = data
                self.linear, self.angular = types.SimpleNamespace(x=0.0), types.SimpleNamespace(z=0.0)

        class Stamped:
            def __init__(self):
                self.header, self.twist = types.SimpleNamespace(stamp=None), Message()

        class Node:
            def __init__(self, name):
                self.name = name

            def declare_parameter(self, name, value):
                return types.SimpleNamespace(value=ros.stamped)

            def create_publisher(self, kind, topic, depth):
                return types.SimpleNamespace(publish=lambda m: ros.sent.append((ros.now, topic, kind.__name__, m)))

            def get_clock(self):
                return types.SimpleNamespace(now=lambda: Moment(ros.now))

            def create_timer(self, period, call):
                ros.period, ros.call = period, call

            def get_logger(self):
                return types.SimpleNamespace(info=lambda text: None)

            def destroy_node(self):
                pass

        class Moment:
            def __init__(self, at):
                self.at = at

            def __sub__(self, other):
                return types.SimpleNamespace(nanoseconds=(self.at - other.at) * 1e9)

            def to_msg(self):
                return self.at

        def spin(node):
            while True:
                ros.now += ros.period
                ros.call()

        node = types.ModuleType("rclpy.node")
        node.Node = Node
        rclpy = types.ModuleType("rclpy")
        rclpy.init, rclpy.spin, rclpy.ok, rclpy.try_shutdown = (
            (lambda args=None: None),
            spin,
            (lambda: True),
            (lambda: None),
        )
        geometry, standard = types.ModuleType("geometry_msgs.msg"), types.ModuleType("std_msgs.msg")
        geometry.Twist = type("Twist", (Message,), {})
        geometry.TwistStamped = type("TwistStamped", (Stamped,), {})
        standard.Float64MultiArray = type("Float64MultiArray", (Message,), {})
        return {
            "rclpy": rclpy,
            "rclpy.node": node,
            "geometry_msgs": types.ModuleType("geometry_msgs"),
            "geometry_msgs.msg": geometry,
            "std_msgs": types.ModuleType("std_msgs"),
            "std_msgs.msg": standard,
        }


@pytest.mark.parametrize(
    ("kind", "stamped", "topic", "message"),
    [
        ("voltage", False, "wheel_voltages", "Float64MultiArray"),
        ("cmd_vel", False, "cmd_vel", "Twist"),
        ("cmd_vel", True, "cmd_vel", "TwistStamped"),
    ],
)
def test_the_script_sends_the_plan_and_stops(kind, stamped, topic, message, tmp_path, monkeypatch):
    made = fit(find_scenario("steps"), ROBOT, kind, Floor(3, 3, 0.2), [nominal_model(ROBOT)])
    file = tmp_path / "drive.py"
    file.write_text(script(made))
    ros = FakeRos(stamped)
    for name, module in ros.modules().items():
        monkeypatch.setitem(sys.modules, name, module)
    names = runpy.run_path(str(file))
    names["main"]()
    assert {(t, m) for _, t, m, _ in ros.sent} == {(topic, message)}

    def values(m):
        if kind == "voltage":
            return tuple(m.data)
        twist = m.twist if stamped else m
        return twist.linear.x, twist.angular.z

    sent = np.array([values(m) for *_, m in ros.sent])
    times = np.array([now for now, *_ in ros.sent]) - names["COUNTDOWN_S"]
    driving = (times >= 0) & (times < made.commands.duration_s - 1e-3)
    # Numbers stand with six digits and times to 0.1 ms.
    steep = np.abs(np.diff(made.commands.at(times[driving]), axis=0, prepend=0)).max(axis=1) > 0.5
    assert sent[driving][~steep] == pytest.approx(made.commands.at(times[driving])[~steep], abs=0.06)
    assert not sent[times < 0].any() and not sent[-1].any()


@pytest.fixture
def diagnosis(tmp_path):
    """A folder with a robot and a diagnosis that wants to see a spin with payload."""
    (tmp_path / "robot.toml").write_bytes(builtin_robot_path("burger").read_bytes())
    content = {
        "schema": "rtds-diagnosis/2",
        "verdict": "known",
        "effects": [{"id": "driver_gain", "side": "both", "parameters": {"ratio": {"value": 0.9, "ci90": None}}}],
        "next_experiment": {
            "scenario": "spin --payload 2",
            "separates": [{"id": "spin_scrub", "side": "both"}],
            "expected_separation": 5.0,
            "why": "parts what these runs cannot tell apart",
        },
    }
    (tmp_path / "diagnosis.json").write_text(json.dumps(content))
    return tmp_path / "diagnosis.json"


def test_the_command_plans_what_a_diagnosis_wants_to_see(diagnosis, tmp_path):
    done = rtds_plan(diagnosis, "--floor", "2x1.5", "--out", tmp_path / "plan")
    assert done.exit_code == 0, done.output
    assert "spin: turns on the spot" in done.output and "payload 2 kg" in done.output
    content = json.loads((tmp_path / "plan" / "plan.json").read_text())
    assert content["kind"] == "voltage" and content["payload_kg"] == 2.0 and content["floor_m"] == [2.0, 1.5]
    rows = list(csv.DictReader((tmp_path / "plan" / "commands.csv").open()))
    assert list(rows[0]) == ["t", "v_cmd_l", "v_cmd_r"]
    assert float(rows[-1]["t"]) >= content["duration_s"] and float(rows[-1]["v_cmd_l"]) == 0.0
    names = runpy.run_path(str(tmp_path / "plan" / "drive.py"))
    for row in rows[:-1:25]:
        assert names["command_at"](float(row["t"])) == pytest.approx(
            (float(row["v_cmd_l"]), float(row["v_cmd_r"])), abs=1e-3
        )


def test_a_robot_driven_by_speed_gets_speeds(diagnosis, tmp_path):
    robot = diagnosis.parent / "robot.toml"
    servo = (
        '\n[driver]\nmode = "speed"\n[servo]\nkp_v_s_per_rad = 2.0\nki_v_per_rad = 20.0\nlimit_v = 12.0\nperiod_s ='
        " 0.01\n"
    )
    robot.write_text(robot.read_text() + servo)
    done = rtds_plan(robot, "--scenario", "teleop", "--out", tmp_path / "plan")
    assert done.exit_code == 0, done.output
    assert json.loads((tmp_path / "plan" / "plan.json").read_text())["kind"] == "cmd_vel"
    assert "linear_m_s,angular_rad_s" in (tmp_path / "plan" / "commands.csv").read_text()
    refused = rtds_plan(robot, "--as", "voltage", "--out", tmp_path / "other")
    assert isinstance(refused.exception, RtdsError) and "use --as cmd_vel" in str(refused.exception)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--floor", "3"], "--floor 3: width and depth in metres"),
        (["--floor", "0x3"], "--floor 0x3"),
        (["--floor", "1.2.3x3"], "--floor 1.2.3x3"),
        (["--as", "volts"], "--as volts: unknown"),
        (["--as", "cmd-vel"], "did you mean 'cmd_vel'?"),
        (["--scenario", "spni"], "did you mean 'spin'?"),
        (["--speed", "0"], "--speed 0: it must be above 0"),
        (["--floor", "0.3x0.3"], "the floor has 0.3 x 0.3 m"),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_written(words, complaint, diagnosis, tmp_path):
    done = rtds_plan(diagnosis, *words, "--out", tmp_path / "plan")
    assert isinstance(done.exception, RtdsError) and complaint in str(done.exception)
    assert not (tmp_path / "plan").exists()


def test_a_single_axis_has_no_floor():
    from rtds_host.contract.robot import Axis
    from rtds_host.plan.make import check_robot

    with pytest.raises(InputError, match="is a single axis"):
        check_robot(replace(ROBOT, chassis=None, axis=Axis("inertia", inertia_kg_m2=1e-3)), "voltage")
