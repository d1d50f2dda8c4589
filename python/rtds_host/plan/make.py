"""A manoeuvre of the scenarios' menu made to fit a robot and a floor, and checked by a replay of what will be sent."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rtds_host.contract import Robot, RunLog
from rtds_host.contract.robot import Driver
from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.effects import SIDES, catalogue
from rtds_host.diagnosis.experiment import as_run
from rtds_host.diagnosis.replay.model import Model, nominal_model, replay_run, run_inputs
from rtds_host.errors import InputError
from rtds_host.plan.commands import Commands, knots
from rtds_host.plant.schema import OUTPUT_INDEX, OUTPUTS
from rtds_host.robot import make_body
from rtds_host.scenario import Scenario, SpeedMotion, scenarios
from rtds_host.scenario.reach import needed_voltage

KINDS = ("voltage", "cmd_vel")
NAMES = {"voltage": ("v_cmd_l", "v_cmd_r"), "cmd_vel": ("linear_m_s", "angular_rad_s")}
SAMPLE_S = 0.01
# Below this share of its size a manoeuvre shows next to nothing: friction holds it.
LEAST_SCALE = 0.2
HALVINGS = 7
HEADINGS = np.radians(np.arange(0.0, 180.0, 5.0))
# Signatures with a larger cosine look alike, since less than half of the one (its sine, 0.44) is left next to the
# other; one below so many units of noise is not seen.
ALIKE, SEEN = 0.9, 2.0


@dataclass(frozen=True)
class Floor:
    """Free floor, m, and how much of it to keep clear on each side of the axle's mid-point."""

    width_m: float
    depth_m: float
    margin_m: float


@dataclass(frozen=True)
class Plan:
    """A manoeuvre that fits. `scale`: its size over the menu's; `start`: (x, y, yaw) on the floor, from its corner, x
    along the width; `extent_m`: what the axle's mid-point covers; `path`: (n, 3) s, x, y on the floor; `tops`: largest
    voltage V, wheel speed rad/s, forward speed m/s and yaw rate rad/s."""

    scenario: Scenario
    kind: str
    commands: Commands
    scale: float
    payload_kg: float
    floor: Floor
    start: tuple[float, float, float]
    extent_m: tuple[float, float]
    path: np.ndarray
    tops: dict[str, float]

    @property
    def uphill(self) -> float:
        """Direction that climbs, on the floor, rad."""
        return self.start[2] + self.scenario.uphill_yaw_rad


def _speeds(robot: Robot, out: np.ndarray) -> np.ndarray:
    """Forward speed and yaw rate (n, 2) of a replay."""
    w = out[:, [OUTPUT_INDEX["w_l"], OUTPUT_INDEX["w_r"]]]
    radius, track = robot.wheeled.wheel_radius_m, robot.wheeled.track_width_m
    return np.column_stack([radius * w.mean(axis=1), radius * (w[:, 1] - w[:, 0]) / track])


def _motion_of(commands: Commands) -> SpeedMotion:
    return SpeedMotion(commands.duration_s, commands.at)


def _commands(scenario: Scenario, robot: Robot, kind: str, scale: float, payload_kg: float) -> Commands:
    """The manoeuvre at a share of its size, as what is sent."""
    motion = scenario.build(scenario.values(), robot)
    count = round(motion.duration_s / SAMPLE_S)
    t = SAMPLE_S * np.arange(count + 1)
    if isinstance(motion, SpeedMotion):
        wanted = scale * motion.speeds(np.minimum(t, motion.duration_s))
        wanted[-1] = 0.0
        moved = knots(t, wanted, NAMES["cmd_vel"])
        if kind == "cmd_vel":
            return moved
        body = make_body(robot, payload_kg, scenario.slope_rad, scenario.uphill_yaw_rad)
        volts, middles = needed_voltage(_motion_of(moved), robot, body)
        return knots(np.append(middles, moved.duration_s), np.vstack([volts, [0.0, 0.0]]), NAMES["voltage"])
    volts = scale * motion.voltages(np.floor(t / motion.period_s + 1e-9) * motion.period_s)
    volts[-1] = 0.0
    top = np.abs(volts).max()
    if top > robot.supply_v:
        volts = volts * (robot.supply_v / top)
    if kind == "voltage":
        return knots(t, volts, NAMES["voltage"], held=True)
    out = replay_run(nominal_model(robot), run_inputs(as_run(scenario, robot, payload_kg, t, volts), robot))
    driven = _speeds(robot, out)
    driven[-1] = 0.0
    return knots(t, driven, NAMES["cmd_vel"])


def _volts(
    robot: Robot, scenario: Scenario, commands: Commands, kind: str, payload_kg: float
) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) and voltages (n, 2) that the commands are for the nominal motors."""
    t = np.append(np.arange(0.0, commands.duration_s, SAMPLE_S), commands.duration_s)
    if kind == "voltage":
        return t, commands.at(t)
    body = make_body(robot, payload_kg, scenario.slope_rad, scenario.uphill_yaw_rad)
    volts, middles = needed_voltage(_motion_of(commands), robot, body)
    return t, np.column_stack([np.interp(t, middles, volts[:, k]) for k in (0, 1)])


@dataclass(frozen=True)
class _Driven:
    path: np.ndarray
    tops: dict[str, float]


def _drive(
    robot: Robot, scenario: Scenario, commands: Commands, kind: str, payload_kg: float, models: Sequence[Model]
) -> list[_Driven]:
    """The commands by each model: paths from the origin, headed along x."""
    t, volts = _volts(robot, scenario, commands, kind, payload_kg)
    found = []
    for model in models:
        out = replay_run(
            model,
            run_inputs(as_run(scenario, robot, payload_kg, t, np.clip(volts, -robot.supply_v, robot.supply_v)), robot),
        )
        speeds = _speeds(robot, out)
        x, y = out[:, OUTPUT_INDEX["x"]], out[:, OUTPUT_INDEX["y"]]
        tops = {
            "voltage_v": float(np.abs(volts).max()),
            "wheel_rad_s": float(np.abs(out[:, [OUTPUT_INDEX["w_l"], OUTPUT_INDEX["w_r"]]]).max()),
            "forward_m_s": float(np.abs(speeds[:, 0]).max()),
            "turn_rad_s": float(np.abs(speeds[:, 1]).max()),
        }
        found.append(_Driven(np.column_stack([t, x, y]), tops))
    return found


def _place(paths: Sequence[np.ndarray], floor: Floor) -> tuple[tuple[float, float, float], tuple[float, float]] | None:
    """Start on the floor and extent of paths, or None where no heading lets them fit."""
    points = np.vstack([path[:, 1:] for path in paths])
    room = np.array([floor.width_m, floor.depth_m]) - 2.0 * floor.margin_m
    best = None
    for heading in HEADINGS:
        c, s = math.cos(heading), math.sin(heading)
        turned = points @ np.array([[c, s], [-s, c]])
        low, high = turned.min(axis=0), turned.max(axis=0)
        spare = float((room - (high - low)).min())
        if spare >= 0.0 and (best is None or spare > best[0] + 1e-9):
            middle = 0.5 * np.array([floor.width_m, floor.depth_m]) - 0.5 * (low + high)
            best = (
                spare,
                (float(middle[0]), float(middle[1]), float(heading)),
                (float(high[0] - low[0]), float(high[1] - low[1])),
            )
    return None if best is None else (best[1], best[2])


def check_robot(robot: Robot, kind: str) -> None:
    """Whether a manoeuvre can be planned for a robot.

    Raises
    ------
    InputError : a single axis, or commands that the robot's model cannot be driven by.
    """
    if robot.chassis is None:
        raise InputError(f"robot {robot.name!r}: is a single axis, a manoeuvre on a floor needs a [chassis]")
    if robot.driver.mode == "torque":
        raise InputError(f"robot {robot.name!r}: [driver] mode is 'torque', no manoeuvre is planned for it")
    if kind == "voltage" and robot.driver.mode == "speed":
        raise InputError(f"robot {robot.name!r}: [driver] mode is 'speed', it takes no voltages; use --as cmd_vel")


def driven_by_voltage(robot: Robot) -> Robot:
    """The robot behind its speed loop: what its wheels can do is a matter of motors and voltage."""
    return replace(robot, driver=Driver(), servo=None)


def fit(
    scenario: Scenario,
    robot: Robot,
    kind: str,
    floor: Floor,
    models: Sequence[Model],
    payload_kg: float = 0.0,
    speed_m_s: float = math.inf,
) -> Plan:
    """A manoeuvre as large as floor, speed and supply let it be.

    Parameters
    ----------
    kind : "voltage" or "cmd_vel". models : robots that must stay on the floor, as by a diagnosis; the first one's path
    is kept. speed_m_s : what the robot may drive at most.

    Raises
    ------
    InputError : it does not fit at a fifth of its size, with the room that it needs.
    """

    def attempt(scale: float) -> tuple[Plan | None, str]:
        commands = _commands(scenario, robot, kind, scale, payload_kg)
        driven = _drive(robot, scenario, commands, kind, payload_kg, models)
        tops = {name: max(one.tops[name] for one in driven) for name in driven[0].tops}
        if tops["voltage_v"] > robot.supply_v * (1.0 + 1e-9):
            return None, f"it needs {tops['voltage_v']:.3g} V of {robot.supply_v:g} V"
        if tops["forward_m_s"] > speed_m_s:
            return None, f"it drives {tops['forward_m_s']:.3g} m/s, {speed_m_s:g} m/s are allowed"
        placed = _place([one.path for one in driven], floor)
        if placed is None:
            points = np.vstack([one.path[:, 1:] for one in driven])
            size = points.max(axis=0) - points.min(axis=0) + 2.0 * floor.margin_m
            return None, (
                f"it needs about {size[0]:.2f} x {size[1]:.2f} m with {floor.margin_m:g} m around the robot, the floor "
                f"has {floor.width_m:g} x {floor.depth_m:g} m"
            )
        start, extent = placed
        c, s = math.cos(start[2]), math.sin(start[2])
        path = driven[0].path.copy()
        path[:, 1:] = path[:, 1:] @ np.array([[c, s], [-s, c]]) + np.array(start[:2])
        return Plan(scenario, kind, commands, scale, payload_kg, floor, start, extent, path, tops), ""

    found, why = attempt(1.0)
    if found is not None:
        return found
    smallest, why = attempt(LEAST_SCALE)
    if smallest is None:
        raise InputError(f"{scenario.name}: at a fifth of its size {why}")
    low, high, best = LEAST_SCALE, 1.0, smallest
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        found, _ = attempt(middle)
        if found is None:
            high = middle
        else:
            low, best = middle, found
    return best


def alike_pairs(plan: Plan, robot: Robot) -> tuple[int, int, int]:
    """How much of the catalogue a plan shows: effects it shows, and of these the pairs that look alike and all pairs.

    An effect's signature is what its first start moves in units of noise (contract, section 4); pairs with |cos| above
    `ALIKE` look alike (docs/plan.md).
    """
    t, volts = _volts(robot, plan.scenario, plan.commands, plan.kind, plan.payload_kg)
    log = as_run(plan.scenario, robot, plan.payload_kg, t, volts)
    inputs = run_inputs(log, robot)
    plain = nominal_model(robot)
    out = replay_run(plain, inputs)
    seen = RunLog(log.name, log.meta, t, {**log.columns, **{name: out[:, k] for k, name in enumerate(OUTPUTS)}})
    if not gaps.gap_channels(seen, robot):
        # A robot whose file names no noise: nothing has a unit to be counted in.
        return 0, 0, 0
    signatures = []
    for effect in catalogue(robot).values():
        model = nominal_model(robot)
        effect.apply(model, SIDES[effect.sides[0]], {p.name: p.starts[0] for p in effect.parameters})
        errors = gaps.errors(seen, robot, replay_run(model, inputs))
        signature = np.concatenate([values / math.sqrt(len(values)) for values in errors.values()])
        size = float(np.linalg.norm(signature)) * math.sqrt(len(t))
        if math.isfinite(size) and size > SEEN:
            signatures.append(signature / np.linalg.norm(signature))
    if not signatures:
        return 0, 0, 0
    cosines = np.abs(np.array(signatures) @ np.array(signatures).T)
    count = len(signatures)
    alike = int((np.triu(cosines, 1) > ALIKE).sum())
    return count, alike, count * (count - 1) // 2


def choose(robot: Robot, kind: str, floor: Floor, models: Sequence[Model], speed_m_s: float) -> Plan:
    """The manoeuvre of the menu that parts most of the catalogue on this robot and floor.

    Raises
    ------
    InputError : none fits.
    """
    best: tuple[int, Plan] | None = None
    reasons = []
    for scenario in scenarios().values():
        # A floor is level unless somebody says otherwise.
        if scenario.family != "diagnosis" or scenario.slope_rad:
            continue
        try:
            plan = fit(scenario, robot, kind, floor, models, scenario.payload_kg, speed_m_s)
        except InputError as error:
            reasons.append(str(error))
            continue
        _, alike, pairs = alike_pairs(plan, robot)
        if best is None or pairs - alike > best[0]:
            best = (pairs - alike, plan)
    if best is None:
        raise InputError("no manoeuvre fits: " + "; ".join(reasons[:2]))
    return best[1]


__all__ = ["KINDS", "Floor", "Plan", "alike_pairs", "check_robot", "choose", "driven_by_voltage", "fit"]
