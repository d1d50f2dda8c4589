"""The paper's three scenarios with and without a diagnosed robot's effects, in both physics engines.

    python -m rtds_host.studies.scenarios diagnosis.json --figure effects.png

prints a table (as Markdown) of how each run ends, how well it holds its speeds, and how far the engines lie apart, and
draws paths, currents and speed errors.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from rtds_host.contract import Robot, check_writable
from rtds_host.correction.choose import Chosen, choose
from rtds_host.correction.translate import translate
from rtds_host.errors import RtdsError
from rtds_host.figures import caption, save
from rtds_host.robot import ENGINES, default_engine
from rtds_host.run import Effects, LinkChoice, Options, Outcome, make_plan, perform
from rtds_host.run.plan import robot_path
from rtds_host.vectors import given

SCENARIOS = ("linear", "circle", "eight")
NOMINAL, CHANGED, PLAIN = "#c8501e", "#1f5fa8", "#444444"


@dataclass(frozen=True)
class Pair:
    """One scenario, driven by the nominal robot and by the one with effects."""

    scenario: str
    nominal: Outcome
    changed: Outcome


def drive(
    chosen: Chosen | None,
    robot: str,
    link: LinkChoice,
    engine: str,
    controller: str = "exact",
    names: tuple[str, ...] = SCENARIOS,
    values: dict[str, float] | None = None,
) -> list[Pair]:
    """Drive each scenario twice, and once more in the other engine to compare; `values` as of `make_plan`.

    Raises
    ------
    InputError, LinkError : see `rtds_host.run.perform`.
    """
    other = next(name for name in ENGINES if name != engine)
    pairs = []
    for name in names:
        plan = make_plan(name, values, Options(robot=robot, engine=engine, controller=controller))
        effects = None
        if chosen is not None:
            effects = Effects(translate(chosen.model, plan.robot, plan.body.payload_kg), chosen.names)
        nominal = perform(plan, link, compare=False, against=other)
        changed = perform(plan, link, compare=False, against=other, effects=effects) if effects else nominal
        pairs.append(Pair(name, nominal, changed))
    return pairs


def markdown(pairs: list[Pair]) -> str:
    """The table."""
    lines = [
        (
            "| scenario | robot | end of the path | speed error, rms | peak current, left, right | engines end |"
            " engines, rms |"
        ),
        "|---|---|---|---|---|---|---|",
    ]
    for pair in pairs:
        for text, outcome in (("nominal", pair.nominal), ("with effects", pair.changed)):
            s = outcome.summary
            g, at = given(s.engine_gap, "engine_gap"), s.tracking
            lines.append(
                f"| {pair.scenario} | {text} | {1e3 * at.position_m:.2f} mm,"
                f" {math.degrees(at.yaw_rad):.3f}° off | {1e3 * at.speed_rad_s:.2f} mrad/s |"
                f" {1e3 * s.peak_current_a[0]:.0f}, {1e3 * s.peak_current_a[1]:.0f} mA | {1e3 * g.end_position_m:.3f}"
                f" mm, {math.degrees(g.end_yaw_rad):.4f}° apart | {1e3 * g.speed_rms_rad_s:.2g} mrad/s,"
                f" {1e3 * g.current_rms_a:.2g} mA, {1e3 * g.load_rms_nm:.2g} mN·m |"
            )
    return "\n".join(lines) + "\n"


def draw(pairs: list[Pair], path: Path) -> None:
    """Paths, currents of the left motor and speed errors: a row a scenario, nominal against with effects."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import numpy as np

    from rtds_host.correction.figure import STYLE

    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            len(pairs), 3, figsize=(11.0, 2.5 * len(pairs)), layout="constrained", squeeze=False
        )
        for (way, current, error), pair in zip(axes, pairs):
            reference = pair.nominal.record.reference_poses
            if reference is not None:
                way.plot(reference[:, 0], reference[:, 1], "--", color=PLAIN, label="reference")
            for text, colour, outcome in (("nominal", NOMINAL, pair.nominal), ("with effects", CHANGED, pair.changed)):
                record = outcome.record
                poses = np.array([[s.x_m, s.y_m] for s in record.truth])
                way.plot(poses[:, 0], poses[:, 1], color=colour, label=text)
                for side, style in ((0, "-"), (1, ":")):
                    current.plot(
                        record.t_s,
                        1e3 * record.currents[:, side],
                        style,
                        color=colour,
                        label=f"{text}, {('left', 'right')[side]}",
                    )
                if record.references is not None:
                    miss = 1e3 * (record.speeds - record.references)
                    error.plot(record.t_s, miss[:, 0], color=colour, label=f"{text}, left")
            way.set(title=f"{pair.scenario}: path", xlabel="x (m)", ylabel="y (m)")
            way.axis("equal")
            current.set(title="armature currents", xlabel="t (s)", ylabel="mA")
            error.set(title="speed error, left", xlabel="t (s)", ylabel="mrad/s")
            for axis in (way, current, error):
                axis.legend(loc="best")
        caption(figure, "; ".join(pairs[0].changed.summary.effects[:1]) or "no effect")
        save(figure, path, dpi=110, metadata={"Software": None})
        plt.close(figure)


app = typer.Typer(add_completion=False)


@app.command()
def main(
    diagnosis: Annotated[Path | None, typer.Argument(help="A diagnosis.json.")] = None,
    effect: Annotated[
        list[str] | None, typer.Option(help="An effect, as of `rtds run --effect`; may be repeated.")
    ] = None,
    robot: Annotated[str, typer.Option(help="A built-in robot (burger, jackal, ...), or a robot.toml.")] = "burger",
    engine: Annotated[str, typer.Option(help="pybullet or mujoco; the other one is compared.")] = default_engine(),
    controller: Annotated[str, typer.Option(help="exact or paper.")] = "exact",
    link: Annotated[str, typer.Option(help="model or rtl.")] = "model",
    figure: Annotated[Path | None, typer.Option(help="PNG to draw.")] = None,
    into: Annotated[Path | None, typer.Option(help="Page to put the table into, between its marks.")] = None,
) -> None:
    """Drive linear, circle and eight with and without effects, in both engines."""
    from rtds_host.contract import load_robot
    from rtds_host.contract.output import write_between

    try:
        nominal: Robot = load_robot(robot_path(robot))
        if figure is not None:
            check_writable(figure.parent)
        pairs = drive(choose(nominal, diagnosis, effect), robot, LinkChoice(link), engine, controller)
        if figure is not None:
            draw(pairs, figure)
        if into is not None:
            write_between(into, markdown(pairs), "<!-- scenarios: begin -->", "<!-- scenarios: end -->")
        else:
            print(markdown(pairs), end="")
    except RtdsError as error:
        print("rtds: " + " ".join(str(error).split()), file=sys.stderr)
        raise typer.Exit(2) from error


if __name__ == "__main__":
    app()
