"""What no effect of the catalogue explains, loaded as a table."""

from dataclasses import replace

import numpy as np
import pytest
from correction_cases import ROBOT, diagnosis_of, simulated_case

from rtds_host.correction.close import close
from rtds_host.correction.remainder import added, estimate
from rtds_host.diagnosis.replay.model import nominal_model
from rtds_host.motor.effects import Curve

N = ROBOT.motor.gear_ratio
UNKNOWN = diagnosis_of(verdict="unknown")


def drag(correction, start):
    """Friction that grows with the square of the speed: none of the catalogue's."""
    w = np.linspace(0.0, 8.0, 33)
    curve = Curve(tuple(N * w), tuple(0.004 * w**2 / N))
    return replace(
        correction, units=tuple(replace(u, friction_forward=curve, friction_backward=curve) for u in correction.units)
    )


def bump(correction, start):
    """A torque that depends on the wheel's angle, in no sine's shape."""
    x = np.linspace(0.0, 2 * np.pi, 129)
    curve = Curve(tuple(x), tuple(0.12 * np.exp(-(((x - 3.0) / 0.5) ** 2)) / N))
    return replace(
        correction,
        units=tuple(
            replace(u, ripple=curve, ripple_periods_per_rad=1 / (2 * np.pi * N), ripple_start_rad=float(start[3 + k]))
            for k, u in enumerate(correction.units)
        ),
    )


def bent(correction, start):
    """A driver whose voltage is no straight line over the command."""
    v = np.linspace(-12.0, 12.0, 97)
    curve = Curve(tuple(v), tuple(v + 0.6 * np.sin(v / 1.6)))
    return replace(correction, units=tuple(replace(u, command=curve) for u in correction.units))


def steps(correction, start):
    """A driver that rounds commands to 2 V, of which 8 s show too few."""
    x = [v for edge in np.arange(-11.0, 11.1, 2.0) for v in (edge, edge)]
    y = [v for edge in np.arange(-11.0, 11.1, 2.0) for v in (edge - 1.0, edge + 1.0)]
    return replace(correction, units=tuple(replace(u, command=Curve(tuple(x), tuple(y))) for u in correction.units))


@pytest.mark.parametrize(
    ("change", "located", "kind"),
    [
        (drag, "drivetrain", "torque against speed"),
        (bump, "drivetrain", "torque against wheel angle"),
        (bent, "driver", "voltage against command"),
    ],
)
def test_the_right_table_is_found_and_the_gap_shrinks(change, located, kind):
    case = simulated_case(change, hold_s=0.35)
    learn = replace(case, runs=case.runs[:2])
    found = estimate(learn, nominal_model(ROBOT), diagnosis_of(verdict="unknown", located=located))
    assert found.kind == kind
    gap = close(
        replace(case, runs=case.runs[2:]),
        diagnosis=diagnosis_of(verdict="unknown", located=located),
        causes=False,
        remainder=found,
    ).content["gap"]["simulator"]
    assert gap["before"] > 1.5
    assert gap["closed"] > 0.5


def test_a_curve_over_speed_is_the_friction_that_was_there():
    found = estimate(simulated_case(drag), nominal_model(ROBOT), UNKNOWN)
    for curve in found.curves.values():
        for speed in (1.0, 2.0, 4.0):
            assert curve.at(speed) == pytest.approx(0.004 * speed**2, rel=0.2, abs=0.004)
            assert curve.at(-speed) == pytest.approx(-0.004 * speed**2, rel=0.2, abs=0.004)


def test_where_nothing_is_left_there_is_no_table():
    case = simulated_case(None, seconds=3.0, count=2)
    assert estimate(case, nominal_model(ROBOT), UNKNOWN) is None


def test_a_table_that_does_not_predict_is_not_believed():
    case = simulated_case(steps, hold_s=0.35, count=2)
    assert estimate(case, nominal_model(ROBOT), diagnosis_of(verdict="unknown", located="driver")) is None


def test_where_no_table_fits_none_is_tried():
    case = simulated_case(drag, seconds=1.0, count=1)
    assert estimate(case, nominal_model(ROBOT), diagnosis_of(verdict="unknown", located="sensing")) is None


def test_sums_of_curves_keep_their_jumps():
    total = added(Curve((0.0, 0.0), (-1.0, 1.0)), Curve((-1.0, 1.0), (0.0, 2.0)))
    assert (total.before(0.0), total.at(0.0)) == (0.0, 2.0)
    assert (total.at(-2.0), total.at(2.0)) == (-1.0, 3.0)
    assert added(None, total) is total
