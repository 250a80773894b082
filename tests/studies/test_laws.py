"""Laws of probability: SciPy's, to the last digit, without loading it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from bywire.studies.distribution import (
    LogNormal,
    Normal,
    Triangular,
    Uniform,
    binomial_ranks,
    normal_quantile,
    ranked,
)

LAWS = {
    "uniform": (Uniform(11.0, 3.4), stats.uniform(11.0, 3.4)),
    "normal": (Normal(0.39, 0.0156), stats.norm(0.39, 0.0156)),
    "log-normal": (LogNormal(0.198, 2e-3), stats.lognorm(0.198, scale=2e-3)),
    "triangular": (Triangular(0.3, 0.85, 0.3), stats.triang(0.3, 0.85, 0.3)),
    "rising": (Triangular(1.0, -2.0, 3.0), stats.triang(1.0, -2.0, 3.0)),
    "falling": (Triangular(0.0, -2.0, 3.0), stats.triang(0.0, -2.0, 3.0)),
}


@pytest.mark.parametrize("name", LAWS)
def test_laws_have_the_quantiles_and_the_tails_of_scipy(name):
    ours, theirs = LAWS[name]
    shares = np.concatenate(([2.0**-53, 1.0 - 2.0**-53], np.random.default_rng(1).random(4096)))
    np.testing.assert_array_equal(ours.ppf(shares), theirs.ppf(shares))
    assert ours.support() == theirs.support()
    values = theirs.ppf([1e-12, 0.2, 0.31, 0.9, 1.0 - 1e-12]).tolist()
    for x in (*values, min(values) - 1.0, max(values) + 1.0, -np.inf, np.inf):
        assert ours.cdf(x) == pytest.approx(theirs.cdf(x), rel=1e-9, abs=1e-15)
        assert ours.sf(x) == pytest.approx(theirs.sf(x), rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("count", [1, 2, 17, 64, 10_048, 3_000_000])
@pytest.mark.parametrize("probability", [0.05, 0.5, 0.95])
def test_ranks_of_a_quantile_are_those_of_the_binomial_distribution(count, probability):
    law = stats.binom(count, probability)
    for beyond in (0.25, 0.025, 0.0005):
        given = binomial_ranks(count, probability, beyond)
        assert given == (int(law.ppf(beyond)), int(law.isf(beyond)))


def test_scores_and_ranks_are_those_of_scipy():
    values = np.random.default_rng(2).integers(0, 40, 300).astype(float)
    np.testing.assert_array_equal(ranked(values), stats.rankdata(values))
    shares = np.linspace(0.001, 0.999, 501)
    np.testing.assert_array_equal(normal_quantile(shares), stats.norm.ppf(shares))
