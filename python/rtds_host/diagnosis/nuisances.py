"""What every robot differs in from its file, within known tolerances, and what is no effect therefore (contract,
sections 2, 7).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from rtds_host.contract import Case, Robot
from rtds_host.diagnosis.replay.model import Model
from rtds_host.diagnosis.thresholds import MINOR_SHARE

# One sigma of the logarithm of R, K, J and B (contract, section 2).
PRIOR = 0.01
# A ratio within three sigmas of 1 on a constant with a tolerance is a nuisance (contract, section 2); of R, K, J and B
# without a declared one, within `BAND`.
SIGMAS = 3.0
BAND = SIGMAS * PRIOR
# Probability: no tolerance lies beyond so many sigmas; of normal ones one in two thousand would.
LIMIT = 3.5
# One sigma of the logarithm of a servo's declared gains (contract, section 7).
SERVO_PRIOR = math.log(2.0)
# The same of gains that nobody declared: what is guessed may be slight against what there is.
SERVO_PRIOR_UNDECLARED = -math.log(MINOR_SHARE)
# Physical: a speed command passes a bus and waits for the cycle of the board behind it, and what comes back is stamped
# when it is read: boards and servo buses are asked 50 to 200 times a second.
LATENCY_S = 0.01
# A controller's cycle is about that of its boards; a log whose rows are no further apart has each command in its own
# row.
CONTROLLER_S = (1.0 + MINOR_SHARE) * LATENCY_S
# Probability: one sigma of a share that nobody declares: a servo's integral stands at the limit, or gives way by up to
# all that the limit cuts; which, no sheet says.
RELEASE = 0.5
# Physical: gyro and pose come from devices of their own, whose clocks are some milliseconds off the wheels'.
SKEW_S = 0.003


@dataclass(frozen=True)
class Nuisance:
    """One nuisance of a side, or (`side` None) of the whole robot.

    keys : its name in the file -> the model's entry; nominal : by key, SI; sigma : one sigma of its logarithm, or,
    where the file knows no such thing (`nominal` empty), of its value; low, high : its least and largest value, in
    sigmas; estimated : the file leaves it out, so that a diagnosis reports it wherever it came to.
    """

    name: str
    side: int | None
    keys: dict[str, str]
    nominal: dict[str, float]
    sigma: float
    low: float = -LIMIT
    high: float = LIMIT
    estimated: bool = False

    def values(self, z: float) -> dict[str, float]:
        """What the file would have to say, SI, at z sigmas."""
        return {
            key: self.nominal[key] * math.exp(self.sigma * z) if self.nominal else self.sigma * z for key in self.keys
        }

    def apply(self, model: Model, z: float) -> None:
        """Put it into a model at z sigmas."""
        sides = (0, 1) if self.side is None else (self.side,)
        change, value = (model.scale, math.exp(self.sigma * z)) if self.nominal else (model.put, self.sigma * z)
        for quantity in self.keys.values():
            change(quantity, value, sides)


# Names in [motor] and [servo] -> entries of the model; those of a nuisance vary together.
MOTOR = {
    "resistance": {"resistance_ohm": "resistance"},
    "constant": {"torque_constant_nm_per_a": "torque_constant", "back_emf_constant_v_s_per_rad": "back_emf"},
    "inertia": {"rotor_inertia_kg_m2": "rotor_inertia"},
    "viscous": {"viscous_friction_nm_s_per_rad": "viscous"},
}
# Those that have a tolerance only where the file declares one; of the whole robot.
WINDING = {"inductance": {"inductance_h": "inductance"}}
GEAR = {"gear_ratio": {"gear_ratio": "gear_ratio"}}
CHASSIS = {
    "mass": {"mass_kg": "mass"},
    "yaw_inertia": {"yaw_inertia_kg_m2": "yaw_inertia"},
    "wheel_radius": {"wheel_radius_m": "radius"},
    "wheel_inertia": {"wheel_inertia_kg_m2": "wheel_inertia"},
    "track_width": {"track_width_m": "track"},
    "com_x": {"com_x_m": "com_x"},
    "com_y": {"com_y_m": "com_y"},
}
AXIS = {
    "inertia": {"inertia_kg_m2": "axis_inertia"},
    "mass": {"mass_kg": "axis_mass"},
    "length": {"length_m": "axis_arm"},
    "travel": {"metres_per_rad": "axis_arm"},
}
SERVO = {"servo_kp": {"kp_v_s_per_rad": "servo_kp"}, "servo_ki": {"ki_v_per_rad": "servo_ki"}}
LATENCY = {"latency_s": "latency"}
EARLY = {"command_early_s": "command_early"}
ANTI_WINDUP = {"anti_windup": "servo_release"}
SKEWS = {"gyro_z": {"gyro_delay_s": "gyro_delay"}, "yaw": {"pose_delay_s": "pose_delay"}}
# Name in a diagnosis' `setup` -> entry of the model.
SETUP = {key: quantity for keys in (LATENCY, ANTI_WINDUP, EARLY, *SKEWS.values()) for key, quantity in keys.items()}
# No nuisance: where the encoder was taken to sit.
SETUP["encoder_at_wheel"] = "encoder_at_wheel"
# Names in diagnoses of earlier versions, and the present ones.
FORMER_SETUP = {"gyro_late_s": "gyro_delay_s", "pose_late_s": "pose_delay_s"}


def body_of(robot: Robot) -> dict[str, dict[str, str]]:
    """Constants of what the motors move, that may have a declared tolerance: nuisance -> {name in the file: entry}."""
    if robot.axis is None:
        return CHASSIS
    # The arm is a length, or a travel.
    unused = {"pendulum": "travel", "linear": "length"}.get(robot.axis.kind)
    return {name: keys for name, keys in AXIS.items() if name != unused}


def entries(robot: Robot) -> dict[str, str]:
    """Name in a diagnosis' `nominal_fit` -> entry of the model of a robot."""
    groups = (*MOTOR.values(), *WINDING.values(), *GEAR.values(), *body_of(robot).values(), *SERVO.values())
    return {key: quantity for keys in groups for key, quantity in keys.items()}


def sigma_of(relative: float) -> float:
    """One sigma of the logarithm of a positive constant whose relative standard deviation is given: that of a
    log-normal distribution, so that a constant known to 40 % only stays positive."""
    return math.sqrt(math.log1p(relative**2))


def tolerance(robot: Robot, keys: Iterable[str], default: float = 0.0) -> float:
    """One sigma of the logarithm of constants that vary together: the widest declared, `default` without any."""
    declared = [known for key in keys if (known := robot.tolerance_of(key)) is not None]
    return sigma_of(max(declared)) if declared else default


def band(robot: Robot, of: str) -> float:
    """By how much of 1 a ratio of a constant, as `motor.resistance_ohm`, is a tolerance yet and no cause; 0 where the
    constant has none."""
    section, _, key = of.partition(".")
    group = next((keys for keys in MOTOR.values() if key in keys), {key: ""})
    known = group if section == "motor" else {key: ""}
    return SIGMAS * tolerance(robot, known, PRIOR if section == "motor" and key in entries_of_motor() else 0.0)


def entries_of_motor() -> set[str]:
    """Names in [motor] that have a tolerance though none is declared (contract, section 2)."""
    return {key for keys in MOTOR.values() for key in keys}


def nuisances_of(case: Case, nominal: Model) -> list[Nuisance]:
    """Those that play a part on the robot or the axis of a case, whose nominal model is given."""
    robot = case.robot
    found = []
    winding = ("resistance", "constant", "inductance") if robot.driver.mode == "torque" else ()
    for side in range(len(robot.sides)):
        for name, keys in (MOTOR | WINDING).items():
            sigma = tolerance(robot, keys, PRIOR if name in MOTOR else 0.0)
            if sigma > 0.0 and name not in winding and nominal.get(next(iter(keys.values())), side) > 0:
                found.append(Nuisance(name, side, keys, {key: getattr(robot.motor, key) for key in keys}, sigma))
    found += _declared(robot)
    # A logger that is slower than the controller shows a command in the first row after it began to act: anywhere
    # within a row, and a uniform's second moment is a third of its square.
    row_s = float(np.median([np.median(np.diff(log.t)) for log in case.runs]))
    if row_s > CONTROLLER_S:
        found.append(Nuisance("command's row", None, EARLY, {}, row_s / math.sqrt(3.0), low=0.0, high=math.sqrt(3.0)))
    servo = robot.servo
    if servo is not None:
        found += [
            Nuisance(
                name,
                None,
                keys,
                {key: getattr(servo, key) for key in keys},
                SERVO_PRIOR if declared else SERVO_PRIOR_UNDECLARED,
                estimated=not declared,
            )
            for name, keys in SERVO.items()
            for declared in (not servo.left_out & keys.keys(),)
            if nominal.get(name) > 0
        ]
        found.append(Nuisance("latency", None, LATENCY, {}, LATENCY_S, low=0.0))
        if nominal.get("servo_ki") > 0:
            found.append(Nuisance("anti-windup", None, ANTI_WINDUP, {}, RELEASE, low=0.0, high=1.0 / RELEASE))
    if robot.chassis is not None:
        found += [
            Nuisance(f"{channel} clock", None, keys, {}, SKEW_S)
            for channel, keys in SKEWS.items()
            if robot.noise(channel) is not None and any(log.has(channel) for log in case.runs)
        ]
    return found


def _declared(robot: Robot) -> list[Nuisance]:
    """Those of the gear and of what the motors move, which the file declares to be known to some per cent only."""
    body = robot.axis or robot.chassis
    groups = [(robot.motor, GEAR), (body, body_of(robot))]
    return [
        Nuisance(name, None, keys, {key: getattr(where, key) for key in keys}, sigma)
        for where, names in groups
        for name, keys in names.items()
        if (sigma := tolerance(robot, keys)) > 0.0 and all(getattr(where, key) != 0.0 for key in keys)
    ]
