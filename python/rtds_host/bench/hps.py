"""What an exchange over the board's bridge costs: accesses and clocks of the bus, and the host's own processor time.

    python -m rtds_host.bench.hps [--seconds S]

The accesses and clocks are those of the simulated bus, where each access waits for the one before. They are the same at
every run. The host's code is timed over a file in place of the memory device, so a register costs it a word of memory.
Real time that is left on a board is calculated from both; nothing here was measured on a board.
"""

from __future__ import annotations

import argparse
import statistics
import struct
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rtds_host.bench.measure import STEP_S, set_burger
from rtds_host.cleanup import temporary_folder
from rtds_host.errors import RtdsError
from rtds_host.link.hps import (
    CLOCK_HZ,
    IDENTITY,
    READ,
    SIZE,
    VERSION,
    WRITE,
    HpsLink,
    MemoryBus,
    SimulatedBus,
    addresses,
)

STEPS = 100  # of an exchange: 1 ms
SAMPLES = (1, 10)  # of an exchange; a run has ten
_BATCH = 200  # exchanges between two looks at the clock
_REPEATS = 5


@dataclass(frozen=True)
class Accesses:
    """Accesses of one exchange of 1 ms, without those that wait for the motors, and the clocks of the bus they took.

    Attributes
    ----------
    writes, reads : their number.
    clocks : of 20 ns; 0 on a bus without a clock.
    """

    writes: int
    reads: int
    clocks: int

    @property
    def share(self) -> float:
        """Of the exchange's real time."""
        return self.clocks / CLOCK_HZ / (STEPS * STEP_S)


class CountingBus(SimulatedBus):
    """A simulated bus that carries out one order a time and notes what each took, in `taken`: (operation, clocks)."""

    def __init__(self) -> None:
        super().__init__()
        self.taken: list[tuple[int, int]] = []

    def run(self, orders: Sequence[tuple[int, int, int]]) -> list[int]:
        """See `Bus.run`."""
        found = []
        for order in orders:
            before = self.clocks
            found += super().run([order])
            self.taken.append((order[0], self.clocks - before))
        return found


class FileBus(MemoryBus):
    """The board's bus over a file of registers that hold what a board would answer.

    Attributes
    ----------
    steps : added to STEP_COUNT by each call of `run`.
    taken : operations carried out since it was emptied; None: they are not noted.
    """

    def __init__(self, path: Path, samples: int) -> None:
        at = addresses()
        words = {"IDENTITY": IDENTITY, "VERSION": VERSION, "COUNT": samples}
        content = bytearray(SIZE)
        for name, word in words.items():
            struct.pack_into("<I", content, at[name], word)
        path.write_bytes(content)
        super().__init__(str(path), base=0)
        self.steps = 0
        self.taken: list[int] | None = None
        self._count = at["STEP_COUNT"] >> 2

    def run(self, orders: Sequence[tuple[int, int, int]]) -> list[int]:
        """See `Bus.run`."""
        self._words[self._count] += self.steps
        if self.taken is not None:
            self.taken += [order[0] for order in orders]
        return super().run(orders)


def _exchange(link: HpsLink, samples: int) -> None:
    link.exchange((6.0, 5.0), (0.0, 1e-5), STEPS * STEP_S, STEPS // samples * STEP_S)


def on_the_bus(samples: int) -> Accesses:
    """Accesses and clocks of an exchange of 1 ms with so many samples, on the RTL behind the simulated bus."""
    bus = CountingBus()
    with HpsLink(bus, step_clocks="min") as link:
        set_burger(link)
        bus.taken.clear()
        _exchange(link, samples)
        kinds = [kind for kind, _ in bus.taken]
        return Accesses(
            kinds.count(WRITE),
            kinds.count(READ),
            sum(clocks for kind, clocks in bus.taken if kind in (READ, WRITE)),
        )


def of_the_host(samples: int, seconds: float) -> tuple[Accesses, float]:
    """The accesses that the host's code makes for the same exchange, and its exchanges a second of processor time.

    The second figure is the median of several measurements that take about so many seconds together.
    """
    with temporary_folder() as folder:
        bus = FileBus(Path(folder) / "registers", samples)
        with HpsLink(bus) as link:
            set_burger(link)
            bus.steps = STEPS
            bus.taken = []
            _exchange(link, samples)
            counted = Accesses(bus.taken.count(WRITE), bus.taken.count(READ), 0)
            bus.taken = None
            rates = []
            for _ in range(_REPEATS):
                made, start, used = 0, time.perf_counter(), time.process_time()
                while made == 0 or time.perf_counter() - start < seconds / _REPEATS:
                    for _ in range(_BATCH):
                        _exchange(link, samples)
                    made += _BATCH
                rates.append(made / max(time.process_time() - used, 1e-9))
            return counted, statistics.median(rates)


def run(seconds: float) -> None:
    """Measure and print, a line a number of samples."""
    print(
        "an exchange of 1 ms over the bridge; clocks of the simulated bus, the host's code over a file of registers\n"
    )
    print(
        f"{'samples':>7}{'writes':>8}{'reads':>7}{'clocks':>8}{'of 1 ms':>9}{'exchanges/s':>13}{'us each':>9}"
        f"{'margin':>8}"
    )
    for samples in SAMPLES:
        bus = on_the_bus(samples)
        _, rate = of_the_host(samples, seconds)
        left_s = STEPS * STEP_S * (1.0 - bus.share)
        print(
            f"{samples:>7}{bus.writes:>8}{bus.reads:>7}{bus.clocks:>8}{100 * bus.share:>8.2f}%{rate:>13.0f}"
            f"{1e6 / rate:>9.1f}{left_s * rate:>8.0f}",
            flush=True,
        )
    print("\nmargin: how many times as slow a processor may be on which the link alone still keeps real time")


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="python -m rtds_host.bench.hps", description=__doc__)
    parser.add_argument("--seconds", type=float, default=3.0, help="measuring time of each line")
    options = parser.parse_args()
    try:
        run(options.seconds)
    except RtdsError as error:
        print(f"bench: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
