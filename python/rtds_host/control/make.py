"""A controller by its name."""

from __future__ import annotations

from rtds_host.contract import Motor
from rtds_host.control.base import CONTROLLERS, Controller
from rtds_host.control.exact import ExactController
from rtds_host.control.paper import PaperController
from rtds_host.errors import InputError, did_you_mean


def make_controller(name: str, motor: Motor, limit_v: float) -> Controller:
    """A controller that knows the nominal motor and keeps within +-`limit_v`.

    Raises
    ------
    InputError : unknown name.
    """
    if name == "exact":
        return ExactController(motor, limit_v)
    if name == "paper":
        return PaperController(motor, limit_v)
    raise InputError(f"controller {name!r}: unknown (known: {', '.join(CONTROLLERS)}){did_you_mean(name, CONTROLLERS)}")
