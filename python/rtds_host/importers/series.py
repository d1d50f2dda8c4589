"""Raw samples of one channel, as a recording holds them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

NS = 1_000_000_000


@dataclass(frozen=True)
class Series:
    """Samples of one quantity: `t_ns` (n,) int64 not decreasing, `values` (n,) or (n, 2) for a pair; no NaN."""

    t_ns: np.ndarray
    values: np.ndarray
    origin: str

    def __len__(self) -> int:
        return len(self.t_ns)

    def keep(self, mask: np.ndarray) -> Series:
        """The samples where `mask` (n,) is true."""
        return replace(self, t_ns=self.t_ns[mask], values=self.values[mask])

    def earlier(self, samples: int, seconds: float) -> Series:
        """The same values at the time they were read: that many samples, and then seconds, before their stamp.

        Where messages were lost in between, the stamp of the sample before is no help, and the usual interval is
        taken. The first `samples` values are dropped: the time before the recording is unknown.
        """
        t_ns = self.t_ns
        if samples and len(t_ns) > samples:
            usual = int(np.median(np.diff(t_ns))) * samples
            before = t_ns[:-samples]
            now = t_ns[samples:]
            t_ns = np.where(now - before < usual * (1.0 + 0.5 / samples), before, now - usual)
        elif samples:
            t_ns = t_ns[:0]
        t_ns = np.maximum.accumulate(t_ns) if len(t_ns) else t_ns
        return replace(self, t_ns=t_ns - round(seconds * NS), values=self.values[len(self) - len(t_ns) :])

    def last_of_equal_times(self) -> Series:
        """One sample a time: of several with the same time the last."""
        if len(self) < 2:
            return self
        return self.keep(np.append(np.diff(self.t_ns) > 0, True))
