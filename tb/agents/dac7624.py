"""cocotb's side of the DAC7624 model (`dac7624.v`, which checks the times): names of the checks, packing of codes."""

from __future__ import annotations

from collections.abc import Sequence

CHECKS = (
    "CS_SHORT", "DATA_MOVED", "ADDRESS_MOVED", "RW_MOVED", "LDAC_SHORT", "CS_TO_LDAC", "LDAC_TO_CS", "RESET_SHORT",
    "TORN", "PIN_UNKNOWN",
)  # fmt: skip
"""Names of the bits of `violations_o`, from bit 0."""


def violated(mask: int) -> set[str]:
    """The names of the checks whose bit is set in `mask`."""
    return {name for bit, name in enumerate(CHECKS) if mask >> bit & 1}


def pack(codes: Sequence[int]) -> int:
    """Four 12-bit codes, output A first, as one word."""
    return sum(code << 12 * output for output, code in enumerate(codes))


def unpack(word: int) -> tuple[int, ...]:
    """The four codes of a word, output A first."""
    return tuple(word >> 12 * output & 0xFFF for output in range(4))
