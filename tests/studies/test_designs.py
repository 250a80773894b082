"""Points of designs: they fill the space as they should, and depend on seed and chunk alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.stats import qmc

from bywire.core.errors import ParameterError
from bywire.core.parameters import Leaf
from bywire.core.quantities import Unit
from bywire.studies.designs import SAMPLED, Sampled, spanned
from bywire.studies.distribution import read_distribution
from bywire.studies.plan import correlation_factor
from raising import raises

LEAF = Leaf("x", Unit("m"), -np.inf, np.inf, False, False)
UNIFORM = read_distribution("x", {"kind": "uniform", "low": "0 m", "high": "1 m"}, LEAF, 0.5)
NORMAL = read_distribution("x", {"kind": "normal", "mean": "0 m", "sd": "1 m"}, LEAF, 0.0)
ENDS = read_distribution("x", {"kind": "discrete", "values": ["1 m", "2 m", "3 m"]}, LEAF, 2.0)


@pytest.mark.parametrize("kind", SAMPLED)
def test_a_chunk_depends_on_seed_and_number_alone(kind):
    points = Sampled(kind, 7, [UNIFORM, NORMAL])
    later = points.values(3, 64)
    points.values(0, 64)
    np.testing.assert_array_equal(later, points.values(3, 64))
    assert not np.array_equal(later, points.values(2, 64))
    assert not np.array_equal(later, Sampled(kind, 8, [UNIFORM, NORMAL]).values(3, 64))


def test_every_chunk_of_a_latin_hypercube_is_one():
    for chunk in range(3):
        (column,) = Sampled("latin-hypercube", 1, [UNIFORM]).values(chunk, 64)
        np.testing.assert_array_equal(np.sort(np.floor(64 * column)), np.arange(64))


def test_chunks_of_a_sobol_sequence_are_one_sequence():
    points = Sampled("sobol", 5, [UNIFORM, UNIFORM])
    each = {k: np.stack(points.values(k, 64), axis=1) for k in (0, 1, 3, 2)}  # in any order
    columns = np.concatenate([each[k] for k in range(4)])
    whole = qmc.Sobol(2, rng=np.random.default_rng(5)).random(256)
    np.testing.assert_allclose(columns, whole, atol=1e-15)


def test_correlated_scores_are_as_they_were_asked_for():
    factor = correlation_factor(["a", "b"], {("a", "b"): -0.6})
    a, b = Sampled("monte-carlo", 1, [NORMAL, UNIFORM], factor).values(0, 20_000)
    assert np.corrcoef(a, stats.norm.ppf(b))[0, 1] == pytest.approx(-0.6, abs=0.02)
    assert stats.kstest(b, "uniform").pvalue > 1e-3  # each keeps its own distribution


def test_impossible_correlations_are_refused():
    pairs = {("a", "b"): 0.9, ("b", "c"): 0.9, ("a", "c"): -0.9}
    with pytest.raises(ParameterError, match="not positive definite"):
        correlation_factor(["a", "b", "c"], pairs)


def test_listed_points_begin_with_the_bench_and_reach_the_ends():
    each = [UNIFORM, ENDS]
    corners = spanned("corners", each, [0.5, 2.0], 5)
    assert sorted(zip(*corners.columns, strict=True))[0] == (0.0, 1.0)
    assert corners.columns[0][0] == 0.5
    assert spanned("grid", each, [0.5, 2.0], 4).cases == 1 + 4 * 3
    x, y = spanned("one-at-a-time", each, [0.5, 2.0], 4).columns
    assert np.count_nonzero((x != 0.5) & (y != 2.0)) == 0
    low, high = spanned("grid", [NORMAL], [0.0], 2).columns[0][1:]
    assert (low, high) == pytest.approx((-3.0, 3.0))
    with raises(ParameterError, name="[design] kind", value="grid"):
        spanned("grid", each * 8, [0.5, 2.0] * 8, 9)
    with raises(ParameterError, name="[design] kind", value="corners"):
        spanned("corners", each * 9, [0.5, 2.0] * 9, 9)
