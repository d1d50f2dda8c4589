"""The whole chip through its pins against the ideal link: what is different is what 12-bit converters do, and
no more.
"""

from dataclasses import replace

import numpy as np
import pytest

from rtds_host.errors import InputError, LinkError
from rtds_host.link import open_link
from rtds_host.link.analog import Line, Paths
from rtds_host.link.calibrate import measure
from rtds_host.link.chip import ChipLink, check_status
from rtds_host.link.quantised import QuantisedLink
from rtds_host.motor.parameters import PARAMETER_NAMES
from rtds_host.run.loop import drive
from rtds_host.run.plan import Options, make_plan
from rtds_host.studies.quantisation import cost

MOTOR = dict(zip(PARAMETER_NAMES, (8.6, 1e-3, 6.538e-3, 6.538e-3, 1e-7, 4.372e-7, 1e-5)))
CONVERTERS = ("voltages", "torques", "outputs")
WIRES = Paths(
    to_chip=(Line(1.02, -0.03), Line(0.97, 0.015), Line(1.01, 0.02), Line(0.99, -0.01)),
    from_chip=(Line(0.98, 0.02), Line(1.03, -0.025), Line(1.015, 0.01), Line(0.995, -0.03)),
)


def twin(stages=CONVERTERS):
    """The bit-exact model between ideal 12-bit converters, where the chip is before its first exchange: one step on."""
    link = QuantisedLink(open_link("model"), None, stages)
    link.set_parameters(**MOTOR)
    link.exchange((0.0, 0.0), (0.0, 0.0), MOTOR["step_s"])
    return link


class Both:
    """Two links driven alike; the first one's answers count, samples that differ are counted."""

    def __init__(self, first, second):
        self.first, self.second, self.different, self.samples = first, second, 0, 0

    def set_parameters(self, *constants, **parameters):
        self.first.set_parameters(*constants, **parameters)
        self.second.set_parameters(*constants, **parameters)
        self.second.exchange((0.0, 0.0), (0.0, 0.0), parameters["step_s"])

    def exchange(self, *arguments):
        got, expected = self.first.exchange(*arguments), self.second.exchange(*arguments)
        self.different += int((got.speeds != expected.speeds).sum() + (got.currents != expected.currents).sum())
        self.samples += got.speeds.size + got.currents.size
        return got


def linear(duration_s, steps=None):
    """(differences to the ideal run, samples that differ from the model between converters, the record)."""
    plan = make_plan("linear", {}, Options())
    if duration_s is not None:
        plan = replace(plan, total_steps=round(duration_s / 1e-3))
    with open_link("model") as link:
        ideal = drive(plan, link)
    with ChipLink() as chip, QuantisedLink(open_link("model"), None, CONVERTERS) as model:
        both = Both(chip, model)
        record = drive(plan, both)
        report = chip.report()
    figures = cost(record.currents - ideal.currents, record.speeds - ideal.speeds)
    return figures, both, record, report


def check(figures, both, report):
    assert both.different == 0, (
        f"{both.different} of {both.samples} samples are not those of the model between converters"
    )
    # Half a step of the DAC, and what half a step of each voltage and torque makes of a motor until the controller
    # sees it: docs/adc-dac.md, closed loop. Steps: 0.98 mA and 3.9 mrad/s of the wheel.
    assert figures.current_max_a < 2 * 0.977e-3
    assert figures.speed_max_rad_s < 2 * 1.0 / 258.5
    assert report["cut_by_range"] == []


def test_the_beginning_of_a_run_through_the_pins():
    figures, both, _, report = linear(0.3)
    check(figures, both, report)
    assert both.samples == 4 * 300


@pytest.mark.long
def test_a_whole_run_through_the_pins():
    figures, both, record, report = linear(None)
    print(f"\n24 s of linear: {figures}\n{both.samples} samples, {report}, loop {record.wall_s:.1f} s")
    check(figures, both, report)


def test_idle_clocks_left_out_change_no_code():
    codes = []
    for clocks in ("min", 500):
        with ChipLink(step_clocks=clocks) as link:
            link.set_parameters(**MOTOR)
            before = link.clocks
            got = [link.exchange((v, -v), (1e-4, -2e-4), 0.001, 1e-4) for v in (6.0, -9.0, 2.5)]
            codes.append(np.concatenate([np.hstack([x.speeds, x.currents]) for x in got]))
            a_step = (link.clocks - before) / 300
        assert a_step == pytest.approx(500, abs=1) if clocks == 500 else a_step < 350
    assert np.array_equal(*codes)


def test_parameters_through_the_adc_are_those_of_its_codes():
    with ChipLink(parameters="adc") as link, twin(("parameters", *CONVERTERS)) as model:
        link.set_parameters(**MOTOR)
        for v in (6.0, -3.0):
            got, expected = (one.exchange((v, 2.0), (1e-4, 0.0), 0.002, 1e-3) for one in (link, model))
            assert np.array_equal(got.speeds, expected.speeds) and np.array_equal(got.currents, expected.currents)


def test_the_trapezoidal_rule_and_another_resistance_act_through_the_registers():
    motor = MOTOR | {"resistance_ohm": 10.0}
    with ChipLink() as link, QuantisedLink(open_link("model"), None, CONVERTERS) as model:
        for one in (link, model):
            one.set_parameters(**motor, method="trapezoidal")
        model.exchange((0.0, 0.0), (0.0, 0.0), 1e-5)
        got, expected = (one.exchange((6.0, 2.0), (1e-4, 0.0), 0.002, 2e-4) for one in (link, model))
        assert np.array_equal(got.currents, expected.currents)
        assert link.registers.read("R") == 10.0


def test_a_range_that_cuts_is_named():
    with ChipLink() as link:
        link.set_parameters(**MOTOR)
        link.exchange((30.0, 0.0), (0.0, 0.0), 0.001)
        for _ in range(6):
            link.exchange((15.0, 0.0), (0.0, 0.0), 0.02)
        assert {"v_l", "w_l"} <= set(link.report()["cut_by_range"])


def test_calibration_takes_the_errors_of_the_wires_out():
    points = [((3.137, -2.219), (2e-4, -3e-4)), ((-7.011, 9.005), (0.0, 5e-4))]

    def largest_errors(link):
        link.set_parameters(**MOTOR)
        with twin() as model:
            rows = []
            for v, t in points:
                got, expected = (one.exchange(v, t, 0.05) for one in (link, model))
                rows.append(
                    [np.abs(got.currents - expected.currents).max(), np.abs(got.speeds - expected.speeds).max()]
                )
        return np.max(rows, axis=0)

    with ChipLink(wires=WIRES) as rig:
        rig.set_parameters(**MOTOR)
        found = measure(rig, "chip", points=21, reads=1).paths
    with ChipLink(wires=WIRES) as link:
        before = largest_errors(link)
    with ChipLink(wires=WIRES, calibration=found) as link:
        after = largest_errors(link)
    print(f"\nlargest error without calibration {before}, with it {after} (A, rad/s of the motor)")
    assert before[0] > 0.01 and before[1] > 20.0
    assert after[0] < 3e-3 and after[1] < 4.0  # three steps of the DAC's current, four of its speed
    for line, true in zip((*found.to_chip, *found.from_chip), (*WIRES.to_chip, *WIRES.from_chip)):
        assert abs(line.gain - true.gain) < 5e-4 and abs(line.offset_v - true.offset_v) < 1e-3


@pytest.mark.parametrize("options", [{"step_clocks": 100}, {"step_clocks": "fast"}, {"parameters": "guess"}])
def test_options_out_of_range_are_refused(options):
    with pytest.raises(InputError):
        ChipLink(**options)


def test_a_fatal_flag_names_itself_and_its_meaning():
    with pytest.raises(LinkError, match="simulated chip: status lock_lost: The PLL lost its lock"):
        check_status({"lock_lost": True, "sat_i_l": True}, "simulated chip")
    assert check_status({"sat_i_l": True, "serial_error": True}, "x") == {"i_l"}
