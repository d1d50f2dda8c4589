"""Logs of real robots: ROS bags and csv files into cases, and runs into MCAP for the usual viewers."""

from rtds_host.importers.case import ImportedRun, import_case
from rtds_host.importers.mapping import builtin_mappings, load_mapping
from rtds_host.importers.mcap_out import write_mcap

__all__ = ["ImportedRun", "builtin_mappings", "import_case", "load_mapping", "write_mcap"]
