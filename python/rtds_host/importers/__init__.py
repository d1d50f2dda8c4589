"""Logs of real robots: ROS bags and csv files into cases."""

from rtds_host.importers.case import ImportedRun, import_case
from rtds_host.importers.mapping import builtin_mappings, load_mapping

__all__ = ["ImportedRun", "builtin_mappings", "import_case", "load_mapping"]
