"""The records at the ports of rtds_core, as integers; where a field is, is read from the Verilog header that says
so.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from rtds_host.link.tops import ROOT

HEADER = "rtl/core/rtds_core_records.vh"
PLACES = {
    name: int(place)
    for name, place in re.findall(r"^localparam integer (\w+) = (\d+);", (ROOT / HEADER).read_text(), re.MULTILINE)
}


def _places(record: str, fields: str) -> tuple[int, ...]:
    return tuple(PLACES[f"{record}_{field}"] for field in fields.split())


INPUTS = _places("INPUTS", "V_L V_R T_L T_R")
MOTOR = _places("MOTOR", "R L KM KB J B")
SETTINGS = _places("SETTINGS", "H METHOD FX_ON FX_OWN DELAY STRIDE")
WORD = _places("WORD", "ADDRESS DATA")
STATE = _places("STATE", "I_L W_L I_R W_R")


def _record(places: Sequence[int], values: Sequence[int]) -> int:
    return sum(int(value) << place for place, value in zip(places, values, strict=True))


def inputs(words: Sequence[int]) -> int:
    """Voltages and torques: v_l, v_r, t_l, t_r."""
    return _record(INPUTS, words)


def motor(words: Sequence[int]) -> int:
    """One motor's parameters: R, L, Km, Kb, J, B."""
    return _record(MOTOR, words)


def settings(h: int, method: int = 0, on: int = 0, own: int = 0, delay: int = 0, stride: int = 0) -> int:
    """A step's settings; h is a word."""
    return _record(SETTINGS, (h, method, on, own, delay, stride))


def effect_word(address: int, data: int) -> int:
    """A word for the effect unit."""
    return _record(WORD, (address, data))


def state(record: int) -> list[int]:
    """Words i_l, w_l, i_r, w_r of a state, or of its low words."""
    return [record >> place & 0xFFFF_FFFF for place in STATE]
