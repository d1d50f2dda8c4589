"""Cases of the tier `formed`: one or two effects of the catalogue, and a random curve in one equation (`curve.py`).

No list of unmodelled effects is drawn from: the equation, the quantity, the side and the shape are random. So the tier
asks whether a diagnoser finds functions that nobody wrote down.

How much of the curve no name makes up for is measured as in `hard.py`. The nearest machine of the catalogue has the
constants, the effects' own sizes and the effects that lie in the curve's equation as knobs. The curve is made so large
that the best fit of this machine leaves a gap of about `LEFT_GAP`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rtds_host.blind import curve, hard, machines, planar
from rtds_host.blind.accounts import draw_causes
from rtds_host.blind.scales import Scale, scale_of
from rtds_host.compat import tomllib

LEFT_GAP = (1.6, 6.0)  # what the best fit of the catalogue is to leave
KEPT_GAP = (1.3, 9.0)  # what it may leave
ROOM = 1.3  # an effect's own change, over what is left, when a curve's size is drawn
MOST_RUNS, LONGEST_S = 4, 6.0
CONSTANTS = 0.01  # one sigma of R, K, J and B of each motor, relative
ROUNDS = 60
TRIES = 6  # of a curve's size
FIT_ROUNDS = 4
CLOSE = 1.15  # a size is right where its gap is within this factor of the one wanted
FIRST, LARGEST = 0.03, 0.4  # of a curve, as a share of what is large of its term
# Knobs of the nearest machine: parameter of the planar world and its unit, by what is large of the term.
NEAREST = {
    "voltage_over_command": (("drop", 0.02), ("deadzone", 0.02), ("curve", 0.1), ("gain", 0.05)),
    "voltage_over_current": (("drop", 0.02), ("deadzone", 0.02), ("gain", 0.05)),
    "flux_over_current": (),
    "torque_over_speed": (("coulomb", 0.02), ("viscous", 0.02), ("asym_torque", 0.01), ("asym_viscous", 0.01)),
    "torque_over_angle": (),
    "damping_over_time": (("coulomb", 0.02), ("viscous", 0.02)),
    "yaw_torque_over_yaw_rate": (("scrub", 0.02),),
    "force_over_speed": (("coulomb", 0.02), ("viscous", 0.02)),
    "force_over_place": (("coulomb", 0.02),),
    "speed_over_speed": (("speed_gain", 0.02),),
    "current_over_current": (("current_gain", 0.02), ("current_bias", 0.02)),
    "gyro_over_yaw_rate": (("gyro_gain", 0.02), ("gyro_bias", 0.02)),
}
BODY = ("scrub", "gyro_gain", "gyro_bias")
NOT_NEGATIVE = ("drop", "deadzone", "coulomb", "scrub")


def possible(robot, missing: list[str]) -> list[str]:
    """Laws that a machine can have and its log's channels can show."""
    gone = list(curve.WHOLE) if robot.axis is not None else []
    if robot.driver.mode == "torque":
        gone += ["voltage_over_current", "flux_over_current", "current_over_current"]
    shown_by = (
        ("w", "speed_over_speed"),
        ("i", "current_over_current"),
        ("gyro_z", "gyro_over_yaw_rate"),
        ("th", "torque_over_angle"),
    )
    gone += [law for stem, law in shown_by if stem in missing]
    return [law for law in curve.LAWS if law not in gone]


def large(law: str, of: Scale, reached: float) -> float:
    """What is large of a law's term on a machine, in its unit; reached : the largest size of what the law runs over."""
    return {
        "voltage": of.volts,
        "torque_constant": 1.0,
        "torque": of.torque,
        "damping": of.drag,
        "yaw_torque": of.force * of.track,
        "force": of.force,
    }.get(curve.LAWS[law][0], reached)


def _range(law: str, robot, truth: hard.Truth) -> tuple[float, float]:
    """Ends of what a machine's runs pass through of the quantity of a law."""
    quantity = curve.LAWS[law][1]
    if quantity == "th":
        return 0.0, 2.0 * math.pi
    if quantity == "t":
        return 0.0, max(float(drive.t[-1]) for drive in truth.drives)
    if quantity == "v_cmd":
        seen = [np.abs(drive.v_cmd).ravel() for drive in truth.drives]
    elif quantity == "speed":
        seen = [np.abs(run["w_l"] + run["w_r"]) * 0.5 * robot.chassis.wheel_radius_m for run in truth.there]
    else:
        names = {"i": ("i_l", "i_r"), "w": ("w_l", "w_r"), "yaw_rate": ("gyro_z",), "x": ("x",)}[quantity]
        seen = [run[name] for run in truth.there for name in names]
    values = np.concatenate(seen)
    if quantity == "x":
        return float(values.min()), float(values.max())
    most = float(np.quantile(np.abs(values), 0.99))
    return -most, most


def draw_curve(rng: np.random.Generator, robot, law: str, low: float, high: float) -> Callable[[float], dict]:
    """A random law on a random side: its size in its term's unit -> the form as a spec has it."""
    shape = curve.draw_shape(rng, law, low, high)
    sides = ["left"] if robot.axis is not None else ["both"] if law in curve.WHOLE else ["both", "left", "right"]
    side = str(rng.choice(sides)) if len(sides) > 1 else sides[0]
    sign = 1.0 if law in (*curve.PASSIVE, "damping_over_time") else float(rng.choice([-1.0, 1.0]))
    equation, quantity, place, names = curve.LAWS[law]

    def made(size: float) -> dict:
        values = [float(f"{value:.5g}") for value in sign * size * shape]
        return {
            "id": law,
            "side": side,
            "subsystem": place,
            "equation": equation,
            "over": quantity,
            "parameters": {"curve": [curve.CODES[law], low, high, *values]},
            "names": list(names),
        }

    return made


def _shifting(target: str, unit: float, sides: tuple[int, ...]) -> Callable[[planar.Machine, float], None]:
    """A knob that adds the logarithm of its factor, in units: from nothing on in both directions."""

    def turn(machine: planar.Machine, factor: float) -> None:
        more = unit * math.log(factor)
        sensing = machine.sensing
        if target in ("gyro_gain", "gyro_bias"):
            setattr(sensing, target, getattr(sensing, target) + more)
        elif hasattr(sensing, target):
            getattr(sensing, target)[list(sides)] += more
        else:
            before = machine.get(target, sides)
            machine.set(target, max(before + more, 0.0) if target in NOT_NEGATIVE else before + more, sides)

    return turn


def nearest(robot, spec: dict, law: str, of: Scale, reached: float) -> hard.Nearest:
    """The nearest machine of the catalogue: constants, the effects' sizes, and the effects of the curve's equation."""
    plain = hard.nearest(robot, spec["constants"], [], spec["effects"])
    sides = (0,) if robot.axis is not None else (0, 1)
    units = {"coulomb": of.torque, "asym_torque": of.torque, "viscous": of.drag, "asym_viscous": of.drag}
    units |= {"drop": of.volts, "deadzone": of.volts, "scrub": of.force * of.track}
    units |= {"current_bias": of.amps, "gyro_bias": reached}
    knobs = [
        hard.Knob(_shifting(target, share * units.get(target, 1.0), (side,)), law)
        for target, share in NEAREST[law]
        for side in (sides if target not in BODY else (0,))
    ]
    return hard.Nearest(plain.robot, plain.ratios, plain.effects, [*plain.knobs, *knobs])


def draw_case(rng: np.random.Generator, spec: dict) -> None:
    """Fill a spec of tier `formed`: machine, runs, constants, effects, the curve, and what the best fit leaves."""
    for _ in range(ROUNDS):
        machines.draw_conditions(rng, spec, False)
        spec["runs"] = spec["runs"][:MOST_RUNS]
        for run in (*spec["runs"], *spec["held_out"]):
            run["plan"] = int(rng.integers(2**31))
            run["duration"] = min(run["duration"], LONGEST_S)
        robot = machines.robot_of(spec["robot"])
        spec["constants"], spec["forms"] = _constants(rng, spec["robot"]), []
        spec["effects"], _ = draw_causes(rng, robot, spec)
        if _drawn(rng, robot, spec):
            return
    raise RuntimeError(f"no machine of tier formed was found in {ROUNDS} draws")


def _constants(rng: np.random.Generator, text: str) -> dict:
    """The ratios that a machine has of what its file says, as `planar.put_ratios` takes them."""
    known = [name for name in planar.TOLERANCE_NAMES if name in tomllib.loads(text)["motor"]]
    ratios: dict = {
        side: {name: 1.0 + CONSTANTS * float(np.clip(rng.standard_normal(), -2.5, 2.5)) for name in known}
        for side in "lr"
    }
    return ratios | {"whole": {}}


def _drawn(rng: np.random.Generator, robot, spec: dict) -> bool:
    """Draw the curve and write `spec["forms"]` and `spec["left"]`; False where none of the wanted size was found."""
    of = scale_of(robot, 1 / spec["rate"], float(np.mean([run["duration"] for run in spec["runs"]])))
    law = str(rng.choice(possible(robot, spec["missing"])))
    known = hard.Truth(rng, robot, spec, spec["runs"])
    if not all(np.isfinite(values).all() for run in known.there for values in run.values()):
        return False
    low, high = _range(law, robot, known)
    if high - low < 1e-6:
        return False
    made = draw_curve(rng, robot, law, low, high)
    model = nearest(robot, spec, law, of, high)
    fit = hard.fitted(model, known.errors, rounds=1)
    most_left = min(_own_changes(rng, robot, spec, model, fit, known).values()) / ROOM
    if most_left < LEFT_GAP[0] ** 2 - 1.0:
        return False
    largest = min(LEFT_GAP[1], math.sqrt(1.0 + most_left))
    wanted = math.exp(rng.uniform(math.log(LEFT_GAP[0]), math.log(largest))) ** 2 - 1.0
    size, most = FIRST * large(law, of, high), LARGEST * large(law, of, high)
    for _ in range(TRIES):
        spec["forms"] = [made(size)]
        machine = planar.build_machine(robot, spec, rng)
        left = fit.apart(known.errors(machine))
        if not math.isfinite(left) or left <= 0.0:
            return False
        factor = math.sqrt(wanted / left)
        if 1.0 / CLOSE < factor < CLOSE:
            break
        size *= min(max(factor, 0.1), 10.0)
        if size > most:
            return False
    return _measured(rng, robot, spec, model)


def _own_changes(
    rng: np.random.Generator, robot, spec: dict, model: hard.Nearest, fit: hard.Fit, truth: hard.Truth
) -> dict[str, float]:
    """Sum of squares of each effect's own change of the truth that no knob of the others makes up for."""
    found = {}
    for effect in spec["effects"]:
        others = [one for one in spec["effects"] if one is not effect]
        change = truth.errors(planar.build_machine(robot, {**spec, "effects": others}, rng))
        found[effect["id"]] = hard.own_change(model, fit, change, effect["id"])
    return found


def _measured(rng: np.random.Generator, robot, spec: dict, model: hard.Nearest) -> bool:
    """Fit the nearest machine to the truth and write `spec["left"]`, see `hard.account`.

    False where what is left is out of range, or where an effect does not matter: its own change of the truth, less what
    all other knobs make up for, has to be as large as what is left.
    """
    truth, fresh = (hard.Truth(rng, robot, spec, spec[which]) for which in ("runs", "held_out"))
    fit = hard.fitted(model, truth.errors, rounds=FIT_ROUNDS)
    if not KEPT_GAP[0] < math.sqrt(1.0 + fit.left) < KEPT_GAP[1]:
        return False
    own = _own_changes(rng, robot, spec, model, fit, truth)
    left_out = {name: fit.left + change for name, change in own.items()}
    if min(left_out.values()) < (1.0 + hard.MATTERS) * fit.left:
        return False
    (form,) = spec["forms"]
    less = planar.build_machine(robot, {**spec, "forms": []}, rng)
    spec["left"] = {
        **hard.gaps_of(rng, robot, spec, truth, fresh, fit.left, model.machine(fit.at), 1.0),
        "without": {name: hard.gap_of(square) for name, square in left_out.items()},
        "beyond": {form["id"]: hard.gap_of(fit.apart(truth.errors(less)))},
        "asked": [],
    }
    return True
