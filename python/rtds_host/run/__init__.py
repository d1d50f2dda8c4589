"""Driving a scenario: plan, loop, log, energies, summary, figure."""

from __future__ import annotations

import sys
import types
from typing import Any

from rtds_host.run.loop import Record, drive, drive_with
from rtds_host.run.path import Sample, SignalPath
from rtds_host.run.plan import COUPLINGS, Options, Plan, make_plan, other_controller
from rtds_host.run.session import LinkChoice, Outcome, perform, write_outcome
from rtds_host.run.summary import Effects, Summary

__all__ = [
    "COUPLINGS",
    "Effects",
    "LinkChoice",
    "Options",
    "Outcome",
    "Plan",
    "Record",
    "Sample",
    "SignalPath",
    "Summary",
    "drive",
    "drive_with",
    "make_plan",
    "other_controller",
    "perform",
    "write_outcome",
]


class _Callable(types.ModuleType):
    """This sub-package bears the name of the function `rtds_host.run`, and can be called in its place."""

    def __call__(self, *args: Any, **options: Any) -> Outcome:
        from rtds_host import api

        return api.run(*args, **options)


sys.modules[__name__].__class__ = _Callable
