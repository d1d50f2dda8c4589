"""Where the processor time of a run goes: the motors, the host, each call of PyBullet.

    python -m rtds_host.bench.share [SCENARIO] [--link rtl|model]

Wall time depends on what else a computer does; processor time hardly does. The calls are timed inside the run, so the
timing's own share is in "the rest".
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

from rtds_host.bench.worker import processor_s
from rtds_host.errors import RtdsError
from rtds_host.link import Link, open_link
from rtds_host.robot import STEP_S
from rtds_host.run.loop import drive
from rtds_host.run.plan import make_plan

CALLS = (
    "stepSimulation",
    "setJointMotorControlArray",
    "getJointStates",
    "getBasePositionAndOrientation",
    "getBaseVelocity",
)


@dataclass(frozen=True)
class Share:
    """What one part of a run took.

    Attributes
    ----------
    what : the part. calls : how often it was called, 0 where that says nothing. cpu_s : processor time, s.
    """

    what: str
    calls: int
    cpu_s: float


class _Timed:
    """Functions of a module or object that count their calls and processor time, ns, until `restore`."""

    def __init__(self) -> None:
        self.calls: Counter[str] = Counter()
        self.ns: Counter[str] = Counter()
        self._kept: list[tuple[object, str, Callable]] = []

    def wrap(self, owner: object, name: str) -> None:
        """Time one function from here on."""
        function = getattr(owner, name)

        def timed(*arguments, **named):
            begin = time.process_time_ns()
            try:
                return function(*arguments, **named)
            finally:
                self.ns[name] += time.process_time_ns() - begin
                self.calls[name] += 1

        self._kept.append((owner, name, function))
        setattr(owner, name, timed)

    def restore(self) -> None:
        """Put all functions back."""
        for owner, name, function in reversed(self._kept):
            setattr(owner, name, function)


def _simulator_s(link: Link) -> float:
    """Processor time of the link's own process so far, s; 0 where it has none."""
    pid = getattr(link, "pid", None)
    return 0.0 if pid is None else processor_s(pid)


def measure(scenario: str, link_name: str, bullet: ModuleType) -> tuple[float, list[Share]]:
    """(simulated time, s; the parts, which add up to the whole run's processor time).

    Parameters
    ----------
    bullet : the module `pybullet`, whose functions are timed.

    Raises
    ------
    InputError : an unknown scenario or link. LinkError : the link does not answer.
    """
    plan = make_plan(scenario)
    timed = _Timed()
    with open_link(link_name) as link:
        try:
            for name in CALLS:
                timed.wrap(bullet, name)
            timed.wrap(link, "exchange")
            simulator, host = _simulator_s(link), time.process_time_ns()
            record = drive(plan, link)
            host_s = (time.process_time_ns() - host) * 1e-9
            simulator_s = _simulator_s(link) - simulator
        finally:
            timed.restore()
    parts = [Share("the motors' own process", 0, simulator_s)]
    parts += [Share(name, timed.calls[name], timed.ns[name] * 1e-9) for name in ("exchange", *CALLS)]
    parts.append(Share("the rest of the host", 0, host_s - sum(timed.ns.values()) * 1e-9))
    return (len(record.t_s) - 1) * STEP_S, parts


def table(simulated_s: float, parts: list[Share]) -> str:
    """The parts as a table, largest first."""
    whole = sum(part.cpu_s for part in parts)
    lines = [
        f"{simulated_s:g} s simulated in {whole:.2f} s of processor time, {simulated_s / whole:.1f} times real time",
        "",
        f"| {'part':<30} | {'calls':>7} | {'us a call':>9} | {'s':>6} | {'share':>6} |",
        f"|{'-' * 32}|{'-' * 8}:|{'-' * 10}:|{'-' * 7}:|{'-' * 7}:|",
    ]  # fmt: skip
    for part in sorted(parts, key=lambda part: -part.cpu_s):
        calls, each = (f"{part.calls}", f"{1e6 * part.cpu_s / part.calls:.1f}") if part.calls else ("", "")
        lines.append(f"| {part.what:<30} | {calls:>7} | {each:>9} | {part.cpu_s:>6.2f} | {part.cpu_s / whole:>6.1%} |")
    return "\n".join(lines)


def main() -> int:
    """Drive one scenario and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", nargs="?", default="linear")
    parser.add_argument("--link", default="rtl", choices=("rtl", "model"))
    options = parser.parse_args()
    try:
        from rtds_host.robot import pybullet_engine

        print(table(*measure(options.scenario, options.link, pybullet_engine.pybullet)))
    except (RtdsError, ImportError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
