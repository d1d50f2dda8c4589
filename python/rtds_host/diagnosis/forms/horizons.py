"""Forms of an axis that was searched over pieces of its runs: over whole runs other minima are found.

A piece starts from the measured state, whose noise a curve makes up for, and so the misfit over pieces has local minima
of its own. The search for forms is therefore repeated over whole runs. Errors on held-out runs, over both horizons,
decide between the two (`choice`).
"""

from __future__ import annotations

from collections.abc import Mapping

from rtds_host.diagnosis.fit import Fit, Fitter
from rtds_host.diagnosis.forms.fits import STEPS, Cause, renewed
from rtds_host.diagnosis.forms.search import LEAST_GAP, Found, searched
from rtds_host.diagnosis.problem import Problem


def searched_over_both(
    problem: Problem, fit: Fit, quick: bool, lacking: Mapping[Cause, Fit] | None
) -> tuple[Problem, Found]:
    """Forms as `searched` finds them, and what they were fitted to; of an explanation over pieces, whole runs as well.

    Parameters
    ----------
    fit, lacking : of `problem`, see `searched`.
    """
    found = searched(problem, fit, quick, lacking)
    if not problem.pieces or found.judged[-1].gap <= LEAST_GAP:
        return problem, found
    whole = Problem(problem.case, problem.threads)
    without = {cause: fitted_to(whole, one) for cause, one in (lacking or {}).items()}
    by_runs = searched(whole, fitted_to(whole, fit), quick, without)
    if by_runs.forms and by_runs.judged[-1].gap < found.judged[-1].gap:
        return whole, by_runs
    return problem, found


def fitted_to(problem: Problem, fit: Fit) -> Fit:
    """An explanation fitted to another problem of the same case, from the sizes that it has."""
    fitter = Fitter(problem, fit.start)
    fitter.effects = fit.effects
    problem.follow_angles(True)
    found = fitter.fit(fit.hypothesis, fit.u, fit.z, problem.white(), STEPS)
    problem.follow_angles(False)
    return renewed(problem, found)
