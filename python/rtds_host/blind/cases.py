"""Cases with known truth: what is drawn, what is written for a diagnoser, and what is sealed.

``python -m rtds_host.blind.cases --n 40 --tier all --seed 1 --out DIR`` writes ``DIR/public/case-NNN`` (what a
diagnoser may see) and ``DIR/truth/case-NNN.json``.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from rtds_host.blind import formed_world, hard, machines
from rtds_host.blind.accounts import Drive, draw_causes, shown, worth
from rtds_host.blind.kernel import SIDE_NAMES
from rtds_host.blind.planar import (
    CLOSED,
    STEP_S,
    TOLERANCE_NAMES,
    Machine,
    add_noise,
    build_machine,
    coloured,
    commands_of,
    control_rows,
    noises,
    nominal_machine,
    place_of,
    quantum_of,
    replay_gap,
    run_machine,
    sample_times,
    stem,
)
from rtds_host.blind.scales import draw_outside, scale_of
from rtds_host.blind.vocabulary import EFFECTS, UNNAMED, draw_effect
from rtds_host.contract import RunMeta, builtin_robot_path, load_robot, read_run, write_run
from rtds_host.vectors import given

SCENARIOS = ("coast", "crawl", "steps", "prbs", "spin", "circle", "eight", "linear", "teleop")
TIERS = ("all", "tol", "few", "pair", "none", "unknown", "long")
# Drawn only where they are asked for: several causes at once; other machines than the burger, and real loggers;
# machines as hard as measured ones; machines with a random curve in one of their equations.
OTHERS = ("sizes", "loggers")
ACCOUNTS = ("many", "messy", *OTHERS, "hard", "formed")
KINDS = (*TIERS, *ACCOUNTS)
WORLDS = ("planar", "mujoco")
HELD_OUT = 2  # runs of each sealed case that the diagnoser never sees
SLOW_EFFECTS = ("winding_heating", "battery_decline")


def _burgers_scale():
    return scale_of(load_robot(builtin_robot_path("burger")), 0.01, 16.0)


# Channels that a case with few of them lacks.
MISSING = (
    ["v_bus", "i", "th", "gyro_z", "pose"],
    ["v_bus", "th", "gyro_z", "pose"],
    ["v_bus", "pose"],
    ["pose"],
    ["i", "v_bus"],
    ["v_bus", "i", "pose"],
    ["w", "i", "v_bus"],
    ["w", "v_bus"],
    ["gyro_z", "pose"],
    ["gyro_z"],
    ["th", "v_bus", "i", "gyro_z"],
)


def draw_spec(rng: np.random.Generator, tier: str, world: str = "planar", robot=None) -> dict:
    """What happens in a case of a tier: effects, tolerance, channels, rates, runs, and runs held out of the case.

    `robot` (default the burger) gives the sizes of the kinds with several causes their scale.
    """
    spec: dict[str, Any] = {
        "tier": tier,
        "world": world,
        "effects": [],
        "outside": None,
        "rest": None,
        "tolerance": tier in ("tol", "long", *ACCOUNTS),
        "normal_tolerance": tier in ACCOUNTS,
        "colour": (0.0, 0.0),
        "rate": float(rng.choice([100.0, 200.0])),
        "jitter": 0.0,
        "dropped": 0.0,
        "missing": [],
        "slow": {},
        "form": "parquet",
    }
    _draw_what_is_there(rng, spec)
    _draw_the_log(rng, spec)
    if tier == "hard":
        hard.draw_case(rng, spec)
        return spec
    if tier == "formed":
        formed_world.draw_case(rng, spec)
        return spec
    if tier in OTHERS:
        machines.draw_conditions(rng, spec, tier == "loggers")
        spec["effects"], _ = draw_causes(rng, machines.robot_of(spec["robot"]), spec)
        return spec
    _draw_runs(rng, spec)
    if tier in ACCOUNTS:
        spec["effects"], spec["rest"] = draw_causes(rng, robot or load_robot(builtin_robot_path("burger")), spec)
    return spec


def _draw_what_is_there(rng: np.random.Generator, spec: dict) -> None:
    """Effects, or what no effect describes, of the kinds that have one or two; `draw_causes` draws those of others."""
    tier = spec["tier"]
    if tier in ("all", "tol", "few"):
        spec["effects"] = [draw_effect(rng)]
    elif tier == "pair":
        first = draw_effect(rng)
        second = draw_effect(rng)
        while second["id"] == first["id"]:
            second = draw_effect(rng)
        spec["effects"] = [first, second]
    elif tier == "long":
        slow = str(rng.choice(SLOW_EFFECTS)) if rng.random() < 0.5 else None
        spec["effects"] = [draw_effect(rng, slow)]
    elif tier == "unknown":
        spec["outside"] = draw_outside(rng, _burgers_scale(), world=spec["world"])
    elif tier not in ("none", *ACCOUNTS):
        raise ValueError(f"tier {tier!r} is not one of {', '.join(KINDS)}")


def _draw_the_log(rng: np.random.Generator, spec: dict) -> None:
    """Tolerance, clock, noise, channels and file form of a case's logs."""
    tier = spec["tier"]
    if tier in ("pair", "none", "unknown", "few"):
        spec["tolerance"] = bool(rng.random() < 0.5)
    if rng.random() < 0.35:
        spec["jitter"] = 0.4
    if rng.random() < 0.1:
        spec["dropped"] = float(rng.uniform(0.005, 0.03))
    if rng.random() < (0.5 if tier in ACCOUNTS else 0.15):
        spec["colour"] = (float(rng.uniform(0.01, 0.05)), float(rng.uniform(0.1, 0.4)))
    if rng.random() < 0.2:
        spec["slow"] = {"x": 50, "y": 50, "yaw": 50} if rng.random() < 0.6 else {"gyro_z": 50, "v_bus": 10}
    if tier == "few":
        _draw_few_channels(rng, spec)
    if rng.random() < 0.1:
        spec["form"] = "csv"


def _draw_few_channels(rng: np.random.Generator, spec: dict) -> None:
    """The channels that a case lacks, and an effect that shows in those left: else it would be no case at all."""
    spec["missing"] = list(MISSING[rng.integers(len(MISSING))])
    for _ in range(200):
        if shown(spec["effects"][0]["id"], spec["missing"]):
            break
        spec["effects"] = [draw_effect(rng)]


def _draw_runs(rng: np.random.Generator, spec: dict) -> None:
    """What is driven: the runs of the case, and those held out of it."""
    tier = spec["tier"]
    count = int(rng.choice([3, 4, 5, 5, 6, 6, 7]))
    names = list(rng.permutation(SCENARIOS))[:count]
    if not set(names) & {"steps", "prbs", "coast"}:
        names[0] = str(rng.choice(["steps", "prbs", "coast"]))
    payload = rng.permutation(np.arange(count) % 2) * 2.0
    slope = rng.permutation(np.arange(count) % 2) * 0.1
    runs = []
    for k, name in enumerate(names):
        uphill = float(rng.choice([0.0, math.pi / 2, rng.uniform(-math.pi, math.pi)]))
        low, high = {"prbs": (10, 13), "spin": (12, 18), "crawl": (14, 18), "steps": (14, 18)}.get(name, (16, 24))
        runs.append(
            {
                "name": str(name),
                "payload_kg": float(payload[k]),
                "slope_rad": float(slope[k]),
                "uphill_yaw_rad": round(uphill, 4),
                "duration": round(float(rng.uniform(low, high)), 1),
            }
        )
    if tier == "long":
        runs = runs[:3]
        for run in runs:
            run["duration"] = round(float(rng.uniform(60, 90)), 1)
    spec["runs"] = sorted(runs, key=lambda run: run["name"])
    spec["held_out"] = []
    for k, name in enumerate(rng.permutation(["teleop", "steps", "coast", "spin", "eight", "prbs"])[:HELD_OUT]):
        spec["held_out"].append(
            {
                "name": str(name),
                "payload_kg": float(k % 2) * 2.0,
                "slope_rad": float(rng.integers(2)) * 0.1,
                "uphill_yaw_rad": round(float(rng.uniform(-math.pi, math.pi)), 4),
                "duration": round(float(rng.uniform(40, 60) if tier == "long" else rng.uniform(12, 18)), 1),
            }
        )


def make_case(
    seed: int,
    spec: dict | str,
    folder: Path,
    robot_path: Path | None = None,
    sizes: bool = True,
    held_out: Path | None = None,
) -> dict:
    """Write one case folder and return its truth.

    Parameters
    ----------
    seed : everything that is random follows from it.
    spec : a tier's name, or a dictionary as `draw_spec` returns it.
    folder : the public folder to write; gets nothing that tells the truth.
    robot_path : nominal robot, default the burger.
    sizes : compute `size_gap` and `size_sigma` (eight more replays).
    held_out : folder for the runs that the case does not show; none are made without it.

    Returns
    -------
    dict, schema "rtds-truth/1" plus `tier`, `size_gap` (root mean square change of the replayed channels through the
    effects, in noise units) and `size_sigma` (root of the summed squares of that change, after the part that the
    motors' R, K, J and B can imitate within 1 % is projected off).
    """
    rng = np.random.default_rng(seed)
    if isinstance(spec, str):
        spec = draw_spec(rng, spec)
    robot_path = Path(robot_path or builtin_robot_path("burger"))
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    if "robot" in spec:
        (folder / "robot.toml").write_text(spec["robot"])
    else:
        shutil.copyfile(robot_path, folder / "robot.toml")
    robot = load_robot(folder / "robot.toml")
    made = Making(spec, robot, rng, scatter=int(rng.integers(2**31)))
    planned = [(run, folder) for run in spec["runs"]]
    if held_out is not None:
        planned += [(run, Path(held_out)) for run in spec["held_out"]]
    for run, place in planned:
        made.run(run, place, shown=place == folder, sizes=sizes)
    return made.truth(sizes, held_out)


class Making:
    """A case that is being made: the robot with and without its effects, and what its runs have shown so far.

    rng : what is drawn run by run; scatter : the seed of the robot's tolerances.
    """

    def __init__(self, spec: dict, robot, rng: np.random.Generator, scatter: int) -> None:
        self.spec, self.robot, self.rng, self.scatter = spec, robot, rng, scatter
        self.logger, self.counts = spec.get("logger"), spec.get("counts")
        self.machine = build_machine(robot, spec, np.random.default_rng(scatter))
        self.plain = build_machine(robot, spec, np.random.default_rng(scatter), effects=False)
        self.rounding: dict[str, list[float]] = {}
        # Changes of the channels through the effects, (m,), and through the tolerances, (m, 8), run by run.
        self.changes: list[np.ndarray] = []
        self.slopes: list[np.ndarray] = []
        self.drives: dict[bool, list] = {False: [], True: []}  # by: held out

    def run(self, run: dict, place: Path, shown: bool, sizes: bool) -> None:
        """Drive one run and write its log below `place`; shown : it is none of those held out."""
        spec, robot, rng = self.spec, self.robot, self.rng
        seed = int(rng.integers(2**31))
        fastest = 2e-4 if spec["world"] == "mujoco" else 1e-4
        t = sample_times(run["duration"], spec["rate"], spec["jitter"], spec["dropped"], rng, fastest)
        planned_by = np.random.default_rng(run["plan"]) if "plan" in run else rng
        v_cmd, w_ref = commands_of(spec, run, t, planned_by, robot)
        closed = run["name"] in CLOSED
        start = self._start(run)
        quantum = quantum_of("w_l", robot, self.counts)
        own = math.sqrt(max(given(robot.noise("w_l"), "noise") ** 2 - quantum**2 / 12, 0))
        white_w = own * np.column_stack([coloured(rng.standard_normal(t.size), t, *spec["colour"]) for _ in range(2)])
        where = place_of(run)
        raw = run_machine(
            self.machine,
            t,
            v_cmd,
            start,
            closed=closed,
            w_ref=w_ref,
            noise_w=white_w,
            robot=robot,
            period_rows=control_rows(spec, run),
            seed=seed,
            **where,
            world=spec["world"],
        )
        measured = add_noise(raw, t, robot, rng, white_w, spec["colour"], self.counts)
        if closed:
            for s, label in enumerate("lr"):
                measured[f"w_ref_{label}"] = np.round(w_ref[:, s], 4)
        columns = {"t": t} | {f"v_cmd_{label}": v_cmd[:, s] for s, label in enumerate(robot.sides)}
        columns |= self._kept(measured, t.size)
        if self.logger is not None:
            columns = as_logged(columns, self.logger, robot, rng, shown, self.rounding)
        meta = RunMeta(
            scenario=run["name"],
            payload_kg=run["payload_kg"],
            slope_rad=run["slope_rad"],
            uphill_yaw_rad=run["uphill_yaw_rad"],
        )
        write_run(place / run["name"], meta, columns, spec["form"])
        self.drives[not shown].append((t, v_cmd, start, where, seed))
        if sizes and shown and "left" not in spec and (spec["effects"] or spec["outside"]):
            if spec["world"] != "planar":  # both sides of the difference come from one world
                raw = run_machine(self.machine, t, v_cmd, start, seed=seed, **where)
            change, slope = _signature(self.machine, self.plain, robot, t, v_cmd, start, where, columns, seed, raw)
            self.changes.append(change)
            self.slopes.append(slope)

    def _start(self, run: dict) -> np.ndarray:
        """Where a run begins, (5,): x, y m, yaw rad, angles of both wheels, rad."""
        robot, rng, missing = self.robot, self.rng, self.spec["missing"]
        heading = float(rng.choice([0.0, run["uphill_yaw_rad"], rng.uniform(-math.pi, math.pi)]))
        start = np.array([*rng.uniform(-1, 1, 2), heading, *rng.uniform(-20, 20, 2)])
        # Whoever replays a log without a pose or an angle starts from zero (contract, section 1).
        if "pose" in missing:
            start[:3] = 0.0
        if "th" in missing:
            start[3:] = 0.0
        if robot.axis is not None and "th" not in missing:
            start = np.array([0.0, 0.0, 0.0, robot.axis.zero_rad + rng.uniform(-0.5, 0.5), robot.axis.zero_rad])
        return start

    def _kept(self, measured: dict[str, np.ndarray], rows: int) -> dict[str, np.ndarray]:
        """The channels that the case has, at their own rates, rounded as files are."""
        spec, columns = self.spec, {}
        for name, values in measured.items():
            if stem(name) in spec["missing"]:
                continue
            slow = spec["slow"].get(name)
            if slow:
                every = max(1, round(spec["rate"] / slow))
                values = np.where(np.arange(rows) % every == 0, values, np.nan)
            columns[name] = np.round(values, 6 if self.counts is None else 9)
        return columns

    def truth(self, sizes: bool, held_out: Path | None) -> dict:
        """What is true of the case, once all runs are made; arguments as of `make_case`."""
        spec, robot = self.spec, self.robot
        truth = {
            "schema": "rtds-truth/1",
            "tier": spec["tier"],
            "world": spec["world"],
            "verdict": "unknown" if spec["outside"] else ("known" if spec["effects"] else "none"),
            "effects": spec["effects"],
        }
        if self.machine.tolerance:
            absent = (
                ()
                if robot.driver.mode != "torque"
                else ("resistance_ohm", "torque_constant_nm_per_a", "back_emf_constant_v_s_per_rad")
            )
            truth["nominal_fit"] = {
                label: {key: value for key, value in self.machine.tolerance[label].items() if key not in absent}
                for label in robot.sides
            }
        if spec["outside"]:
            truth["outside"] = spec["outside"]
        if self.changes:
            truth |= self._size()
        if self.rounding:
            truth["noise"] = {
                name: float(f"{math.hypot(given(robot.noise(name), 'noise'), math.sqrt(np.mean(squares))):.6g}")
                for name, squares in self.rounding.items()
            }
        if sizes and spec["effects"]:
            noise = truth.get("noise")
            truth |= hard.account(spec) if "left" in spec else _account(robot, spec, self.scatter, self.drives, noise)
            if self.logger is not None and held_out is not None:
                # Stamps with a delay are no effect: the truth itself leaves a gap.
                truth["held_out_gap"] |= {
                    "known": _left(self.machine, robot, held_out, truth["noise"]),
                    "before": _left(nominal_machine(robot), robot, held_out, truth["noise"]),
                }
        if "machine" in spec:
            truth["machine"] = spec["machine"]
            truth["logger"] = None if self.logger is None else asdict(self.logger)
        truth["conditions"] = {key: spec[key] for key in ("rate", "jitter", "dropped", "missing", "slow", "colour")}
        return truth

    def _size(self) -> dict[str, float]:
        """`size_gap` and `size_sigma`, see `make_case`."""
        change, slope = np.concatenate(self.changes), np.concatenate(self.slopes)
        gram = slope.T @ slope + np.eye(slope.shape[1])
        seen = slope.T @ change
        left = max(change @ change - seen @ np.linalg.solve(gram, seen), 0)
        return {
            "size_gap": round(float(np.sqrt(np.mean(change**2))), 4),
            "size_sigma": round(float(np.sqrt(left)), 3),
        }


def _left(machine: Machine, robot, held_out: Path, rounded: dict) -> float:
    """Gap that a machine leaves on the held-out runs as they were logged, pooled over channels and runs."""
    gaps: dict[str, list[float]] = {}
    for folder in sorted(p for p in Path(held_out).iterdir() if p.is_dir()):
        for name, value in replay_gap(machine, robot, read_run(folder, robot), rounded).items():
            gaps.setdefault(name, []).append(value**2)
    return round(math.sqrt(np.mean([np.mean(values) for values in gaps.values()])), 4)


def as_logged(
    columns: dict[str, np.ndarray],
    logger,
    robot,
    rng: np.random.Generator,
    shown: bool,
    rounding: dict[str, list[float]],
) -> dict[str, np.ndarray]:
    """What a logger writes of exact columns; adds each channel's mean squared rounding error to `rounding`.

    Glitches are in the runs that are shown only: what cannot be counted says nothing about a prediction.
    """
    t = columns["t"]
    out = {"t": t + logger.epoch_s}
    if logger.stamp_s:
        late = np.round(rng.normal(0.0, logger.stamp_s, t.size), 4)
        late[0] = 0.0
        # Rows stay in order, 0.1 ms apart at least.
        steps = 1e-4 * np.arange(t.size)
        out["t"] = np.round(np.maximum.accumulate(out["t"] + late - steps) + steps, 4)
    for name, values in columns.items():
        if name == "t":
            continue
        out[name] = logger.rounded(name, values)
        if robot.noise(name):
            rounding.setdefault(name, []).append(float(np.nanmean((out[name] - values) ** 2)))
    keep = np.ones(t.size, bool)
    if logger.hole_rows and t.size > 10 * logger.hole_rows:
        at = int(rng.integers(t.size // 4, 3 * t.size // 4))
        keep[at : at + logger.hole_rows] = False
    if shown:
        names = [name for name in out if name[0] in "iw" or name.startswith(("gyro", "th"))]
        for _ in range(logger.glitches):
            name, row = str(rng.choice(names)), int(rng.integers(t.size // 8, t.size - 2))
            out[name] = out[name].copy()
            out[name][row] += float(rng.choice([-1, 1]) * rng.uniform(2, 10)) * (np.nanmax(np.abs(out[name])) + 1e-9)
    if not keep.all():  # the command of the lost rows acts all the same: a log that loses none of its changes
        changed = np.any(
            [np.diff(values, prepend=values[0]) != 0 for name, values in out.items() if name.startswith("v_cmd")],
            axis=0,
        )
        keep |= changed
    out = {name: values[keep] for name, values in out.items()}
    return out


def _account(robot, spec: dict, scatter: int, drives: dict[bool, list], noise: dict | None = None) -> dict:
    """What each cause of a case is worth, on its own runs and on those held out (`accounts.worth`).

    Returns
    -------
    {"effects" with `gap_without`, "gap": {"before", "refit", "known"}, "held_out_gap": the same, "rest"}: gaps of the
    nominal robot, of one with the right tolerances, and of one with all named effects. `rest` holds the subsystem, the
    gap without it, and the share of the gap that is left where everything with a name is known.
    """

    def build(effects, rest, tolerance):
        return build_machine(
            robot, {**spec, "effects": effects, "rest": rest, "tolerance": tolerance}, np.random.default_rng(scatter)
        )

    out: dict[str, Any] = {}
    for held, name in ((False, "gap"), (True, "held_out_gap")):
        if not drives[held]:
            continue
        gaps = worth(
            noises(robot, noise),
            build,
            spec["effects"],
            spec.get("rest"),
            [Drive(*drive) for drive in drives[held]],
            set(spec["missing"]),
        )
        out[name] = {key: round(gaps[key], 4) for key in ("before", "refit", "known")}
        if not held:
            out["effects"] = [
                {**effect, "gap_without": round(gap, 3)} for effect, gap in zip(spec["effects"], gaps["without"])
            ]
            if spec.get("rest"):
                known, before = gaps["known"], gaps["before"]
                out["rest"] = {
                    **spec["rest"],
                    "gap_without": round(known, 3),
                    "share": round(max(known - 1, 0) / max(before - 1, 1e-9), 4),
                }
    return out


def _signature(machine, plain, robot, t, v_cmd, start, where, columns, seed, raw):
    """Change of a run's channels through the effects and through 1 % of each nuisance, in noise units.

    Returns
    -------
    (m,), (m, 8); every tenth row, weighted so that sums stand for all rows.
    """
    coarse = {
        "seed": seed,
        "step_s": 200e-6
        if machine.base_step_s == STEP_S and robot.axis is None and robot.chassis.mass_kg < 3.0
        else machine.base_step_s,
    }
    exact = run_machine(plain, t, v_cmd, start, **where, seed=seed, step_s=machine.step_s)
    base = run_machine(plain, t, v_cmd, start, **where, **coarse)
    rows = slice(0, None, 10)

    def vector(other: dict, base: dict) -> np.ndarray:
        parts = []
        for name in ("i_l", "i_r", "w_l", "w_r", "gyro_z", "x", "y", "yaw"):
            if name not in columns:
                if name[:2] == "w_" and f"th_{name[-1]}" in columns:
                    name = f"th_{name[-1]}"
                else:
                    continue
            difference = other[name] - base[name]
            weight = math.sqrt(10.0)
            if name in ("x", "y", "yaw", "th_l", "th_r"):  # moves in windows of 1 s, one of them a second
                step = round(1.0 / float(np.median(np.diff(t))))
                difference = difference[step:] - difference[:-step]
                difference = difference / math.sqrt(2.0)
                weight = math.sqrt(10.0 / step)
            parts.append(weight * difference[rows] / robot.noise(name))
        return np.concatenate(parts)

    change = vector(raw, exact)
    columns_out = []
    for s in range(2):
        for targets in TOLERANCE_NAMES.values():
            side = plain.side.copy()
            for target in targets:
                side[SIDE_NAMES.index(target), s] *= 1.01
            moved = Machine(side, plain.world, plain.sensing, base_step_s=plain.base_step_s, lever=plain.lever)
            columns_out.append(vector(run_machine(moved, t, v_cmd, start, **where, **coarse), base))
    return change, np.column_stack(columns_out)


def main(argv: list[str] | None = None) -> None:
    """Write many cases: ``--n``, ``--tier``, ``--seed``, ``--out``, optionally ``--effect`` and ``--no-sizes``."""
    parser = argparse.ArgumentParser(prog="rtds_host.blind.cases", description=__doc__)
    parser.add_argument("--n", type=int, default=10, help="number of cases")
    parser.add_argument("--tier", choices=KINDS, default="all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--effect", choices=sorted(EFFECTS) + sorted(UNNAMED), help="always this effect")
    parser.add_argument("--world", choices=WORLDS, default="planar")
    parser.add_argument("--no-sizes", action="store_true", help="do not compute the effects' sizes")
    args = parser.parse_args(argv)
    (args.out / "truth").mkdir(parents=True, exist_ok=True)
    for k in range(args.n):
        rng = np.random.default_rng([args.seed, k, KINDS.index(args.tier)])
        spec = draw_spec(rng, args.tier, args.world)
        if args.effect in UNNAMED:
            spec["effects"], spec["outside"] = [], draw_outside(rng, _burgers_scale(), args.effect, args.world)
        elif args.effect:
            spec["effects"], spec["outside"] = [draw_effect(rng, args.effect)], None
        name = f"case-{k:03d}"
        truth = make_case(int(rng.integers(2**31)), spec, args.out / "public" / name, sizes=not args.no_sizes)
        (args.out / "truth" / f"{name}.json").write_text(json.dumps(truth, indent=1) + "\n")
        what = ", ".join(f"{e['id']} {e['side']}" for e in truth["effects"]) or truth["verdict"]
        print(
            f"{name}: {what}  size {truth.get('size_sigma', 0):g} sigma, gap {truth.get('size_gap', 0):g}", flush=True
        )


if __name__ == "__main__":
    main()
