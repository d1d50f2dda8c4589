"""Screening: which effects could explain what is left, by their signatures projected off the nuisances.

A signature is the change of all residuals when an effect of typical size enters the replay, a finite change and not
a derivative, since gaps, friction and delays have no useful derivative at zero.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from rtds_host.diagnosis.effects import CATALOGUE, Effect
from rtds_host.diagnosis.fit import Fitter, Hypothesis, apply, scaled
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model

# Effects whose parameters each stand for a part of their own: absent where only one of them is.
SEPARATE = ("com_offset", "friction_asymmetry")
# Effects whose signature changes its form with its size, and with what the other side does.
OSCILLATING = ("backlash", "gear_compliance", "longitudinal_slip", "voltage_limit")


@dataclass
class Signature:
    """One direction of one effect: the change of the residuals when it enters with `values`."""

    effect: str
    side: str
    values: dict[str, float]

    @property
    def key(self) -> tuple:
        return self.effect, self.side, tuple(self.values.items())


@dataclass
class Candidate:
    """An explanation worth a fit: expected gain of chi2 and scaled parameters to start from."""

    hypothesis: Hypothesis
    gain: float
    start: np.ndarray


def start_values(effect: Effect) -> list[dict[str, float]]:
    """Parameter sets to take signatures at."""
    if effect.id in SEPARATE:
        null = {p.name: p.null for p in effect.parameters}
        return [{**null, p.name: p.starts[0]} for p in effect.parameters]
    if effect.id == "torque_ripple":
        return []                   # its number of cycles must be looked up in a spectrum, see `ripple`
    names = [p.name for p in effect.parameters]
    return [dict(zip(names, combination)) for combination in itertools.product(*(p.starts for p in effect.parameters))]


def available(problem: Problem) -> list[Effect]:
    """Effects that exist on this machine."""
    robot = problem.robot
    result = []
    for effect in CATALOGUE.values():
        if robot.axis is not None and not effect.axis:
            continue
        if robot.driver.mode == "torque" and effect.id in ("resistance_error", "torque_constant_error",
                                                           "winding_heating", "bridge_drop", "supply_sag"):
            continue
        result.append(effect)
    return result


class Screen:
    """Signatures of all effects about one explanation (nothing, or effects already found).

    `residual` (N,), `jacobian` (N, p), `penalty` (p,) the prior's precision and `at` (p,) the fit's parameters describe
    that explanation. `moves`: changes of the residuals, (N,), by `Signature.key`, that need no replay; it is filled with
    those that had to be replayed.
    """

    def __init__(self, fitter: Fitter, base: Model, residual: np.ndarray, jacobian: np.ndarray, penalty: np.ndarray,
                 at: np.ndarray, dispersion: float, moves: dict[tuple, np.ndarray], taken: Hypothesis = (),
                 extra: dict[tuple[str, str], list[dict]] | None = None, only: set[str] | None = None):
        problem = fitter.problem
        self.dispersion = dispersion
        jobs: list[Signature] = []
        names = {0: "left", 1: "right"}
        for effect in available(problem):
            if only is not None and effect.id not in only:
                continue
            sides = [names[k] for k in range(len(problem.robot.sides))] if effect.sided else ["both"]
            if effect.id in OSCILLATING and len(sides) == 2:
                sides.append("both")
            for side in sides:
                jobs += [Signature(effect.id, side, values)
                         for values in start_values(effect) + (extra or {}).get((effect.id, side), [])]
        new = [job for job in jobs if job.key not in moves]
        models = [apply(base, ((job.effect, job.side),), [job.values]) for job in new]
        for job, moved in zip(new, problem.residuals(models)):
            moves[job.key] = (moved - residual).astype(np.float32)
        rows = np.array([moves[job.key] for job in jobs])
        self.signatures = jobs
        mix = list(np.eye(len(jobs)))
        # Effects of both sides: the sum of the sides' signatures.
        left = {s.key: k for k, s in enumerate(jobs) if s.side == "left"}
        for k, s in enumerate(list(self.signatures)):
            twin = left.get(Signature(s.effect, "left", s.values).key)
            if s.side == "right" and twin is not None and s.effect not in OSCILLATING:
                self.signatures.append(Signature(s.effect, "both", s.values))
                mix.append(mix[k] + mix[twin])
        combine = np.array(mix)
        jac = jacobian.astype(np.float32)
        inner = np.linalg.inv((jac.T @ jac).astype(float) / dispersion + np.diag(penalty))
        cross = (rows @ jac).astype(float) @ inner / dispersion
        gram = (rows @ rows.T).astype(float) / dispersion - cross @ (rows @ jac).astype(float).T / dispersion
        r32 = residual.astype(np.float32)
        # Nuisances that an effect sets free give their prior's cost back: the gradient holds the prior's pull too.
        slope = (rows @ r32).astype(float) / dispersion - cross @ ((jac.T @ r32).astype(float) / dispersion + penalty * at)
        self.gram = combine @ gram @ combine.T
        self.slope = combine @ slope
        self.taken = taken

    def _line(self, k: int) -> tuple[float, float]:
        """Best step along a signature within its bounds, and the gain of chi2 (over dispersion) it brings."""
        size = self.gram[k, k]
        if size <= 1e-9:
            return 0.0, 0.0
        step = -self.slope[k] / size
        signature = self.signatures[k]
        limit = np.inf
        floor = -np.inf
        for p in CATALOGUE[signature.effect].parameters:
            value = signature.values[p.name] - p.null
            if value == 0:
                continue
            ends = sorted(((p.low - p.null) / value, (p.high - p.null) / value))
            floor, limit = max(floor, ends[0]), min(limit, ends[1])
        # A signature of finite size says little far from that size.
        step = min(max(step, max(floor, -6.0)), min(limit, 6.0))
        return step, -(2 * step * self.slope[k] + step * step * size)

    def candidates(self) -> list[Candidate]:
        """Single effects, best first."""
        groups: dict[tuple[str, str], list[int]] = {}
        for k, s in enumerate(self.signatures):
            groups.setdefault((s.effect, s.side), []).append(k)
        result = []
        for (effect, side), members in groups.items():
            if (effect, side) in self.taken:
                continue
            parameters = CATALOGUE[effect].parameters
            null = {p.name: p.null for p in parameters}
            if effect in SEPARATE:
                gram = self.gram[np.ix_(members, members)] + 1e-9 * np.eye(len(members))
                steps = np.clip(-np.linalg.solve(gram, self.slope[members]), -20, 20)
                gain = float(-(2 * steps @ self.slope[members] + steps @ gram @ steps))
                values = dict(null)
                for step, k in zip(steps, members):
                    for name, value in self.signatures[k].values.items():
                        values[name] += step * (value - null[name])
                result.append(Candidate(((effect, side),), gain, scaled(((effect, side),), [values])))
                continue
            if effect == "torque_ripple":
                result.append(self._ripple(side, members))
                continue
            lines = [(self._line(k), k) for k in members]
            (step, gain), k = max(lines, key=lambda item: item[0][1])
            first = parameters[0]
            values = dict(self.signatures[k].values)
            # Size is the first parameter's affair; the others give its shape.
            values[first.name] = float(np.clip(first.null + step * (values[first.name] - first.null), first.low,
                                               first.high))
            if effect in OSCILLATING:
                # Extrapolating a resonance or a limit is worth nothing: the best of the starts, as it stands.
                gain, k = max((self._direct(k), k) for k in members)
                values = dict(self.signatures[k].values)
            result.append(Candidate(((effect, side),), gain, scaled(((effect, side),), [values])))
        return sorted(result, key=lambda c: -c.gain)

    def _direct(self, k: int) -> float:
        """Gain of chi2 (over dispersion) at a signature's own size."""
        return float(-(2 * self.slope[k] + self.gram[k, k]))

    def _ripple(self, side: str, members: list[int]) -> Candidate:
        """Amplitude and phase by least squares on the quadratures of each number of cycles."""
        best = Candidate((("torque_ripple", side),), 0.0, np.zeros(3))
        for a, b in zip(members[::2], members[1::2]):
            pair = [a, b]
            gram = self.gram[np.ix_(pair, pair)] + 1e-9 * np.eye(2)
            steps = -np.linalg.solve(gram, self.slope[pair])
            gain = float(-(steps @ self.slope[pair]))
            if gain > best.gain:
                values = self.signatures[a].values
                values = {"amplitude_nm": float(np.hypot(*steps)) * values["amplitude_nm"],
                          "cycles_per_rev": values["cycles_per_rev"],
                          "phase_rad": float(np.arctan2(steps[1], steps[0]))}
                best = Candidate(best.hypothesis, gain, scaled(best.hypothesis, [values]))
        return best

    def pairs(self, count: int) -> list[Candidate]:
        """Pairs of effects by the joint gain of their best signatures, best first."""
        best: dict[tuple[str, str], int] = {}
        for k, s in enumerate(self.signatures):
            key = (s.effect, s.side)
            if s.effect == "torque_ripple":
                continue            # found alone or on top of another effect
            if key not in best or self._line(k)[1] > self._line(best[key])[1]:
                best[key] = k
        keys = [key for key in best if self.gram[best[key], best[key]] > 1.0]
        found = []
        for a, b in itertools.combinations(keys, 2):
            if a[0] == b[0] and ("both" in (a[1], b[1])):
                continue
            i, j = best[a], best[b]
            gram = self.gram[np.ix_([i, j], [i, j])]
            det = gram[0, 0] * gram[1, 1] - gram[0, 1] ** 2
            if det < 1e-4 * gram[0, 0] * gram[1, 1]:
                continue
            steps = -np.linalg.solve(gram, self.slope[[i, j]])
            if not self._allowed(i, steps[0]) or not self._allowed(j, steps[1]):
                continue
            gain = float(-(steps @ self.slope[[i, j]]))
            found.append((gain, a, b, i, j, steps))
        found.sort(key=lambda item: -item[0])
        result = []
        for gain, a, b, i, j, steps in found[:count]:
            hypothesis = tuple(sorted((a, b)))
            starts = {}
            for key, k, step in ((a, i, steps[0]), (b, j, steps[1])):
                parameters = CATALOGUE[key[0]].parameters
                values = dict(self.signatures[k].values)
                for n, p in enumerate(parameters):
                    if n == 0 or key[0] in SEPARATE:
                        values[p.name] = float(np.clip(p.null + step * (values[p.name] - p.null), p.low, p.high))
                starts[key] = scaled((key,), [values])
            result.append(Candidate(hypothesis, gain, np.concatenate([starts[h] for h in hypothesis])))
        return result

    def _allowed(self, k: int, step: float) -> bool:
        if not -8 < step < 8:
            return False
        signature = self.signatures[k]
        for p in CATALOGUE[signature.effect].parameters[:1]:
            value = p.null + step * (signature.values[p.name] - p.null)
            if not p.low <= value <= p.high:
                return False
        return True
