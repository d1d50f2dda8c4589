"""What to do next, for every verdict: which check on the robot, which run, what in the simulator."""

from __future__ import annotations

from typing import Any

from rtds_host.contract import Robot
from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.report.details import Details
from rtds_host.diagnosis.report.words import (
    SUBSYSTEM_WORDS,
    by_share,
    channel_name,
    enumerated,
    indistinguishable_from,
    listed_name,
    manoeuvre,
    percent,
    plain_name,
)

# Where to look by hand, by the place of what has no name.
LOOK = {
    "driver": "measure the voltage at the motor's terminals against the command: small and full, under load and "
    "with the wheel "
    "in the air",
    "winding": "measure the winding's resistance cold and warm, and the voltage of the motor turned from outside",
    "drivetrain": "turn each wheel in the air, by hand and by a slow command, both ways: free play, tight spots "
    "and springs can "
    "be felt, friction shows in the current",
    "wheel_ground": "look at tyres, caster and floor, and measure the distance of ten wheel turns: straight and on "
    "the spot, with "
    "payload and without",
    "chassis": "weigh the robot as it was driven, put a level on the floor, and look for what drags or swings",
    "sensing": "hold each sensor against a measurement by hand: ten turns of a wheel, ten turns of the robot, "
    "current and gyro "
    "at standstill",
    "timing": "stop a wheel against a hard stop and compare the times in each channel: a bus or a logger may "
    "deliver late or "
    "unevenly",
}
UNLIKE = (
    "Does the robot still behave unlike its simulator? Record a run in which it does, with that load, speed and "
    "floor, and "
    "diagnose it together with these."
)
# Commands for what comes next; files by the names that rtds writes.
EXPORT = (
    "Gazebo, MuJoCo, Isaac Sim: `rtds export diagnosis.json --robot robot.toml --to sdf --out robot.sdf` (or "
    "`mjcf`, `usd-json`, "
    "`urdf`, `python`) writes the robot {}."
)
SAMPLES = "For domain randomisation `--samples N` draws N robots from the range of each size."
CLOSE = (
    "The simulator of rtds: `rtds run SCENARIO --effects diagnosis.json` drives with it; "
    "`rtds close CASE --diagnosis diagnosis.json` says how near it comes."
)
PREDICT = (
    "`rtds predict RUN --robot robot.toml --diagnosis diagnosis.json --out predicted.csv` replays a run with it; "
    "such a robot is "
    "not exported."
)
PLAN = (
    "`rtds plan diagnosis.json --robot robot.toml --floor 3x3 --out plan` makes {} for this robot and your floor: "
    "commands as a table, as csv and as a ROS 2 script."
)
NOWHERE = "The runs do not show where: record current, gyro and pose too, as far as the robot has them."


def _of_effect(diagnosis: dict[str, Any], effect: dict[str, Any]) -> tuple[str, list[str]]:
    """One included effect: a check first; a remedy only where nothing else would show the same."""
    known = CATALOGUE[effect["id"]]
    name = listed_name(effect)
    if indistinguishable := indistinguishable_from(diagnosis, effect):
        names = enumerated([listed_name(one) for one in (effect, *indistinguishable)], "or")
        title = f"Find out which it is before you change anything: {names} would look the same in these runs."
        return title, [f"{listed_name(one)}: {CATALOGUE[one['id']].check}" for one in (effect, *indistinguishable)]
    others = enumerated([plain_name(other) for other in known.confused_with], "or")
    return (
        f"{name[0].upper()}{name[1:]}: check it on the robot.",
        [
            f"{known.check} This also distinguishes it from what looks similar: {others}.",
            f"If this shows it: {known.advice[0].lower()}{known.advice[1:]}",
        ],
    )


def _of_place(place: str | None) -> str:
    return f"Look there by hand: {LOOK[place]}." if place in LOOK else NOWHERE


def exportable(robot: Robot) -> bool:
    """Whether `rtds export` and `rtds plan` take a robot: on two wheels, driven by voltage or wheel speeds."""
    return robot.chassis is not None and robot.driver.mode != "torque"


def _into_simulators(robot: Robot) -> list[str]:
    """The commands that put what was found into a simulator."""
    if not exportable(robot):
        return [PREDICT]
    return [
        f"{EXPORT.format('with it, and lists what that simulator cannot express')} {SAMPLES}",
        *([CLOSE] if robot.driver.mode == "voltage" else []),
    ]


def next_steps(diagnosis: dict[str, Any], details: Details) -> list[tuple[str, list[str]]]:
    """What to do next, in order: a sentence and what belongs below it, in which commands stand between backquotes.

    No step rests on a cause that these runs cannot tell from another, and every remedy stands behind a check that would
    show the cause itself.
    """
    verdict, gap = diagnosis["verdict"], diagnosis["gap"]
    residual = gap.get("rest") or {}
    steps: list[tuple[str, list[str]]] = []
    if verdict == "none":
        undetermined = details.localisation.undetermined if details.localisation is not None else ()
        possible = exportable(details.case.robot)
        return [
            (
                "Use the simulator as it is for driving of this kind.",
                [EXPORT.format("as it is, its motor values adjusted")] if possible else [],
            ),
            (
                UNLIKE,
                [f"These runs cannot show everything: {text}." for text in undetermined]
                + ([PLAN.format("a run to judge the simulator on")] if possible else []),
            ),
        ]
    if verdict == "unknown":
        steps.append(("Change nothing on the robot yet: no cause is established.", []))
        warned = details.gate.warnings if details.gate is not None else ()
        if warned:
            steps.append(
                ("See first to what was found in the recordings; it may be all there is.", [f.text for f in warned[:3]])
            )
    steps += [_of_effect(diagnosis, effect) for effect in by_share(diagnosis)]
    if verdict in ("partial", "unknown"):
        place = residual.get("subsystem")
        words = f"the {SUBSYSTEM_WORDS[place]}" if place else "a place that is not known"
        unmodelled = sum(row["share"] for row in diagnosis["budget"] if row["what"] == "rest")
        title = (
            f"{percent(unmodelled)} of the difference is unmodelled; most of it shows in {words}."
            if verdict == "partial"
            else f"The difference shows most in {words}."
        )
        below = [_of_place(place)]
        key = "after" if verdict == "partial" else "refit"
        worst = max(gap.get("channels") or {}, key=lambda c: gap["channels"][c].get(key) or 0.0, default=None)
        if worst is not None:
            below.append(f"The channel with the largest misfit: {channel_name(worst)}.")
        steps.append((title, below))
    plan = diagnosis.get("next_experiment")
    if plan:
        why = str(plan.get("why", ""))
        steps.append(
            (
                f"Record the manoeuvre {manoeuvre(plan)} next, and diagnose again with it.",
                [
                    f"{why[:1].upper()}{why[1:].rstrip('.')}.",
                    *([PLAN.format("this manoeuvre")] if exportable(details.case.robot) else []),
                ],
            )
        )
    if diagnosis["effects"]:
        title = (
            "Or leave the robot as it is and give the simulator what was found"
            if verdict == "known"
            else ("Meanwhile the simulator can have what was found")
        )
        below = _into_simulators(details.case.robot)
        if any(indistinguishable_from(diagnosis, effect) for effect in diagnosis["effects"]):
            below.append(
                "Causes that look the same here may differ in other driving: trust it for driving like these runs."
            )
        steps.append((f"{title}:", below))
    return steps
