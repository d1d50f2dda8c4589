"""A script of timed faults: the file, read with every check."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from rtds_host.contract.inputs import read_toml
from rtds_host.errors import InputError, did_you_mean, shown
from rtds_host.link.scaling import FULL_SCALE

SCHEMA = "rtds-faults/1"
SIDES = ("left", "right")
# Converters at the motor units' inputs, in the order of the chip's ADC; the current sensors, one a side.
INPUT_CHANNELS = ("v_left", "v_right", "t_left", "t_right")
SENSOR_CHANNELS = ("i_left", "i_right")
# What an open contact leaks by default: 12 V drive 12 µA, a ten-thousandth of the motor's no-load current.
OPEN_OHM = 1e6
MOST_FAULTS = 1000
# Keys of each kind beyond kind, from_s and to_s, with those that it cannot do without.
KINDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "phase_open": (("side", "resistance_ohm"), ("side",)),
    "encoder_stuck": (("side",), ("side",)),
    "supply_dip": (("volts", "measured"), ("volts",)),
    "adc_stuck": (("channel", "code"), ("channel",)),
}


@dataclass(frozen=True)
class Fault:
    """One fault. It acts from `from_s` on and no longer at `to_s`, s (infinite: to the end of the run).

    Attributes
    ----------
    kind : of `KINDS`. side : "left" or "right" (phase_open, encoder_stuck).
    resistance_ohm : phase_open, of the armature circuit, ohm.
    volts : supply_dip, voltage of the bus, V. measured : whether the log's `v_bus` shows it.
    channel : adc_stuck, of `INPUT_CHANNELS` or `SENSOR_CHANNELS`. code : 0 to 4095; None: the one that is there first.
    """

    kind: str
    from_s: float
    to_s: float = math.inf
    side: str = ""
    resistance_ohm: float = OPEN_OHM
    volts: float = 0.0
    measured: bool = True
    channel: str = ""
    code: int | None = None

    @property
    def target(self) -> tuple[str, str]:
        """What it acts on: two faults of one target cannot act at the same time."""
        return self.kind, self.side or self.channel

    def __str__(self) -> str:
        what = {
            "phase_open": f"motor phase open, {self.side} ({self.resistance_ohm:g} ohm)",
            "encoder_stuck": f"encoder stuck, {self.side}",
            "supply_dip": f"supply at {self.volts:g} V" + ("" if self.measured else ", not measured"),
            "adc_stuck": f"ADC {self.channel} stuck" + ("" if self.code is None else f" at code {self.code}"),
        }[self.kind]
        until = "to the end" if math.isinf(self.to_s) else f"to {self.to_s:.9g} s"
        return f"{what}, from {self.from_s:.9g} s {until}"


def read_faults(path: Path) -> tuple[Fault, ...]:
    """The faults of a script (docs/faults.md has its format), in the order of time.

    Raises
    ------
    InputError : it cannot be read, or a fault cannot be meant; names the file, the fault and the key.
    """
    table = read_toml(path)
    if table.get("schema") != SCHEMA:
        raise InputError(f"{path}: schema: is {shown(table.get('schema'))}, {SCHEMA!r} is needed")
    for key in table:
        if key not in ("schema", "fault"):
            known = ("schema", "fault")
            raise InputError(f"{path}: {key}: unknown (known: {', '.join(known)}){did_you_mean(key, known)}")
    entries = table.get("fault", [])
    if not isinstance(entries, list) or not entries or not all(isinstance(one, dict) for one in entries):
        raise InputError(f"{path}: fault: at least one table [[fault]] is needed")
    if len(entries) > MOST_FAULTS:
        raise InputError(f"{path}: fault: {len(entries)} of them, at most {MOST_FAULTS} are possible")
    faults = [_fault(f"{path}: fault {k}", entry) for k, entry in enumerate(entries, 1)]
    last: dict[tuple[str, str], Fault] = {}
    for fault in sorted(faults, key=lambda one: one.from_s):
        before = last.get(fault.target)
        if before is not None and before.to_s > fault.from_s:
            raise InputError(f"{path}: {fault}: begins while another of its kind acts there ({before})")
        last[fault.target] = fault
    return tuple(sorted(faults, key=lambda one: (one.from_s, one.kind, one.side, one.channel)))


def _fault(place: str, entry: dict) -> Fault:
    kind = entry.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        hint = did_you_mean(kind, KINDS) if isinstance(kind, str) else ""
        raise InputError(f"{place}: kind: is {shown(kind)} (known: {', '.join(KINDS)}){hint}")
    more, needed = KINDS[kind]
    known = ("kind", "from_s", "to_s", *more)
    for key in entry:
        if key not in known:
            raise InputError(f"{place}: {key}: {kind} has none (known: {', '.join(known)}){did_you_mean(key, known)}")
    for key in ("from_s", *needed):
        if key not in entry:
            raise InputError(f"{place}: {key}: is missing, {kind} needs it")
    from_s = _number(place, entry, "from_s", 0.0)
    to_s = _number(place, entry, "to_s", 0.0, math.inf)
    if to_s <= from_s:
        raise InputError(f"{place}: to_s: is {to_s:g} s, it must be after from_s, {from_s:g} s")
    code = entry.get("code")
    if code is not None and (not isinstance(code, int) or isinstance(code, bool) or not 0 <= code <= FULL_SCALE):
        raise InputError(f"{place}: code: is {shown(code)}, a whole number from 0 to {FULL_SCALE} is needed")
    measured = entry.get("measured", True)
    if not isinstance(measured, bool):
        raise InputError(f"{place}: measured: is {shown(measured)}, true or false is needed")
    return Fault(
        kind=kind,
        from_s=from_s,
        to_s=to_s,
        side=_choice(place, entry, "side", SIDES),
        resistance_ohm=_number(place, entry, "resistance_ohm", 1e-3, OPEN_OHM, most=1e9),
        volts=_number(place, entry, "volts", 0.0, 0.0),
        measured=measured,
        channel=_choice(place, entry, "channel", (*INPUT_CHANNELS, *SENSOR_CHANNELS)),
        code=code,
    )


def _number(place: str, entry: dict, key: str, least: float, default: float = 0.0, most: float = math.inf) -> float:
    value = entry.get(key, default)
    if key not in entry:
        return default
    # A whole number beyond binary64 cannot become a float.
    if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > 1e300 or math.isnan(value):
        raise InputError(f"{place}: {key}: is {shown(value)}, a finite number is needed")
    if not least <= value <= most:
        within = f"at least {least:g}" if math.isinf(most) else f"{least:g} to {most:g}"
        raise InputError(f"{place}: {key}: is {value:g}, it must be {within}")
    return float(value)


def _choice(place: str, entry: dict, key: str, known: tuple[str, ...]) -> str:
    value = entry.get(key, "")
    if key in entry and value not in known:
        hint = did_you_mean(value, known) if isinstance(value, str) else ""
        raise InputError(f"{place}: {key}: is {shown(value)} (known: {', '.join(known)}){hint}")
    return value
