"""What 12-bit converters cost: current and speed with the chip's codes in and out, against the ideal link.

Two questions. *Open loop*: the voltages and torques of an ideal run are replayed, with converters in the way, so that
each difference is theirs alone; one stage after the other, then all. *Closed loop*: the run is driven again through
converters, so that controller and robot answer to them, as on the board.

The converters here are ideal ones (nearest code, no noise, no offset) and the arithmetic is the chip's, bit for bit. R,
L and the step are registers of the chip and are not converted.

    python -m rtds_host.studies.quantisation --help
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import typer

from rtds_host.errors import RtdsError
from rtds_host.link import open_link
from rtds_host.link.quantised import STAGES, QuantisedLink
from rtds_host.link.scaling import ADC_CHANNELS, DAC_OUTPUTS, AdcScale, DacScale, Scaling, default_scaling

DEFAULT_SCENARIOS = ("linear", "circle", "eight")


@dataclass(frozen=True)
class Cost:
    """Difference to the ideal link over both motors and all samples (one a millisecond).

    Attributes
    ----------
    current_rms_a, current_max_a : A.
    speed_rms_rad_s, speed_max_rad_s : rad/s of the wheel.
    clipped : quantities that a converter's range cut.
    """

    current_rms_a: float
    current_max_a: float
    speed_rms_rad_s: float
    speed_max_rad_s: float
    clipped: frozenset[str] = frozenset()


def cost(currents: np.ndarray, speeds: np.ndarray, clipped: Sequence[str] = ()) -> Cost:
    """Figures of differences `currents` (n, 2) A and `speeds` (n, 2) rad/s of the wheel."""
    return Cost(
        current_rms_a=float(np.sqrt(np.mean(currents**2))),
        current_max_a=float(np.abs(currents).max()),
        speed_rms_rad_s=float(np.sqrt(np.mean(speeds**2))),
        speed_max_rad_s=float(np.abs(speeds).max()),
        clipped=frozenset(clipped),
    )


def open_loop(plan, record, stages: Sequence[str], scaling: Scaling | None = None) -> Cost:
    """Replay an ideal run's inputs with converters at `stages`.

    Parameters
    ----------
    plan, record : `rtds_host.run.plan.Plan` and the `rtds_host.run.loop.Record` of its ideal run.

    Raises
    ------
    InputError : a quantised parameter set is unusable (a parameter below half a step reads as zero).
    """
    from rtds_host.robot import STEP_S
    from rtds_host.run.loop import set_motors

    currents, speeds = np.zeros_like(record.currents), np.zeros_like(record.speeds)
    with QuantisedLink(open_link("model"), scaling, stages) as link:
        set_motors(link, plan)
        for start, end, volts, load in zip(
            record.starts, record.ends, record.applied, record.shaft_torques, strict=True
        ):
            got = link.exchange(volts, load, (end - start) * STEP_S, STEP_S)
            currents[start + 1 : end + 1] = got.currents
            speeds[start + 1 : end + 1] = got.speeds / plan.robot.motor.gear_ratio
        return cost(currents - record.currents, speeds - record.speeds, sorted(link.clipped))


def closed_loop(plan, record, scaling: Scaling | None = None):
    """Drive the plan again through converters everywhere; the cost and the new `Record`."""
    from rtds_host.run.loop import drive

    with QuantisedLink(open_link("model"), scaling) as link:
        again = drive(plan, link)
        return cost(again.currents - record.currents, again.speeds - record.speeds, sorted(link.clipped)), again


def _row(label: str, figures: Cost) -> str:
    cut = ", ".join(sorted(figures.clipped)) or "none"
    return (
        f"| {label} | {1e3 * figures.current_rms_a:.3f} | {1e3 * figures.current_max_a:.3f} "
        f"| {1e3 * figures.speed_rms_rad_s:.3f} | {1e3 * figures.speed_max_rad_s:.3f} | {cut} |"
    )


def report(scenarios: Sequence[str], robot: str = "burger") -> str:
    """The tables of docs/adc-dac.md, Markdown.

    Raises
    ------
    InputError : unknown scenario or robot.
    """
    from rtds_host.run.loop import drive
    from rtds_host.run.plan import Options, make_plan
    from rtds_host.run.summary import path_errors, speed_error_rms

    lines, tracking = [], []
    for name in scenarios:
        plan = make_plan(name, options=Options(robot=robot))
        with open_link("model") as link:
            ideal = drive(plan, link)
        lines += [
            f"`{name}`, robot `{robot}`, {plan.duration_s:g} s, exchange {1e3 * plan.exchange_s:g} ms:",
            "",
            "| converters at | current rms, mA | largest, mA | wheel speed rms, mrad/s | largest, mrad/s | clipped |",
            "|---|---|---|---|---|---|",
        ]
        lines += [_row(f"{stage} only", open_loop(plan, ideal, (stage,))) for stage in STAGES]
        lines.append(_row("all, open loop", open_loop(plan, ideal, STAGES)))
        figures, again = closed_loop(plan, ideal)
        lines += [_row("all, closed loop", figures), ""]
        for label, record in (("ideal", ideal), ("12 bits", again)):
            errors = path_errors(record)
            if errors is not None:
                tracking.append(
                    f"| {name} | {label} | {speed_error_rms(record):.5f} | {1e3 * errors[0]:.2f} "
                    f"| {np.degrees(errors[1]):.3f} | {1e3 * errors[2]:.2f} |"
                )
    if tracking:
        lines += [
            (
                "| run | link | speed error rms, rad/s | end position off, mm | end yaw off, deg | largest on the way,"
                " mm |"
            ),
            "|---|---|---|---|---|---|",
            *tracking,
        ]
    return "\n".join(lines)


def ranges(scaling: Scaling | None = None) -> str:
    """The table of ranges of docs/adc-dac.md, Markdown."""
    scaling = scaling or default_scaling()
    units = {
        "v": "V",
        "t": "N·m",
        "b": "N·m·s/rad",
        "j": "kg·m²",
        "km": "N·m/A",
        "kb": "V·s/rad",
        "i": "A",
        "w": "rad/s",
    }
    lines = ["| converter | quantity | unit | at code 0 | at code 4095 | one step |", "|---|---|---|---|---|---|"]
    parts: tuple[tuple[tuple[str, ...], Sequence[AdcScale | DacScale], str], ...] = (
        (ADC_CHANNELS, scaling.adc, "ADC"),
        (DAC_OUTPUTS, scaling.dac, "DAC"),
    )
    for names, scales, part in parts:
        for place, (name, scale) in enumerate(zip(names, scales, strict=True)):
            low, high = scale.limits
            step = (high - low) / 4095
            where = f"ADC {place}" if part == "ADC" else f"DAC {'ABCD'[place]}"
            lines.append(f"| {where} | {name} | {units[name.split('_')[0]]} | {low:.5g} | {high:.5g} | {step:.4g} |")
    return "\n".join(lines)


def main(
    scenario: Annotated[list[str] | None, typer.Option(help="scenario to measure, may be repeated")] = None,
    robot: Annotated[str, typer.Option(help="a robot of the package, or a robot.toml")] = "burger",
    show_ranges: Annotated[bool, typer.Option("--ranges", help="print the default ranges only")] = False,
) -> None:
    """Measure what 12-bit converters cost against the ideal link; prints Markdown."""
    try:
        print(ranges() if show_ranges else report(scenario or DEFAULT_SCENARIOS, robot))
    except RtdsError as error:
        print(error, file=sys.stderr)
        raise SystemExit(2) from None


if __name__ == "__main__":
    typer.run(main)
