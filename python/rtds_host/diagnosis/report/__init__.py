"""The answer for people: one self-contained page, a short summary on the terminal, the schema of the json."""

from rtds_host.diagnosis.report.details import Candidate, Details, Trace
from rtds_host.diagnosis.report.page import report_page
from rtds_host.diagnosis.report.schema import schema, validate
from rtds_host.diagnosis.report.summary import print_summary

__all__ = ["Candidate", "Details", "Trace", "print_summary", "report_page", "schema", "validate"]
