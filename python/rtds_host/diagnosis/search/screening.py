"""By how much each effect is predicted to improve a fit, and what one screening keeps for the next."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rtds_host.diagnosis import ripple
from rtds_host.diagnosis.fit import Fit
from rtds_host.diagnosis.screen import Candidate, Screen, Signature, doubles, sensitivities_of
from rtds_host.diagnosis.search.store import Store

# Numerical: sides of an effect with this share of its best side's predicted gain are tried, too.
NEARLY = 0.8
# Numerical: effects of each screening whose signatures are taken again for the next.
RETAKEN = 8


@dataclass(frozen=True)
class Screening:
    """What a search screens fits by.

    quick : the first screening takes fewer signatures of slow effects; last : the last screening by no discrepancy,
    with its signatures; slow : signatures of slow effects, which are taken once; None where all are to be taken again.
    """

    quick: bool
    last: Screen | None = None
    slow: Mapping[Signature, np.ndarray] | None = None

    def again(self) -> Screening:
        """The same, but the next screening takes all signatures again."""
        return replace(self, slow=None)

    def screens(self, store: Store, fit: Fit) -> list[Screen]:
        """Predicted gains next to a fit, by the discrepancy it leaves and by none, with the last screening's
        signatures.

        The first is insensitive to what is slow, since that may be the discrepancy; the second to what is small.
        """
        signatures, white = self.last.sensitivities if self.last else {}, store.problem.white()
        return [Screen(store.problem, fit, signatures, *by) for by in ((fit.noise, None), (white, self.last))]

    def renewed(self, store: Store, fit: Fit) -> tuple[list[Screen], Screening]:
        """The same with signatures that are taken next to the fit, and what the next screening begins with.

        Slow effects, and those with small predicted gains, keep the signatures of the last screening: a gain depends on
        the residuals much more than on the robot that the effect is added to.
        """
        problem = store.problem
        periodic = [effect.id for effect in store.effects.values() if effect.periodic]
        extra = further_starts(store, fit)
        before: Sequence[Screen | None] = (None, self.last)
        known: dict[Signature, np.ndarray] = {}
        if self.slow is not None and self.last is not None:
            before = screens = self.screens(store, fit)
            ranks = [list(dict.fromkeys(c.cause[0] for c in screen.candidates())) for screen in screens]
            retaken = {effect for effects in ranks for effect in effects[:RETAKEN]} | set(periodic)
            known = {s: m for s, m in self.last.sensitivities.items() if s.effect not in retaken} | dict(self.slow)
        signatures = sensitivities_of(store.fitter, fit, extra, store.wanted, known, self.quick and not fit.hypothesis)
        slow = self.slow
        if slow is None:
            slow = {s: m for s, m in signatures.items() if store.effects[s.effect].nonlinear}
        noises = fit.noise, problem.white()
        screens = [Screen(problem, fit, signatures, *by) for by in zip(noises, before, strict=True)]
        return screens, replace(self, last=screens[1], slow=slow)


def further_starts(store: Store, fit: Fit) -> dict[tuple[str, str], list[dict]]:
    """Parameter sets to take signatures at beyond each effect's own, by (effect, side): of periodic effects, from what
    a fit leaves, and of those that a servo's loop bends.
    """
    sought = [e for e in sorted(store.wanted) if store.effects[e].periodic]
    found = ripple.starts(store.problem, store.problem.replay(fit.model(store.problem)), sought) if sought else {}
    if store.problem.robot.driver.mode == "speed":
        bent = [store.effects[e] for e in sorted(store.wanted) if store.effects[e].starts_in_loop]
        found |= {
            (effect.id, side): [dict(one) for one in effect.starts_in_loop]
            for effect in bent
            for side in ("left", "right")
        }
    return found


def ranked(store: Store, screens: Iterable[Screen], count: int) -> list[Candidate]:
    """The first `count` effects of each screening by predicted gain: the best side, and another with nearly as much.

    All modes of an effect are among them: what one promises as it stands says little of where a fit takes it.
    """
    picked: dict[tuple[tuple[str, str], tuple[bool, ...]], Candidate] = {}
    for screen in screens:
        sides: dict[str, dict[tuple[str, str], float]] = {}
        modes: dict[tuple[str, str], list[Candidate]] = {}
        for c in screen.candidates():
            modes.setdefault(c.cause, []).append(c)
            if c.gain > 0.0 and not doubles(store.problem, c.cause, screen.taken):
                sides.setdefault(c.cause[0], {}).setdefault(c.cause, c.gain)
        for mine in list(sides.values())[:count]:
            best = max(mine.values())
            for cause, gain in list(mine.items())[:2]:
                for c in modes[cause] if gain >= NEARLY * best else ():
                    picked.setdefault((cause, c.mode), c)
    return list(picked.values())
