"""MuJoCo's system identification with its `<dcmotor>` on measured cases, and `rtds diagnose --quick` on the same.

    python -m rtds_host.bench.sysid CASE... [--folds 4] [--iterations 15]

For each case the table has the gap on runs that were left out (contract, section 4) and the processor time of three
fits: the `<dcmotor>` given the effects that the diagnosis named, the `<dcmotor>` with all of its parameters, and the
diagnosis. MuJoCo's fit is `mujoco.sysid.optimize` over rollouts of whole runs; its residuals are those of the gap, so
that it minimises what the table shows. Runs are left out in `--folds` groups. Named effects that the actuator and its
joint have no parameter for are listed.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import io
import json
import logging
import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np

from rtds_host.contract import GRAVITY_M_S2, Case, Robot, read_case
from rtds_host.contract.runlog import read_object
from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.diagnose import diagnose, taken
from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import nominal_model
from rtds_host.diagnosis.residual import RunData
from rtds_host.errors import InputError, RtdsError
from rtds_host.export import mjcf
from rtds_host.export.dcmotor import BRISTLE_SWING, COPPER_PER_K
from rtds_host.export.figures import figures_of
from rtds_host.plant.schema import OUTPUT_INDEX, OUTPUTS

# s; a step of a robot with contacts, the longest and shortest of an axis.
ROBOT_STEP_S, LONGEST_STEP_S, SHORTEST_STEP_S = 2e-3, 1e-3, 2.5e-4
# Relative bounds of the nominal constants next to named effects.
REFIT = 0.2
# Shares of the largest torque that friction starts with; the better of both after a few steps goes on.
STARTS, FIRST_STEPS = (0.01, 0.1), 4
# Errors, in units of noise, beyond which a rollout that went astray counts no more.
ASTRAY = 1e6
# Effect -> the parameters below that can have it.
EXPRESSED = {
    "resistance_error": ("resistance",),
    "torque_constant_error": ("constant",),
    "driver_gain": ("constant", "resistance"),
    "rotor_inertia_error": ("inertia",),
    "viscous_friction": ("damping",),
    "coulomb_friction": ("coulomb",),
    "rolling_resistance": ("coulomb",),
    "stribeck_friction": ("coulomb", "static", "stribeck"),
    "torque_ripple": ("cogging", "poles", "phase"),
    "winding_heating": ("heat", "heat_tau"),
    "voltage_limit": ("saturation",),
    "command_delay": ("delay",),
}
NOMINAL = ("resistance", "constant", "inertia", "damping")
ELECTRICAL = ("resistance", "constant", "inductance", "heat", "heat_tau")


@dataclass(frozen=True)
class Scales:
    """What parameters are shares of, SI, at the gear's output: largest torque and speed, inertia; `supply_v`."""

    torque_nm: float
    speed_rad_s: float
    inertia_kg_m2: float
    supply_v: float


def scales_of(robot: Robot, runs: Sequence[RunData]) -> Scales:
    """The scales of a robot or an axis on its runs."""
    motor, n = robot.motor, robot.motor.gear_ratio
    speed = max(float(np.nanmax(np.abs(data.log.columns["w_l"]))) for data in runs)
    if robot.driver.mode == "torque":
        command = max(float(np.abs(data.inputs[2]).max()) for data in runs)
        torque = abs(robot.driver.torque_nm_per_v) * command * n
    else:
        torque = n * motor.torque_constant_nm_per_a * robot.supply_v / motor.resistance_ohm
    load = 0.0
    if robot.axis is not None:
        axis = robot.axis
        arm = axis.length_m if axis.kind == "pendulum" else axis.metres_per_rad
        load = axis.inertia_kg_m2 + axis.mass_kg * arm**2
    elif robot.chassis is not None:
        load = robot.chassis.wheel_inertia_kg_m2 + 0.5 * robot.chassis.mass_kg * robot.chassis.wheel_radius_m**2
    return Scales(torque, speed, load + n**2 * motor.rotor_inertia_kg_m2, robot.supply_v)


@dataclass(frozen=True)
class Setting:
    """A parameter: start, lowest and highest value, in the unit of its modifier."""

    start: float
    low: float
    high: float


def settings_of(robot: Robot, free: Sequence[str], named_only: bool, scales: Scales) -> dict[str, Setting]:
    """The parameters that are fitted. With `named_only` the nominal constants stay within `REFIT` of the file."""
    n, motor = robot.motor.gear_ratio, robot.motor
    own = n**2 * motor.rotor_inertia_kg_m2 / scales.inertia_kg_m2
    fluid = n**2 * motor.viscous_friction_nm_s_per_rad * scales.speed_rad_s / scales.torque_nm
    all_of_them = {
        "resistance": Setting(1.0, 0.2, 5.0),
        "constant": Setting(1.0, 0.2, 5.0),
        "inductance": Setting(1.0, 0.05, 20.0),
        "inertia": Setting(0.0, -own, 5.0),
        "damping": Setting(0.0, -fluid, 2.0),
        "coulomb": Setting(0.01, 0.0, 1.0),
        "static": Setting(0.005, 0.0, 1.0),
        "stribeck": Setting(0.1, 1e-3, 3.0),
        "stiffness": Setting(0.5, 0.01, 1.0),
        "lugre_damping": Setting(0.05, 0.0, 2.0),
        "cogging": Setting(0.01, -0.5, 0.5),
        "poles": Setting(10.0, 0.5, 40.0),
        "phase": Setting(0.0, -math.pi, math.pi),
        "heat": Setting(0.01, 0.0, 3.0),
        "heat_tau": Setting(30.0, 0.5, 1000.0),
        "saturation": Setting(1.0, 0.02, 3.0),
        "delay": Setting(0.005, 0.0, 0.6),
    }
    narrow = {
        "resistance": Setting(1.0, 1.0 - REFIT, 1.0 + REFIT),
        "constant": Setting(1.0, 1.0 - REFIT, 1.0 + REFIT),
        "inertia": Setting(0.0, -min(own, REFIT), REFIT),
        "damping": Setting(0.0, -REFIT * fluid, REFIT * fluid + 1e-4),
    }
    names = [name for name in all_of_them if robot.driver.mode == "voltage" or name not in ELECTRICAL]
    if not named_only:
        return {name: all_of_them[name] for name in names}
    kept = {name: narrow[name] for name in NOMINAL if name in names}
    return kept | {name: all_of_them[name] for name in names if name in free}


def axis_spec(robot: Robot, step_s: float) -> mujoco.MjSpec:
    """One axis as a hinge with its load; the motor is set later."""
    axis, motor, n = robot.axis, robot.motor, robot.motor.gear_ratio
    assert axis is not None
    mass, arm, gravity = 0.0, 0.0, 0.0
    if axis.kind == "pendulum":
        mass, arm, gravity = axis.mass_kg, axis.length_m, GRAVITY_M_S2
    inertia = axis.inertia_kg_m2 + (axis.mass_kg * axis.metres_per_rad**2 if axis.kind == "linear" else 0.0)
    # Down is where the pendulum's angle is `zero_rad`; the hinge turns from +z to +x.
    down = (arm * math.sin(-axis.zero_rad), 0.0, -arm * math.cos(-axis.zero_rad))
    return mujoco.MjSpec.from_string(
        f'<mujoco><compiler angle="radian"/><option timestep="{step_s:.9g}" gravity="0 0 {-gravity:.9g}" '
        'integrator="implicitfast"/><worldbody><body><inertial pos="{:.9g} {:.9g} {:.9g}" '.format(*down)
        + f'mass="{max(mass, 1e-9):.9g}" diaginertia="1e-12 1e-12 1e-12"/>'
        f'<joint name="wheel_left" type="hinge" axis="0 1 0" '
        f'armature="{n**2 * motor.rotor_inertia_kg_m2 + inertia:.9g}" '
        f'damping="{n**2 * motor.viscous_friction_nm_s_per_rad:.9g}"/></body></worldbody><actuator>'
        f'<dcmotor name="motor_left" joint="wheel_left" gear="{n:.9g}" motorconst="1 1" resistance="1"/></actuator>'
        "</mujoco>"
    )


def robot_spec(robot: Robot, data: RunData) -> mujoco.MjSpec:
    """A robot on a plane, as `rtds export --actuator dcmotor` writes it, under the slope and payload of a run."""
    spec = mujoco.MjSpec.from_string(mjcf.write(figures_of(nominal_model(robot), robot), "", "dcmotor"))
    payload, slope, uphill = data.inputs[5][:3]
    spec.option.timestep = ROBOT_STEP_S
    along = -GRAVITY_M_S2 * math.sin(slope)
    spec.option.gravity = [along * math.cos(uphill), along * math.sin(uphill), -GRAVITY_M_S2 * math.cos(slope)]
    spec.body("payload").mass += payload
    for sensor in list(spec.sensors):
        spec.delete(sensor)
    return spec


def equip(spec: mujoco.MjSpec, robot: Robot, names: Sequence[str], scales: Scales) -> None:
    """Give each motor the parts that the fitted parameters need; what they hold is set by `apply`."""
    motor, kind = robot.motor, mujoco.mjtCtrlInput
    lugre = "stiffness" in names or "stribeck" in names
    for actuator in spec.actuators:
        torque_mode = robot.driver.mode == "torque"
        constant = 1.0 if torque_mode else motor.torque_constant_nm_per_a
        actuator.set_to_dcmotor(
            motorconst=[constant, constant if torque_mode else motor.back_emf_constant_v_s_per_rad],
            resistance=1.0 if torque_mode else motor.resistance_ohm,
            inductance=[0.0, 0.0] if torque_mode else [motor.inductance_h, 0.0],
            thermal=[1.0, 0.0, 30.0, COPPER_PER_K, 25.0, 25.0] if "heat" in names else [0.0] * 6,
            cogging=[1e-9, 1.0, 0.0] if "cogging" in names else [0.0] * 3,
            lugre=[1.0, 0.0, 1e-3, 1e-3, 1.0] if lugre else [0.0] * 5,
            saturation=[scales.torque_nm * 2.0, 0.0, 0.0] if "saturation" in names else [0.0] * 3,
            ctrlspec=int(kind.mjINPUT_FF if torque_mode else kind.mjINPUT_VOLTAGE),
        )
        actuator.ctrllimited = 0


def apply(spec: mujoco.MjSpec, robot: Robot, values: dict[str, float], scales: Scales) -> None:
    """Put values into a spec: shares of the scales, at the motor's shaft where the element wants it."""
    n, motor, step = robot.motor.gear_ratio, robot.motor, spec.option.timestep
    torque = scales.torque_nm / n
    dry = values.get("coulomb", 0.0)
    lugre = "stiffness" in values or "stribeck" in values
    loads = {"inertia": 0.0}
    if robot.axis is not None:
        axis = robot.axis
        loads["inertia"] = axis.inertia_kg_m2 + (axis.mass_kg * axis.metres_per_rad**2 if axis.kind == "linear" else 0)
    for actuator in spec.actuators:
        joint = spec.joint(actuator.target)
        if robot.driver.mode == "voltage":
            ohm = motor.resistance_ohm * values.get("resistance", 1.0)
            constant = math.sqrt(motor.torque_constant_nm_per_a * motor.back_emf_constant_v_s_per_rad)
            actuator.gainprm[0], actuator.gainprm[1] = ohm, constant * values.get("constant", 1.0)
            actuator.dynprm[0] = motor.inductance_h * values.get("inductance", 1.0) / ohm
            if "heat" in values:
                kelvin = values["heat"] / COPPER_PER_K / (scales.supply_v**2 / motor.resistance_ohm)
                actuator.dynprm[2] = max(kelvin, 1e-9)
                actuator.dynprm[3] = values["heat_tau"] / actuator.dynprm[2]
        inertia = n**2 * motor.rotor_inertia_kg_m2 + values.get("inertia", 0.0) * scales.inertia_kg_m2
        joint.armature = max(inertia, 0.0) + loads["inertia"]
        fluid = values.get("damping", 0.0) * scales.torque_nm / scales.speed_rad_s
        joint.damping[0] = max(n**2 * motor.viscous_friction_nm_s_per_rad + fluid, 0.0)
        joint.frictionloss = 0.0 if lugre else dry * scales.torque_nm
        if lugre:
            stiffest = (BRISTLE_SWING / step) ** 2 * scales.inertia_kg_m2 / n**2
            stiffness = stiffest * values.get("stiffness", 1.0)
            actuator.biasprm[3] = dry * torque
            actuator.biasprm[4] = (dry + values.get("static", 0.0)) * torque
            actuator.biasprm[5] = values.get("stribeck", 0.1) * scales.speed_rad_s * n
            actuator.dynprm[5] = stiffness
            critical = 2.0 * math.sqrt(stiffness * scales.inertia_kg_m2 / n**2)
            actuator.dynprm[6] = values.get("lugre_damping", 0.0) * critical
        if "cogging" in values:
            actuator.biasprm[:3] = [values["cogging"] * torque, values["poles"] / n, values["phase"]]
        if "saturation" in values:
            actuator.forcerange[:] = [-values["saturation"] * torque, values["saturation"] * torque]


@dataclass
class Fit:
    """One set of parameters on a case: `fit` on some runs, `errors` on any."""

    robot: Robot
    runs: Sequence[RunData]
    settings: dict[str, Setting]
    iterations: int
    scales: Scales
    specs: list[mujoco.MjSpec] = field(default_factory=list)

    def __post_init__(self) -> None:
        for data in self.runs:
            if self.robot.axis is None:
                spec = robot_spec(self.robot, data)
            else:
                row = float(np.median(np.diff(data.inputs[0])))
                spec = axis_spec(self.robot, min(max(row / 2.0, SHORTEST_STEP_S), LONGEST_STEP_S))
            equip(spec, self.robot, list(self.settings), self.scales)
            self.specs.append(spec)

    def _controls(self, k: int, delay_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Times, s, and what the motors are fed, held between commands: V, or N·m of a torque drive."""
        data, step = self.runs[k], self.specs[k].option.timestep
        t, commands, bus = data.inputs[0], data.inputs[2], data.inputs[3]
        robot = self.robot
        fed = np.clip(commands, -robot.supply_v, robot.supply_v)
        if robot.driver.mode == "torque":
            fed = fed * robot.driver.torque_nm_per_v
        elif robot.driver.bus == "measured":
            fed = fed * (bus / robot.supply_v)[:, None]
        times = step * np.arange(math.ceil(float(t[-1]) / step - 1e-9) + 2)
        # The mean over a step, by the integral: it goes smoothly with the delay. A robot's command from before its
        # first row counts from there on.
        ends = np.append(data.inputs[1], max(times[-1] + step, data.inputs[1][-1] + step))
        area = np.vstack([np.zeros(fed.shape[1]), np.cumsum(fed * np.diff(ends)[:, None], axis=0)])
        edges = np.append(times, times[-1] + step) - delay_s
        there = [np.interp(edges, ends, area[:, side]) for side in range(len(self.specs[k].actuators))]
        return times, np.diff(np.column_stack(there), axis=0) / step

    def _start(self, k: int, model: mujoco.MjModel) -> np.ndarray:
        start, data = self.runs[k].inputs[6], mujoco.MjData(model)
        if self.robot.axis is not None:
            data.qpos[0], data.qvel[0] = start[3], start[5]
        else:
            yaw = start[2]
            data.qpos[:7] = [start[0], start[1], 0.0, math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)]
            data.qpos[7:9], data.qvel[6:8] = start[3:5], start[5:7]
        for side, actuator in enumerate(model.actuator_actadr):
            current = start[7 + side]
            if actuator >= 0 and self.robot.driver.mode == "voltage" and np.isfinite(current):
                data.act[actuator + model.actuator_actnum[side] - 1] = current
        state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        return state

    def out(self, k: int, model: mujoco.MjModel, states: np.ndarray) -> np.ndarray:
        """A rollout's states (steps, state) at the log's times, columns as `OUTPUTS`; currents are the motors'."""
        t = self.runs[k].inputs[0]
        nq, nv = model.nq, model.nv

        def at(column: int) -> np.ndarray:
            return np.interp(t, states[:, 0], states[:, column])

        found = np.zeros((len(t), len(OUTPUTS)))
        first_q, first_v = (0, 0) if self.robot.axis is not None else (7, 6)
        for side, letter in enumerate("lr"[: model.nu]):
            found[:, OUTPUT_INDEX[f"th_{letter}"]] = at(1 + first_q + side)
            found[:, OUTPUT_INDEX[f"w_{letter}"]] = at(1 + nq + first_v + side)
            if self.robot.driver.mode == "voltage":
                last = model.actuator_actadr[side] + model.actuator_actnum[side] - 1
                found[:, OUTPUT_INDEX[f"i_{letter}"]] = at(1 + nq + nv + last)
        if self.robot.axis is None:
            quaternion = states[:, 4:8]
            yaw = np.unwrap(2.0 * np.arctan2(quaternion[:, 3], quaternion[:, 0]))
            found[:, OUTPUT_INDEX["yaw"]] = np.interp(t, states[:, 0], yaw)
            found[:, OUTPUT_INDEX["x"]], found[:, OUTPUT_INDEX["y"]] = at(1), at(2)
            found[:, OUTPUT_INDEX["gyro_z"]] = at(1 + nq + 5)
        return found

    def errors(self, k: int, model: mujoco.MjModel, states: np.ndarray) -> dict[str, np.ndarray]:
        """Errors of a run by channel, in units of noise; none beyond `ASTRAY`."""
        found = gaps.errors(self.runs[k].log, self.robot, self.out(k, model, states))
        return {channel: np.clip(np.nan_to_num(error, nan=ASTRAY), -ASTRAY, ASTRAY) for channel, error in found.items()}

    def residual(self, chosen: Sequence[int]) -> Callable[..., Any]:
        """The residual of some runs as `mujoco.sysid.optimize` takes it: its squares sum to the gap's square."""
        from mujoco import sysid

        count: dict[str, int] = {}
        for k in chosen:
            there = np.zeros((len(self.runs[k].log.t), len(OUTPUTS)))
            for channel, error in gaps.errors(self.runs[k].log, self.robot, there).items():
                count[channel] = count.get(channel, 0) + len(error)
        weights = {c: 1.0 / math.sqrt(n * len(count)) for c, n in count.items() if n}
        parts = [self._part(sysid, k, weights) for k in chosen]

        def total(x: np.ndarray, params: Any, **more: Any) -> tuple[list, list, list]:
            found: tuple[list, list, list] = ([], [], [])
            for part in parts:
                for into, new in zip(found, part(x, params, **more), strict=True):
                    into.extend(new)
            return found

        return total

    def _part(self, sysid: Any, k: int, weights: dict[str, float]) -> Callable[..., Any]:
        spec = self.specs[k]
        times, fed = self._controls(k, 0.0)
        model = spec.compile()
        start = self._start(k, model)
        columns = np.zeros((len(times), 1))
        sequence = sysid.ModelSequences(
            "case", spec, self.runs[k].log.name, start, sysid.TimeSeries(times, fed),
            sysid.TimeSeries(times, columns, {"none": (sysid.SignalType.CustomObs, np.array([0]))}),
            allow_missing_sensors=True,
        )  # fmt: skip

        def build(params: Any, one: mujoco.MjSpec) -> mujoco.MjModel:
            apply(one, self.robot, self._values(params), self.scales)
            return one.compile()

        def roll(*, models: Any, datas: Any, param_dicts: Any, **_: Any) -> list[Any]:
            late = [self._controls(k, self._values(params).get("delay", 0.0))[1] for params in param_dicts]
            states = rolled(list(models), list(datas), np.tile(start, (len(late), 1)), np.stack(late))
            return [SimpleNamespace(state=SimpleNamespace(data=one), sensordata=None) for one in states]

        def missed(
            params: Any, predicted: Any, measured: Any, model: Any, _: bool, state: Any = None, **__: Any
        ) -> Any:
            errors = self.errors(k, model, np.vstack([start, state]))
            return np.concatenate([errors[c] * weights[c] for c in weights if c in errors]), measured, measured

        return sysid.build_residual_fn(
            models_sequences=[sequence], build_model=build, custom_rollout=roll, modify_residual=missed,
            resample_true=False, n_threads=1,
        )  # fmt: skip

    def _values(self, params: Any) -> dict[str, float]:
        return {name: float(params[name].value[0]) for name in self.settings}

    def fit(self, chosen: Sequence[int], known: Mapping[str, float] | None = None) -> dict[str, float]:
        """Values that minimise the gap of some runs; `known`: values of a smaller fit, one more start."""
        from mujoco import sysid

        residual, best = self.residual(chosen), None
        starts: list[Mapping[str, float]] = [{"coulomb": share} for share in STARTS]
        for begin in [*starts[: 2 if "coulomb" in self.settings else 1], *([known] if known else [])]:
            params = sysid.ParameterDict()
            for name, one in self.settings.items():
                start = min(max(begin.get(name, one.start), one.low), one.high)
                params.add(sysid.Parameter(name, start, one.low, one.high))
            params, result = self._optimise(sysid, params, residual, FIRST_STEPS)
            if best is None or result < best[1]:
                best = params, result
        assert best is not None
        return self._values(self._optimise(sysid, best[0], residual, self.iterations)[0])

    def _optimise(self, sysid: Any, params: Any, residual: Any, steps: int) -> tuple[Any, float]:
        spans = np.array([min(one.high - one.low, 1.0 + abs(one.start)) for one in self.settings.values()])
        params.move_off_bounds()
        # The optimiser prints each step, whatever it is told.
        with contextlib.redirect_stdout(io.StringIO()):
            found, _ = sysid.optimize(
                params, residual, optimizer="mujoco", verbose=False, max_iters=steps, x_scale=spans
            )
        missed = np.concatenate(residual(found.as_vector(), found)[0])
        return found, float(missed @ missed)

    def gap(self, values: dict[str, float], chosen: Sequence[int]) -> list[dict[str, np.ndarray]]:
        """Errors on some runs with given values, by run."""
        found = []
        for k in chosen:
            apply(self.specs[k], self.robot, values, self.scales)
            model = self.specs[k].compile()
            start = self._start(k, model)
            fed = self._controls(k, values.get("delay", 0.0))[1]
            states = rolled([model], [mujoco.MjData(model)], start[None], fed[None])[0]
            found.append(self.errors(k, model, states))
        return found


@dataclass(frozen=True)
class Row:
    """A line of the table: gaps on runs left out and processor time, s, of the fits; `beyond`: named effects that the
    actuator has no parameter for."""

    name: str
    nominal: float
    named: float
    everything: float
    diagnosis: float
    named_s: float
    everything_s: float
    diagnosis_s: float
    named_effects: tuple[str, ...]
    beyond: tuple[str, ...]
    values: dict[str, float]


def left_out(
    fit: Fit, folds: int, known: Sequence[Mapping[str, float]] | None = None
) -> tuple[float, float, list[dict[str, float]]]:
    """Gap on runs that were left out in `folds` groups, processor time of all fits, s, and each fit's values.

    known : values of a smaller fit by group.
    """
    everyone, began = range(len(fit.runs)), time.process_time()
    parts: list[dict[str, np.ndarray]] = []
    values = []
    for group in range(min(folds, len(fit.runs))):
        out = [k for k in everyone if k % min(folds, len(fit.runs)) == group]
        values.append(fit.fit([k for k in everyone if k not in out], known[group] if known else None))
        parts += fit.gap(values[-1], out)
    return gaps.gap(gaps.pooled(parts)), time.process_time() - began, values


def row_of(case: Case, folds: int, iterations: int, report: Path | None = None, from_nominal: bool = False) -> Row:
    """A case's line. `report`: folder of a diagnosis that is there already; its processor time is then not a number.
    `from_nominal`: the fit of all parameters does not also start from the smaller fit's values.

    Raises
    ------
    InputError : a robot driven by wheel speeds, or a single run.
    """
    robot = case.robot
    if robot.driver.mode == "speed":
        raise InputError(f"{case.name}: is driven by wheel speeds, whose loop is no part of a <dcmotor>")
    if len(case.runs) < 2:
        raise InputError(f"{case.name}: holds one run, none can be left out")
    began = time.process_time()
    found = diagnose(case, quick=True, threads=1)[0] if report is None else read_object(report / "diagnosis.json")
    diagnosis_s = time.process_time() - began if report is None else math.nan
    runs = Problem(taken(case, examine(case)), 1).whole
    scales = scales_of(robot, runs)
    names = tuple(entry["id"] for entry in found["effects"])
    free = {parameter for name in names for parameter in EXPRESSED.get(name, ())}
    plain = Fit(robot, runs, {}, iterations, scales)
    nominal = gaps.gap(gaps.pooled(plain.gap({}, range(len(runs)))))
    small = Fit(robot, runs, settings_of(robot, sorted(free), True, scales), iterations, scales)
    named = left_out(small, folds)
    large = Fit(robot, runs, settings_of(robot, [], False, scales), iterations, scales)
    everything = left_out(large, folds, None if from_nominal else named[2])
    return Row(
        name=case.name,
        nominal=nominal,
        named=named[0],
        everything=everything[0],
        diagnosis=float(found["gap"]["after"]),
        named_s=named[1],
        everything_s=everything[1] + (0.0 if from_nominal else named[1]),
        diagnosis_s=diagnosis_s,
        named_effects=names,
        beyond=tuple(name for name in names if name not in EXPRESSED),
        values=everything[2][-1],
    )


HEAD = (
    "| case | nominal | `<dcmotor>`, named | `<dcmotor>`, all | `rtds diagnose` | named; bold: no parameter for it "
    "| processor time, s |\n|---|---|---|---|---|---|---|"
)


def line(row: Row) -> str:
    """A row as a line of a Markdown table."""
    named = ", ".join(f"**{name}**" if name in row.beyond else name for name in row.named_effects) or "nothing"
    times = [row.named_s, row.everything_s, *([] if math.isnan(row.diagnosis_s) else [row.diagnosis_s])]
    return (
        f"| {row.name} | {row.nominal:.3g} | {row.named:.3g} | {row.everything:.3g} | {row.diagnosis:.3g} | {named} | "
        f"{', '.join(f'{one:.0f}' for one in times)} |"
    )


def main(words: Sequence[str] | None = None) -> int:
    """Print the table, a line a case as it is done; 2 on bad input."""
    parser = argparse.ArgumentParser(prog="python -m rtds_host.bench.sysid", description=__doc__.partition("\n")[0])
    parser.add_argument("case", nargs="+", type=Path, help="folder of a case with two runs or more")
    parser.add_argument("--folds", type=int, default=4, help="groups of runs that are left out in turn")
    parser.add_argument("--iterations", type=int, default=15, help="most steps of MuJoCo's optimiser")
    parser.add_argument("--reports", type=Path, help="folder with a diagnosis a case, REPORTS/NAME/diagnosis.json")
    parser.add_argument(
        "--from-nominal", action="store_true", help="start the fit of all parameters from the nominal ones alone"
    )
    parser.add_argument("--values", action="store_true", help="also print the fitted parameters, as JSON")
    given = parser.parse_args(words)
    try:
        if not hasattr(mujoco, "mjtCtrlInput"):
            raise InputError(f"MuJoCo {mujoco.__version__}: 4.0 or later is needed")
        if given.folds < 2 or given.iterations < 1:
            raise InputError("--folds and --iterations: at least 2 and 1")
        if importlib.util.find_spec("absl") is None or not hasattr(mujoco_sysid(), "optimize"):
            raise InputError("mujoco.sysid: the packages it needs are not installed; pip install 'rtds-host[sysid]'")
        logging.getLogger("absl").setLevel(logging.ERROR)
        print(HEAD, flush=True)
        for folder in given.case:
            report = given.reports and given.reports / folder.name
            row = row_of(read_case(folder), given.folds, given.iterations, report, given.from_nominal)
            print(line(row), flush=True)
            if given.values:
                print(json.dumps(row.values), file=sys.stderr)
    except RtdsError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def mujoco_sysid() -> Any:
    """MuJoCo's toolbox; without the packages that it needs it is an empty module."""
    from mujoco import sysid

    return sysid


def rolled(models: list, datas: list, starts: np.ndarray, controls: np.ndarray) -> np.ndarray:
    """States (models, steps, state) from their starts on, one control a step held; mujoco.rollout on one thread.

    A rollout that went astray repeats its last state, whose time would then stand: times are those of the steps.
    """
    from mujoco import rollout

    states, _ = rollout.rollout(models, datas[:1], starts, controls[:, :-1])
    states = np.concatenate([starts[:, None], states], axis=1)
    states[:, :, 0] = models[0].opt.timestep * np.arange(states.shape[1])
    return states


if __name__ == "__main__":
    sys.exit(main())
