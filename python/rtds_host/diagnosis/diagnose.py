"""A case's whole diagnosis: log -> gate -> replay -> candidates -> choice -> report."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rtds_host.contract import Case, RunLog
from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.evidence import Choice
from rtds_host.diagnosis.experiment import next_experiment
from rtds_host.diagnosis.fit import Fit, Hypothesis, apply, parameters
from rtds_host.diagnosis.gate import Gate, examine
from rtds_host.diagnosis.localise import localise
from rtds_host.diagnosis.localise.regimes import Motion, regimes
from rtds_host.diagnosis.problem import NOMINAL_KEYS, PRIOR, Problem
from rtds_host.diagnosis.replay.model import REPORT_STEP_S, Model, replay_run
from rtds_host.diagnosis.replay.slots import OUTPUTS
from rtds_host.diagnosis.report.details import Candidate, Details, Trace
from rtds_host.diagnosis.search import Search
from rtds_host.diagnosis.verdict import NO_GAP, Decision, decide

SCHEMA = "rtds-diagnosis/1"
Z90 = 1.6448536269514722
BOOTSTRAPS = 400
# Where an explanation leaves structure, nature's form is another than its own by about so much of the share left open.
REST_SHARE = 0.5
MOVED = 0.01                                      # sigma of the prior


def diagnose(case: Case, quick: bool = False, threads: int = 2, seed: int = 1,
             progress: Callable[[str, float], None] | None = None,
             without: frozenset[str] = frozenset()) -> tuple[dict, Details]:
    """Diagnose a case.

    Parameters
    ----------
    case : as read; quick : a narrower search; threads : cores to use; seed : of the bootstrap.
    progress : called with a stage and a share of the work done.
    without : effects left out of the catalogue (to test that what is missing is called unknown).

    Returns
    -------
    The content of `diagnosis.json` (contract, section 5), and what the report shows beyond it.

    Raises
    ------
    InputError : the data make a diagnosis impossible; the message says why.
    """
    began = time.perf_counter()
    say = progress or (lambda stage, share: None)
    say("gate", 0.0)
    gate = examine(case)
    found = investigate(case, quick, threads, say, without)
    diagnosis, details = conclude(found, gate, seed, say)
    details.seconds = time.perf_counter() - began
    say("done", 1.0)
    return diagnosis, details


@dataclass
class Investigation:
    """A search and what was decided on it."""

    problem: Problem
    choice: Choice
    decision: Decision


def investigate(case: Case, quick: bool = False, threads: int = 2, say: Callable[[str, float], None] = lambda *_: None,
                without: frozenset[str] = frozenset()) -> Investigation:
    """Search for the explanation of a case and decide; parameters as of `diagnose`."""
    say("replay", 0.05)
    found = _searched(Problem(case, threads), quick, say, without)
    left = found.decision.fit.chi2 / found.problem.size
    if case.robot.axis is not None and (found.decision.verdict == "unknown" or left > 1.0 + NO_GAP):
        # An axis integrates and sticks: over whole runs of a real one the misfit has many local minima, over pieces few.
        found = _searched(Problem(case, threads, pieces=True), quick, say, without)
    return found


def _searched(problem: Problem, quick: bool, say: Callable[[str, float], None], without: frozenset[str]) -> Investigation:
    search = Search(problem, quick, without)
    say("candidates", 0.1)
    choice = search.run()
    say("choice", 0.8)
    return Investigation(problem, choice, decide(problem, choice))


def conclude(found: Investigation, gate: Gate | None, seed: int = 1,
             say: Callable[[str, float], None] = lambda *_: None) -> tuple[dict, Details]:
    """What a decision means in the contract's terms: gap on held-out runs, places, alternatives, next experiment."""
    problem, choice, decision = found.problem, found.choice, found.decision
    case, fit = problem.case, decision.fit
    say("gap", 0.85)
    held = _held_out(problem, decision, seed)
    located, localisation, after = _locate(problem, decision, held)
    say("report", 0.95)

    diagnosis = {
        "schema": SCHEMA,
        "verdict": decision.verdict,
        "located": located,
        "effects": _effects(problem, decision),
        "nominal_fit": _nominal_fit(problem, fit if decision.verdict != "unknown" else decision.base),
        "alternatives": _alternatives(problem, decision),
        "indistinguishable": [[_named(problem, e, s) for e, s in members] for members in decision.alike],
        "gap": held["gap"],
        "held_out_runs": [run.name for run in case.runs],
        "next_experiment": next_experiment(problem, decision, choice.fits),
    }
    rest = diagnosis["gap"]["rest"]
    if rest["structured"] and after is not None:
        shares = after.shares()
        rest["subsystem"] = shares[0]["subsystem"] if shares else None
    details = Details(
        case=case, gate=gate, localisation=localisation, localisation_after=after,
        candidates=_candidates(problem, choice, decision), traces=held["traces"], regimes=held["regimes"],
        run_gaps=held["runs"], notes=list(case.notices) + held["notes"])
    return diagnosis, details


def _round(value: float, digits: int = 5) -> float:
    return float(f"{value:.{digits}g}")


def _sandwich(problem: Problem, fit: Fit) -> np.ndarray:
    """Variances of (z, u) that follow from how the residuals really scatter from block to block, (k + p,).

    H. White, Econometrica 48, 1980, clustered by the blocks: residuals may be correlated within one.
    """
    keep = np.flatnonzero(fit.free)
    pull = fit.jacobian[:, keep].astype(float) * fit.residual[:, None] / fit.dispersion
    sums = np.zeros((problem.block_count, len(keep)))
    np.add.at(sums, problem.blocks, pull)
    bread = np.linalg.inv(fit.precision()[np.ix_(keep, keep)])
    result = np.zeros(len(fit.free))
    result[keep] = np.diag(bread @ (sums.T @ sums) @ bread)
    return result


def _effects(problem: Problem, decision: Decision) -> list[dict]:
    fit = decision.fit
    if decision.verdict == "none":
        return []
    if decision.verdict == "unknown":
        return []
    sigma = np.sqrt(np.maximum(np.diag(fit.covariance()), _sandwich(problem, fit)))[len(fit.z):]
    rest = 1.0 - decision.closed if decision.structured else 0.0
    result, k = [], 0
    for (effect, side), values in zip(fit.hypothesis, fit.values):
        entry = {}
        for p in CATALOGUE[effect].parameters:
            at_bound = not fit.free[len(fit.z) + k]
            pinned = not at_bound and sigma[k] < 2.0
            form = math.hypot(CATALOGUE[effect].form, 0.0 if CATALOGUE[effect].erratic else REST_SHARE * rest)
            spread = Z90 * math.hypot(sigma[k] * p.spread, form * abs(values[p.name] - p.null))
            name, _, unit = p.reported(problem.robot.axis)
            entry[name] = {"value": _round(unit * values[p.name]),
                           "ci90": [_round(unit * max(values[p.name] - spread, p.low)),
                                    _round(unit * min(values[p.name] + spread, p.high))] if pinned else None}
            k += 1
        probability = sum(s.probability for s in decision.ranked if (effect, side) in s.fit.hypothesis)
        result.append({**_named(problem, effect, side), "subsystem": CATALOGUE[effect].subsystem,
                       "probability": _round(min(probability, 1.0), 4), "parameters": entry})
    strength = {h: _knockout(fit, k) for k, h in enumerate(fit.hypothesis)}
    order = sorted(range(len(result)), key=lambda k: -strength[fit.hypothesis[k]])
    return [result[k] for k in order]


def _knockout(fit: Fit, which: int) -> float:
    """How strongly the residuals feel one effect of a fit, first order."""
    k = len(fit.z)
    for n, (effect, _) in enumerate(fit.hypothesis):
        count = len(CATALOGUE[effect].parameters)
        if n == which:
            change = fit.jacobian[:, k:k + count].astype(float) @ fit.u[k - len(fit.z):k - len(fit.z) + count]
            return float(change @ change)
        k += count
    return 0.0


def _nominal_fit(problem: Problem, fit: Fit) -> dict:
    result: dict[str, dict[str, float]] = {}
    for z, (name, side) in zip(fit.z, problem.nuisance_names()):
        if abs(z) < MOVED:
            continue
        for key in NOMINAL_KEYS[name]:
            value = getattr(problem.robot.motor, key) * math.exp(PRIOR * z)
            result.setdefault("lr"[side], {})[key] = _round(value, 8)
    return result


def _named(problem: Problem, effect: str, side: str) -> dict[str, str]:
    return {"id": effect, "side": CATALOGUE[effect].side_on(problem.robot.axis, side)}


def _reported(problem: Problem, effect: str, values: dict[str, float]) -> dict[str, float]:
    shown = [(p.reported(problem.robot.axis), values[p.name]) for p in CATALOGUE[effect].parameters]
    return {name: _round(unit * value, 4) for (name, _, unit), value in shown}


def _alternatives(problem: Problem, decision: Decision) -> list[dict]:
    rows = [{"effects": [_named(problem, e, s) for e, s in scored.fit.hypothesis],
             "probability": scored.probability} for scored in decision.ranked]
    rows.append({"effects": "unknown", "probability": decision.unknown})
    first = rows[0] if decision.verdict != "unknown" else rows[-1]
    # What is blamed stands first among equals; shared by prior, or beside a large rest, it is not always the likeliest.
    rows.sort(key=lambda r: (-r["probability"], r is not first))
    result, total = [], 0.0
    for row in rows:
        if total >= 0.995 and row["probability"] < 0.005:
            break
        total += row["probability"]
        result.append({**row, "probability": _round(row["probability"], 4)})
    return result


def _left_out(problem: Problem, fit: Fit, rows: np.ndarray) -> Model:
    """The explanation fitted without some residuals: one Newton step from the fit to all."""
    keep = np.flatnonzero(fit.free)
    j = fit.jacobian[np.ix_(rows, keep)].astype(float)
    precision = fit.precision()[np.ix_(keep, keep)]
    rest = precision - j.T @ j / fit.dispersion
    step = np.zeros(len(fit.free))
    step[keep] = np.linalg.solve(rest + 1e-9 * np.diag(np.diag(precision)),
                                 j.T @ fit.residual[rows] / fit.dispersion)
    k = len(fit.z)
    # One linear step is trusted for three of its sigmas.
    sigma = np.sqrt(np.diag(fit.covariance()))
    step = np.clip(step, -3 * sigma - 1e-6, 3 * sigma + 1e-6)
    ps = parameters(fit.hypothesis)
    u = fit.u + step[k:]
    u = np.clip(u, [(p.low - p.null) / p.spread for _, _, p in ps], [(p.high - p.null) / p.spread for _, _, p in ps]) \
        if ps else u
    moved = replace(fit, z=fit.z + step[:k], u=u)
    return moved.model(problem)


def _slice(log: RunLog, first: int, last: int) -> RunLog:
    return replace(log, t=log.t[first:last], columns={c: v[first:last] for c, v in log.columns.items()})


def _held_out(problem: Problem, decision: Decision, seed: int) -> dict:
    """Gaps on runs (of a single run: on halves) that the models were not fitted to."""
    robot, fit, base = problem.robot, decision.fit, decision.base
    effects = decision.verdict == "known"
    step = min(REPORT_STEP_S, fit.model(problem).step_s)
    parts: dict[str, list[dict[str, np.ndarray]]] = {"before": [], "refit": [], "after": []}
    seconds: list[float] = []
    by_regime: dict[str, dict[str, list[dict[str, np.ndarray]]]] = {}
    runs, traces = {}, {}
    notes = [f"{name}: no heading in the log; the slope's pull says that the run began at {heading:.2f} rad"
             for name, heading in problem.headings.items()]
    for k, data in enumerate(problem.whole):
        mine = np.flatnonzero(problem.runs_of == k)
        pieces = [(0, len(data.log.t), mine)]
        if len(problem.whole) == 1:
            middle = len(data.log.t) // 2
            half = np.median(problem.blocks[mine])
            pieces = [(0, middle, mine[problem.blocks[mine] < half]),
                      (middle, len(data.log.t), mine[problem.blocks[mine] >= half])]
            notes.append("one run only: each half was held out in turn, which is weaker evidence than another run")
        nominal = replay_run(problem.nominal, data.inputs, step)
        run_parts = {"before": [], "refit": [], "after": []}
        shown = {"refit": np.empty_like(nominal), "after": np.empty_like(nominal)}
        for first, last, rows in pieces:
            refit = replay_run(_left_out(problem, base, rows), data.inputs, step)
            after = replay_run(_left_out(problem, fit, rows), data.inputs, step) if effects else refit
            log = _slice(data.log, first, last)
            seconds.append(float(log.t[-1] - log.t[0]))
            motion = _regimes(problem, log, after[first:last])
            for name, out in (("before", nominal), ("refit", refit), ("after", after)):
                found = gaps.errors_at(log, robot, out[first:last])
                run_parts[name].append({channel: error for channel, (_, error) in found.items()})
                for regime, inside in motion.items():
                    part = {channel: error[inside[rows]] for channel, (rows, error) in found.items()}
                    by_regime.setdefault(regime, {}).setdefault(name, []).append(part)
            shown["refit"][first:last], shown["after"][first:last] = refit[first:last], after[first:last]
        for name in parts:
            parts[name] += run_parts[name]
        runs[data.log.name] = {name: gaps.gap(gaps.pooled(p)) for name, p in run_parts.items()}
        traces[data.log.name] = _traces(problem, data.log, nominal, shown["refit"], shown["after"])
    channels = {name: gaps.pooled(p) for name, p in parts.items()}
    total = {name: gaps.gap(c) for name, c in channels.items()}
    closed = gaps.closed(total["before"], total["after"])
    effect_closed = gaps.closed(total["refit"], total["after"])
    interval = _bootstrap(parts, seconds, np.random.default_rng(seed)) if closed is not None else None
    share = 0.0 if effect_closed is None else 1.0 - effect_closed
    return {
        "gap": {
            **{name: _round(value) for name, value in total.items()},
            "closed": None if closed is None else _round(closed),
            "closed_ci90": interval,
            "effect_closed": None if effect_closed is None else _round(effect_closed),
            "channels": {c: {name: _round(channels[name][c]) for name in parts} for c in channels["before"]},
            "rest": {"share": _round(min(max(share, 0.0), 1.0)), "structured": bool(decision.structured),
                     "subsystem": None},
        },
        "runs": runs, "traces": traces, "notes": notes, "regimes": _by_regime(by_regime),
    }


def _regimes(problem: Problem, log: RunLog, out: np.ndarray) -> dict[str, np.ndarray]:
    """Regime -> rows of a log in it, by how the corrected replay `out` moves, which no sensor has to measure."""
    column = {name: out[:, k] for k, name in enumerate(OUTPUTS)}
    speeds = [column[f"w_{s}"] for s in problem.robot.sides]
    body = problem.robot.chassis is not None
    motion = Motion(log.t, speeds, column["yaw"] if body else None, column["gyro_z"] if body else None)
    half = max(1, round(0.015 / float(np.median(np.diff(log.t)))))
    return regimes(motion, log.meta, log.meta.slope_rad, half)


def _by_regime(parts: dict[str, dict[str, list[dict[str, np.ndarray]]]]) -> dict[str, dict[str, float]]:
    """Gap of each regime, of those that hold some of the samples and not all of them."""
    counts = {regime: sum(len(e) for part in named["before"] for e in part.values()) for regime, named in parts.items()}
    whole = counts.get("first half", 0) + counts.get("second half", 0)
    return {regime: {name: _round(gaps.gap(gaps.pooled(p))) for name, p in named.items()}
            for regime, named in parts.items() if max(1, min(50, 0.02 * whole)) <= counts[regime] < 0.98 * whole}


def _bootstrap(parts: dict[str, list[dict[str, np.ndarray]]], seconds: list[float],
               rng: np.random.Generator) -> list[float] | None:
    """90 % interval of the share closed: blocks of about 1 s of each channel drawn again, with replacement.

    `parts`: by model, errors by channel of each stretch; `seconds`: how long each stretch is.
    """
    blocks: dict[str, dict[str, np.ndarray]] = {}
    for name in ("before", "after"):
        for part, length in zip(parts[name], seconds):
            for channel, error in part.items():
                count = max(1, min(len(error), round(length)))
                sums = np.array([[float(np.sum(e**2)), len(e)] for e in np.array_split(error, count)])
                known = blocks.setdefault(channel, {}).get(name)
                blocks[channel][name] = sums if known is None else np.vstack([known, sums])
    draws = []
    for _ in range(BOOTSTRAPS):
        squares = {"before": [], "after": []}
        for channel in blocks.values():
            pick = rng.integers(0, len(channel["before"]), len(channel["before"]))
            for name, values in squares.items():
                chosen = channel[name][pick]
                values.append(chosen[:, 0].sum() / max(chosen[:, 1].sum(), 1))
        before, after = (math.sqrt(np.mean(squares[name])) for name in ("before", "after"))
        value = gaps.closed(before, after)
        if value is not None:
            draws.append(value)
    if len(draws) < BOOTSTRAPS // 2:
        return None
    return [_round(float(q)) for q in np.quantile(draws, [0.05, 0.95])]


def _traces(problem: Problem, log: RunLog, nominal: np.ndarray, refit: np.ndarray,
            after: np.ndarray) -> dict[str, Trace]:
    names = ("v_bus", "i_l", "i_r", "w_l", "w_r", "th_l", "th_r", "gyro_z", "x", "y", "yaw")
    return {c: Trace(log.t, log.columns[c], nominal[:, k], refit[:, k], after[:, k])
            for k, c in enumerate(names) if log.has(c)}


def _locate(problem: Problem, decision: Decision, held: dict) -> tuple[list[dict], object, object]:
    """Shares of the subsystems: fair shares of what the effects explain, or what the components' replay says."""
    refit = decision.base.model(problem)
    localisation = localise(problem.case, refit)
    after = None
    if decision.verdict == "known":
        after = localise(problem.case, decision.fit.model(problem))
    if decision.verdict == "none":
        return [], localisation, after
    if decision.verdict == "unknown":
        return localisation.shares(), localisation, after
    fit = decision.fit
    subsystems = sorted({CATALOGUE[e].subsystem for e, _ in fit.hypothesis})
    if len(subsystems) == 1:
        return [{"subsystem": subsystems[0], "share": 1.0}], localisation, after
    # Shapley value of each subsystem in the fall of the mean square (L. S. Shapley, 1953).
    worth: dict[tuple[str, ...], float] = {}
    for count in range(len(subsystems) + 1):
        for members in itertools.combinations(subsystems, count):
            kept: Hypothesis = tuple(h for h in fit.hypothesis if CATALOGUE[h[0]].subsystem in members)
            values = [v for h, v in zip(fit.hypothesis, fit.values) if h in kept]
            residual = problem.residual(apply(problem.with_nuisances(fit.z), kept, values))
            worth[members] = -float(residual @ residual)
    shares = {}
    n = len(subsystems)
    for s in subsystems:
        others = [x for x in subsystems if x != s]
        shares[s] = sum(
            math.factorial(c) * math.factorial(n - c - 1) / math.factorial(n)
            * (worth[tuple(sorted(m + (s,)))] - worth[m])
            for c in range(n) for m in itertools.combinations(others, c))
    positive = {s: max(v, 0.0) for s, v in shares.items()}
    total = sum(positive.values()) or 1.0
    rows = [{"subsystem": s, "share": _round(v / total)} for s, v in positive.items()]
    return sorted(rows, key=lambda r: -r["share"]), localisation, after


def _candidates(problem: Problem, choice: Choice, decision: Decision) -> list[Candidate]:
    """What was tried, best first, with the reason in words."""
    chosen = decision.fit
    equals = {member for members in decision.alike for member in members[1:]}
    rows = []
    blamed = {s.fit.hypothesis: s for s in decision.ranked}
    for scored in sorted(choice.ranked, key=lambda s: (s.fit.hypothesis != chosen.hypothesis, s.score))[:14]:
        fit = scored.fit
        gain = decision.gains.get(fit.hypothesis)
        worse = (fit.chi2 - chosen.chi2) / choice.dispersion
        if fit.hypothesis == chosen.hypothesis and decision.verdict != "unknown":
            verdict, reason = "blamed", "explains the runs best, on stretches it was not fitted to as well"
        elif len(fit.hypothesis) == len(chosen.hypothesis) and any(h in equals for h in fit.hypothesis):
            verdict, reason = "alike", "fits these runs as well as what is blamed"
        elif fit.hypothesis in decision.reasons:
            verdict, reason = "rejected", decision.reasons[fit.hypothesis]
        elif worse > 0:
            verdict, reason = "rejected", f"leaves {worse:.0f} more units of chi2 than what is blamed"
        else:
            verdict, reason = "rejected", "its further parameters do not earn their place"
        rows.append(Candidate(
            effects=[_named(problem, e, s) for e, s in fit.hypothesis],
            parameters=[_reported(problem, e, values) for (e, _), values in zip(fit.hypothesis, fit.values)],
            improvement=None if gain is None else _round(gain[0], 4),
            held_out_t=None if gain is None else _round(gain[1], 3),
            probability=_round(blamed[fit.hypothesis].probability, 4) if fit.hypothesis in blamed else 0.0,
            verdict=verdict, reason=reason))
    return rows
