"""`python -m rtds_host.bench`: prints the speed of the links next to what they aim at."""

from __future__ import annotations

import argparse
import os
import shutil
import sys

from rtds_host.bench import against, replays
from rtds_host.bench.measure import measure_latency, measure_model, measure_rtl
from rtds_host.errors import RtdsError
from rtds_host.link import open_link

# simulator, clocks a step, steps an exchange (Icarus: short ones), effects, every clock evaluated, aim as multiple of
# real time
LOOPS = (
    ("verilator", "min", 3200, False, False, 5.0),
    ("verilator", 500, 3200, False, True, None),
    ("verilator", 500, 3200, False, False, 2.0),
    ("verilator", "min", 800, True, False, None),
    ("verilator", 500, 800, True, True, None),
    ("verilator", 500, 800, True, False, None),
    ("icarus", "min", 100, False, False, None),
    ("icarus", 500, 10, False, False, None),
)
MODEL_AIM = 1000.0


def _against(value: float, aim: float | None) -> str:
    return "" if aim is None else f"{aim:>8g} {value / aim:>7.2f}"


def run(seconds: float) -> None:
    """Measure and print, line by line."""
    load = os.getloadavg()[0]
    print(f"{os.cpu_count()} processors, load {load:.1f} before the start; {seconds:g} s a line")
    print("simulated over wall time, and over processor time: what a core of one's own would give\n")
    print(f"{'loop':<68}{'clocks/s':>10}{'steps/s':>10}{'x wall':>9}{'x cpu':>9}{'aim':>9} {'wall/aim':>8}")
    for sim, step_clocks, exchange_steps, effects, every_clock, aim in LOOPS:
        if sim == "icarus" and shutil.which("iverilog") is None:
            print(f"{'RTL, icarus':<68}not installed: apt-get install iverilog")
            continue
        figure = measure_rtl(sim, step_clocks, exchange_steps, seconds, every_clock, effects)
        used = figure.clocks / figure.steps
        name = f"RTL, {sim}, {used:.1f} clocks a step{', effects' * effects}{', idle ones evaluated' * every_clock}"
        print(
            f"{name:<68}{figure.clocks_per_s:>10.3g}{figure.steps_per_s:>10.3g}{figure.times_real_time:>9.3g}"
            f"{figure.times_real_time_of_a_free_core:>9.3g} {_against(figure.times_real_time, aim)}",
            flush=True,
        )
    figure = measure_model(seconds)
    print(
        f"{'bit-exact model, both motors':<68}{'':>10}{figure.steps_per_s:>10.3g}{figure.times_real_time:>9.4g}"
        f"{figure.times_real_time_of_a_free_core:>9.4g} {_against(figure.times_real_time, MODEL_AIM)}"
    )
    print(f"\n{'exchange of one step':<34}{'median':>10}{'99 %':>10}")
    for name, open_it in (
        ("RTL, verilator, through the socket", lambda: open_link("rtl")),
        ("bit-exact model, in process", lambda: open_link("model")),
    ):
        latency = measure_latency(open_it)
        print(f"{name:<34}{latency.median_s * 1e6:>7.0f} µs{latency.slowest_of_hundred_s * 1e6:>7.0f} µs")


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="python -m rtds_host.bench", description=__doc__)
    parser.add_argument("--seconds", type=float, default=3.0, help="measuring time of each line")
    parser.add_argument(
        "--against", metavar="STATE", help="a commit or a source tree: its loops and the present ones in turn"
    )
    parser.add_argument(
        "--replays", metavar="STATE", help="the diagnosis' replays in place of the loops: whether they are the same"
    )
    parser.add_argument("--pairs", type=int, default=5, help="of measurements a line with --against or --replays")
    options = parser.parse_args()
    try:
        if options.replays:
            replays.run(options.replays, options.pairs)
        elif options.against:
            against.run(options.against, options.seconds, options.pairs)
        else:
            run(options.seconds)
    except RtdsError as error:
        print(f"bench: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("bench: interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
