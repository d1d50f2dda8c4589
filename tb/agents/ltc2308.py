"""cocotb's side of the LTC2308 model (`ltc2308.v`, which checks the times): names, log of conversions, verdict."""

from __future__ import annotations

import dataclasses
import random

import cocotb
from cocotb.triggers import ReadOnly, Timer, ValueChange

CHECKS = (
    "CONVST_SHORT", "CONVST_LATE_LOW", "CYCLE_SHORT", "SCK_EARLY", "SCK_FAST", "SCK_HIGH_SHORT", "SCK_LOW_SHORT",
    "SDI_SETUP", "SDI_HOLD", "ACQUISITION", "SCK_TO_CONVST", "SCK_COUNT", "WORD_MODE", "PIN_UNKNOWN",
)  # fmt: skip
"""Names of the bits of `violations_o`, from bit 0."""


def violated(mask: int) -> set[str]:
    """The names of the checks whose bit is set in `mask`."""
    return {name for bit, name in enumerate(CHECKS) if mask >> bit & 1}


def pack(codes: list[int]) -> int:
    """Eight 12-bit codes, channel 0 first, as the model's input word."""
    return sum(code << 12 * channel for channel, code in enumerate(codes))


@dataclasses.dataclass(frozen=True)
class Conversion:
    """One conversion: the device's channel (None before the first word), the code sampled, the time in ps."""

    channel: int | None
    code: int
    time_ps: int


class Ltc2308:
    """Feeds the analogue side of the model and remembers what it converted.

    Each channel gets a new random code just after every conversion has begun, so a code tells which
    conversion it came from: a result that is one conversion late, or of another channel, does not match.

    Parameters
    ----------
    codes, conversions, channel, known, t_last : handles of the model's ports (see `ltc2308.v`).
    violations : handle of the mask of violations.
    """

    def __init__(self, codes, conversions, channel, known, t_last, violations, seed: int = 1):
        self._codes, self._conversions, self._channel = codes, conversions, channel
        self._known, self._t_last, self._violations = known, t_last, violations
        self._random = random.Random(seed)
        self.log: list[Conversion] = []
        self.fixed: list[int] | None = None
        self._now = self._draw()
        cocotb.start_soon(self._run())

    def _draw(self) -> list[int]:
        codes = self.fixed or [self._random.randrange(1, 4095) for _ in range(8)]
        self._codes.value = pack(codes)
        return codes

    async def _run(self) -> None:
        while True:
            await ValueChange(self._conversions)
            await ReadOnly()
            channel = int(self._channel.value) if int(self._known.value) else None
            code = 0xBAD if channel is None else self._now[channel]
            self.log.append(Conversion(channel, code, int(self._t_last.value)))
            await Timer(1, "ns")
            self._now = self._draw()

    @property
    def violations(self) -> set[str]:
        """Names of all the times that were violated so far."""
        return violated(int(self._violations.value))

    def check(self) -> None:
        """Fail the test if any time of the data sheet was violated."""
        assert not self.violations, f"LTC2308 data sheet violated: {sorted(self.violations)}"
