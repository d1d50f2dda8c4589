"""Cases with several causes: what each of them is worth, and the draw of such that each matters.

Kind `many`: three to five effects of the catalogue at once, mostly from different subsystems. Kind `messy`: one or two,
and a smaller one that no name of the catalogue describes, the rest. Sizes are drawn in the machine's own scales and
kept where leaving the effect out leaves a gap of at least 1.5.

`gap_without` is the gap (contract, section 4) left by a simulator that has all the truth but this effect: the planar
world replays the runs' commands with and without it, free of noise, and the sensors' noise is added as the 1 that it
is in the square of each channel's gap. Motors keep their tolerance and the other effects their sizes: nothing is
fitted again.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from rtds_host.blind import planar
from rtds_host.blind.gap import channel_gaps
from rtds_host.blind.kernel import SIDE_NAMES, WORLD_NAMES
from rtds_host.blind.scales import draw_sized, draw_unmodelled, scale_of, strengthened
from rtds_host.blind.vocabulary import EFFECTS

ASKED_GAP = 1.5  # effects worth less are not asked for in the score
LARGEST_GAP = 25.0
COUNTED = ("i_l", "i_r", "w_l", "w_r", "gyro_z", "x", "y", "yaw", "th_l", "th_r")
TRIAL_RUNS, TRIAL_S = 3, 8.0  # what the draw of sizes looks at
ROUNDS = 30
COUNTS = {
    "many": (3, 4, 5),
    "messy": (1, 2),
    "formed": (1, 2),
    "sizes": (0, 1, 1, 1, 1, 2, 2, 2),
    "loggers": (0, 1, 1, 1, 1, 2, 2, 2),
}
REST_SHARE = (0.05, 0.5)  # of the gap that a rest is worth
# Two that add to one and the same torque: no size of the one alone is the truth.
SAME_TERM = ({"coulomb_friction", "stribeck_friction"},)


@dataclass(frozen=True)
class Drive:
    """One run's commands and conditions, as `planar.run_machine` takes them."""

    t: np.ndarray
    v_cmd: np.ndarray
    start: np.ndarray
    where: dict
    seed: int

    def replay(self, machine, step_s: float) -> dict[str, np.ndarray]:
        """Error-free channels of a machine under these commands."""
        return planar.run_machine(
            machine, self.t, self.v_cmd.copy(), self.start, **self.where, seed=self.seed, step_s=step_s
        )


def gap_between(
    noise: dict[str, float], drives: list[Drive], there: list[dict], other: list[dict], missing: set[str]
) -> float:
    """Gap of a noise-free replay against noisy measurements of another machine, in expectation.

    Parameters
    ----------
    noise : one standard deviation of each channel that counts.
    there, other : channels of each drive, of the machine that is measured and of the one that replays.
    missing : stems of channels that the log does not have.

    Returns
    -------
    sqrt(1 + mean over channels of the squared difference in noise units); infinity where a replay ran away.
    """
    squares: dict[str, list[float]] = {}
    for drive, a, b in zip(drives, there, other):
        seen = {name: a[name] for name in COUNTED if name in noise and planar.stem(name) not in missing}
        if not all(np.isfinite(values).all() for values in (*seen.values(), *b.values())):
            return math.inf
        for name, value in channel_gaps(drive.t, seen, b, noise).items():
            squares.setdefault(name, []).append(value**2)
    return math.sqrt(1.0 + float(np.mean([np.mean(values) for values in squares.values()]))) if squares else 1.0


def worth(
    noise: dict[str, float], build, effects: list[dict], rest: dict | None, drives: list[Drive], missing: set[str]
) -> dict:
    """What each cause of a case is worth.

    Parameters
    ----------
    build : (effects, rest, tolerance) -> machine, with the case's own tolerances where `tolerance` is True.

    Returns
    -------
    {"before", "refit": gaps of the nominal robot and of one with the right tolerances, "without": gap without each
    effect, "known": gap with all effects and without the rest, "finite": bool}.
    """
    machines = [build(effects, rest, True), build([], None, False), build([], None, True), build(effects, None, True)]
    machines += [build(effects[:k] + effects[k + 1 :], rest, True) for k in range(len(effects))]
    step_s = min(machine.step_s for machine in machines)
    replays = [[drive.replay(machine, step_s) for drive in drives] for machine in machines]
    gaps = [gap_between(noise, drives, replays[0], other, missing) for other in replays[1:]]
    return {
        "before": gaps[0],
        "refit": gaps[1],
        "known": gaps[2],
        "without": gaps[3:],
        "finite": all(map(math.isfinite, gaps)),
    }


def _sound(machine, payload_kg: float) -> bool:
    """Whether the body's mass matrix is safely positive with the largest payload, and masses are."""
    mass = machine.world[WORLD_NAMES.index("mass")] + machine.mass_extra
    yaw_inertia, cy = (machine.world[WORLD_NAMES.index(name)] for name in ("yaw_inertia", "com_y"))
    inertia = machine.side[SIDE_NAMES.index("inertia")]
    return bool(mass > 0 and yaw_inertia > 2 * (mass + payload_kg) * cy * cy and (inertia > 0).all())


# Effects by the start of their name -> the channel without which they do not show. Without a logged angle a ripple's
# phase may differ from run to run.
SHOWN_BY = {"current_": "i", "gyro_": "gyro_z", "speed_filter": "w", "torque_ripple": "th"}


def shown(effect: str, missing: Collection[str]) -> bool:
    """Whether an effect shows in a log that lacks some channels, by their stems."""
    return not any(effect.startswith(start) and stem in missing for start, stem in SHOWN_BY.items())


def possible(robot, missing: list[str]) -> list[str]:
    """Effects that a machine can have and its log's channels can show."""
    from rtds_host.blind.machines import menu

    return [name for name in menu(robot) if shown(name, missing)]


def draw_names(
    rng: np.random.Generator, count: int, taken: tuple[str, ...] = (), menu: list[str] | None = None
) -> list[str]:
    """Names of `count` different effects of `menu` (all), in three of four cases each of a subsystem of its own."""
    allowed = menu or list(EFFECTS)
    subsystems = sorted({EFFECTS[name][0] for name in allowed})
    names = list(taken)
    apart = rng.random() < 0.75
    while len(names) < count + len(taken):
        used = {EFFECTS[name][0] for name in names}
        subsystem = str(rng.choice([item for item in subsystems if not apart or item not in used] or subsystems))
        name = str(rng.choice([item for item in allowed if EFFECTS[item][0] == subsystem]))
        if name not in names and not any(pair <= {*names, name} for pair in SAME_TERM):
            names.append(name)
    return names[len(taken) :]


def close_loop(robot, spec: dict, machine, run: dict, drive: Drive, w_ref) -> None:
    """Let a run's controller set the commands of its drive, in place, if the run is one with a closed loop."""
    if run["name"] not in planar.CLOSED:
        return
    planar.run_machine(
        machine,
        drive.t,
        drive.v_cmd,
        drive.start,
        **drive.where,
        closed=True,
        w_ref=w_ref,
        robot=robot,
        period_rows=planar.control_rows(spec, run),
        seed=drive.seed,
    )


def _trial(robot, spec: dict, machine, rng: np.random.Generator, whole: bool = False) -> list[Drive]:
    """Noise-free drives of a case's runs, or the beginnings of the first; closed loops are closed around `machine`."""
    drives = []
    for run in spec["runs"] if whole else spec["runs"][:TRIAL_RUNS]:
        t = np.round(np.arange(0.0, run["duration"] if whole else min(run["duration"], TRIAL_S), 1 / spec["rate"]), 4)
        v_cmd, w_ref = planar.commands_of(spec, run, t, rng, robot)
        rest = robot.axis.zero_rad if robot.axis else 0.0
        start = np.array([0.0, 0.0, run["uphill_yaw_rad"], rest, rest])
        drive = Drive(t, v_cmd, start, planar.place_of(run), int(rng.integers(2**31)))
        close_loop(robot, spec, machine, run, drive, w_ref)
        drives.append(drive)
    return drives


def draw_causes(rng: np.random.Generator, robot, spec: dict) -> tuple[list[dict], dict | None]:
    """Effects of a case of kind `many` or `messy`, and the unmodelled one of a messy one.

    Every effect is drawn again (half of the time another one) until leaving it out matters in short drives of the
    case's runs, and not beyond all measure; the unmodelled one is made as strong as
    a share of the gap between 5 and 50 % asks for.

    Parameters
    ----------
    spec : as `cases.draw_spec` fills it but for the causes.

    Returns
    -------
    (effects, rest), rest None for `many`.
    """
    messy = spec["tier"] == "messy"
    count = int(rng.choice(COUNTS[spec["tier"]]))
    noise = planar.noises(robot, {})
    axis = robot.axis.kind if robot.axis else None
    menu = possible(robot, spec["missing"])
    of = scale_of(robot, 1 / spec["rate"], float(np.mean([run["duration"] for run in spec["runs"]])))
    heaviest = max(run["payload_kg"] for run in (*spec["runs"], *spec["held_out"]))
    missing = set(spec["missing"])

    def several() -> list[dict]:
        return [draw_sized(rng, name, of, axis) for name in draw_names(rng, count, menu=menu)]

    effects = several()

    def build(effects, rest, tolerance):
        return planar.build_machine(robot, {"tolerance": False, "effects": effects, "outside": rest}, rng)

    def again(effect: dict) -> dict:
        if rng.random() < 0.5:
            return draw_sized(rng, effect["id"], of, axis)
        others = tuple(item["id"] for item in effects if item is not effect)
        return draw_sized(rng, draw_names(rng, 1, others, menu)[0], of, axis)

    drives: list[Drive] = []
    for _ in range(ROUNDS):
        machine = build(effects, None, False)
        if not _sound(machine, heaviest):
            effects = several()
            continue
        drives = _trial(robot, spec, machine, rng)
        gaps = worth(noise, build, effects, None, drives, missing)
        poor = [k for k, gap in enumerate(gaps["without"]) if not 1.1 * ASKED_GAP <= gap <= LARGEST_GAP]
        if not poor:
            break
        for k in poor:
            effects[k] = again(effects[k])
    if not messy:
        return effects, None
    rest = _draw_rest(rng, robot, spec, of, build, effects)
    return (effects, rest) if rest else draw_causes(rng, robot, spec)


def _draw_rest(rng: np.random.Generator, robot, spec: dict, of, build, effects: list[dict]) -> dict | None:
    """An unmodelled effect worth a small part of the gap on the case's whole runs; None where none was found."""
    missing = set(spec["missing"])
    machine = build(effects, None, False)
    step_s = machine.step_s
    drives = _trial(robot, spec, machine, rng, whole=True)
    named = [drive.replay(machine, step_s) for drive in drives]
    nominal = build([], None, False)
    noise = planar.noises(robot, {})
    before = gap_between(noise, drives, named, [drive.replay(nominal, step_s) for drive in drives], missing)
    for _ in range(ROUNDS):
        rest = draw_unmodelled(rng, of, spec["world"])
        wanted = max(1.3, 1.0 + (before - 1.0) * math.exp(rng.uniform(*np.log(REST_SHARE))))
        factor, weak, strong = 1.0, 0.01, 100.0
        for _ in range(8):
            there = build(effects, strengthened(rest, factor), False)
            gap = gap_between(noise, drives, [drive.replay(there, step_s) for drive in drives], named, missing)
            if 0.75 < (gap - 1.0) / (wanted - 1.0) < 1.33:
                return strengthened(rest, factor)
            weak, strong = (factor, strong) if gap < wanted else (weak, factor)
            step = factor * math.sqrt((wanted**2 - 1.0) / max(gap**2 - 1.0, 1e-9)) if math.isfinite(gap) else math.nan
            factor = step if weak < step < strong else math.sqrt(weak * strong)
    return None
