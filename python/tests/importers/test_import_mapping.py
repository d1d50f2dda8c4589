"""Any robot's topics and units through a mapping file."""

from __future__ import annotations

import math

import numpy as np
import pytest
from import_recordings import Recording, stamp, turtlebot, twist

from rtds_host.contract import builtin_robot, builtin_robot_path, load_robot, read_case
from rtds_host.errors import InputError
from rtds_host.importers import builtin_mappings, import_case, load_mapping
from rtds_host.importers.units import FIXED, RELATIVE, factor, known_units

HEAD = 'schema = "rtds-mapping/1"\nrobot = "burger"\n'


def write(tmp_path, text, head=HEAD):
    path = tmp_path / "robot_x.toml"
    path.write_text(head + text)
    return path


def run_of(source, tmp_path, mapping, **options):
    imported = import_case([source], tmp_path / "case", mapping=mapping, **options)
    return read_case(tmp_path / "case").runs[0], imported[0].imported.notices


def rover(n: int = 200) -> Recording:
    """A robot with messages of its own: PWM counts, rpm of the motor, mA, a 16-bit encoder that wraps."""
    recording = Recording()
    for k in range(n):
        t = 0.02 * k
        for side, name in enumerate(("left", "right")):
            speed = (2.0, -1.5)[side] * math.sin(t)
            angle = (2.0, -1.5)[side] * (1 - math.cos(t)) + 160.0
            recording.add(
                t,
                f"/{name}/wheel",
                "rover_msgs/Wheel",
                {
                    "header": {"stamp": stamp(t), "frame_id": ""},
                    "pwm": round(100 * speed),
                    "rpm": speed * 258.5 * 60 / (2 * math.pi),
                    "milliamps": round(80 * speed),
                    "ticks": round(angle / (2 * math.pi) * 4096) % 65536,
                },
            )
        recording.add(
            t, "/volts", "std_msgs/Float64MultiArray", {"layout": {"dim": [], "data_offset": 0}, "data": [0.0, 11.5]}
        )
    return recording


ROVER = """
[signal]
v_cmd_l = { topic = "/left/wheel", field = "pwm", unit = "pwm", full_scale = 1000 }
v_cmd_r = { topic = "/right/wheel", field = "pwm", unit = "pwm", full_scale = 1000, reverse = true }
w_l = { topic = "/left/wheel", field = "rpm", unit = "rpm", shaft = "motor" }
w_r = { topic = "/right/wheel", field = "rpm", unit = "rpm", shaft = "motor", reverse = true }
i_l = { topic = "/left/wheel", field = "milliamps", unit = "mA" }
i_r = { topic = "/right/wheel", field = "milliamps", unit = "mA", scale = 2.0, offset = 10.0 }
th_l = { topic = "/left/wheel", field = "ticks", unit = "counts", counts_per_rev = 4096, wraps_at = 65536 }
v_bus = { topic = "/volts", field = "data[1]", unit = "V" }
"""


def test_voltages_currents_and_counts_of_a_robot_with_messages_of_its_own(tmp_path):
    rover().mcap(tmp_path / "drive.mcap")
    run, _ = run_of(tmp_path / "drive.mcap", tmp_path, write(tmp_path, ROVER), robot="burger")
    case = read_case(tmp_path / "case")
    assert case.robot.driver.mode == "voltage" and case.robot.servo is None
    speed = 2.0 * np.sin(run.t)
    assert run.columns["v_cmd_l"] == pytest.approx(np.round(100 * speed) / 1000 * 12.0, abs=1e-6)
    assert run.columns["v_cmd_r"] == pytest.approx(-np.round(-75 * speed) / 1000 * 12.0, abs=1e-6)
    assert run.columns["w_l"] == pytest.approx(speed, abs=1e-5)
    assert run.columns["w_r"] == pytest.approx(0.75 * speed, abs=1e-5)
    assert run.columns["i_l"] == pytest.approx(np.round(80 * speed) * 1e-3)
    assert run.columns["i_r"] == pytest.approx((2.0 * np.round(-60 * speed) + 10.0) * 1e-3)
    # 160 rad lie beyond one round of the 16-bit counter: the start is lost, the way is not.
    assert np.ptp(run.columns["th_l"]) == pytest.approx(4.0, abs=0.01)
    assert np.nanmedian(run.columns["v_bus"]) == 11.5


def test_a_sqlite_bag_without_definitions_needs_them_in_the_mapping(tmp_path):
    bag = rover().sqlite(tmp_path / "drive")
    with pytest.raises(InputError, match=r"rover_msgs/msg/Wheel is not defined in the bag, add it to \[definitions\]"):
        import_case([bag], tmp_path / "case", mapping=write(tmp_path, ROVER))
    more = ROVER + (
        '[definitions]\n"rover_msgs/msg/Wheel" = """\nstd_msgs/Header header\nint16 pwm\nfloat32 rpm\n'
        'int32 milliamps\nuint16 ticks\n"""\n'
    )
    run, _ = run_of(bag, tmp_path, write(tmp_path, more))
    assert run.columns["w_l"] == pytest.approx(2.0 * np.sin(run.t), abs=1e-5)


def test_voltages_win_over_speed_commands_which_stay_as_references(tmp_path):
    recording = rover()
    for k in range(200):
        recording.add(0.02 * k, "/cmd_vel", "geometry_msgs/Twist", twist(0.033, 0.0))
    recording.mcap(tmp_path / "drive.mcap")
    run, _ = run_of(tmp_path / "drive.mcap", tmp_path, write(tmp_path, ROVER + '[twist]\ntopic = "/cmd_vel"\n'))
    assert read_case(tmp_path / "case").robot.driver.mode == "voltage"
    assert run.columns["w_ref_l"] == pytest.approx(1.0)


def test_a_command_runs_out_where_the_base_says_so(tmp_path):
    recording = turtlebot(seconds=6.0)
    recording.messages = [m for m in recording.messages if m[1] != "/cmd_vel"]
    for t in (0.4, 0.7, 4.0):
        recording.add(t, "/cmd_vel", "geometry_msgs/Twist", twist(0.033, 0.0))
    recording.mcap(tmp_path / "drive.mcap")
    text = 'base = "turtlebot3"\n[commands]\ntimeout_s = 0.5\n[twist]\ntopic = "/cmd_vel"\n'
    run, _ = run_of(tmp_path / "drive.mcap", tmp_path, write(tmp_path, text))

    def at(t):
        return run.columns["w_cmd_l"][np.flatnonzero(run.t <= t + 1e-9)[-1]]

    assert [at(t) for t in (0.3, 0.5, 0.8, 1.19, 1.25, 3.9, 4.2, 4.6)] == pytest.approx(
        [0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]
    )


def test_a_twist_uses_the_robots_own_geometry_unless_told(tmp_path):
    turtlebot().mcap(tmp_path / "drive.mcap")
    text = (
        '[signal]\nw_l = { topic = "/joint_states", field = "velocity[0]", unit = "m/s" }\n'
        'w_r = { topic = "/joint_states", field = "velocity[1]", unit = "m/s" }\n'
        '[twist]\ntopic = "/cmd_vel"\n[servo]\nkp_v_s_per_rad = 1.0\nki_v_per_rad = 10.0\nperiod_s = 0.01\n'
        '[driver]\nbus = "measured"\n[sensors]\nw_rad_s = 0.5\n'
    )
    run, _ = run_of(tmp_path / "drive.mcap", tmp_path, write(tmp_path, text))
    sent = np.unique(run.columns["w_cmd_l"])
    assert len(sent) > 20  # not cut
    robot = read_case(tmp_path / "case").robot
    assert (robot.servo.kp_v_s_per_rad, robot.servo.limit_v, robot.servo.period_s) == (1.0, 12.0, 0.01)
    assert robot.driver.bus == "measured"
    assert robot.sensors == {**builtin_robot("burger").sensors, "w_rad_s": 0.5}
    # Without before_first nothing is known before the first command, and the run starts with it.
    assert run.columns["w_cmd_l"][0] == pytest.approx(3.0 * math.sin(0.01), rel=1e-6)


def test_speed_mode_without_an_inner_loop_is_refused(tmp_path):
    turtlebot().mcap(tmp_path / "drive.mcap")
    text = '[signal.w_l]\ntopic = "/joint_states"\nfield = "velocity[0]"\nunit = "m/s"\n[twist]\ntopic = "/cmd_vel"\n'
    with pytest.raises(InputError, match=r"\[servo\] period_s: missing"):
        import_case([tmp_path / "drive.mcap"], tmp_path / "case", mapping=write(tmp_path, text))
    assert not (tmp_path / "case").exists()


def test_a_single_axis_in_torque_mode(tmp_path):
    robot = tmp_path / "axis.toml"
    robot.write_text(
        'schema = "rtds-robot/1"\nname = "arm"\n[motor]\nrotor_inertia_kg_m2 = 0.0\n'
        "viscous_friction_nm_s_per_rad = 0.0\ngear_ratio = 1.0\n[supply]\nvoltage_v = 24.0\n"
        '[axis]\nkind = "pendulum"\nmass_kg = 0.1\nlength_m = 0.2\n'
        '[driver]\nmode = "torque"\ntorque_nm_per_v = 0.1\n[sensors]\nth_rad = 0.001\n'
    )
    table = tmp_path / "arm.csv"
    table.write_text("t,torque,angle\n" + "".join(f"{0.01 * k},{0.05 * math.sin(k)},{k % 360}\n" for k in range(900)))
    text = (
        '[time]\ncolumn = "t"\n[signal]\nv_cmd_l = { column = "torque", unit = "N*m" }\n'
        'th_l = { column = "angle", unit = "deg", wraps_at = 360 }\n'
    )
    run, _ = run_of(table, tmp_path, write(tmp_path, text), robot=str(robot))
    case = read_case(tmp_path / "case")
    assert case.robot == load_robot(robot)
    assert run.columns["v_cmd_l"][1] == pytest.approx(0.5 * math.sin(1))
    assert run.columns["th_l"][-1] == pytest.approx(math.radians(899))


@pytest.mark.parametrize("quantity", sorted(FIXED))
def test_every_unit_has_a_factor(quantity, tmp_path):
    robot = builtin_robot("burger")
    for unit in known_units(quantity):
        if unit == "N*m":
            with pytest.raises(InputError, match="torque"):
                factor("here", quantity, unit, robot)
            continue
        assert factor("here", quantity, unit, robot, full_scale=255.0, counts_per_rev=4096.0) > 0
    assert set(RELATIVE) <= set(FIXED)


def test_factors_of_common_units():
    robot = builtin_robot("burger")
    assert factor("", "speed", "rpm", robot) * 60 == pytest.approx(2 * math.pi)
    assert factor("", "rate", "deg/s", robot) * 180 == pytest.approx(math.pi)
    assert factor("", "speed", "m/s", robot) == pytest.approx(1 / 0.033)
    assert factor("", "speed", "m/s", robot, wheel_radius_m=0.05) == pytest.approx(20.0)
    assert factor("", "voltage", "pwm", robot, full_scale=885.0) * 885 == pytest.approx(12.0)
    assert factor("", "angle", "counts", robot, counts_per_rev=48.0, shaft="motor") * 48 * 258.5 == pytest.approx(
        2 * math.pi
    )


@pytest.mark.parametrize(
    "text, complaint",
    [
        (
            "[signal.w_l]\ntopic = '/left/wheel'\nfield = 'rpm'\nunit = 'furlongs'",
            "unit 'furlongs' is not a unit of speed",
        ),
        ("[signal.w_l]\ntopic = '/a'\nfield = 'x'\nunits = 'rpm'", "key 'units' is unknown"),
        ("[signal.w_l]\nfield = 'x'", "needs a topic .* or a column"),
        ("[signal.w_l]\ntopic = '/a'", "needs the field"),
        ("[signal.speed]\ntopic = '/a'\nfield = 'x'", "is not a channel of the format"),
        ("[signal.v_bus]\ntopic = '/a'\nfield = 'x'\nreverse = 1", "true or false"),
        ("[signal.w_l]\ntopic = '/a'\nfield = 'x'\ndelay_samples = 0.5", "whole number"),
        ("[signal.w_l]\ntopic = '/a'\nfield = 'x'\nscale = 'two'", "finite number"),
        (f"[signal.w_l]\ntopic = '/a'\nfield = 'x'\nscale = {10**400}", "finite number"),
        ("[signal.w_l]\ntopic = '/a'\nfield = 'x'\nscale = 0", "scale is 0"),
        ("[runs]\nsquare = 3", r"\[runs.square\]: is 3"),
        (f"a = {'[' * 5000}{']' * 5000}", "TOML"),
        ("[signal.x]\ntopic = '/a'\npair = ['v', 'w']", "wheel's speed only"),
        ("[twist]\ncut = 0.01", "needs a topic"),
        ("[twist]\ntopic = '/cmd_vel'\ncut = -1", "at least 0"),
        ("[servo]\nkp = 3", "key 'kp' is unknown"),
        ("[time]\nsource = 'sun'", "header, record"),
        ("[time]\nunit = 'days'", "s, ms, us, ns"),
        ("[wheels]\nradius = 1", "key 'wheels' is unknown"),
        ("base = 'turtlebot9'", "known: create3, jackal, rtds, turtlebot3, "),
        ("[definitions]\n'a/msg/B' = 'float99 x['", r"\[definitions\] a/msg/B: cannot be read"),
        ("signal = 3", "table"),
        ("= 3", "not valid TOML"),
    ],
)
def test_a_wrong_mapping_is_named_with_its_place(tmp_path, text, complaint):
    rover(20).mcap(tmp_path / "drive.mcap")
    path = write(tmp_path, text + "\n")
    with pytest.raises(InputError, match=complaint) as caught:
        import_case([tmp_path / "drive.mcap"], tmp_path / "case", mapping=path)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "case").exists()


def test_mappings_that_come_along_are_sound():
    assert {"rtds", "turtlebot3", "turtlebot3_gazebo", "create3", "jackal", "wpilib_sysid"} <= set(builtin_mappings())
    for name in builtin_mappings():
        assert load_mapping(name).name == name
    with pytest.raises(InputError, match="schema"):
        load_mapping(builtin_robot_path("burger"))


def test_a_waffle_needs_only_its_own_figures():
    waffle = load_mapping("turtlebot3_waffle")
    stock = load_mapping("turtlebot3")
    assert waffle.twist.track_width_m == 0.287 and stock.twist.track_width_m == 0.160
    assert waffle.signals == stock.signals and waffle.servo == stock.servo
    assert waffle.before_first == stock.before_first == 0.0


def test_a_mapping_of_an_earlier_version_is_read_with_the_names_that_it_has(tmp_path):
    text = '[signal]\nw_l = {{ topic = "/a", field = "rpm", unit = "rpm", {} }}\n'
    former = load_mapping(str(write(tmp_path, text.format("late_s = 0.02, late_samples = 1"))))
    assert former.signals["w_l"][0].delay_s == 0.02 and former.signals["w_l"][0].delay_samples == 1
    with pytest.raises(InputError, match="late_s"):
        load_mapping(str(write(tmp_path, text.format("late_s = 0.02, delay_s = 0.03"))))
