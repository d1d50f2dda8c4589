"""The answer for people: one self-contained page, a short summary on the terminal, the schema of the json."""

from rtds_host.diagnosis.report.details import Candidate, Details, Trace

__all__ = ["Candidate", "Details", "Trace"]
