"""Positions of the plant's parameters in a model, and a replay's columns: both follow from `rtds_host.plant.schema`."""

from rtds_host.plant.schema import COMMON, COMMON_INDEX, OUTPUT_INDEX, OUTPUTS, SIDE, SIDE_INDEX

__all__ = ["COMMON", "COMMON_INDEX", "OUTPUTS", "OUTPUT_INDEX", "SIDE", "SIDE_INDEX"]
