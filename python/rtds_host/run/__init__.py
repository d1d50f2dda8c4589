"""Driving a scenario: plan, loop, log, energies, summary, figure."""

from rtds_host.run.loop import Record, drive, drive_with
from rtds_host.run.path import Sample, SignalPath
from rtds_host.run.plan import COUPLINGS, Options, Plan, make_plan, other_controller
from rtds_host.run.session import LinkChoice, Outcome, check_writable, perform, write_outcome
from rtds_host.run.summary import Effects, Summary

__all__ = ["COUPLINGS", "Effects", "LinkChoice", "Options", "Outcome", "Plan", "Record", "Sample", "SignalPath",
           "Summary", "check_writable", "drive", "drive_with", "make_plan", "other_controller", "perform", "write_outcome"]
