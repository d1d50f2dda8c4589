"""The simulation error of a run in the units of benchmarks."""

import numpy as np
import pytest
import typer
from axis_machine import write_axis_case
from diagnosis_cases import make_case
from typer.testing import CliRunner

from rtds_host.diagnosis.forms.simulation_error import channels, errors, main, table


def test_errors_are_a_root_mean_square_a_share_of_the_spread_and_a_relative_norm():
    measured = np.array([1.0, 3.0, 1.0, 3.0])
    rmse, normalised, relative = errors(measured, measured + 0.5)
    assert (rmse, normalised) == pytest.approx((0.5, 0.5))
    assert relative == pytest.approx(100.0 * 0.5 / np.sqrt(5.0))


def test_the_right_model_is_off_by_the_sensors_noise_alone():
    case = make_case()
    found = channels(case.runs[0], case.robot)
    speed, yaw_rate = (errors(*found[name])[0] for name in ("w_l, rad/s", "gyro_z, rad/s"))
    assert speed == pytest.approx(case.robot.noise("w_l"), rel=0.1)
    assert yaw_rate == pytest.approx(case.robot.noise("gyro_z"), rel=0.1)
    assert not any("cmd" in name for name in found)
    assert "| w_l, rad/s |" in table(found)


def test_a_run_of_a_linear_axis_has_its_position_in_millimetres(tmp_path):
    case = write_axis_case(tmp_path / "axis", "linear", "torque", seconds=1.0)
    app = typer.Typer()
    app.command()(main)
    said = CliRunner().invoke(app, [str(case / "sines"), "--robot", str(case / "robot.toml")])
    assert said.exit_code == 0, said.output
    rows = {row.split("|")[1].strip(): row.split("|")[2:5] for row in said.stdout.splitlines()[2:]}
    assert list(rows) == ["w_l, rad/s", "th_l, rad", "position, mm"]
    assert float(rows["position, mm"][0]) == pytest.approx(20.0 * float(rows["th_l, rad"][0]), rel=0.01)
