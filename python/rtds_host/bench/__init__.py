"""Speed of the links: `python -m rtds_host.bench` measures and prints, `measure` gives the figures."""

from rtds_host.bench.measure import LatencyFigure, LoopFigure, measure_latency, measure_model, measure_rtl

__all__ = ["LatencyFigure", "LoopFigure", "measure_latency", "measure_model", "measure_rtl"]
