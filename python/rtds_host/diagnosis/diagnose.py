"""A case's whole diagnosis: log -> gate -> replay -> candidates -> attribution -> report."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from rtds_host.contract import Case
from rtds_host.diagnosis import budget
from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.attribution import (
    Attribution,
    EffectEvidence,
    attribute,
    declared,
    with_one_more,
    without_effects,
)
from rtds_host.diagnosis.choice import MAX_RESIDUAL_RATIO, HeldOutScore, residual_ratio
from rtds_host.diagnosis.effects import RESEMBLES
from rtds_host.diagnosis.effort import Effort
from rtds_host.diagnosis.experiment import next_experiment
from rtds_host.diagnosis.fit import Fit, Hypothesis
from rtds_host.diagnosis.forms import Forms, forms_of
from rtds_host.diagnosis.gate import Gate, examine
from rtds_host.diagnosis.heldout import HeldOut, held_out
from rtds_host.diagnosis.intervals import Key, intervals
from rtds_host.diagnosis.likelihood import correlated
from rtds_host.diagnosis.localise import Localisation, localise
from rtds_host.diagnosis.localise.shares import FAINT
from rtds_host.diagnosis.nuisances import SETUP
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.report.details import Candidate, Details
from rtds_host.diagnosis.report.words import effect_name
from rtds_host.diagnosis.residual import CHANNELS
from rtds_host.diagnosis.scatter import over_runs, scattered
from rtds_host.diagnosis.screen import changes_by_missing, sensitivities_of
from rtds_host.diagnosis.search.driver import MOST_WORK, QUICK_WORK, Limits, Search
from rtds_host.diagnosis.search.moves.adding import with_one_of
from rtds_host.diagnosis.search.stepwise import STEPS, Selection, by_likelihood
from rtds_host.diagnosis.search.store import FAR, Store
from rtds_host.diagnosis.thresholds import MINOR_SHARE, SIGNIFICANT
from rtds_host.vectors import given

SCHEMA = "rtds-diagnosis/3"
# Named effects that leave no more than this of the gap explain it (contract, section 5).
RESIDUAL_OF_KNOWN = 0.3
# Why an effect is not included in whose place a form leaves clearly less.
SUPERSEDED = "is superseded by a free curve, which leaves clearly less of runs that it was not fitted to"
# Numerical: a nuisance that moved by less than so many of its sigmas did not move.
MOVED = 0.01


def diagnose(
    case: Case,
    quick: bool = False,
    threads: int = 2,
    progress: Callable[[str, float], None] | None = None,
    without: frozenset[str] = frozenset(),
) -> tuple[dict, Details]:
    """Diagnose a case.

    Parameters
    ----------
    case : as read; quick : a narrower search; threads : cores to use. progress : called with a stage and
    a share of the work done. without : effects left out of the catalogue (to test that what is missing is called
    unknown). Nothing is drawn by chance.

    Returns
    -------
    The content of `diagnosis.json` (contract, section 5), and what the report shows beyond it.

    Raises
    ------
    InputError : the data make a diagnosis impossible; the message says why.
    """
    began = time.perf_counter()
    effort = effort_of(case, quick, progress or (lambda stage, share: None))
    say = effort.say
    say("gate", 0.0)
    gate = examine(case)
    # A replay has a thread a core; further ones of linear algebra would only wait for them, busily.
    with threadpool_limits(1, "blas"), effort.watched():
        found = investigate(taken(case, gate), quick, threads, say, without)
        diagnosis, details = conclude(found, gate, say)
    details.seconds = time.perf_counter() - began
    say("done", 1.0)
    return diagnosis, details


def effort_of(case: Case, quick: bool, say: Callable[[str, float], None]) -> Effort:
    """What counts the work of a case's diagnosis: at most of three searches of an axis, of two of a robot, and as much
    as one for the attribution.
    """
    most = QUICK_WORK if quick else MOST_WORK
    return Effort(say, {"candidates": most * (3 if case.robot.axis is not None else 2), "attribution": most})


def taken(case: Case, gate: Gate) -> Case:
    """The case as the gate leaves it: without what is certainly no measurement, with its noise as its samples show
    it and with gains of a servo that the file leaves out.
    """
    seen = gate.case or case
    return replace(seen, robot=replace(seen.robot, noise_ratio=gate.noise_ratio))


@dataclass
class Investigation:
    """A search and the attribution made of it."""

    problem: Problem
    search: Search
    attribution: Attribution

    @property
    def gap(self) -> float:
        """The gap that the attribution leaves, of whole runs."""
        return self.problem.declared_gap(self.attribution.fit.model(self.problem))


def investigate(
    case: Case,
    quick: bool = False,
    threads: int = 2,
    say: Callable[[str, float], None] = lambda *_: None,
    without: frozenset[str] = frozenset(),
) -> Investigation:
    """Search for the explanation of a case and weigh its effects; parameters as of `diagnose`."""
    say("replay", 0.05)
    search = Search(Problem(case, threads), quick, without)
    say("candidates", 0.1)
    best = search.run()
    if case.robot.encoder is None:
        search, best = _encoder_placed(case, search, best, threads, without)
    if search.store.within_noise(best):
        say("attribution", 0.7)
        return Investigation(search.problem, search, attribute(search, best))
    selection = explanations(search.problem.case, search, best, threads, without)
    search, best = selection.stepwise()
    say("attribution", 0.7)
    search, attribution = supported_choice(selection, search, best)
    return Investigation(search.problem, search, attribution)


def _encoder_placed(case: Case, search: Search, best: Fit, threads: int, without: frozenset[str]) -> tuple[Search, Fit]:
    """The search and its explanation with the encoder where it explains more: at the gear's output, or on the wheel.

    It matters with free play or a spring alone, and a file need not say it (contract, section 2). The explanation that
    was found, with one of these more and the encoder on the wheel, is fitted first; only if that is the more probable
    is a whole search worth its time.
    """
    if search.problem.robot.axis is not None or search.store.within_noise(best):
        return search, best
    on_wheel = replace(case, robot=replace(case.robot, encoder="wheel"))
    other = Search(Problem(on_wheel, threads), search.quick, without)
    nothing = other.begin()
    store = other.store
    base = store.try_fit(best.hypothesis, best.u, nothing) if best.hypothesis else nothing
    giving = {e.id for e in store.effects.values() if e.gives} & store.wanted
    rough = store.try_fits(with_one_of(store, base, giving), rough=True)
    near = [fit for fit in rough if store.score(fit) < search.store.score(best) + FAR]
    fits = [base, *store.converged(near)]
    other.problem.follow_angles(False)
    if min(map(store.score, fits)) >= search.store.score(best):
        return search, best
    found = other.run()
    return (other, found) if store.score(found) < search.store.score(best) else (search, best)


def explanations(case: Case, search: Search, best: Fit, threads: int, without: frozenset[str]) -> Selection:
    """The explanations that beams find of whole runs and, of an axis, of pieces, from which runs left out choose.

    An axis integrates and sticks: over whole runs of a real one the misfit has many local minima, over pieces few. But
    a piece hardly shows what is slow, and starts from what a biased sensor says. By one size a run the likelihood sees
    what acts seldom and strongly, by one a block what acts often.
    """
    searches = [search, Search(Problem(case, threads, by_run=True), search.quick, without)]
    if case.robot.axis is not None:
        searches.append(Search(Problem(case, threads, pieces=True), search.quick, without))
    for other in searches[1:]:
        other.begin()
    selection = Selection.of_beams(searches, best)
    found_by, selected = selection.choice()
    fit = selected.fit
    start = found_by.problem.aligned_commands(fit.model(found_by.problem)) if case.robot.axis is None else fit.start
    if start != fit.start:
        # The link of one run was later than that of the others, which hides what else is missing: once more without.
        kept = [(one.store.fits, one.store.fitter.start) for one in searches]
        for one in searches:
            fitter = one.store.fitter
            one.store.fits, fitter.start = {}, fitter.start.with_command_delays(dict(start.command_delays))
            one.begin()
        again = search.store.try_fit(fit.hypothesis, fit.u, search.store.fits[()])
        aligned = Selection.of_beams(searches, again)
        if aligned.choice()[1].gap < selected.gap:
            selection = aligned
        else:
            for one, (fits, began) in zip(searches, kept, strict=True):
                one.store.fits, one.store.fitter.start = fits, began
    return selection


def supported_choice(selection: Selection, search: Search, best: Fit) -> tuple[Search, Attribution]:
    """The attribution of the explanation that held-out runs choose, of those whose effects are each supported.

    Effects may be chosen that help only together. Elimination then removes one after the other, and more is lost than
    the criterion allows. What is left is one more explanation, and held-out runs choose again, of all but those that
    did not stand, as often as the search takes steps.

    Parameters
    ----------
    search : that found `best`, the first choice.
    """
    stood: list[tuple[HeldOutScore, Search, Attribution]] = []
    failed: set[Hypothesis] = set()
    while len(stood) < STEPS:
        found = attribute(search, best)
        left = HeldOutScore.of(search.problem, found.fit)
        stood.append((left, search, found))
        # A single effect that was removed did not meet the criterion.
        several = len(best.hypothesis) - len(found.included) > 1
        if not several or residual_ratio(HeldOutScore.of(search.problem, best), left) > MAX_RESIDUAL_RATIO:
            break
        failed.add(best.hypothesis)
        search, score = selection.choice(failed, [(one, by) for one, by, _ in stood])
        if any(score is one for one, *_ in stood):
            break
        best = by_likelihood(search, score.fit)
    _, score = Selection(selection.searches).choice(others=[(one, by) for one, by, _ in stood])
    return next((by, found) for one, by, found in stood if one is score)


def _supported(found: Investigation, say: Callable[[str, float], None]) -> tuple[Attribution, HeldOut, Forms]:
    """The attribution as far as held-out runs support it, its gaps on these, and the forms of its residual."""
    problem, attribution = found.problem, found.attribution
    say("gap", 0.85)
    held = held_out(problem, attribution)
    if held.gap("refit") > max(held.gap("before"), gaps.LEAST):
        # Nuisances that open the gap of runs left out are no better known than declared.
        attribution = replace(attribution, base=declared(problem, attribution.base))
        held = held_out(problem, attribution if attribution.included else replace(attribution, fit=attribution.base))
    if held.gap("refit") < gaps.LEAST or held.gap("after") > held.gap("refit"):
        # No gap, and no effect of it (contract, section 5): what was found is shown as tried.
        attribution = Attribution(attribution.base, attribution.base, (), attribution.rejected, (), (((), 1.0),))
        held = held_out(problem, attribution)
    shapes = Forms()
    if _looked_for(problem, attribution, held):
        say("forms", 0.87)
        lacking = {one.cause: one.refitted for one in attribution.included}
        shapes = forms_of(problem, attribution.fit, held.gap("after"), found.search.quick, lacking)
        if shapes.superseded:
            attribution, held, shapes = without_superseded(found, attribution, held, shapes)
    return attribution, held, shapes


def conclude(
    found: Investigation, gate: Gate, say: Callable[[str, float], None] = lambda *_: None
) -> tuple[dict, Details]:
    """An attribution in the contract's terms: gap on held-out runs, shares, alternatives, next experiment."""
    problem = found.problem
    attribution, held, shapes = _supported(found, say)
    total = {name: held.gap(name) for name in ("before", "refit", "after")}
    closed = gaps.closed(total["before"], total["after"])
    effect_closed = gaps.closed(total["refit"], total["after"])
    unexplained = min(max(1.0 - effect_closed, 0.0), 1.0) if effect_closed is not None else 0.0
    structured = _beyond_noise(problem, attribution.fit, total["after"]) and _correlated(problem, attribution.fit)
    verdict = _verdict(total, bool(attribution.included), structured, unexplained)
    timing = given(gate.timing, "the clock")
    known = intervals(
        problem, attribution.fit, timing.stamps_s, timing.step_s, _missing(found.search.store, attribution.fit)
    )
    scatter = scattered(problem, attribution.fit) if attribution.included else {}
    looked_at = replace(problem.looked_at, robot=problem.declared)
    localisation = localise(looked_at, attribution.base.model(problem))
    after = localise(looked_at, attribution.fit.model(problem), held=True) if attribution.included else localisation
    rows = [] if verdict == "none" else budget.shares(problem, attribution.fit, total["after"], after)
    located = budget.located(problem, rows)
    placed = after.shares()
    rows = shapes.shared(rows, total["after"])
    fitted, known = with_forms(problem, attribution.fit, known, shapes)
    say("report", 0.95)

    diagnosis = {
        "schema": SCHEMA,
        "verdict": verdict,
        "located": [{**row, "share": _round(row["share"])} for row in located],
        "effects": [
            {**_effect(problem, attribution, fitted, one, held, known), **_scatter(*scatter[one.cause])}
            for one in attribution.included
        ],
        "forms": shapes.entries,
        "budget": [{**row, "share": _round(row["share"])} for row in rows],
        "nominal_fit": _nominal_fit(problem, fitted),
        **setup_of(problem, fitted),
        "alternatives": _alternatives(problem, attribution, verdict),
        "indistinguishable": [[_named(problem, cause) for cause in causes] for causes in attribution.indistinguishable],
        "gap": {
            **{name: _round(value) for name, value in total.items()},
            "closed": None if closed is None else _round(closed),
            "closed_ci90": None if closed is None or held.interval is None else [_round(v) for v in held.interval],
            "with_forms": None if shapes.gap is None else _round(shapes.gap),
            "effect_closed": None if effect_closed is None else _round(effect_closed),
            "channels": {c: {name: _round(held.channels[name][c]) for name in total} for c in held.channels["before"]},
            "rest": {
                "share": _round(unexplained),
                "structured": bool(structured),
                "subsystem": placed[0]["subsystem"] if structured and placed else None,
            },
        },
        "held_out_runs": [run.name for run in problem.case.runs],
        "next_experiment": None,
    }
    diagnosis["next_experiment"] = next_experiment(problem, found.search.store, attribution, diagnosis)
    lies = localisation, after if attribution.included else None
    details = _details(found, gate, attribution, held, shapes.notes, lies)
    if verdict != "none":
        details.over_runs = {
            (cause[0], _side(problem, cause) if cause[0] in problem.effects else cause[1]): sizes
            for cause, sizes in over_runs(shapes.problem or problem, fitted).items()
        }
    return diagnosis, details


def _details(
    found: Investigation,
    gate: Gate,
    attribution: Attribution,
    held: HeldOut,
    notes: list[str],
    lies: tuple[Localisation, Localisation | None],
) -> Details:
    """What the report shows beyond the diagnosis; `lies`: where the gap lies before and after the effects."""
    problem = found.problem
    return Details(
        case=replace(problem.case, robot=problem.declared),
        gate=gate,
        localisation=lies[0],
        localisation_after=lies[1],
        candidates=_candidates(found, attribution),
        traces=held.traces,
        regimes={k: {n: _round(v) for n, v in e.items()} for k, e in held.regimes.items()},
        run_gaps=held.runs,
        decided={(cause[0], _side(problem, cause)): found for cause, found in held.decided.items()},
        notes=list(problem.case.notices)
        + held.notes
        + notes
        + said_of_end(found.search.limits)
        + _louder(problem, attribution.fit),
    )


def _looked_for(problem: Problem, attribution: Attribution, held: HeldOut) -> bool:
    """Whether forms are looked for: an explanation leaves a gap with structure."""
    return held.gap("refit") >= gaps.LEAST and held.gap("after") >= gaps.LEAST and _correlated(problem, attribution.fit)


def without_superseded(
    found: Investigation, attribution: Attribution, held: HeldOut, shapes: Forms
) -> tuple[Attribution, HeldOut, Forms]:
    """The attribution without the effects that forms supersede, what it leaves of runs left out, and the forms.

    Effects that help only next to superseded ones fall with them. Then the forms are those of what is left, or, where
    these leave more of runs left out than the criterion allows, no effect is superseded. Where held-out runs support an
    effect of the catalogue that makes the larger part of a curve, it is named.

    Parameters
    ----------
    held : what the attribution with all its effects leaves of runs left out.
    """
    problem, quick = found.problem, found.search.quick
    reduced = without_effects(found.search, attribution, {cause: SUPERSEDED for cause in shapes.superseded})
    # Section 3's names are preferred to forms (contract, section 5): dry friction to a torque over the speed.
    alike = {name for one in shapes.entries for name in RESEMBLES.get((one["term"], one["over"]), ())}
    alike -= {name for name, _ in shapes.superseded}
    named = with_one_more(found.search, reduced, alike, shapes.left[-1] ** 2 - 1.0) if alike else reduced
    if named is not reduced:
        left = held_out(problem, named)
        beyond = forms_of(problem, named.fit, left.gap("after"), quick)
        new = [effect_name(_named(problem, c)) for c in named.fit.hypothesis if c not in reduced.fit.hypothesis]
        said = [f"{effect} is named in place of this curve: it makes the larger part of it" for effect in new]
        return named, left, replace(beyond, notes=shapes.notes + said + beyond.notes)
    left = held_out(problem, reduced)
    kept = {one.cause for one in reduced.included}
    if kept == {cause for cause in attribution.fit.hypothesis if cause not in shapes.superseded}:
        return reduced, left, shapes
    next_to_few, next_to_all = left.gap("after"), held.gap("after")
    few = forms_of(problem, reduced.fit, next_to_few, quick)
    whole = forms_of(problem, attribution.fit, next_to_all, quick)
    if whole.leaves(next_to_all) ** 2 - 1.0 <= MAX_RESIDUAL_RATIO * (few.leaves(next_to_few) ** 2 - 1.0):
        return attribution, held, whole
    return reduced, left, replace(few, notes=shapes.notes + few.notes)


def _missing(store: Store, fit: Fit) -> list[np.ndarray]:
    """Changes of the residuals, (N,) each, by effects that a fit does not have; none where it leaves no gap."""
    if not fit.hypothesis or store.within_noise(fit):
        return []
    return changes_by_missing(sensitivities_of(store.fitter, fit, {}, store.wanted, {}, coarse=True), fit)


def said_of_end(limits: Limits) -> list[str]:
    """What is said of a search that ended before it was done."""
    further = "; without --quick it goes on three times as long" if limits.quick else ""
    return (
        [f"the search has ended before it was done, and what it had found by then is shown{further}"]
        if limits.ended
        else []
    )


def _verdict(total: dict[str, float], named: bool, structured: bool, unexplained: float) -> str:
    if total["refit"] < gaps.LEAST:
        return "none"
    if not named:
        return "unknown" if structured else "none"
    return "partial" if structured and unexplained > RESIDUAL_OF_KNOWN else "known"


def _beyond_noise(problem: Problem, fit: Fit, gap: float) -> bool:
    """Whether there is a residual: in the gap, or in what the gap does not count, the bus and angles as well as
    speeds."""
    return gap >= gaps.LEAST or float(fit.residual @ fit.residual) >= (1.0 + FAINT) * problem.size


def _correlated(problem: Problem, fit: Fit) -> bool:
    """Whether what a fit leaves is no white noise: it follows itself, or displacements over a second, which average a
    sample's noise, are off by more than chance."""
    # Of angles and poses displacements are compared.
    moves = [k for k in np.unique(problem.channels_of) if CHANNELS[k].startswith(("x", "y", "th"))]
    for k in moves:
        mine = fit.residual[problem.channels_of == k]
        chance = 1.0 + SIGNIFICANT * np.sqrt(2.0 / len(mine))
        if float(np.mean(mine**2)) > max(chance, gaps.LEAST**2):
            return True
    return correlated(fit.residual, problem.channels_of, SIGNIFICANT, moves)


def _louder(problem: Problem, fit: Fit) -> list[str]:
    """Channels whose residuals are white and larger than declared: a sensor that is noisier than its file says."""
    found = []
    for k in np.unique(problem.channels_of):
        mine = problem.channels_of == k
        name = CHANNELS[k]
        # Of angles and poses displacements are compared, which have other samples than the log.
        if not name.startswith(("v_bus", "i_", "w_", "gyro_z")):
            continue
        unit = problem.robot.known_noise(name) / problem.declared.known_noise(name)
        times = float(np.sqrt(np.mean(fit.residual[mine] ** 2))) * unit
        if times < gaps.LEAST:
            continue
        if not correlated(fit.residual[mine], problem.channels_of[mine], SIGNIFICANT):
            found.append(
                f"{name}: its residuals are white, as of a sensor {times:.2g} times as noisy as [sensors] says"
            )
    return found


def _round(value: float, digits: int = 5) -> float:
    return float(f"{value:.{digits}g}")


def with_forms(
    problem: Problem, fit: Fit, known: dict[Key, tuple[float, float] | None], shapes: Forms
) -> tuple[Fit, dict[Key, tuple[float, float] | None]]:
    """The fit whose values are written, and intervals of its effects: of forms the one of all together.

    A form was fitted along with effects and tolerances, and closes with their values only. An interval keeps its width
    about the value as it is then, within the parameter's bounds.
    """
    if shapes.fit is None:
        return fit, known
    before, after = (dict(zip(one.hypothesis, one.values)) for one in (fit, shapes.fit))
    moved: dict[Key, tuple[float, float] | None] = {}
    for (cause, name), within in known.items():
        if within is not None:
            by = after[cause][name] - before[cause][name]
            p = next(p for p in problem.effects[cause[0]].parameters if p.name == name)
            within = min(max(within[0] + by, p.low), p.high), min(max(within[1] + by, p.low), p.high)
        moved[cause, name] = within
    return shapes.fit, moved


def _effect(
    problem: Problem,
    attribution: Attribution,
    fit: Fit,
    one: EffectEvidence,
    held: HeldOut,
    known: dict[Key, tuple[float, float] | None],
) -> dict:
    effect, values = problem.effects[one.cause[0]], dict(zip(fit.hypothesis, fit.values))[one.cause]
    entry = {}
    for p in effect.parameters:
        name, _, unit = p.reported(problem.robot.axis)
        within = known[one.cause, p.name]
        entry[name] = {
            "value": _round(unit * values[p.name]),
            "ci90": None if within is None else [_round(unit * end) for end in within],
        }
    probability = one.probability * attribution.share(one.cause)
    return {
        **_named(problem, one.cause),
        "subsystem": effect.subsystem,
        "probability": _round(probability, 4),
        "parameters": entry,
        "gap_without": _round(held.without[one.cause]),
    }


def _scatter(much: float, setting: str | None) -> dict:
    return {"scatter": _round(much, 3), "scatters_with": setting}


def _nominal_fit(problem: Problem, fit: Fit) -> dict:
    result: dict[str, dict[str, float]] = {}
    for z, nuisance in zip(fit.z, problem.nuisances):
        if abs(z) < MOVED and not nuisance.estimated or SETUP.keys() & nuisance.keys.keys():
            continue
        for key, value in nuisance.values(z).items():
            for suffix in problem.robot.sides if nuisance.side is None else ("lr"[nuisance.side],):
                result.setdefault(suffix, {})[key] = _round(value, 8)
    return result


def setup_of(problem: Problem, fit: Fit) -> dict:
    """What was refitted of what surrounds the machine, its clocks and its servo's limit; nothing where all is as
    declared.
    """
    found = {
        key: _round(value, 4)
        for z, nuisance in zip(fit.z, problem.nuisances)
        if abs(z) >= MINOR_SHARE
        for key, value in nuisance.values(z).items()
        if key in SETUP
    }
    # Where the file does not say it, the answer says where it took the encoder to sit.
    if problem.robot.encoder == "wheel" and any(fit.effects[e].gives for e, _ in fit.hypothesis):
        found["encoder_at_wheel"] = 1.0
    return {"setup": found} if found else {}


def _named(problem: Problem, cause: tuple[str, str]) -> dict[str, str]:
    return {"id": cause[0], "side": _side(problem, cause)}


def _side(problem: Problem, cause: tuple[str, str]) -> str:
    """The side as it is written: a single axis has none but "left"."""
    return problem.effects[cause[0]].side_on(problem.robot.axis, cause[1])


def _alternatives(problem: Problem, attribution: Attribution, verdict: str) -> list[dict]:
    """Explanations and "unknown", best first: what the catalogue lacks is one effect more, as likely as each of its
    own; where none of these is included and a gap remains, it is what is left. Doubt of an effect is in the
    explanations without it."""
    one = 1.0 / (1.0 + len(problem.effects))
    outside = {"none": 0.0, "unknown": 1.0 - one}.get(verdict, one)
    rows: list[dict[str, Any]] = [
        {"effects": [_named(problem, cause) for cause in hypothesis], "probability": p * (1.0 - outside)}
        for hypothesis, p in attribution.alternatives
    ]
    rows.append({"effects": "unknown", "probability": outside})
    first = rows[-1] if verdict == "unknown" else rows[0]
    rows.sort(key=lambda r: (-r["probability"], r is not first))
    result: list[dict] = []
    total = 0.0
    for row in rows:
        if total >= 0.995 and row["probability"] < 0.005:
            break
        total += row["probability"]
        result.append({**row, "probability": _round(row["probability"], 4)})
    return result


def _candidates(found: Investigation, attribution: Attribution) -> list[Candidate]:
    """What was tried, best first, with the reason in words."""
    problem, store, chosen = found.problem, found.search.store, attribution.fit
    likely = dict(attribution.alternatives)
    equals = {cause for causes in attribution.indistinguishable for cause in causes[1:]}
    fits = sorted(store.fits.values(), key=lambda f: (f.hypothesis != chosen.hypothesis, store.score(f)))[:14]
    base = store.fits[()]
    rows = []
    for fit in fits:
        if fit.hypothesis == chosen.hypothesis:
            verdict, reason = (
                "included",
                (
                    "explains the runs best, each of its effects on its own evidence"
                    if fit.hypothesis
                    else "no other effect has evidence of its own with it"
                ),
            )
        elif any(h in equals for h in fit.hypothesis) and fit.hypothesis in likely:
            verdict, reason = "alike", "fits these runs as well as what is named"
        elif out := [attribution.rejected[h] for h in fit.hypothesis if h in attribution.rejected]:
            verdict, reason = "rejected", f"one of its effects {out[0]}"
        else:
            verdict, reason = (
                "rejected",
                f"is {0.5 * (store.score(fit) - store.score(chosen)):.0f} units of log evidence behind",
            )
        rows.append(
            Candidate(
                effects=[_named(problem, cause) for cause in fit.hypothesis],
                parameters=[_reported(problem, cause, values) for cause, values in zip(fit.hypothesis, fit.values)],
                improvement=_round(
                    (float(base.residual @ base.residual) - float(fit.residual @ fit.residual)) / problem.size, 4
                ),
                probability=_round(likely.get(fit.hypothesis, 0.0), 4),
                verdict=verdict,
                reason=reason,
            )
        )
    return rows


def _reported(problem: Problem, cause: tuple[str, str], values: dict[str, float]) -> dict[str, float]:
    shown = [(p.reported(problem.robot.axis), values[p.name]) for p in problem.effects[cause[0]].parameters]
    return {name: _round(unit * value, 4) for (name, _, unit), value in shown}
