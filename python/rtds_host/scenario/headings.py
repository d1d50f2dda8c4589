"""On a slope at every heading: up, across, down, across, and back."""

import math

from rtds_host.contract import Robot
from rtds_host.scenario.base import Parameter, Scenario, SpeedMotion, Values
from rtds_host.scenario.profiles import length_s, ramped

DRIVE_S, TURN_S, RAMP_S = 4.0, 2.5, 0.4


def build(values: Values, robot: Robot) -> SpeedMotion:
    # A ramp's area belongs to the piece it leads out of, so a piece of n seconds turns by n times its rate.
    rate = 0.5 * math.pi / TURN_S
    pieces = [(0.5, 0.0, 0.0)]
    for turn in (rate, rate, rate, rate, -rate, -rate):
        pieces += [(DRIVE_S, values["speed_m_s"], 0.0), (TURN_S, 0.0, turn)]
    pieces += [(DRIVE_S, -values["speed_m_s"], 0.0), (1.0, 0.0, 0.0)]
    return SpeedMotion(length_s(pieces), lambda t: ramped(t, pieces, RAMP_S))


SCENARIO = Scenario(
    name="headings",
    about="on a slope of 0.1 rad: up, across, down and across again, forward and backward",
    build=build,
    parameters={"speed_m_s": Parameter(0.12, "speed of a leg", 0.0, 10.0)},
    slope_rad=0.1,
    exchange_s=0.004,
    separates="slope error, centre of mass, payload, from friction and from one another",
)
