"""Steps of voltage of many sizes and both signs, the wheels not together."""

from rtds_host.contract import Robot
from rtds_host.scenario.base import Parameter, Scenario, Values, VoltageMotion
from rtds_host.scenario.profiles import length_s, staircase

# seconds, left and right as shares of the peak
PIECES = (
    (0.5, 0.0, 0.0),
    (1.0, 0.4, 0.4),
    (1.0, -0.4, -0.4),
    (0.8, 0.8, 0.8),
    (0.8, 0.2, 0.2),
    (0.8, 0.0, 0.6),
    (0.8, 0.6, 0.0),
    (0.8, 1.0, -1.0),
    (0.8, -1.0, 1.0),
    (0.8, -0.3, 0.3),
    (0.8, 0.3, -0.3),
    (1.0, 1.0, 1.0),
    (1.0, -0.8, -0.8),
    (0.8, -0.6, -0.2),
    (0.8, -0.2, -0.6),
    (0.8, 0.1, 0.1),
    (0.7, 0.0, 0.0),
)


def build(values: Values, robot: Robot) -> VoltageMotion:
    pieces = [(seconds * values["stretch"], left, right) for seconds, left, right in PIECES]
    return VoltageMotion(length_s(pieces), lambda t: values["peak_v"] * staircase(t, pieces))


SCENARIO = Scenario(
    name="steps",
    about="steps of voltage of many sizes and both signs",
    build=build,
    parameters={
        "peak_v": Parameter(10.0, "the largest step's level", 0.01, 100.0),
        "stretch": Parameter(1.0, "stretches every piece by this factor", 0.1, 100.0),
    },
    exchange_s=0.002,
    separates="resistance and constants of the motor, sag, driver gain, delays, rotor inertia",
)
