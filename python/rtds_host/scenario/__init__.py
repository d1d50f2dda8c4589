"""Scenarios: one file each, found by themselves."""

from rtds_host.scenario.base import (
    Motion,
    Parameter,
    Scenario,
    SpeedMotion,
    VoltageMotion,
    find_scenario,
    reference_poses,
    scenarios,
    wheel_references,
)
from rtds_host.scenario.own import is_own, own_scenario
from rtds_host.scenario.reach import check_reach
from rtds_host.scenario.scaled import scaled_values

__all__ = [
    "Motion",
    "Parameter",
    "Scenario",
    "SpeedMotion",
    "VoltageMotion",
    "check_reach",
    "find_scenario",
    "is_own",
    "own_scenario",
    "reference_poses",
    "scaled_values",
    "scenarios",
    "wheel_references",
]
