"""What control holds in each clock of a step, found by watching a simulator, for the C++ main's evaluation a phase.

A compiled simulation evaluates all logic in every clock, although a step's clocks differ: in one a product is taken,
in the next nothing. The main therefore has a copy of the evaluation for each phase of a step, compiled for the values
that control has in it, a few successive phases in one function (``sim/verilator_main.cpp``, "One evaluation a
phase"). Which values these are is found here: the members are read from the header that Verilator wrote, a simulator
with a profile of its own is run, and what it says becomes ``rtds_phases.h``. A pin that is wrong costs time only,
since the main looks at all of them first.
"""

from __future__ import annotations

import itertools
import os
import re
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rtds_host.errors import LinkError
from rtds_host.link.base import Link
from rtds_host.link.tops import Top
from rtds_host.motor.effects import Curve, MotorParameters, SupplyEffects, UnitEffects
from rtds_host.motor.parameters import METHODS

# Opens a simulator of a top for whoever watches it, given clocks a step and more variables for its process.
Opener = Callable[[Top, "int | str", Mapping[str, str]], Link]

HEADER = "rtds_phases.h"
PROFILE_VARIABLE = "RTDS_PROFILE"
# A value that a member has in this share of a phase's clocks is a pin. The others are clocks of a sample, of a
# request's last step or of new parameters, a few in a hundred each; what depends on data varies far more in these runs.
PIN_SHARE = 0.96
# Phases in one function. The first two of a step are by themselves: what a strobe begins depends on data, and what
# follows would be compiled for each case. Longer chains are hardly faster, take longer to compile, and leave more
# clocks to the general evaluation where one ends early.
FIRST_CHAIN = 2
CHAIN = 12
MEMBER = re.compile(r"^\s*(?:CData|SData)/\*\d+:\d+\*/ (\w+);", re.MULTILINE)
# Members that hold no state from one evaluation to the next.
PASSING = re.compile(r"__V(?:stl|ico|act|nba|trig|dly)|__VlemCall")
_STEP_S = 1e-5
_EXCHANGES = 24

MOTOR = (8.6, 1e-3, 6.538e-3, 6.538e-3, 1e-7, 4.372e-7)


def members(header: str) -> list[str]:
    """Names of the design's small members in the class that Verilator wrote, given the text of its header."""
    return [name for name in MEMBER.findall(header) if not PASSING.search(name)]


def widths(header: str) -> dict[str, int]:
    """Bits of each small member."""
    return {
        name: int(high) + 1
        for high, name in re.findall(r"^\s*(?:CData|SData)/\*(\d+):0\*/ (\w+);", header, re.MULTILINE)
    }


def member_name(top: Top, name: str) -> str:
    """The generated member of a net or register below the top."""
    return f"{top.module}.{name}".replace(".", "__DOT__")


def phase_macros(top: Top, header: str) -> str:
    """C macros that give the phase's number; "" where the generated code does not keep what they need."""
    bits, terms, at = widths(header), [], 0
    for name in (member_name(top, name) for name in top.phases):
        if name not in bits:
            return ""
        terms.append(f"static_cast<unsigned>((root).{name}) << {at}")
        at += bits[name]
    if not terms:
        return ""
    return f"#define RTDS_PHASE(root) ({' | '.join(terms)})\n#define RTDS_PHASE_COUNT {1 << at}\n"


def profile_header(top: Top, header: str) -> str:
    """``rtds_phases.h`` of the simulator that watches itself; "" as `phase_macros`."""
    macros = phase_macros(top, header)
    counted = {member_name(top, name) for name in top.idle[1:2]}  # the main sets it on between two clocks
    names = " ".join(f"W({name})" for name in members(header) if name not in counted)
    return macros and f"{macros}#define RTDS_MEMBERS(W) {names}\n"


def still_pairs(top: Top, header: str) -> list[tuple[str, str]]:
    """The generated members (copy, register) of `Top.still`, those that there are.

    A port of the top is a member by its own name, and where the bridge sees it a second one below the top.
    """
    bits = widths(header)
    return [
        (copy, member_name(top, register))
        for port, register in top.still
        for copy in (port, member_name(top, port))
        if copy in bits and member_name(top, register) in bits
    ]


def chains(follows: Mapping[int, int]) -> list[list[int]]:
    """The phases of each chain, given which phase usually follows which.

    The step begins with the phase of the highest number (`Top.phases`). A phase outside of it is a chain of its own.
    """
    step: list[int] = []
    phase = max(follows, default=-1)
    while phase in follows and phase not in step:
        step.append(phase)
        phase = follows[phase]
    ends = [0, *range(FIRST_CHAIN, len(step), CHAIN), len(step)]
    parts = [step[first:end] for first, end in itertools.pairwise(ends) if first < end]
    return parts + [[other] for other in follows if other not in step]


def pinned_header(top: Top, header: str, profile: str) -> str:
    """``rtds_phases.h`` of the simulator that has an evaluation a phase; "" as `phase_macros`.

    Parameters
    ----------
    header : text of the class that Verilator wrote.
    profile : what the watching simulator wrote: "phase N next M", then "member value times all" a line.

    Raises
    ------
    LinkError : the profile is not of these lines.
    """
    macros = phase_macros(top, header)
    if not macros:
        return ""
    still = still_pairs(top, header)
    kept = set(members(header)) - {name for pair in still for name in pair}
    pins: dict[int, list[str]] = {}
    follows: dict[int, int] = {}
    phase = -1
    try:
        for line in profile.splitlines():
            fields = line.split()
            if fields[0] == "phase":
                phase = int(fields[1])
                pins[phase], follows[phase] = [], int(fields[3])
                continue
            name, (value, times, clocks) = fields[0], map(int, fields[1:])
            if name in kept and times >= PIN_SHARE * clocks:
                pins[phase].append(f"IS({name}, {value})")
    except (ValueError, IndexError, KeyError) as error:
        raise LinkError(f"the simulator's profile is not usable ({error})") from error
    follows = {number: after for number, after in sorted(follows.items()) if after in pins}
    lines = [macros]
    lines.append("#define RTDS_STILL(S) " + " ".join(f"S({copy}, {register})" for copy, register in still) + "\n")
    lines += [f"#define RTDS_PINS_{number}(IS) {' '.join(pins[number])}\n" for number in sorted(pins)]
    entries = []
    for first, *others in chains(follows):
        lines.append(f"#define RTDS_CHAIN_{first}(P) {' '.join(f'P({phase})' for phase in others)}\n")
        entries.append(f"C({first}, {1 + len(others)}, {follows[[first, *others][-1]]})")
    lines.append(f"#define RTDS_CHAINS(C) {' '.join(entries)}\n")
    return "".join(lines) if entries else ""


def _drive(link: Link, exchanges: int) -> None:
    """Exchanges of a run's kind: wheels driven and held, at rest and reversing."""
    rng = np.random.default_rng(1)
    for number in range(exchanges):
        scale = 0.0 if number % 4 == 3 else 1.0
        link.exchange(
            scale * rng.uniform(-12.0, 12.0, 2), scale * rng.uniform(-1e-3, 1e-3, 2), 400 * _STEP_S, 100 * _STEP_S
        )


def _sets_of_effects() -> list[tuple[UnitEffects, UnitEffects, SupplyEffects | None]]:
    """Few effects and nearly all of them, so that what differs between two settings becomes no pin."""
    level, bent = Curve((0.0, 0.0), (1e-4, 1e-4)), Curve((0.0, 50.0), (2e-4, 1e-4))
    dry = UnitEffects(friction_forward=level, friction_backward=level)
    own = MotorParameters(9.0, 1.1e-3, 6.6e-3, 6.5e-3, 1.1e-7, 4.4e-7)
    full = UnitEffects(
        motor=own,
        command=Curve((-12.0, 12.0), (-11.0, 11.5)),
        limit_v=10.0,
        drop=Curve((-1.0, 1.0), (-0.2, 0.3)),
        friction_forward=bent,
        friction_backward=level,
        torque=Curve((-500.0, 500.0), (-1e-5, 2e-5)),
        load_share=0.2,
        ripple=Curve((0.0, 3.0, 6.0), (1e-5, -1e-5, 1e-5)),
        ripple_periods_per_rad=2.0,
        heat_rise_per_w=0.01,
        heat_tau_s=10.0,
    )
    supply = SupplyEffects(voltage_v=12.0, source_resistance_ohm=0.1, decline_v_per_s=0.01, command_delay_s=3e-4)
    return [(dry, dry, None), (replace(full, motor=None), full, supply)]


def _watched(watching: Top, opener: Opener, step_clocks: int | str, number: int) -> str:
    """The profile of one run, of the first or second set of settings."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "profile"
        environment = {PROFILE_VARIABLE: os.fspath(place)}
        with opener(watching, step_clocks, environment) as link:
            if ("EFFECTS", 0) not in watching.parameters:
                link.set_effects(*_sets_of_effects()[number])
            link.set_parameters(*MOTOR, step_s=_STEP_S, method=METHODS[number])
            _drive(link, _EXCHANGES)
        try:
            return place.read_text()
        except OSError as error:
            raise LinkError(f"the simulator that was to be watched left no profile ({error.strerror})") from error


def watch(top: Top, opener: Opener) -> str:
    """The profile of a top: `opener` builds it with the means to watch itself, and it is run.

    Raises
    ------
    LinkError : it cannot be built or run, or left no profile.
    """
    watching = replace(top, bridge="bridge_core", profile=True)
    return joined([_watched(watching, opener, clocks, number) for clocks, number in (("min", 0), (500, 1), ("min", 1))])


def joined(profiles: Sequence[str]) -> str:
    """One profile of several of the same model: a member counts as often as it had one and the same value.

    Where two differ in the most frequent value of a member, neither is kept.
    """
    counts: dict[tuple[int, str], tuple[int, int, int]] = {}
    follows: dict[int, int] = {}
    for profile in profiles:
        phase = -1
        for line in profile.splitlines():
            fields = line.split()
            if fields[0] == "phase":
                phase = int(fields[1])
                follows.setdefault(phase, int(fields[3]))
                continue
            value, times, clocks = map(int, fields[1:])
            before = counts.get((phase, fields[0]))
            if before is None:
                counts[phase, fields[0]] = value, times, clocks
            elif before[0] == value:
                counts[phase, fields[0]] = value, before[1] + times, before[2] + clocks
            else:
                counts[phase, fields[0]] = value, 0, before[2] + clocks
    lines = []
    for phase in sorted(follows):
        lines.append(f"phase {phase} next {follows[phase]}")
        lines += [f"{name} {v} {times} {n}" for (at, name), (v, times, n) in counts.items() if at == phase]
    return "\n".join(lines) + "\n"
