"""What every robot differs in from its file, within known tolerances, and what is no effect therefore (contract,
sections 2, 7).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rtds_host.contract import Case
from rtds_host.diagnosis.replay.model import Model

# One sigma of the logarithm of R, K, J and B (contract, section 2).
PRIOR = 0.01
# A ratio within this of 1 on R, K, J or B is a nuisance (contract, section 2).
BAND = 0.03
# Probability: no tolerance lies beyond so many sigmas; of normal ones one in two thousand would.
LIMIT = 3.5
# One sigma of the logarithm of a servo's declared gains (contract, section 7).
SERVO_PRIOR = math.log(2.0)
# Probability: the same of gains that nobody declared.
SERVO_PRIOR_UNDECLARED = math.log(10.0)
# Physical: a speed command passes a bus and waits for the cycle of the board behind it, and what comes back is stamped
# when it is read: boards and servo buses are asked 50 to 200 times a second.
LATENCY_S = 0.01
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
    sigmas.
    """

    name: str
    side: int | None
    keys: dict[str, str]
    nominal: dict[str, float]
    sigma: float
    low: float = -LIMIT
    high: float = LIMIT

    def values(self, z: float) -> dict[str, float]:
        """What the file would have to say, SI, at z sigmas."""
        return {
            key: self.nominal[key] * math.exp(self.sigma * z) if self.nominal else self.sigma * z for key in self.keys
        }

    def apply(self, model: Model, z: float) -> None:
        """Put it into a model at z sigmas."""
        sides = (0, 1) if self.side is None else (self.side,)
        values = self.values(z)
        for key, slot in self.keys.items():
            if self.nominal:
                model.scale(slot, math.exp(self.sigma * z), sides)
            else:
                model.put(slot, values[key], sides)


# Names in [motor] and [servo] -> entries of the model; those of a nuisance vary together.
MOTOR = {
    "resistance": {"resistance_ohm": "resistance"},
    "constant": {"torque_constant_nm_per_a": "torque_constant", "back_emf_constant_v_s_per_rad": "back_emf"},
    "inertia": {"rotor_inertia_kg_m2": "rotor_inertia"},
    "viscous": {"viscous_friction_nm_s_per_rad": "viscous"},
}
SERVO = {"servo_kp": {"kp_v_s_per_rad": "servo_kp"}, "servo_ki": {"ki_v_per_rad": "servo_ki"}}
LATENCY = {"latency_s": "latency"}
ANTI_WINDUP = {"anti_windup": "servo_release"}
SKEWS = {"gyro_z": {"gyro_late_s": "gyro_late"}, "yaw": {"pose_late_s": "pose_late"}}
# Name in a diagnosis' `nominal_fit`, and in its `setup` -> entry of the model.
ENTRIES = {key: slot for keys in (*MOTOR.values(), *SERVO.values()) for key, slot in keys.items()}
SETUP = {key: slot for keys in (LATENCY, ANTI_WINDUP, *SKEWS.values()) for key, slot in keys.items()}


def nuisances_of(case: Case, nominal: Model) -> list[Nuisance]:
    """Those that play a part on the robot or the axis of a case, whose nominal model is given."""
    robot = case.robot
    found = []
    winding = ("resistance", "constant") if robot.driver.mode == "torque" else ()
    for side in range(len(robot.sides)):
        for name, keys in MOTOR.items():
            if name not in winding and nominal.get(next(iter(keys.values())), side) > 0:
                found.append(Nuisance(name, side, keys, {key: getattr(robot.motor, key) for key in keys}, PRIOR))
    if robot.driver.mode == "speed":
        sigma = SERVO_PRIOR if robot.servo.declared else SERVO_PRIOR_UNDECLARED
        found += [
            Nuisance(name, None, keys, {key: getattr(robot.servo, key) for key in keys}, sigma)
            for name, keys in SERVO.items()
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
