"""How far a diagnosis is, counted in the work of its search and not in the stages that it has passed.

A search ends by itself or after so much work (`Limits`), so that the share of what it may do is known at every moment:
an upper bound of what is left. `Problem` tells each piece of work to whoever watches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Say = Callable[[str, float], None]

# Layout: shares of the whole at which stages that are counted in work begin and end.
COUNTED = {"candidates": (0.1, 0.7), "attribution": (0.7, 0.85)}

_watching: ContextVar[Callable[[float], None] | None] = ContextVar("watching", default=None)


def spend(work: float) -> None:
    """Tell whoever watches that so much work is done (`Problem.work`)."""
    watch = _watching.get()
    if watch is not None:
        watch(work)


class Effort:
    """Turns stages and work into a share of the whole that grows and never falls.

    Parameters
    ----------
    say : takes (stage, share). most : work that each counted stage may do; one that does more stays at its end.
    """

    def __init__(self, say: Say, most: dict[str, float]):
        self._say, self._most = say, most
        self.work = self._begun = 0.0
        self._stage, self._share = "", 0.0

    def say(self, stage: str, share: float) -> None:
        """A stage begins, at a share of the whole."""
        self._stage, self._begun = stage, self.work
        self._tell(share)

    def spend(self, work: float) -> None:
        """So much more work is done."""
        self.work += work
        if self._stage in self._most:
            low, high = COUNTED[self._stage]
            self._tell(low + (high - low) * min((self.work - self._begun) / self._most[self._stage], 1.0))

    def _tell(self, share: float) -> None:
        self._share = max(self._share, share)
        self._say(self._stage, self._share)

    @contextmanager
    def watched(self) -> Iterator[None]:
        """While it lasts, the work of this thread's problems is counted here."""
        token = _watching.set(self.spend)
        try:
            yield
        finally:
            _watching.reset(token)
