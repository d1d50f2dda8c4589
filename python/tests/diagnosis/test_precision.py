"""The Hessian of a fit, from which evidences and intervals follow."""

import numpy as np

from rtds_host.diagnosis.fit import Fit
from rtds_host.diagnosis.likelihood import Likelihood
from rtds_host.diagnosis.start import DECLARED


def test_it_is_positive_definite_where_sensitivities_are_large_and_nearly_alike():
    """Speeds a thousand times as fine as the model: sums of their squares, rounded to single precision, outweigh the
    prior, and variances came out negative."""
    rng, rows = np.random.default_rng(1), 20_000
    shared = rng.standard_normal(rows)
    columns = 3e4 * (shared[:, None] + 1e-4 * rng.standard_normal((rows, 4))).astype(np.float32)
    fit = Fit(
        {},
        (),
        np.zeros(4),
        np.empty(0),
        rng.standard_normal(rows),
        columns,
        np.empty((rows, 0), np.float32),
        np.ones(4, bool),
        Likelihood(np.zeros(rows, int), np.ones(1)),
        DECLARED,
    )
    assert np.linalg.eigvalsh(fit.precision)[0] > 0.0
    assert np.all(np.diag(fit.covariance) > 0.0)
