"""The next experiment: the safe manoeuvre that separates the remaining rivals best."""

from __future__ import annotations

from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.verdict import Decision


def next_experiment(problem: Problem, decision: Decision) -> dict | None:
    """The manoeuvre to run next (contract, section 5), or None where nothing is left to separate."""
    return None
