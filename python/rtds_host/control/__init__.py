"""Speed controllers: from the speed that is wanted at the end of an exchange to the voltage held over it."""

from rtds_host.control.base import CONTROLLERS, Controller, Observation
from rtds_host.control.make import make_controller

__all__ = ["CONTROLLERS", "Controller", "Observation", "make_controller"]
