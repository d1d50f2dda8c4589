"""Timed faults and played-back signals in a run: what goes wrong, at which step of the motor units."""

from rtds_host.faults.inject import FaultLink
from rtds_host.faults.script import KINDS, Fault, read_faults
from rtds_host.faults.stimulus import Stimulus, read_stimulus
from rtds_host.faults.timeline import Injection

__all__ = ["KINDS", "Fault", "FaultLink", "Injection", "Stimulus", "read_faults", "read_stimulus"]
