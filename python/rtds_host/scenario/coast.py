"""Pulses with pauses at zero volts: the wheels run down against their friction, the winding shorted."""

from rtds_host.contract import Robot
from rtds_host.scenario.base import Parameter, Scenario, Values, VoltageMotion
from rtds_host.scenario.profiles import length_s, staircase

PIECES = (
    (0.4, 0.0, 0.0),
    (1.3, 1.0, 1.0),
    (1.1, 0.0, 0.0),
    (1.3, -1.0, -1.0),
    (1.1, 0.0, 0.0),
    (1.5, 0.7, -0.7),
    (1.3, 0.0, 0.0),
    (1.5, -0.5, 0.5),
    (1.2, 0.0, 0.0),
    (1.0, 0.8, 0.3),
    (1.1, 0.0, 0.0),
    (1.4, -0.3, -0.8),
    (1.3, 0.0, 0.0),
    (1.2, 0.25, 0.25),
    (1.2, 0.0, 0.0),
)


def build(values: Values, robot: Robot) -> VoltageMotion:
    return VoltageMotion(length_s(PIECES), lambda t: values["peak_v"] * staircase(t, PIECES))


SCENARIO = Scenario(
    name="coast",
    about="pulses of voltage with pauses at zero volts",
    build=build,
    parameters={"peak_v": Parameter(9.0, "the largest pulse", 0.01, 100.0)},
    exchange_s=0.002,
    separates="friction of drivetrain and ground, load friction, current and speed sensors against each other",
)
