"""Does the simulator with an effect agree with the diagnosis' replay of the same effect? A table, effect by effect.

    python -m rtds_host.studies.agreement --help

Every effect of the catalogue is switched on at a size met in practice, and one designed run is driven from its commands
twice: in the real-time simulator (motor units in a link, robot in a physics engine) and in the replay, at a fine step.
The difference is a gap as the contract's section 4 measures it: 1 is the sensors' own noise.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from rtds_host.contract import Case, Robot, RunLog, RunMeta, builtin_robot
from rtds_host.contract.output import write_between
from rtds_host.correction.close import FINE_STEP_S, distance
from rtds_host.correction.simulate import Setting, simulate
from rtds_host.diagnosis.effects import CATALOGUE, SIDES, catalogue
from rtds_host.diagnosis.replay.model import Model, nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.scales import scales_of
from rtds_host.errors import InputError, RtdsError, did_you_mean
from rtds_host.plant.schema import OUTPUTS
from rtds_host.robot import default_engine

# Bound on the difference, in units of noise: a tenth of what a sensor hides.
BOUND = 0.1
STEP_S = 0.005
SECONDS = 6.6
START, END = "<!-- agreement: begin -->", "<!-- agreement: end -->"


@dataclass(frozen=True)
class Row:
    """One line of the table. `size`: how far the effect itself moves the replay; `apart`: simulator against replay;
    `worst`: the channel that differs most, and by how much; all in units of noise."""

    effect: str
    side: str
    values: dict[str, float]
    runs_in: str
    size: float
    apart: float
    worst: tuple[str, float]
    bound: float
    reason: str

    @property
    def within(self) -> bool:
        return self.apart <= self.bound


def designed_run(seconds: float = SECONDS) -> RunLog:
    """A run that shows every effect: steps with reversals, a slow crawl through zero, turning on the spot; on a slope,
    with payload, from wheel angles that are not zero."""
    t = np.arange(round(seconds / STEP_S) + 1) * STEP_S
    rng = np.random.default_rng(7)
    levels = np.array([[8.0, 8.0], [-5.0, -7.0], [9.0, 6.0], [3.0, 4.0], [-8.0, -8.0], [0.0, 0.0]])
    third = seconds / 3.3
    v = levels[np.minimum((t / (third / len(levels))).astype(int), len(levels) - 1)]
    crawl = (t > third) & (t <= 2 * third)
    wave = 2.5 * np.sin(2 * np.pi * (t - third) / (0.8 * third))
    v = np.where(crawl[:, None], np.column_stack([wave, 0.8 * wave + 0.6]), v)
    turns = rng.uniform(3.0, 9.0, 64) * np.where(np.arange(64) % 2, 1.0, -1.0)
    spin = turns[np.minimum(((t - 2 * third) / 0.45).clip(0).astype(int), 63)]
    v = np.where((t > 2 * third)[:, None], np.column_stack([-spin, spin]), v)
    v[t < 0.2] = v[t > 3.15 * third] = 0.0
    columns = {"v_cmd_l": v[:, 0], "v_cmd_r": v[:, 1]}
    at_start = {"x": 0.3, "y": -0.2, "yaw": 0.4, "th_l": 2.0, "th_r": -1.1}
    columns |= {name: np.full(len(t), value) for name, value in at_start.items()}
    meta = RunMeta(scenario="designed", payload_kg=1.0, slope_rad=0.08, uphill_yaw_rad=0.3)
    return RunLog("designed", meta, t, columns)


def measured(log: RunLog, out: np.ndarray) -> RunLog:
    """The run with every channel as an answer (n, 11) has it."""
    return replace(log, columns={**log.columns, **{name: out[:, k] for k, name in enumerate(OUTPUTS)}})


def values_of(effect: str) -> dict[str, float]:
    """The size at which an effect is compared, with its switches off."""
    given = CATALOGUE[effect].compared_at
    return {
        p.name: p.null if p.switch else given.get(p.name, p.starts[len(p.starts) // 2])
        for p in CATALOGUE[effect].on(scales_of(builtin_robot("burger"))).parameters
    }


def modes_of(effect: str) -> list[dict[str, float]]:
    """That size, with its switches off and with each of them on."""
    off = values_of(effect)
    return [off, *({**off, p.name: p.starts[-1]} for p in CATALOGUE[effect].parameters if p.switch)]


def sides_of(effect: str) -> tuple[str, ...]:
    """Sides compared: both, and left alone where an effect has sides."""
    return CATALOGUE[effect].sides[:2]


def _model(robot: Robot, effect: str, side: str, values: dict[str, float]) -> Model:
    model = nominal_model(robot)
    CATALOGUE[effect].apply(model, SIDES[side], values)
    return model


def compare(
    effect: str, side: str, log: RunLog, robot: Robot, setting: Setting, values: dict[str, float] | None = None
) -> Row:
    """One line of the table; values : of the effect's parameters, in place of those of `values_of`."""
    values = values or values_of(effect)
    model = _model(robot, effect, side, values)
    inputs = run_inputs(log, robot)
    truth, plain = (replay_run(m, inputs, FINE_STEP_S) for m in (model, nominal_model(robot)))
    out = simulate(log, robot, model, setting).out
    log = measured(log, truth)
    case = Case("designed", robot, (log,))
    size, _ = distance(case, [(log, truth, plain)])
    apart, channels = distance(case, [(log, truth, out)])
    worst = max(channels, key=lambda channel: channels[channel])
    bound, reason = CATALOGUE[effect].agrees_within or (BOUND, "")
    switches = [p for p in CATALOGUE[effect].parameters if p.switch]
    if switches and all(values[p.name] == p.null for p in switches):
        bound, reason = BOUND, ""
    return Row(effect, side, values, CATALOGUE[effect].runs_in, size, apart, (worst, channels[worst]), bound, reason)


def rows(
    effects: Iterable[str] | None = None, setting: Setting | None = None, seconds: float = SECONDS
) -> Iterator[Row]:
    """The table's lines, in the catalogue's order by subsystem.

    Raises
    ------
    InputError : an effect that is not in the catalogue.
    """
    there = catalogue(builtin_robot("burger"))
    names = list(effects or sorted(there, key=lambda e: (there[e].subsystem, e)))
    for name in names:
        if name not in there:
            raise InputError(
                f"effect {name!r}: not in the catalogue (`rtds effects` lists it){did_you_mean(name, there)}"
            )
    robot, log = builtin_robot("burger"), designed_run(seconds)
    for name in names:
        for values, side in itertools.product(modes_of(name), sides_of(name)):
            yield compare(name, side, log, robot, setting or Setting(), values)


def markdown(found: list[Row]) -> str:
    """The table as Markdown."""
    from rtds_host.correction.translate import PLACE_NAMES

    lines = [
        "| effect | side | size | runs in | moves the run by | simulator less replay | most in | bound |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in found:
        size = ", ".join(f"{name} {value:g}" for name, value in row.values.items())
        lines.append(
            f"| `{row.effect}` | {row.side} | {size} | {PLACE_NAMES[row.runs_in]} | {row.size:.3g} | {row.apart:.2g} | "
            f"`{row.worst[0]}` {row.worst[1]:.2g} | {row.bound:g}{'' if row.within else ' (missed)'} |"
        )
    reasons = dict.fromkeys((row.effect, row.reason) for row in found if row.reason)
    lines += [f"\n`{effect}`: {reason}." for effect, reason in reasons]
    return "\n".join(lines) + "\n"


app = typer.Typer(add_completion=False)


@app.command()
def main(
    effect: Annotated[list[str] | None, typer.Option(help="Only this effect; may be repeated.")] = None,
    link: Annotated[str, typer.Option(help="model or rtl.")] = "model",
    engine: Annotated[str, typer.Option(help="pybullet or mujoco.")] = default_engine(),
    into: Annotated[Path | None, typer.Option(help="Page to put the table into, between its marks.")] = None,
) -> None:
    """Compare the simulator with the replay for every effect; status 1 where a bound is missed."""
    setting = Setting(
        link=link, link_options={"sim": "verilator", "step_clocks": "min"} if link == "rtl" else {}, engine=engine
    )
    try:
        found = []
        for row in rows(effect, setting):
            found.append(row)
            print(
                f"{row.effect:24} {row.side:6} moves {row.size:8.3g}  apart {row.apart:8.2g}  most in {row.worst[0]} "
                f"{row.worst[1]:.2g}{'' if row.within else '  BOUND MISSED'}",
                file=sys.stderr,
                flush=True,
            )
        table = markdown(found)
        if into is None:
            print(table, end="")
        else:
            write_between(into, table, START, END)
    except RtdsError as error:
        print(f"rtds: {error}", file=sys.stderr)
        raise typer.Exit(2) from error
    if not all(row.within for row in found):
        raise typer.Exit(1)


if __name__ == "__main__":
    app()
