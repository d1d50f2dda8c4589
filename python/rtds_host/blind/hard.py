"""Cases as hard as measured machines: the tier `hard`.

A measured machine has every part slightly of another form than a catalogue's formula, and constants that a shop page
knows to some ten per cent. Here a machine gets all of `FORMS` that its kind can have, constants off by what its file
declares in `[tolerance]`, and one or two effects of the catalogue. Half of the cases are axes whose runs last less than
two seconds; the others are longer axes and robots.

How hard a case is, is measured. The nearest machine that the catalogue can make (constants, the forms' nearest effects,
the drawn effects) is fitted to the noise-free truth by least squares in the gap's own measure. The sensors' noise is
then chosen so that this best fit leaves a gap of 2 to 10. An effect matters where a machine without it, fitted as well,
leaves as much again (in squares) as what is left anyway; so does a form, without its nearest effects. But a form's
nearest effect may stand for another form: a delay of the commands for a moving mean of the speed. So the form's own
change of the truth, less what all other knobs make up for, must be as large, too.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rtds_host.blind import machines, planar
from rtds_host.blind.accounts import COUNTED, Drive, close_loop, draw_names, possible
from rtds_host.blind.gap import SAMPLED, displacements
from rtds_host.blind.kernel import SIDE_NAMES, WORLD_NAMES
from rtds_host.blind.scales import Scale, draw_sized, scale_of
from rtds_host.blind.vocabulary import log_uniform
from rtds_host.compat import tomllib

LEFT_GAP = (2.0, 10.0)  # what the best fit of the catalogue leaves
NOISE_FACTOR = (0.05, 8.0)  # of the drawn sensors' noise, within which they are sensors yet
TOLERANCES = (0.1, 0.4)  # one sigma of constants, relative
SIDES_APART = 0.02  # of one robot's two motors, of a batch
SHORT_S = (0.5, 1.9)  # runs of half of the cases
LONG_S = {"axis": (2.0, 5.0), "robot": (2.0, 4.0)}
RATES = (100.0, 200.0, 500.0, 1000.0)  # of an axis' log
ROUNDS = 40
TRIES, SIZES = 20, 5  # effects that are looked at on a machine, sizes of one of them
MATTERS = 1.0  # an effect matters where leaving it out adds so many times the square of what is left
LARGEST = 30.0  # times what is left: an effect beyond that hides all else
FIT_ROUNDS, LEAST_ROUNDS = 2, 6  # of a fit, while machines are drawn and where it decides what is asked
# Ratios of constants that the file declares to be loose are calibrated and no cause (contract, section 2).
CALIBRATED = (
    "resistance_error",
    "torque_constant_error",
    "rotor_inertia_error",
    "payload_error",
    "yaw_inertia_error",
)
# Effects whose name a diagnoser may give a form, since it is the same part of the machine.
ALIKE = {
    "brush_film": ("bridge_drop", "driver_deadzone"),
    "flux_droop": (),
    "presliding": ("coulomb_friction", "stribeck_friction"),
    "power_drag": ("viscous_friction", "coulomb_friction", "stribeck_friction"),
    "speed_mean": ("speed_filter", "measurement_delay"),
    "current_mean": (),
    "switching_ripple": (),
    "sampled_commands": ("command_delay",),
}
FORMS = tuple(ALIKE)
ELECTRICAL = ("brush_film", "flux_droop", "current_mean", "switching_ripple")
PLACES = {
    "brush_film": "driver",
    "flux_droop": "winding",
    "presliding": "drivetrain",
    "power_drag": "drivetrain",
    "speed_mean": "sensing",
    "current_mean": "sensing",
    "switching_ripple": "driver",
    "sampled_commands": "timing",
}
LONGEST_MEAN_S = 0.08
LOG_STEP = 0.02  # of a logarithm, for a slope
FARTHEST = 1.5  # a fit moves a logarithm by no more at once
TRUST = 0.05  # share of a column's own square that a step is held back by


def _form(rng: np.random.Generator, name: str, of: Scale) -> dict[str, float]:
    """Parameters of a form at a machine's scales, of the size that data sheets and papers give them."""
    power = rng.uniform(0.4, 0.8) if rng.random() < 0.6 else rng.uniform(1.3, 1.8)
    return {
        "brush_film": lambda: {
            "film_volts": of.volts * log_uniform(rng, 0.015, 0.1),
            "film_amps": of.amps * log_uniform(rng, 0.02, 0.15),
        },
        "flux_droop": lambda: {
            "droop": log_uniform(rng, 0.08, 0.4),
            "droop_amps": of.amps * log_uniform(rng, 0.3, 1.0),
        },
        "presliding": lambda: {
            "slip_torque": of.torque * log_uniform(rng, 0.02, 0.12),
            "slip_rad": log_uniform(rng, 0.003, 0.05),
        },
        "power_drag": lambda: {
            "power_drag": of.torque * log_uniform(rng, 0.015, 0.08),
            "power_speed": of.speed,
            "power": power,
        },
        "speed_mean": lambda: {
            "mean_s": min(of.period * log_uniform(rng, 2.0, 8.0), max(2.0 * of.period, LONGEST_MEAN_S))
        },
        "current_mean": lambda: {"current_mean_s": of.period * log_uniform(rng, 1.0, 4.0)},
        "switching_ripple": lambda: {
            "ripple_amps": of.amps * log_uniform(rng, 0.004, 0.03),
            "ripple_hz": log_uniform(rng, 5.0, 60.0),
        },
        "sampled_commands": lambda: {"tick_s": log_uniform(rng, 0.004, 0.02)},
    }[name]()


def draw_form(rng: np.random.Generator, name: str, of: Scale, side: str) -> dict:
    """One form: id, side, subsystem and the planar world's parameters."""
    parameters = {key: float(f"{value:.5g}") for key, value in _form(rng, name, of).items()}
    return {
        "id": name,
        "side": side,
        "subsystem": PLACES[name],
        "parameters": parameters,
        "names": list(ALIKE[name]),
    }


def draw_machine(rng: np.random.Generator) -> tuple[str, tuple[float, float]]:
    """Class of a machine and shortest and longest run, s."""
    if rng.random() < 0.5:
        return str(rng.choice(machines.AXES)), SHORT_S
    if rng.random() < 0.4:
        return str(rng.choice(machines.AXES)), LONG_S["axis"]
    return str(rng.choice(["desk", "turtlebot", "competition"])), LONG_S["robot"]


def loosened(rng: np.random.Generator, text: str) -> tuple[str, dict]:
    """A `robot.toml` that declares its constants to be loose, and the ratios that the machine has of them.

    Returns
    -------
    (text, {"l": {name in the file: ratio}, "r": the same, "whole": of what the motors move}).
    """
    tables = tomllib.loads(text)
    motor = log_uniform(rng, *TOLERANCES)
    loose = {"motor": motor}
    if "axis" in tables:
        for name in ("inertia_kg_m2", "mass_kg"):
            if name in tables["axis"]:
                loose[name] = log_uniform(rng, *TOLERANCES)
    else:
        loose |= {"mass_kg": 0.1, "yaw_inertia_kg_m2": log_uniform(rng, *TOLERANCES)}

    def off(sigma: float) -> float:
        return float(np.exp(np.clip(rng.standard_normal(), -2.0, 2.0) * math.sqrt(math.log1p(sigma**2))))

    batch = {name: off(motor) for name in planar.TOLERANCE_NAMES if name in tables["motor"]}
    ratios = {side: {name: value * off(SIDES_APART) for name, value in batch.items()} for side in "lr"}
    ratios["whole"] = {name: off(sigma) for name, sigma in loose.items() if name != "motor"}
    return _written(tables | {"tolerance": loose}), ratios


def _written(tables: dict) -> str:
    named = {name: values for name, values in tables.items() if isinstance(values, dict)}
    return machines.robot_toml(tables["name"], named)


def with_noise(text: str, factor: float) -> str:
    """A `robot.toml` whose sensors are `factor` times as noisy; all else stays as it is written."""
    lines, table = [], ""
    for line in text.splitlines():
        if head := re.match(r"\s*\[(.*?)\]", line):
            table = head.group(1).strip()
        entry = re.match(r"(\s*\w+\s*=\s*)([-+\w.]+)", line)
        if table == "sensors" and entry and re.match(r"[-+.\d]", entry.group(2)):
            line = f"{entry.group(1)}{float(f'{float(entry.group(2)) * factor:.6g}')!r}{line[entry.end() :]}"
        lines.append(line)
    return "\n".join(lines) + "\n"


# ---- the nearest machine of the catalogue ----------------------------------------


@dataclass(frozen=True)
class Knob:
    """One number of the nearest machine: `turn(machine, factor)` with the factor on where it starts.

    cause : the id of the effect or form whose number it is, "" for a constant.
    """

    turn: Callable[[planar.Machine, float], None]
    cause: str = ""


@dataclass(frozen=True)
class Nearest:
    """What the catalogue can say of a case: a machine for any setting of its knobs (logarithms, 0 where it starts)."""

    robot: object
    ratios: dict
    effects: list[dict]
    knobs: list[Knob]

    def machine(self, at: np.ndarray) -> planar.Machine:
        """The machine at a setting."""
        machine = planar.nominal_machine(self.robot)
        planar.put_ratios(machine, self.ratios, self.robot)
        for effect in self.effects:
            turned = iter([at[j] for j, knob in enumerate(self.knobs) if knob.cause == effect["id"]])
            numbers = {
                name: value * math.exp(next(turned)) if name in _continuous(effect) else value
                for name, value in effect["parameters"].items()
            }
            planar.apply_effect(machine, {**effect, "parameters": numbers})
        for j, knob in enumerate(self.knobs):
            knob.turn(machine, math.exp(at[j]))
        return machine


def _continuous(effect: dict) -> list[str]:
    return [name for name in effect["parameters"] if name not in ("cycles_per_rev", "phase_rad")]


def _scaling(targets: tuple[str, ...], sides: tuple[int, ...]) -> Callable[[planar.Machine, float], None]:
    def turn(machine: planar.Machine, factor: float) -> None:
        for target in targets:
            machine.scale(target, factor, sides)

    return turn


def _adding(target: str, start: float, sides: tuple[int, ...]) -> Callable[[planar.Machine, float], None]:
    def turn(machine: planar.Machine, factor: float) -> None:
        if target in WORLD_NAMES:
            machine.world[WORLD_NAMES.index(target)] += start * factor
        else:
            machine.side[SIDE_NAMES.index(target), list(sides)] += start * factor

    return turn


def _still(machine: planar.Machine, factor: float) -> None:
    """An effect's numbers are turned where it is applied."""


def nearest(robot, ratios: dict, forms: list[dict], effects: list[dict]) -> Nearest:
    """Knobs of the nearest machine: constants of each side, what the motors move, each form's nearest effects, and the
    effects' own numbers."""
    sides = (0,) if robot.axis is not None else (0, 1)
    knobs = [Knob(_scaling(planar.TOLERANCE_NAMES[name], (s,))) for s in sides for name in ratios["lr"[s]]]
    moved = ("wheel_inertia", "pendulum") if robot.axis is not None else ("mass", "yaw_inertia")
    knobs += [Knob(_scaling((name,), sides)) for name in moved if name != "pendulum" or robot.axis.kind == "pendulum"]
    starts = {
        "brush_film": lambda p: [("drop", 0.8 * p["film_volts"])],
        "presliding": lambda p: [("coulomb", p["slip_torque"])],
        # A power of the speed is dry friction and viscous friction by parts.
        "power_drag": lambda p: [("viscous", p["power_drag"] / p["power_speed"]), ("coulomb", 0.3 * p["power_drag"])],
        "speed_mean": lambda p: [("filter_tau", p["mean_s"] / 2.0)],
        "sampled_commands": lambda p: [("command_delay", p["tick_s"] / 2.0)],
    }
    for form in forms:
        start = starts.get(form["id"], lambda p: [])
        knobs += [Knob(_adding(*one, sides), form["id"]) for one in start(form["parameters"])]
    knobs += [Knob(_still, effect["id"]) for effect in effects for _ in _continuous(effect)]
    return Nearest(robot, ratios, effects, knobs)


def residual(
    noise: dict[str, float], drives: list[Drive], there: list[dict], other: list[dict], missing: set[str]
) -> np.ndarray:
    """Errors of a replay in units of noise, weighted so that the sum of squares is the gap's square less 1."""
    parts: dict[str, list[np.ndarray]] = {}
    for drive, a, b in zip(drives, there, other):
        names = [name for name in COUNTED if name in noise and planar.stem(name) not in missing]
        for name in (name for name in names if name in SAMPLED):
            parts.setdefault(name, []).append((b[name] - a[name]) / noise[name])
        ways = [name for name in names if name in ("x", "y", "yaw")]
        ways += [name for name in names if name[:3] == "th_" and f"w_{name[-1]}" not in names]
        if ways:
            seen, made = (displacements(drive.t, run, tuple(ways), run.get("yaw")) for run in (a, b))
            for name in ways:
                error = (made[name] - seen[name]) / (noise[name] * math.sqrt(2.0))
                if np.isfinite(error).any():
                    parts.setdefault(name, []).append(error[np.isfinite(error)])
    weighted = [
        error / math.sqrt(error.size * len(errors) * len(parts)) for errors in parts.values() for error in errors
    ]
    out = np.concatenate(weighted) if weighted else np.zeros(1)
    return np.clip(np.nan_to_num(out, nan=1e6, posinf=1e6, neginf=-1e6), -1e6, 1e6)


@dataclass
class Fit:
    """Best setting of a nearest machine, its residuals and their slopes over the knobs."""

    at: np.ndarray
    errors: np.ndarray
    slopes: np.ndarray

    @property
    def left(self) -> float:
        """Sum of squares."""
        return float(self.errors @ self.errors)

    def apart(self, change: np.ndarray) -> float:
        """Sum of squares of a change of the residuals that no knob makes up for."""
        way, *_ = np.linalg.lstsq(self.slopes, change, rcond=1e-6)
        return float(np.sum((change - self.slopes @ way) ** 2))


def fitted(
    model: Nearest,
    errors: Callable[[planar.Machine], np.ndarray],
    at: np.ndarray | None = None,
    rounds: int = FIT_ROUNDS,
) -> Fit:
    """Fit a nearest machine by damped Gauss-Newton steps, from a setting on or from where its knobs start.

    Parameters
    ----------
    errors : machine -> residuals whose sum of squares is to be small. rounds : most steps.
    """
    at = np.zeros(len(model.knobs)) if at is None else at
    now = errors(model.machine(at))
    for _ in range(rounds):
        slopes = _slopes(model, errors, at, now)
        at, now, better = _step(model, errors, at, now, slopes)
        if not better:
            break
    return Fit(at, now, slopes)


def without(model: Nearest, errors: Callable[[planar.Machine], np.ndarray], fit: Fit, cause: str) -> float:
    """Sum of squares that is left without a cause, all others fitted again.

    Steps along the slopes of the whole fit lead to where that fit starts, since next to a missing cause the slopes may
    be next to nothing.
    """
    kept = [j for j, knob in enumerate(model.knobs) if knob.cause != cause]
    effects = [effect for effect in model.effects if effect["id"] != cause]
    less = Nearest(model.robot, model.ratios, effects, [model.knobs[j] for j in kept])
    at, now = fit.at[kept], errors(less.machine(fit.at[kept]))
    for _ in range(FIT_ROUNDS):
        at, now, better = _step(less, errors, at, now, fit.slopes[:, kept])
        if not better:
            break
    return fitted(less, errors, at, LEAST_ROUNDS).left


def own_change(model: Nearest, fit: Fit, change: np.ndarray, cause: str) -> float:
    """Sum of squares of a cause's own change of the residuals that no knob of the others makes up for."""
    kept = [j for j, knob in enumerate(model.knobs) if knob.cause != cause]
    return Fit(fit.at[kept], fit.errors, fit.slopes[:, kept]).apart(change)


def _slopes(model: Nearest, errors, at: np.ndarray, now: np.ndarray) -> np.ndarray:
    columns = []
    for j in range(at.size):
        moved = at.copy()
        moved[j] += LOG_STEP
        columns.append((errors(model.machine(moved)) - now) / LOG_STEP)
    return np.column_stack(columns)


def _step(
    model: Nearest, errors, at: np.ndarray, now: np.ndarray, slopes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, bool]:
    """One damped step, shortened until it helps: new setting, its residuals, and whether it helped by 3 per cent."""
    gram = slopes.T @ slopes
    held = np.diag(TRUST * np.diag(gram) + 1e-9 * max(np.trace(gram), 1e-12) + 1e-12)
    way = np.clip(-np.linalg.solve(gram + held, slopes.T @ now), -FARTHEST, FARTHEST)
    for part in (1.0, 0.3, 0.1):
        place = at + part * way
        there = errors(model.machine(place))
        if there @ there < now @ now:
            return place, there, bool(there @ there < 0.97 * (now @ now))
    return at, now, False


# ---- the draw ----------------------------------------


def drives_of(robot, spec: dict, machine: planar.Machine, runs: list[dict]) -> list[Drive]:
    """Noise-free drives of planned runs, by each run's own seed; closed loops are closed around `machine`."""
    drives = []
    for run in runs:
        t = planar.sample_times(run["duration"], spec["rate"], 0.0, 0.0, np.random.default_rng(0))
        v_cmd, w_ref = planar.commands_of(spec, run, t, np.random.default_rng(run["plan"]), robot)
        rest = robot.axis.zero_rad if robot.axis else 0.0
        start = np.array([0.0, 0.0, run["uphill_yaw_rad"], rest, rest])
        drive = Drive(t, v_cmd, start, planar.place_of(run), run["plan"])
        close_loop(robot, spec, machine, run, drive, w_ref)
        drives.append(drive)
    return drives


def draw_case(rng: np.random.Generator, spec: dict) -> None:
    """Fill a spec of tier `hard`: machine, runs, constants, forms, effects, noise, and what the best fit leaves."""
    for _ in range(ROUNDS):
        _conditions(rng, spec)
        robot = machines.robot_of(spec["robot"])
        of = scale_of(robot, 1 / spec["rate"], float(np.mean([run["duration"] for run in spec["runs"]])))
        side = "left" if robot.axis is not None else "both"
        torque = robot.driver.mode == "torque"
        spec["forms"] = [draw_form(rng, name, of, side) for name in FORMS if not (torque and name in ELECTRICAL)]
        if _draw_effects(rng, robot, of, spec) and _measured(rng, robot, spec):
            return
    raise RuntimeError(f"no machine of tier hard was found in {ROUNDS} draws")


class Truth:
    """A machine's noise-free replays of planned runs, and what another machine's replays differ from them by."""

    def __init__(self, rng: np.random.Generator, robot, spec: dict, runs: list[dict]):
        machine = planar.build_machine(robot, spec, rng)
        self.noise, self.missing, self.step_s = planar.noises(robot, {}), set(spec["missing"]), machine.step_s
        self.drives = drives_of(robot, spec, machine, runs)
        self.there = self._replay(machine)

    def _replay(self, machine: planar.Machine) -> list[dict]:
        with np.errstate(over="ignore", invalid="ignore"):  # a trial that runs away is no fit, and says so by its size
            return [drive.replay(machine, min(self.step_s, machine.step_s)) for drive in self.drives]

    def errors(self, machine: planar.Machine) -> np.ndarray:
        """Weighted residuals, see `residual`."""
        return residual(self.noise, self.drives, self.there, self._replay(machine), self.missing)


def _draw_effects(rng: np.random.Generator, robot, of: Scale, spec: dict) -> bool:
    """Draw one or two effects that the best fit without them would not make up for; False where none was found."""
    spec["effects"] = []
    truth = Truth(rng, robot, spec, spec["runs"])
    model = nearest(robot, spec["constants"], spec["forms"], [])
    fit = fitted(model, truth.errors)
    shaped = {name for form in spec["forms"] for name in ALIKE[form["id"]]}
    menu = [name for name in possible(robot, spec["missing"]) if name not in (*CALIBRATED, *shaped)]
    axis = robot.axis.kind if robot.axis else None
    count = int(rng.choice([1, 2]))
    name = ""
    for k in range(TRIES):
        # Several sizes of each, or the few effects that matter at any size would be all that is drawn.
        if k % SIZES == 0 or name in {e["id"] for e in spec["effects"]}:
            name = draw_names(rng, 1, tuple(e["id"] for e in spec["effects"]), menu)[0]
        effect = draw_sized(rng, name, of, axis)
        machine = planar.build_machine(robot, {**spec, "effects": [effect]}, rng)
        change = truth.errors(machine)
        if MATTERS * fit.left < fit.apart(change) and change @ change < (LARGEST * LARGEST) * fit.left:
            spec["effects"].append(effect)
        if len(spec["effects"]) == count:
            return True
    return bool(spec["effects"])


def _conditions(rng: np.random.Generator, spec: dict) -> None:
    name, span = draw_machine(rng)
    machines.draw_conditions(rng, spec, False, name, span)
    if name in machines.AXES:
        spec["rate"] = float(rng.choice(RATES))
        spec["missing"] = ["gyro_z", "pose", *[["v_bus"], ["v_bus", "th"], ["v_bus", "i"]][rng.integers(3)]]
    else:
        spec["runs"] = spec["runs"][:4]
    spec["robot"], spec["constants"] = loosened(rng, spec["robot"])
    for run in (*spec["runs"], *spec["held_out"]):
        run["plan"] = int(rng.integers(2**31))
        run["duration"] = min(run["duration"], span[1])


def _measured(rng: np.random.Generator, robot, spec: dict) -> bool:
    """Fit the nearest machine and choose the sensors' noise by what it leaves; False where a case is not of this tier.

    Writes `spec["left"]`: gaps on the case's runs and on the held-out ones, without each effect and form, and by what
    of each form is beyond all numbers of the nearest machine.
    """
    truth, fresh = (Truth(rng, robot, spec, spec[which]) for which in ("runs", "held_out"))
    model = nearest(robot, spec["constants"], spec["forms"], spec["effects"])
    fit = fitted(model, truth.errors, rounds=LEAST_ROUNDS)
    nominal = float(np.sum(truth.errors(planar.nominal_machine(robot)) ** 2))
    factor = math.sqrt(fit.left / (math.exp(rng.uniform(*np.log(LEFT_GAP))) ** 2 - 1.0))
    if not NOISE_FACTOR[0] < factor < NOISE_FACTOR[1] or not 4.0 * fit.left < nominal < 1e8:
        return False
    left_out = {effect["id"]: without(model, truth.errors, fit, effect["id"]) for effect in spec["effects"]}
    if min(left_out.values()) < (1.0 + MATTERS) * fit.left:
        return False
    own, beyond = {}, {}
    for form in spec["forms"]:
        less = planar.build_machine(robot, {**spec, "forms": [one for one in spec["forms"] if one is not form]}, rng)
        change = truth.errors(less)
        beyond[form["id"]] = fit.apart(change)
        if any(knob.cause == form["id"] for knob in model.knobs):
            own[form["id"]] = own_change(model, fit, change, form["id"])
            left_out[form["id"]] = without(model, truth.errors, fit, form["id"])
    spec["robot"] = with_noise(spec["robot"], factor)

    spec["left"] = {
        **gaps_of(rng, robot, spec, truth, fresh, fit.left, model.machine(fit.at), factor),
        "without": {name: gap_of(square / factor**2) for name, square in left_out.items()},
        "beyond": {name: gap_of(square / factor**2) for name, square in beyond.items()},
        "asked": [
            name
            for name, square in left_out.items()
            if square > (1.0 + MATTERS) * fit.left and own.get(name, math.inf) > MATTERS * fit.left
        ],
    }
    return True


def gap_of(square: float) -> float:
    """The gap of residuals with a sum of squares, as `residual` weighs them."""
    return round(math.sqrt(1.0 + square), 4)


def gaps_of(
    rng: np.random.Generator,
    robot,
    spec: dict,
    truth: Truth,
    fresh: Truth,
    left: float,
    best: planar.Machine,
    factor: float,
) -> dict[str, dict[str, float]]:
    """Gaps of a case's runs, `truth`, and of the held-out ones, `fresh`.

    Parameters
    ----------
    left : sum of squares that the nearest machine leaves of the case's runs; best : that machine; factor : of the
        sensors' noise.

    Returns
    -------
    {"gap", "held_out_gap"}, each {"before", "refit", "known"}: of the nominal robot, of one with the right constants,
    and of the nearest machine.
    """
    plain = planar.build_machine(robot, {**spec, "effects": [], "forms": []}, rng)

    def gaps(of: Truth, known: float) -> dict[str, float]:
        before, refit = (float(np.sum(of.errors(machine) ** 2)) for machine in (planar.nominal_machine(robot), plain))
        return {name: gap_of(x / factor**2) for name, x in (("before", before), ("refit", refit), ("known", known))}

    return {
        "gap": gaps(truth, left),
        "held_out_gap": gaps(fresh, float(np.sum(fresh.errors(best) ** 2))),
    }


def account(spec: dict) -> dict:
    """What the truth of a case says of its causes, as `cases._account` does for the other tiers.

    `gap_without` is what the best fit leaves without an effect, or without a form's nearest effects, the others fitted
    again. `forms` are there in another form than a catalogue's: `names` are the effects that say so, and `matters`
    whether leaving them out doubles what is left, and the form itself changes as much. `gap_beyond_names` is the gap by
    what the form changes and the nearest machine does not, its nearest effects included.
    """
    left = spec["left"]
    forms = [
        {
            **form,
            "gap_without": left["without"].get(form["id"]),
            "gap_beyond_names": left["beyond"][form["id"]],
            "matters": form["id"] in left["asked"],
        }
        for form in spec["forms"]
    ]
    effects = [{**effect, "gap_without": left["without"][effect["id"]]} for effect in spec["effects"]]
    return {"gap": left["gap"], "held_out_gap": left["held_out_gap"], "effects": effects, "forms": forms}
