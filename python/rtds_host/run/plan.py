"""What is to be driven and how, checked before anything starts."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

from rtds_host.contract import Motor, Robot, builtin_robot_path, load_robot
from rtds_host.control import CONTROLLERS
from rtds_host.errors import InputError, did_you_mean
from rtds_host.robot import STEP_S, Body, Split, check_engine, default_engine, make_body, make_split
from rtds_host.scenario import Motion, Scenario, VoltageMotion, check_reach, own_scenario, scaled_values

COUPLINGS = ("closed", "paper")
LOG_LIMIT_STEPS = 8
MAX_STEPS = 4_000_000
# A hundredth of the usual step of the motor units; a run at much less would never end.
FINEST_STEP_S = 1e-7


@dataclass(frozen=True)
class Plan:
    """One run, complete. Times in steps are steps of the physics engine (`STEP_S`).

    `split`: who carries the body's inertia; None with coupling 'paper', where nothing comes back to the motors.
    """

    scenario: Scenario
    values: dict[str, float]
    motion: Motion
    robot: Robot
    robot_path: Path
    body: Body
    controller: str | None
    coupling: str
    engine: str
    exchange_steps: int
    log_steps: int
    total_steps: int
    simulator_step_s: float
    method: str
    split: Split | None

    @property
    def exchange_s(self) -> float:
        """Exchange interval, s."""
        return self.exchange_steps * STEP_S

    @property
    def duration_s(self) -> float:
        """Length of the run, s."""
        return self.total_steps * STEP_S

    @property
    def reflected_kg_m2(self) -> float:
        """Inertia at each wheel that the motor units carry for the body."""
        return self.split.reflected_kg_m2 if self.split else 0.0

    @property
    def unit_motor(self) -> Motor:
        """The motor as its unit has it, with what it carries."""
        return self.split.motor(self.robot.motor) if self.split else self.robot.motor


@dataclass(frozen=True)
class Options:
    """What the caller may change; None keeps the scenario's or the program's default. SI.

    `scaled`: the defaults of the scenario's lengths, payload and duration are those for a robot of this one's size.
    """

    robot: str = "burger"
    controller: str = "exact"
    coupling: str = "closed"
    engine: str = field(default_factory=default_engine)
    support: str = "skids"
    payload_kg: float | None = None
    slope_rad: float | None = None
    uphill_yaw_rad: float | None = None
    exchange_s: float | None = None
    log_s: float | None = None
    simulator_step_s: float = 1e-5
    method: str = "backward_euler"
    scaled: bool = False


def robot_path(name: str) -> Path:
    """Path of a robot: one that comes with the package, or a file.

    Raises
    ------
    InputError : neither a known name nor a file.
    """
    if name.endswith(".toml") or "/" in name:
        return Path(name)
    return builtin_robot_path(name)


def _steps(name: str, seconds: float, unit: str = "engine steps") -> int:
    if not math.isfinite(seconds) or seconds <= 0:
        raise InputError(f"{name}: is {seconds:g} s, it must be above 0")
    steps = round(seconds / STEP_S)
    if steps < 1 or abs(seconds / STEP_S - steps) > 1e-6:
        raise InputError(f"{name}: is {seconds:g} s, it must be a whole number of {STEP_S:g} s ({unit})")
    return steps


def _divisor(number: int, limit: int) -> int:
    return max(k for k in range(1, min(number, limit) + 1) if number % k == 0)


def make_plan(scenario: str | Scenario, values: dict[str, float] | None = None, options: Options | None = None) -> Plan:
    """Put a run together and check it.

    Raises
    ------
    InputError : unknown scenario, robot, controller, engine, coupling; a figure out of range; a motion the motors
        cannot follow. One line that names it, with the limit.
    """
    options = options or Options()
    if isinstance(scenario, str):
        scenario = own_scenario(scenario)
    for name, value, known in (
        ("controller", options.controller, tuple(CONTROLLERS)),
        ("coupling", options.coupling, COUPLINGS),
    ):
        if value not in known:
            raise InputError(f"{name} {value!r}: unknown (known: {', '.join(known)}){did_you_mean(value, known)}")
    check_engine(options.engine)
    path = robot_path(options.robot)
    robot = load_robot(path)
    if robot.driver.mode != "voltage":
        raise InputError(f"{path}: [driver] mode is {robot.driver.mode!r}, a scenario drives by voltage")

    def pick(value, default):
        return default if value is None else value

    payload = scenario.payload_kg
    if options.scaled:
        fitting, payload = scaled_values(scenario, robot)
        values = {**fitting, **(values or {})}
    body = make_body(
        robot,
        pick(options.payload_kg, payload),
        pick(options.slope_rad, scenario.slope_rad),
        pick(options.uphill_yaw_rad, scenario.uphill_yaw_rad),
        options.support,
    )
    chosen = scenario.values(values)
    motion = check_reach(scenario, chosen, robot, body)
    voltage = isinstance(motion, VoltageMotion)
    if voltage and options.coupling == "paper":
        raise InputError(
            f"scenario {scenario.name!r}: drives by voltage, there is no reference the robot could "
            "follow with coupling 'paper'"
        )
    exchange, log = _intervals(scenario, motion, options)
    if 0 < options.simulator_step_s < FINEST_STEP_S:
        raise InputError(f"step: is {options.simulator_step_s:g} s, it must be at least {FINEST_STEP_S:g} s")
    total = max(1, math.ceil(motion.duration_s / STEP_S - 1e-6))
    if total > MAX_STEPS:
        raise InputError(f"duration: is {motion.duration_s:g} s, at most {MAX_STEPS * STEP_S:g} s are possible")
    return Plan(
        scenario=scenario,
        values=chosen,
        motion=motion,
        robot=robot,
        robot_path=path,
        body=body,
        controller=None if voltage else options.controller,
        coupling=options.coupling,
        engine=options.engine,
        exchange_steps=exchange,
        log_steps=log,
        total_steps=total,
        simulator_step_s=options.simulator_step_s,
        method=options.method,
        split=make_split(robot, body) if options.coupling == "closed" else None,
    )


def _intervals(scenario: Scenario, motion: Motion, options: Options) -> tuple[int, int]:
    """Engine steps between exchanges, and between rows of the log.

    Raises
    ------
    InputError : an interval that is no whole number of steps, or a log that misses changes of the command.
    """
    exchange_s = options.exchange_s
    if exchange_s is None and options.controller != "paper":
        exchange_s = scenario.exchange_s
    exchange = _steps("exchange", CONTROLLERS[options.controller] if exchange_s is None else exchange_s)
    # A row must stand wherever the command may change.
    period = _steps("scenario's period", motion.period_s) if isinstance(motion, VoltageMotion) else exchange
    grid = period if period % exchange == 0 else exchange
    log = _divisor(grid, LOG_LIMIT_STEPS) if options.log_s is None else _steps("log interval", options.log_s)
    if grid % log:
        raise InputError(
            f"log interval: is {log * STEP_S:g} s, it must divide {grid * STEP_S:g} s, at which the "
            "voltages change, or the log could not hold them"
        )
    return exchange, log


def other_controller(plan: Plan) -> Plan:
    """The same run with the other controller at its own interval, to compare with."""
    other = next(name for name in CONTROLLERS if name != plan.controller)
    exchange = round(CONTROLLERS[other] / STEP_S)
    return replace(plan, controller=other, exchange_steps=exchange, log_steps=exchange)
