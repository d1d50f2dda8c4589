"""Where the energy went: the run's inputs once more through the bit-exact model, which sums every step.

A run with effects goes through the model once more too, to see that it ends in the same state; its energies are not
summed (the terms are those of ideal motor units).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rtds_host.correction.correction import Correction
from rtds_host.correction.coupler import set_effects
from rtds_host.faults.inject import FaultLink
from rtds_host.faults.timeline import Injection
from rtds_host.link.base import Link
from rtds_host.link.model import ModelLink
from rtds_host.motor import EnergyTerms
from rtds_host.robot import STEP_S
from rtds_host.run.loop import Record, set_motors
from rtds_host.run.plan import Plan

# J. Of less that went between motors and robot, only the rounding of both energies would be compared.
STILL_J = 1e-9


@dataclass(frozen=True)
class Audit:
    """Energy of the motors and of the robot.

    Attributes
    ----------
    terms : energy of both motors, summed at every simulator step.
    imbalance : drawn minus accounted over the largest term, the worse of the two motors.
    robot_gap : (work at the shafts minus energy gained by the robot) over the work exchanged in both directions; None
    of a
        robot that stood still (below `STILL_J`).
    throughput_j : work exchanged between motors and robot, in both directions.
    same : the model ends at the same 32-bit currents and speeds as the link did.
    """

    terms: EnergyTerms
    imbalance: float
    robot_gap: float | None
    throughput_j: float
    same: bool


def _same(plan: Plan, record: Record, last) -> bool:
    ratio = plan.robot.motor.gear_ratio
    return bool(
        np.array_equal(last.speeds[-1].astype(np.float64) / ratio, record.speeds[-1])
        and np.array_equal(last.currents[-1].astype(np.float64), record.currents[-1])
    )


def ends_alike(
    plan: Plan, record: Record, correction: Correction | None = None, injection: Injection | None = None
) -> bool:
    """Whether the bit-exact model, with effects and what was injected, ends at the same 32-bit currents and speeds."""
    with ModelLink() as model:
        link: Link = model if injection is None else FaultLink(model, injection)
        set_motors(link, plan, carry=correction is None)
        if correction is not None:
            set_effects(link, correction)
        for start, end, volts, load in zip(
            record.starts, record.ends, record.applied, record.shaft_torques, strict=True
        ):
            last = link.exchange(volts, load, (end - start) * STEP_S)
    return _same(plan, record, last)


def audit(plan: Plan, record: Record) -> Audit:
    """Replay the applied voltages and torques of a record and sum the energies.

    What the motor units carry of the body is the robot's: its energy counts as work at the shafts, not as stored.
    """
    with ModelLink(energy=True) as link:
        set_motors(link, plan)
        throughput, before = 0.0, np.zeros(2)
        reflected = 0.5 * record.reflected_kg_m2 / plan.robot.motor.gear_ratio**2
        for start, end, volts, load in zip(
            record.starts, record.ends, record.applied, record.shaft_torques, strict=True
        ):
            last = link.exchange(volts, load, (end - start) * STEP_S)
            moving = reflected * last.speeds[-1].astype(np.float64) ** 2
            work = link.pair.energy.shaft_j + moving
            throughput += float(np.abs(work - before).sum())
            before = work
        terms = link.pair.energy
    imbalance = float(terms.imbalance.max())
    terms = replace(terms, shaft_j=terms.shaft_j + moving, stored_j=terms.stored_j - moving)
    gap = float(terms.shaft_j.sum()) - record.engine_energy_j
    return Audit(
        terms=terms,
        imbalance=imbalance,
        throughput_j=throughput,
        robot_gap=gap / throughput if throughput > STILL_J else None,
        same=_same(plan, record, last),
    )
