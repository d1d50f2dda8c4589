"""`python -m rtds_host.bench.sysid`: a `<dcmotor>` replays an axis as the diagnosis does; bad input is a line."""

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", minversion="4.0")

from rtds_host.bench.sysid import EXPRESSED, Fit, line, main, row_of, scales_of, settings_of  # noqa: E402
from rtds_host.contract import Axis, Case, Driver, Motor, Robot, RunLog, RunMeta  # noqa: E402
from rtds_host.diagnosis.effects import CATALOGUE, SIDES  # noqa: E402
from rtds_host.diagnosis.gap import gap, pooled  # noqa: E402
from rtds_host.diagnosis.problem import Problem  # noqa: E402
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs  # noqa: E402
from rtds_host.errors import InputError  # noqa: E402
from rtds_host.plant.schema import OUTPUT_INDEX  # noqa: E402

ROBOT = Robot(
    name="wheel",
    motor=Motor(3.3, 6.6e-3, 0.0105, 0.0105, 1.3e-6, 3e-6, 9.69),
    supply_v=12.0,
    chassis=None,
    axis=Axis("inertia", inertia_kg_m2=5e-6),
    driver=Driver(),
    servo=None,
    sensors={"w_rad_s": 0.3, "i_a": 0.013},
)


def case_of(effects=()):
    """Two runs of half a second, replayed with effects, without noise."""
    model = nominal_model(ROBOT)
    for effect, values in effects:
        CATALOGUE[effect].apply(model, SIDES["left"], values)
    t, runs = np.arange(501) * 1e-3, []
    for name, sign in (("forward", 1.0), ("reverse", -1.0)):
        volts = sign * np.where(t < 0.2, 3.0, np.where(t < 0.4, 5.0, 0.0))
        columns = {"v_cmd_l": volts, "th_l": np.zeros(501), "w_l": np.zeros(501), "i_l": np.zeros(501)}
        log = RunLog(name, RunMeta(), t, columns)
        out = replay_run(model, run_inputs(log, ROBOT), 1e-4)
        seen = {channel: out[:, OUTPUT_INDEX[channel]] for channel in ("th_l", "w_l", "i_l")}
        runs.append(RunLog(name, RunMeta(), t, {**columns, **seen}))
    return Case("wheel", ROBOT, tuple(runs))


def fit_of(case, names=(), named_only=True):
    runs = Problem(case, 1).whole
    scales = scales_of(ROBOT, runs)
    return Fit(ROBOT, runs, settings_of(ROBOT, names, named_only, scales), 6, scales)


def test_the_nominal_motor_is_the_replays():
    fit = fit_of(case_of())
    assert gap(pooled(fit.gap({}, (0, 1)))) < 0.5


def test_friction_is_found_where_it_was_put_and_predicts_the_other_run():
    case = case_of([("coulomb_friction", {"torque_nm": 0.02})])
    fit = fit_of(case, EXPRESSED["coulomb_friction"])
    plain, values = gap(pooled(fit.gap({}, (1,)))), fit.fit((0,))
    assert values["coulomb"] * fit.scales.torque_nm == pytest.approx(0.02, rel=0.1)
    assert gap(pooled(fit.gap(values, (1,)))) < 0.2 * plain


def test_all_parameters_of_a_torque_drive_are_mechanical():
    case = case_of()
    scales = scales_of(ROBOT, Problem(case, 1).whole)
    torque = Robot(**{**ROBOT.__dict__, "driver": Driver(mode="torque", torque_nm_per_v=0.1)})
    electrical = {"resistance", "constant", "inductance", "heat", "heat_tau"}
    assert electrical <= settings_of(ROBOT, (), False, scales).keys()
    assert not electrical & settings_of(torque, (), False, scales).keys()


def test_what_is_named_and_has_no_parameter_there_is_bold():
    from rtds_host.bench.sysid import Row

    row = Row("a", 9.0, 4.0, 3.0, 1.5, 1, 2, 3, ("coulomb_friction", "pwm_curve"), ("pwm_curve",), {})
    assert line(row) == "| a | 9 | 4 | 3 | 1.5 | coulomb_friction, **pwm_curve** | 1, 2, 3 |"


def test_a_case_of_one_run_and_one_driven_by_speeds_are_refused(tmp_path, capsys):
    case = case_of()
    with pytest.raises(InputError, match="holds one run"):
        row_of(Case("one", ROBOT, case.runs[:1]), 2, 1)
    speed = Robot(**{**ROBOT.__dict__, "driver": Driver(mode="speed")})
    with pytest.raises(InputError, match="is driven by wheel speeds"):
        row_of(Case("two", speed, case.runs), 2, 1)
    assert main([str(tmp_path / "none")]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1 and ("none" in said[0] or "sysid" in said[0])
