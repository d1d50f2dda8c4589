"""What an import makes of the nominal robot: tolerances and the encoder's place go along, gains may be unknown."""

import numpy as np
import pytest

from rtds_host.compat import tomllib
from rtds_host.contract import builtin_robot_path, read_case
from rtds_host.importers.case import import_case

MAPPING = """schema = "rtds-mapping/1"
robot = "mine.toml"
[time]
column = "t"
unit = "s"
[signal]
{kind}_cmd_l = {{ column = "cl", unit = "{unit}" }}
{kind}_cmd_r = {{ column = "cr", unit = "{unit}" }}
w_l = {{ column = "wl", unit = "rad/s" }}
w_r = {{ column = "wr", unit = "rad/s" }}
"""


def imported(tmp_path, kind, unit, more="", t=None, command=None, speed=None):
    robot = builtin_robot_path("burger").read_text().replace("[sensors]", '[sensors]\nencoder = "motor"')
    (tmp_path / "mine.toml").write_text(robot + "\n[tolerance]\nmotor = 0.2\nmass_kg = 0.1\n")
    (tmp_path / "map.toml").write_text(MAPPING.format(kind=kind, unit=unit) + more)
    t = np.arange(0.0, 4.0, 0.02) if t is None else t
    command = 2.0 * np.sin(3.0 * t) if command is None else command
    speed = 0.5 * command if speed is None else speed
    rows = np.column_stack([t, command, command, speed, speed])
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header="t,cl,cr,wl,wr", comments="", fmt="%.9g")
    import_case([tmp_path / "run.csv"], tmp_path / "case", mapping=str(tmp_path / "map.toml"))
    return read_case(tmp_path / "case"), tomllib.loads((tmp_path / "case" / "robot.toml").read_text())


@pytest.mark.parametrize("more", ["", "[sensors]\nw_rad_s = 0.1\n"])
def test_tolerances_and_the_encoder_s_place_go_along(tmp_path, more):
    case, written = imported(tmp_path, "v", "V", more)
    assert case.robot.tolerance == {"motor": 0.2, "mass_kg": 0.1}
    assert written["sensors"]["encoder"] == "motor"


@pytest.mark.parametrize("known", ["", "kp_v_s_per_rad = 0.5\n", "ki_v_per_rad = 0.0\n"])
def test_gains_that_neither_mapping_nor_robot_knows_are_left_out_of_the_case(tmp_path, known):
    case, written = imported(tmp_path, "w", "rad/s", "[servo]\nperiod_s = 0.01\n" + known)
    gains = {"kp_v_s_per_rad", "ki_v_per_rad"}
    assert case.robot.servo.left_out == {key for key in gains if key not in known}
    assert gains & written["servo"].keys() == gains - case.robot.servo.left_out


def test_a_brake_and_a_staircase_are_imported(tmp_path):
    t = np.arange(0.0, 0.5, 0.01)
    (tmp_path / "a").mkdir()
    case, _ = imported(tmp_path / "a", "v", "V", t=t, command=np.zeros(len(t)), speed=6.0 * np.exp(-t / 0.1))
    assert len(case.runs) == 1
    (tmp_path / "b").mkdir()
    t = 1.09 * np.arange(30.0)
    case, _ = imported(tmp_path / "b", "v", "V", t=t)
    assert len(case.runs[0].t) == 30
