"""Scenarios of one's own, from outside the package: a Python file with a `SCENARIO`, or a csv of commands over time."""

from __future__ import annotations

import importlib.util
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from rtds_host.contract import Robot
from rtds_host.contract.runlog import read_columns
from rtds_host.errors import InputError, RtdsError, shown
from rtds_host.scenario.base import Motion, Scenario, SpeedMotion, Values, VoltageMotion, find_scenario

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")
SUFFIXES = (".py", ".csv")
VOLTAGES, SPEEDS = ("v_cmd_l", "v_cmd_r"), ("linear_m_s", "angular_rad_s")
# The engine's step, s: a row of voltages may begin at any of them, and is held from there.
PERIOD_S = 0.001
# s from one exchange with the robot to the next: short, so that a step of voltage acts when its row says.
EXCHANGE_S = 0.002
# Longest run of commands, s.
LONGEST_S = 3600.0


def is_own(name: str) -> bool:
    """Whether a scenario is named by a file of one's own."""
    return name.endswith(SUFFIXES)


def own_scenario(name: str) -> Scenario:
    """A scenario that comes with the package, by its name; or of a file (.py or .csv), by its path.

    Raises
    ------
    InputError : no such name or file, a file that ends in an error or holds no `SCENARIO`, or a csv that is no table
        of commands.
    """
    if not is_own(name):
        return find_scenario(name)
    path = Path(name)
    if not path.is_file():
        raise InputError(f"{path}: {'is not a file' if path.exists() else 'does not exist'}")
    return _of_python(path) if path.suffix == ".py" else _of_csv(path)


def _of_python(path: Path) -> Scenario:
    spec = importlib.util.spec_from_file_location(f"rtds_own_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"{path}: is not a Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except RtdsError:
        raise
    except SyntaxError as error:
        raise InputError(f"{path}: row {error.lineno}: {error.msg}") from error
    except Exception as error:
        raise InputError(f"{path}: ends in {type(error).__name__}: {error}") from error
    scenario = getattr(module, "SCENARIO", None)
    if not isinstance(scenario, Scenario):
        said = "missing" if scenario is None else f"is {shown(scenario)}"
        raise InputError(f"{path}: SCENARIO: {said}, a rtds_host.scenario.Scenario is needed")
    if not NAME.fullmatch(scenario.name):
        raise InputError(f"{path}: name: is {shown(scenario.name)}, letters, digits, '_', '-' and '.' are possible")
    return replace(scenario, build=lambda values, robot: _built(path, scenario, values, robot))


def _built(path: Path, scenario: Scenario, values: Values, robot: Robot) -> Motion:
    """What a file's `build` makes, looked at before anything is driven by it.

    Raises
    ------
    InputError : it ends in an error, or makes no motion, or one whose function gives no two finite numbers a time.
    """
    try:
        motion = scenario.build(values, robot)
        if not isinstance(motion, SpeedMotion | VoltageMotion):
            raise InputError(f"{path}: build: makes {shown(motion)}, a SpeedMotion or a VoltageMotion is needed")
        times = np.linspace(0.0, motion.duration_s, 11)
        made = motion.voltages(times) if isinstance(motion, VoltageMotion) else motion.speeds(times)
        found = np.asarray(made, dtype=float)
    except RtdsError:
        raise
    except Exception as error:
        raise InputError(f"{path}: build: ends in {type(error).__name__}: {error}") from error
    if found.shape != (11, 2) or not np.isfinite(found).all():
        raise InputError(
            f"{path}: build: its motion makes an array {found.shape} of 11 times, two finite numbers a time, (11, 2), "
            "are needed"
        )
    return motion


def _of_csv(path: Path) -> Scenario:
    columns = read_columns(path, ("t", *VOLTAGES, *SPEEDS))
    names = VOLTAGES if all(name in columns for name in VOLTAGES) else SPEEDS
    if "t" not in columns or not all(name in columns for name in names):
        raise InputError(
            f"{path}: row 1: the columns t, {' and '.join(VOLTAGES)} (V), or t, {' and '.join(SPEEDS)} are needed"
        )
    t = columns["t"] - columns["t"][0]
    values = np.column_stack([columns[name] for name in names])
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if bad.size:
        raise InputError(f"{path}: row {bad[0] + 2}: a command is missing")
    if not 0.1 <= t[-1] <= LONGEST_S:
        raise InputError(f"{path}: lasts {t[-1]:g} s, 0.1 to {LONGEST_S:g} s are possible")

    def build(_: Values, robot: Robot) -> Motion:
        if names == SPEEDS:
            return SpeedMotion(float(t[-1]), lambda at: np.column_stack([np.interp(at, t, v) for v in values.T]))

        # Half a microsecond, so that a row that begins at a step begins there in binary numbers, too.
        def held(at: np.ndarray) -> np.ndarray:
            return values[np.clip(np.searchsorted(t, at + 5e-7, "right") - 1, 0, None)]

        return VoltageMotion(float(t[-1]), held, period_s=PERIOD_S)

    return Scenario(
        name=re.sub(r"[^A-Za-z0-9_.-]", "_", path.stem),
        about=f"commands of {path.name}",
        build=build,
        exchange_s=EXCHANGE_S if names == VOLTAGES else None,
        family="own",
    )
