"""The scales of a machine: what a large torque, speed, voltage or mass is on it, from its file and its runs.

Priors, bounds and starts of effects are shares of these, so that a micromouse and a robot of 50 kg are searched alike.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtds_host.contract import GRAVITY_M_S2, Robot, RunLog
from rtds_host.diagnosis.thresholds import FEW_SHARE
from rtds_host.scenario.linear import SCENARIO

# A run's length, s, for what is asked of a robot without runs: that of the paper's straight line.
USUAL_RUN_S = SCENARIO.values()["duration_s"]


# Scales that depend on how long runs last, and, where torque is commanded and no speed has a limit, on how fast they
# were, or on how much was asked of the motor.
OF_RUNS, OF_SPEEDS_MET, OF_ASKED = {"run", "decline"}, {"speed", "viscous", "tread", "turn"}, {"torque", "spin"}


@dataclass(frozen=True)
class Scales:
    """Scales in SI, at the wheel's side of the gear; 1 where a machine has no such thing.

    torque : N·m, at stall (torque mode: at the largest command); speed : rad/s, without load (torque mode: the largest
    met); viscous : N·m·s/rad, torque over speed; loss : N·m·s/rad, the nominal B; volts : V, supply; asked : V, the
    largest command of the runs (infinite where speeds are commanded, and without any); decline : V/s, all of the supply
    over the longest run; ohm : winding; amps : A, at stall; per_watt : 1/W, of the power at stall; force : N, weight on
    a wheel; give : 1/N, its inverse; tread : N·s/m, force over rim speed; mass : kg (of an axis: in shares of its
    load); radius, track : m; spin : N·m, torque about the vertical of both wheels at stall; turn : rad/s, on the spot
    without load; run : s, longest run; movable : of an axis, the load beyond the declared that its motor could move, in
    shares of the declared; 0 of a robot.
    """

    torque: float
    speed: float
    volts: float
    ohm: float
    amps: float
    loss: float
    mass: float = 1.0
    force: float = 1.0
    radius: float = 1.0
    track: float = 1.0
    run: float = USUAL_RUN_S
    asked: float = math.inf
    movable: float = 0.0

    one: float = 1.0

    @property
    def viscous(self) -> float:
        return self.torque / self.speed

    @property
    def decline(self) -> float:
        return self.volts / self.run

    @property
    def per_watt(self) -> float:
        return 1.0 / (self.volts * self.amps)

    @property
    def give(self) -> float:
        return 1.0 / self.force

    @property
    def softness(self) -> float:
        return self.radius / self.force

    @property
    def tread(self) -> float:
        return self.force / (self.radius * self.speed)

    @property
    def spin(self) -> float:
        return self.torque / self.radius * self.track

    @property
    def turn(self) -> float:
        return 2.0 * self.radius * self.speed / self.track


def scales_of(robot: Robot, runs: Sequence[RunLog] = ()) -> Scales:
    """Scales of a robot or an axis; `runs`: its logs, which say how fast and how long it ran where its file
    does not.
    """
    motor, volts = robot.motor, robot.supply_v
    longest = max((float(log.t[-1] - log.t[0]) for log in runs), default=USUAL_RUN_S)
    asked = (
        max((float(np.abs(log.commands("voltage")).max()) for log in runs), default=0.0)
        if robot.driver.mode != "speed"
        else 0.0
    )
    asked = asked if asked > 0.0 else math.inf
    if robot.driver.mode == "torque":
        torque = motor.gear_ratio * robot.driver.torque_nm_per_v * min(asked, volts)
        speed, ohm, amps = _met(runs), 1.0, 1.0
    else:
        ohm, amps = motor.resistance_ohm, volts / motor.resistance_ohm
        torque = motor.gear_ratio * motor.torque_constant_nm_per_a * amps
        speed = volts / (motor.gear_ratio * motor.back_emf_constant_v_s_per_rad)
    loss = motor.gear_ratio**2 * motor.viscous_friction_nm_s_per_rad
    body = robot.chassis
    if body is None:
        run = max(longest, 1e-3)
        return Scales(abs(torque), speed, volts, ohm, amps, loss, run=run, asked=asked, movable=_movable(robot))
    return Scales(
        abs(torque),
        speed,
        volts,
        ohm,
        amps,
        loss,
        body.mass_kg,
        0.5 * body.mass_kg * GRAVITY_M_S2,
        body.wheel_radius_m,
        body.track_width_m,
        max(longest, 1e-3),
        asked,
    )


def _movable(robot: Robot) -> float:
    """Load that an axis' motor could move at its full command, in shares of the declared one; 0 without any declared.

    It takes that load to its speed without load in `USUAL_RUN_S` (torque mode: to 1 rad/s), or holds it level.
    """
    motor, axis = robot.motor, robot.axis
    if axis is None:
        return 0.0
    ratio = motor.gear_ratio
    if robot.driver.mode == "torque":
        torque, speed = abs(ratio * robot.driver.torque_nm_per_v * robot.supply_v), 1.0
    else:
        torque = ratio * motor.torque_constant_nm_per_a * robot.supply_v / motor.resistance_ohm
        speed = robot.supply_v / (ratio * motor.back_emf_constant_v_s_per_rad)
    inertia = torque * USUAL_RUN_S / speed
    if axis.kind == "inertia":
        return inertia / axis.inertia_kg_m2 if axis.inertia_kg_m2 > 0.0 else 0.0
    arm = abs(axis.length_m if axis.kind == "pendulum" else axis.metres_per_rad)
    if axis.mass_kg * arm <= 0.0:
        return 0.0
    mass = inertia / arm**2
    if axis.kind == "pendulum":
        mass = max(mass, torque / (GRAVITY_M_S2 * arm))
    return mass / axis.mass_kg


def _met(runs: Sequence[RunLog]) -> float:
    """Largest speed met, rad/s, by the speed's or the angle's samples; 1 without any."""
    found = 0.0
    for log in runs:
        for side in "lr":
            w, th = log.columns.get(f"w_{side}"), log.columns.get(f"th_{side}")
            if w is not None and np.isfinite(w).any():
                found = max(found, float(np.nanquantile(np.abs(w), 1.0 - FEW_SHARE)))
            elif th is not None and np.isfinite(th).sum() > 2:
                good = np.isfinite(th)
                found = max(
                    found, float(np.quantile(np.abs(np.diff(th[good]) / np.diff(log.t[good])), 1.0 - FEW_SHARE))
                )
    return found if found > 0.0 and math.isfinite(found) else 1.0
