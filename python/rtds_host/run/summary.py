"""The figures of a run: for the terminal, and as `summary.json`."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np

from rtds_host.correction.correction import Correction
from rtds_host.faults.timeline import Injection
from rtds_host.robot import STEP_S
from rtds_host.run.energy import Audit, audit, ends_alike
from rtds_host.run.loop import Record
from rtds_host.run.plan import Plan
from rtds_host.vectors import given

# What the paper states for its own set-up.
PAPER_STEP_RATIO = 2000


@dataclass(frozen=True)
class EngineGap:
    """How far the same run comes out in another physics engine. Root mean squares over the run, both sides."""

    engine: str
    end_position_m: float
    end_yaw_rad: float
    speed_rms_rad_s: float
    current_rms_a: float
    load_rms_nm: float


@dataclass(frozen=True)
class Effects:
    """What makes a run's robot another one: the correction, and how each effect is named in a summary."""

    correction: Correction
    names: tuple[str, ...]


class Tracking(NamedTuple):
    """How a run followed its reference: at the end, the largest distance on the way, and both wheels' speeds (rms)."""

    position_m: float
    yaw_rad: float
    farthest_m: float
    speed_rad_s: float


@dataclass(frozen=True)
class Summary:
    """Figures of one run, SI; two-vectors are [left, right]. None where a run has no reference, or no comparison;
    energies are those of ideal motor units, None with `effects` or `faults`; `robot_energy_gap` is None of a robot that
    stood still."""

    scenario: str
    robot: str
    link: str
    engine: str
    coupling: str
    controller: str | None
    exchange_s: float
    simulated_s: float
    wall_s: float
    step_ratio: float
    inertia_ratio: float | None
    carried_inertia_kg_m2: list[float]
    end_position_error_m: float | None
    end_yaw_error_rad: float | None
    path_error_max_m: float | None
    speed_error_rms_rad_s: float | None
    compared_controller: str | None
    compared_exchange_s: float | None
    compared_error_rms_rad_s: float | None
    peak_current_a: list[float]
    peak_voltage_v: list[float]
    current_negative_s: list[float]
    drawn_j: list[float] | None
    recovered_j: list[float] | None
    copper_j: list[float] | None
    viscous_j: list[float] | None
    shaft_j: list[float] | None
    stored_j: list[float] | None
    numerical_j: list[float] | None
    energy_imbalance: float | None
    robot_energy_j: float
    robot_energy_gap: float | None
    model_agrees: bool
    engine_gap: EngineGap | None
    link_report: dict | None
    effects: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()

    @property
    def tracking(self) -> Tracking:
        """How the reference was followed.

        Raises
        ------
        ValueError : the run had no reference.
        """
        return Tracking(
            given(self.end_position_error_m, "end_position_error_m"),
            given(self.end_yaw_error_rad, "end_yaw_error_rad"),
            given(self.path_error_max_m, "path_error_max_m"),
            given(self.speed_error_rms_rad_s, "speed_error_rms_rad_s"),
        )

    def to_json(self) -> dict:
        """For `summary.json`."""
        return asdict(self)


def speed_error_rms(record: Record) -> float | None:
    """RMS over both wheels, a sample every millisecond, of speed minus reference, rad/s."""
    if record.references is None:
        return None
    return float(np.sqrt(np.mean((record.speeds - record.references)[1:] ** 2)))


def path_errors(record: Record) -> tuple[float, float, float] | None:
    """At the end: distance m and yaw error rad; and the largest distance on the way, m, at equal times."""
    if record.reference_poses is None:
        return None
    poses = np.array([[s.x_m, s.y_m, s.yaw_rad] for s in record.truth])
    off = poses - record.reference_poses[record.rows]
    distance = np.hypot(off[:, 0], off[:, 1])
    return float(distance[-1]), float(off[-1, 2]), float(distance.max())


def engine_gap(plan: Plan, record: Record, engine: str, other: Record) -> EngineGap:
    """Compare a record with that of the same plan in another engine; torques at the wheel."""

    def rms(a: np.ndarray, b: np.ndarray) -> float:
        return float(np.sqrt(np.mean((a.astype(float) - b.astype(float)) ** 2)))

    here, there = record.truth[-1], other.truth[-1]
    return EngineGap(
        engine,
        math.hypot(here.x_m - there.x_m, here.y_m - there.y_m),
        here.yaw_rad - there.yaw_rad,
        rms(record.speeds, other.speeds),
        rms(record.currents, other.currents),
        plan.robot.motor.gear_ratio * rms(record.shaft_torques, other.shaft_torques),
    )


def summarise(
    plan: Plan,
    record: Record,
    link: str,
    compared: tuple[Plan, Record] | None = None,
    rival: tuple[str, Record] | None = None,
    effects: Effects | None = None,
    injection: Injection | None = None,
) -> Summary:
    """The figures of a run; `compared` is the same run with the other controller, `rival` in the other engine."""
    ideal = effects is None and injection is None
    energy: Audit | None = audit(plan, record) if ideal else None
    correction = effects.correction if effects else None
    alike = energy.same if energy else ends_alike(plan, record, correction, injection)

    def term(name: str) -> list[float] | None:
        return getattr(energy.terms, name).tolist() if energy else None

    errors = path_errors(record) or (None, None, None)
    return Summary(
        scenario=plan.scenario.name,
        robot=plan.robot.name,
        link=link,
        engine=plan.engine,
        coupling=plan.coupling,
        controller=plan.controller,
        exchange_s=plan.exchange_s,
        simulated_s=plan.duration_s,
        wall_s=record.wall_s,
        step_ratio=int(record.ends[0] - record.starts[0]) * STEP_S / plan.simulator_step_s,
        inertia_ratio=plan.split.ratio if plan.split else None,
        carried_inertia_kg_m2=record.reflected_kg_m2.tolist(),
        end_position_error_m=errors[0],
        end_yaw_error_rad=errors[1],
        path_error_max_m=errors[2],
        speed_error_rms_rad_s=speed_error_rms(record),
        compared_controller=compared[0].controller if compared else None,
        compared_exchange_s=compared[0].exchange_s if compared else None,
        compared_error_rms_rad_s=speed_error_rms(compared[1]) if compared else None,
        peak_current_a=np.abs(record.currents).max(axis=0).tolist(),
        peak_voltage_v=np.abs(record.applied).astype(float).max(axis=0).tolist(),
        current_negative_s=((record.currents < 0.0).sum(axis=0) * float(record.t_s[1])).tolist(),
        drawn_j=term("supplied_j"),
        recovered_j=term("recovered_j"),
        copper_j=term("copper_j"),
        viscous_j=term("viscous_j"),
        shaft_j=term("shaft_j"),
        stored_j=term("stored_j"),
        numerical_j=term("numerical_j"),
        energy_imbalance=energy.imbalance if energy else None,
        robot_energy_j=record.engine_energy_j,
        robot_energy_gap=energy.robot_gap if energy else None,
        model_agrees=alike,
        engine_gap=engine_gap(plan, record, *rival) if rival else None,
        link_report=record.link_report,
        effects=effects.names if effects else (),
        faults=injection.names if injection else (),
    )


def _errors(s: Summary, at: Tracking) -> list[tuple[str, str]]:
    """Rows on the path and on the speeds of a run with a reference."""
    path = (
        f"{1e3 * at.position_m:.2f} mm and {math.degrees(at.yaw_rad):.3f} deg off; "
        f"largest distance on the way {1e3 * at.farthest_m:.2f} mm"
    )
    speed = f"{at.speed_rad_s:.5f} rad/s with {s.controller!r} at {1e3 * s.exchange_s:g} ms"
    if s.compared_error_rms_rad_s is not None and s.compared_exchange_s is not None:
        speed += (
            f", {s.compared_error_rms_rad_s:.5f} with {s.compared_controller!r} at "
            f"{1e3 * s.compared_exchange_s:g} ms (ratio {s.compared_error_rms_rad_s / at.speed_rad_s:.3g})"
        )
    return [("end of the path", path), ("speed error (rms)", speed)]


def lines(summary: Summary) -> list[tuple[str, str]]:
    """The summary as pairs of a label and a text, in the order they are printed."""
    s = summary

    def pair(values: list[float], form: str, unit: str) -> str:
        return f"{values[0]:{form}} | {values[1]:{form}} {unit}"

    rows = [("robot, link", f"{s.robot}, motors in {s.link}, {s.engine}, coupling {s.coupling}")]
    rows += [("effects" if k == 0 else "", name) for k, name in enumerate(s.effects)]
    rows += [("faults" if k == 0 else "", name) for k, name in enumerate(s.faults)]
    if any(s.carried_inertia_kg_m2):
        rows.append(
            (
                "inertia",
                (
                    f"the body's at the wheel is {s.inertia_ratio:.3g} times the rotor's; the motor units carry "
                    + pair(s.carried_inertia_kg_m2, ".3g", "kg m2 of it")
                ),
            )
        )
    if s.controller is not None:
        rows += _errors(s, s.tracking)
    wall = f"{s.wall_s:.2f} s for {s.simulated_s:g} s simulated ({s.simulated_s / s.wall_s:.3g} times real time)"
    if s.engine_gap is not None:
        g = s.engine_gap
        rows.append(
            (
                f"{s.engine} - {g.engine}",
                (
                    f"end {1e3 * g.end_position_m:.3f} mm and {math.degrees(g.end_yaw_rad):.4f} deg apart; rms"
                    f" {1e3 * g.speed_rms_rad_s:.2g} mrad/s, {1e3 * g.current_rms_a:.2g} mA, {1e3 * g.load_rms_nm:.2g}"
                    " mN m"
                ),
            )
        )
    differs = "the model's end differs from the link's"
    rows += [
        ("peak current, voltage", pair(s.peak_current_a, ".3f", "A") + ",  " + pair(s.peak_voltage_v, ".2f", "V")),
        ("current below zero", pair(s.current_negative_s, ".2f", "s")),
    ]
    if s.drawn_j is not None:
        recovered, copper, viscous, shaft, stored = (
            given(values, "energy") for values in (s.recovered_j, s.copper_j, s.viscous_j, s.shaft_j, s.stored_j)
        )
        rows += [
            ("energy drawn", pair(s.drawn_j, ".3f", "J") + ", recovered " + pair(recovered, ".4f", "J")),
            ("  copper, viscous", pair(copper, ".3f", "J") + ",  " + pair(viscous, ".3f", "J")),
            ("  shafts, stored", pair(shaft, ".3f", "J") + ",  " + pair(stored, ".4f", "J")),
            (
                "  balance",
                f"off by {s.energy_imbalance:.1e} of the largest term, every step summed"
                + ("" if s.model_agrees else f"; {differs}"),
            ),
            (
                "  robot",
                "stood still, nothing went to and fro"
                if s.robot_energy_gap is None
                else (
                    f"gained {s.robot_energy_j:.3f} J, the shafts gave {sum(shaft):.3f} J "
                    f"(off by {100 * s.robot_energy_gap:.3f} % of what went to and fro)"
                ),
            ),
        ]
    elif not s.model_agrees:
        rows.append(("model", differs))
    rows += [
        ("steps", f"{s.step_ratio:g} simulator steps an exchange with the robot (the paper: about {PAPER_STEP_RATIO})"),
        ("wall time", wall),
    ]
    if s.link_report is not None:
        rows.append(("link", _link_text(s.link_report)))
    return rows


def _link_text(report: dict) -> str:
    """A link's report in words."""
    parts = []
    if "overruns" in report:
        parts.append(
            f"{report['exchanges']} exchanges began {1e3 * report['lateness_mean_s']:.2f} ms late on average, "
            f"{1e3 * report['lateness_max_s']:.2f} ms at most, jitter {1e3 * report['jitter_s']:.2f} ms, "
            f"{report['overruns']} overruns"
        )
        parts.append(f"{report['samples_held']} of {report['samples']} samples repeated")
    if "chip_steps" in report:
        clocks = "every clock" if report["every_clock"] else "idle clocks left out"
        parts.append(
            f"{report['chip_steps']} steps of the chip, {report['clocks_50_mhz']} clocks of 50 MHz ({clocks}) in "
            f"{report['chip_wall_s']:.2f} s"
        )
    if "lateness_s" in report:
        parts.append(f"{report['steps']} strobes, together {1e3 * report['lateness_s']:.3g} ms late")
    if "cut_by_range" in report:
        parts.append("cut by a range: " + (", ".join(report["cut_by_range"]) or "nothing"))
    return "; ".join(parts)
