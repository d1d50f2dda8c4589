"""Backward elimination: forms that a later form makes needless.

A form is added next to those that there are (forward selection), and the first of them may have stood in for another
equation's. So after each addition the earlier ones are left out in turn, with all else fitted again, and the same
criterion decides. Forward steps with such a check are stepwise selection (M. A. Efroymson, "Multiple Regression
Analysis", in: Mathematical Methods for Digital Computers, 1960).
"""

from __future__ import annotations

from collections.abc import Sequence

from rtds_host.diagnosis.choice import MAX_RESIDUAL_RATIO, HeldOutScore, pooled
from rtds_host.diagnosis.forms.curves import Form
from rtds_host.diagnosis.forms.fits import derived, refitted_without, renewed
from rtds_host.diagnosis.problem import Problem

# A form and its side.
Sided = tuple[Form, str]


def supported(with_it: HeldOutScore, without_it: HeldOutScore) -> bool:
    """Whether held-out runs and the evidence both support a form."""
    return pooled(with_it, without_it) <= MAX_RESIDUAL_RATIO and with_it.fit.score < without_it.fit.score


def eliminated(
    problem: Problem, judged: Sequence[HeldOutScore], forms: Sequence[Sided]
) -> tuple[list[HeldOutScore], list[Sided]]:
    """The explanations and the forms without those that are not supported any more, the most needless one first.

    Parameters
    ----------
    judged : the explanation without any form and with one after the other; forms : these, the latest one last. That one
        was taken next to the others, so it is left out itself only once one of these is gone.
    """
    kept, now, checked = list(forms), judged[-1], list(forms[:-1])
    while checked:
        fits = refitted_without(problem, now.fit, [(form.id, side) for form, side in checked])
        fewer = [HeldOutScore.in_few_steps(problem, fit) for fit in fits]
        needless = [(less.gap, k) for k, less in enumerate(fewer) if not supported(now, less)]
        if not needless:
            break
        _, k = min(needless)
        now = fewer[k]
        kept.remove(checked[k])
        checked = list(kept)
    if len(kept) == len(forms):
        return list(judged), kept
    if not kept:
        return [judged[0]], kept
    # What each form closes is a difference between explanations that have the forms before it.
    chain = [HeldOutScore.in_few_steps(problem, renewed(problem, derived(problem, now.fit)))]
    for form, side in reversed(kept[1:]):
        (fit,) = refitted_without(problem, chain[0].fit, [(form.id, side)])
        chain.insert(0, HeldOutScore.in_few_steps(problem, fit))
    return [judged[0], *chain], kept
