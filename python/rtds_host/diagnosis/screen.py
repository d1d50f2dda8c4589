"""Screening: which effects could explain what is left, by their signatures projected off what is in already.

A signature is the change of all residuals when an effect of typical size enters the replay, a finite change and not
a derivative, since gaps, friction and delays have no useful derivative at zero. Signatures are whitened as the
residuals are (`likelihood`), so that a candidate's predicted gain is one of likelihood.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rtds_host.diagnosis.conditions import angles_known
from rtds_host.diagnosis.effects import Effect
from rtds_host.diagnosis.fit import Fit, Fitter, Hypothesis, apply, prior_weight, scaled
from rtds_host.diagnosis.likelihood import Likelihood
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.structurally_indistinguishable import scale_all, structurally_indistinguishable

# Numerical: how far from the size it was taken at a signature is believed, in that size.
REACH = 6.0


@dataclass(frozen=True)
class Signature:
    """One direction of one effect: the change of the residuals when it enters with `values`."""

    effect: str
    side: str
    values: tuple[tuple[str, float], ...]


@dataclass
class Candidate:
    """A candidate effect: its predicted gain, in -2 log likelihood, and scaled parameters to start a fit from; mode :
    which switches of the effect are on.

    One side of an effect that is included on both means another size on that side.
    """

    cause: tuple[str, str]
    gain: float
    start: np.ndarray
    mode: tuple[bool, ...] = ()


def start_values(effect: Effect, coarse: bool = False) -> list[dict[str, float]]:
    """Parameter sets to take signatures at; `coarse`: of an effect whose replays are slow, one of three."""
    if effect.separate:
        null = {p.name: p.null for p in effect.parameters}
        return [{**null, p.name: p.starts[0]} for p in effect.parameters]
    if effect.periodic:
        return []  # its period must be looked up in a spectrum, see `ripple`
    names = [p.name for p in effect.parameters]
    starts = [p.starts for p in effect.parameters]
    if coarse and effect.nonlinear:
        starts = [starts[0][1::3] or starts[0], *(s[:1] for s in starts[1:])]
    return [dict(zip(names, combination)) for combination in itertools.product(*starts)]


def available(problem: Problem) -> list[Effect]:
    """Effects that exist on this machine and that its runs could show."""
    robot = problem.robot
    there = {c for log in problem.case.runs for c in log.columns if log.has(c)}
    return [
        effect
        for effect in problem.effects.values()
        if (robot.axis is None or effect.axis)
        and (robot.driver.mode != "torque" or effect.without_winding)
        and (not effect.seen_by or any(c.split("_")[0] in effect.seen_by for c in there))
        and (not effect.periodic or angles_known(problem.case))
    ]


def sensitivities_of(
    fitter: Fitter,
    fit: Fit,
    extra: dict[tuple[str, str], list[dict]],
    wanted: set[str],
    known: dict[Signature, np.ndarray],
    coarse: bool = False,
) -> dict[Signature, np.ndarray]:
    """Changes of the residuals about a fit, (N,) float32, by signature; `known`: those that are not replayed again."""
    found = _changes(fitter.problem, fit, _signatures(fitter.problem, extra, wanted, coarse), known)
    # A limit above all that is commanded changes nothing, and so says nothing of a lower one.
    idle = {(one.effect, one.side) for one, change in found.items() if not change.any()}
    if coarse and idle:
        every = _signatures(fitter.problem, extra, {effect for effect, _ in idle}, False)
        found |= _changes(fitter.problem, fit, [one for one in every if (one.effect, one.side) in idle], found)
    return found


def _signatures(
    problem: Problem, extra: dict[tuple[str, str], list[dict]], wanted: set[str], coarse: bool
) -> list[Signature]:
    """Signatures of some effects on all their sides, at their starts and at extra parameters."""
    found = []
    names = ("left", "right")
    for effect in available(problem):
        if effect.id not in wanted:
            continue
        sides = list(names[: len(problem.robot.sides)]) if effect.sided else ["both"]
        if effect.nonlinear and len(sides) == 2:
            sides.append("both")
        for side in sides:
            found += [
                Signature(effect.id, side, tuple(values.items()))
                for values in start_values(effect, coarse) + extra.get((effect.id, side), [])
            ]
    return found


def _changes(
    problem: Problem, fit: Fit, jobs: Sequence[Signature], known: Mapping[Signature, np.ndarray]
) -> dict[Signature, np.ndarray]:
    """Changes of the residuals about a fit, (N,) float32, by signature; `known`: those that are not replayed again."""
    model = fit.model(problem)
    new = [job for job in jobs if job not in known]
    models = [apply(problem.effects, model, ((job.effect, job.side),), [dict(job.values)]) for job in new]
    found = {job: known[job] for job in jobs if job in known}
    # Each against the fit by the same steps: what these miss is no signature.
    lengths = sorted({m.coarse_s for m in models})
    replayed = problem.residuals([*(model for _ in lengths), *models], [*lengths, *(m.coarse_s for m in models)])
    bases = dict(zip(lengths, replayed))
    for job, moved, m in zip(new, replayed[len(lengths) :], models):
        found[job] = (moved - bases[m.coarse_s]).astype(np.float32)
    return found


def changes_by_missing(changes: Mapping[Signature, np.ndarray], fit: Fit) -> list[np.ndarray]:
    """Of changes of the residuals, (N,) each, those by effects that a fit does not have, and of what both sides may
    have their sums.
    """
    missing = {one: change for one, change in changes.items() if not clashes((one.effect, one.side), fit.hypothesis)}
    right = {(one.effect, one.values): change for one, change in missing.items() if one.side == "right"}
    both = [
        change + right[one.effect, one.values]
        for one, change in missing.items()
        if one.side == "left" and (one.effect, one.values) in right
    ]
    return [*missing.values(), *both]


class Screen:
    """The predicted gain of each effect next to a fit, by its signature and one whitening.

    Parameters
    ----------
    moves : changes of the residuals by signature, from `sensitivities_of`; noise : the discrepancy to whiten by; before
    : a screening with the same discrepancy, of whose moves some may be among these.
    """

    signatures: list[Signature]
    sums: list[tuple[int, int]]
    rows: np.ndarray
    squares: np.ndarray

    def __init__(
        self,
        problem: Problem,
        fit: Fit,
        sensitivities: dict[Signature, np.ndarray],
        noise: Likelihood,
        before: Screen | None = None,
    ):
        self.sensitivities = sensitivities
        self.effects = problem.effects
        self.taken = fit.hypothesis
        self._taken = dict(zip(fit.hypothesis, fit.values))
        # A nuisance on its bound makes no more room: what it would imitate if it could is an effect's to explain.
        keep = np.flatnonzero(fit.free)
        columns = [*fit.by_nuisance.T, *fit.by_effect.T]
        jacobian = noise.whitened([columns[k] for k in keep])
        weight = prior_weight(fit.z, fit.u)[keep]
        at = np.concatenate([fit.z, fit.u])[keep]
        white = noise.whiten(fit.residual).astype(np.float32)
        self._take(sensitivities, noise, before)
        self.shared = self._summed((self.rows @ jacobian).astype(float))
        self.inner = np.linalg.inv((jacobian.T @ jacobian).astype(float) + np.diag(weight))
        cross = self.shared @ self.inner
        self.size = self.squares - np.einsum("ij,ij->i", cross, self.shared)
        self.slope = self._summed((self.rows @ white).astype(float)) - cross @ (
            (jacobian.T @ white).astype(float) + weight * at
        )

    def _take(self, sensitivities: dict[Signature, np.ndarray], noise: Likelihood, before: Screen | None) -> None:
        """Whitened signatures, a row each; those of both sides are sums of two and have no row; and the squares
        of all.
        """
        if before is not None and before.sensitivities is sensitivities:
            self.signatures, self.sums, self.rows, self.squares = (
                before.signatures,
                before.sums,
                before.rows,
                before.squares,
            )
            return
        left = {(s.effect, s.values): k for k, s in enumerate(sensitivities) if s.side == "left"}
        self.sums = [
            (left[s.effect, s.values], k)
            for k, s in enumerate(sensitivities)
            if s.side == "right" and (s.effect, s.values) in left and not self.effects[s.effect].nonlinear
        ]
        signatures = list(sensitivities)
        self.signatures = signatures + [
            Signature(signatures[k].effect, "both", signatures[k].values) for k, _ in self.sums
        ]
        self.rows = np.empty((len(signatures), noise.count), np.float32)
        known = (
            {}
            if before is None
            else {
                s: row
                for s, row in zip(before.sensitivities, before.rows)
                if sensitivities.get(s) is before.sensitivities[s]
            }
        )
        new = [k for k, s in enumerate(signatures) if s not in known]
        for k in sorted(set(range(len(signatures))) - set(new)):
            self.rows[k] = known[signatures[k]]
        noise.whiten_into([sensitivities[signatures[k]] for k in new], [self.rows[k] for k in new])
        squares = np.einsum("ij,ij->i", self.rows, self.rows).astype(float)
        self.squares = np.concatenate(
            [squares, [squares[a] + squares[b] + 2.0 * float(self.rows[a] @ self.rows[b]) for a, b in self.sums]]
        )

    def _summed(self, products: np.ndarray) -> np.ndarray:
        """Products of the rows with something, (n,) or (n, p), and of the signatures that are sums of two."""
        if not self.sums:
            return products
        left, right = np.transpose(self.sums)
        return np.concatenate([products, products[left] + products[right]])

    def _rows_of(self, causes: Sequence[int]) -> np.ndarray:
        """Some signatures, whitened, (n, N)."""
        count = len(self.rows)
        return np.stack(
            [self.rows[k] if k < count else np.add(*(self.rows[n] for n in self.sums[k - count])) for k in causes]
        )

    def _gram(self, causes: Sequence[int]) -> np.ndarray:
        """Products of some signatures, projected, a little more than singular."""
        rows, shared = self._rows_of(causes), self.shared[list(causes)]
        gram = (rows @ rows.T).astype(float) - shared @ self.inner @ shared.T
        # In their own measure: of signatures of 1e5 noises a billionth of one is lost.
        return gram + 1e-9 * np.diag(1.0 + np.abs(np.diag(gram)))

    def _line(self, k: int) -> tuple[float, float]:
        """Best step along a signature within its bounds, and the gain it brings."""
        size = self.size[k]
        if size <= 1e-9:
            return 0.0, 0.0
        step = -self.slope[k] / size
        signature = self.signatures[k]
        floor, limit = -REACH, REACH
        values, start = dict(signature.values), self._start(signature)
        for p in self.effects[signature.effect].parameters:
            value = values[p.name] - p.null
            if value != 0 and p.switch:
                # There is no part of it.
                floor = limit = 1.0
                break
            if value != 0:
                ends = sorted(((p.low - start[p.name]) / value, (p.high - start[p.name]) / value))
                floor, limit = max(floor, ends[0]), min(limit, ends[1])
        step = min(max(step, floor), limit)
        return step, -(2 * step * self.slope[k] + step * step * size)

    def _part(self, k: int) -> tuple[float, float]:
        """A signature as it stands, 1, or the best part of it, and the gain it brings. Extrapolating a resonance or a
        limit is worth nothing; but of what grows evenly from none a part may do: a fifth of a soft tyre's slip is a
        stiffer one's."""
        effect = self.effects[self.signatures[k].effect]
        even = not effect.rough and effect.parameters[0].null == 0.0
        step = min(max(-self.slope[k] / self.size[k], 0.0), 1.0) if even and self.size[k] > 1e-9 else 1.0
        return step, float(-(2 * step * self.slope[k] + step * step * self.size[k]))

    def candidates(self) -> list[Candidate]:
        """Single effects on single sides, each mode of one by itself, best first."""
        groups: dict[tuple[str, str, tuple[bool, ...]], list[int]] = {}
        for k, s in enumerate(self.signatures):
            groups.setdefault((s.effect, s.side, self.effects[s.effect].mode(dict(s.values))), []).append(k)
        result = [
            replace(self._best((name, side), causes), mode=mode)
            for (name, side, mode), causes in groups.items()
            if not clashes((name, side), self.taken) or (splits((name, side), self.taken) and self.effects[name].sized)
        ]
        return sorted(result, key=lambda c: -c.gain)

    def maxima(self) -> list[Candidate]:
        """Of each rough effect on each side the sizes at which its predicted gain has a local maximum, largest first.

        What a resonance does in phase at one stiffness it does out of phase a little beyond. Next to other things that
        are missing no stiffness may be in phase, and the gain is negative at its maximum, too.
        """
        found = []
        lines: dict[tuple[tuple[str, str], tuple], list[tuple[float, int]]] = {}
        for k, s in enumerate(self.signatures):
            if self.effects[s.effect].rough and not clashes((s.effect, s.side), self.taken):
                (_, size), *shape = s.values
                lines.setdefault(((s.effect, s.side), tuple(shape)), []).append((size, k))
        for (cause, _), line in lines.items():
            places = [k for _, k in sorted(line)]
            gains = np.array([-np.inf, *(self._part(k)[1] for k in places), -np.inf])
            found += [
                Candidate(cause, gain, self._sized(k, 1.0))
                for k, before, gain, after in zip(places, gains, gains[1:], gains[2:])
                if gain > max(before, after)
            ]
        return sorted(found, key=lambda c: -c.gain)

    def pairs(self, causes: Sequence[tuple[str, str]]) -> list[tuple[float, Candidate, Candidate]]:
        """Pairs of effects with their predicted gain together, largest first; of `causes`, (effect, side), those that
        one size describes.
        """
        at: dict[tuple[str, str], int] = {}
        for k, s in enumerate(self.signatures):
            cause = s.effect, s.side
            if cause not in causes or not self.effects[s.effect].sized or clashes(cause, self.taken):
                continue
            if cause not in at or self._line(k)[1] > self._line(at[cause])[1]:
                at[cause] = k
        names, ks = list(at), list(at.values())
        if len(names) < 2:
            return []
        gram = self._gram(ks)
        found = []
        for i, j in itertools.combinations(range(len(names)), 2):
            if clashes(names[i], (names[j],)):
                continue
            both, slope = gram[np.ix_((i, j), (i, j))], self.slope[[ks[i], ks[j]]]
            steps = np.clip(-np.linalg.solve(both, slope), -REACH, REACH)
            gain = float(-(2 * steps @ slope + steps @ both @ steps))
            first, second = (Candidate(names[n], gain, self._sized(ks[n], step)) for n, step in zip((i, j), steps))
            found.append((gain, first, second))
        return sorted(found, key=lambda pair: -pair[0])

    def _sized(self, k: int, step: float) -> np.ndarray:
        """Scaled parameters of an effect by a step along its signature: size is the first parameter's affair; the
        others give its shape."""
        signature = self.signatures[k]
        first, values, start = (
            self.effects[signature.effect].parameters[0],
            dict(signature.values),
            self._start(signature),
        )
        values[first.name] = float(
            np.clip(start[first.name] + step * (values[first.name] - first.null), first.low, first.high)
        )
        return scaled(self.effects, ((signature.effect, signature.side),), [values])

    def _start(self, signature: Signature) -> dict[str, float]:
        """The parameters that a signature leads away from: absent, or those of both sides."""
        return self._taken.get((signature.effect, "both")) or {
            p.name: p.null for p in self.effects[signature.effect].parameters
        }

    def _best(self, cause: tuple[str, str], causes: list[int]) -> Candidate:
        effect = self.effects[cause[0]]
        if effect.separate:
            return self._separate(cause, causes)
        if effect.periodic:
            return self._periodic(cause, causes)
        step_of = self._part if effect.nonlinear else self._line
        (step, gain), k = max(((step_of(k), k) for k in causes), key=lambda item: item[0][1])
        return Candidate(cause, gain, self._sized(k, step))

    def _separate(self, cause: tuple[str, str], causes: list[int]) -> Candidate:
        parameters = self.effects[cause[0]].parameters
        null = {p.name: p.null for p in parameters}
        gram = self._gram(causes)
        steps = np.clip(-np.linalg.solve(gram, self.slope[causes]), -20, 20)
        gain = float(-(2 * steps @ self.slope[causes] + steps @ gram @ steps))
        values = dict(null)
        for step, k in zip(steps, causes):
            for name, value in self.signatures[k].values:
                values[name] += step * (value - null[name])
        return Candidate(cause, gain, scaled(self.effects, (cause,), [values]))

    def _periodic(self, cause: tuple[str, str], causes: list[int]) -> Candidate:
        """Amplitude and phase by least squares on the quadratures of each number of cycles."""
        size, _, phase = (p.name for p in self.effects[cause[0]].parameters[:3])
        best = Candidate(cause, 0.0, np.zeros(len(self.effects[cause[0]].parameters)))
        for pair in zip(causes[::2], causes[1::2]):
            gram = self._gram(pair)
            steps = -np.linalg.solve(gram, self.slope[list(pair)])
            gain = float(-(steps @ self.slope[list(pair)]))
            if gain > best.gain:
                values = dict(self.signatures[pair[0]].values)
                values |= {
                    size: float(np.hypot(*steps)) * values[size],
                    phase: float(np.arctan2(steps[1], steps[0])),
                }
                best = Candidate(cause, gain, scaled(self.effects, (cause,), [values]))
        return best


def splits(cause: tuple[str, str], hypothesis: Hypothesis) -> bool:
    """Whether a member is one side of an effect that an explanation holds on both."""
    return cause[1] != "both" and (cause[0], "both") in hypothesis


def clashes(cause: tuple[str, str], hypothesis: Hypothesis) -> bool:
    """Whether an explanation holds this effect on this side already."""
    effect, side = cause
    mine = [s for e, s in hypothesis if e == effect]
    return bool(mine) and ("both" in mine or side == "both" or side in mine)


def doubles(problem: Problem, cause: tuple[str, str], hypothesis: Hypothesis) -> bool:
    """Whether an explanation holds this effect already, be it of another size, or others that explain these runs
    as well.
    """
    if clashes(cause, hypothesis) and not splits(cause, hypothesis):
        return True
    if scale_all(problem.case, [*hypothesis, cause]):
        return True
    return any(equal in hypothesis for equal in structurally_indistinguishable(problem.case, cause))


def excluded(problem: Problem, cause: tuple[str, str], hypothesis: Hypothesis) -> bool:
    """The same, and whether it holds the effect on both sides and this is one of these."""
    return clashes(cause, hypothesis) or doubles(problem, cause, hypothesis)
