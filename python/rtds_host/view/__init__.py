"""Runs to look at: a page on this machine with the way over the floor and the paper's six panels, also while a run
goes on."""

from rtds_host.view.lines import Lines, lines_of_run
from rtds_host.view.live import Feed, LivePath
from rtds_host.view.server import Viewer

__all__ = ["Feed", "Lines", "LivePath", "Viewer", "lines_of_run"]
