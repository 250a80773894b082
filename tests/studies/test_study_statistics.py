"""Intervals cover as they claim, and verdicts say no more than the cases do."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from bywire.studies.statistics import Quantile, influences, judged, quantile_ranks, share

REPEATS = 400


def quantile(values: np.ndarray, probability: float, confidence: float) -> Quantile:
    ordered = np.sort(values)
    ranks = quantile_ranks(values.size, probability, confidence)
    found = ranks.quantile(lambda rank: float(ordered[rank]))
    assert found.value == np.quantile(values, probability)
    return found


def test_shares_cover_at_least_as_often_as_they_claim():
    counts = np.random.default_rng(1).binomial(200, 0.93, REPEATS)
    held = [(s := share(int(n), 200, 0.9)).low <= 0.93 <= s.high for n in counts]
    assert np.mean(held) >= 0.9


@pytest.mark.parametrize(("count", "cases"), [(0, 1), (1, 1), (3, 64), (199, 200), (7, 10**6)])
def test_shares_and_quantiles_have_the_ends_that_scipy_looks_for(count, cases):
    for confidence in (0.5, 0.95, 0.999):
        found = share(count, cases, confidence)
        ends = stats.binomtest(count, cases).proportion_ci(confidence)
        assert (found.low, found.high) == pytest.approx((ends.low, ends.high), rel=1e-6, abs=1e-11)
    values = np.random.default_rng(count).standard_normal(min(cases, 200))
    made = quantile(values, 0.9, 0.95)
    same = stats.quantile_test(values, p=0.9).confidence_interval(0.95)
    np.testing.assert_array_equal([made.low, made.high], [same.low, same.high])


@pytest.mark.parametrize("probability", [0.05, 0.5, 0.95])
def test_intervals_of_quantiles_cover(probability):
    rng = np.random.default_rng(2)
    true = -np.log1p(-probability)
    made = [quantile(rng.exponential(size=300), probability, 0.9) for _ in range(REPEATS)]
    assert np.mean([q.low <= true <= q.high for q in made]) >= 0.87
    few = quantile(rng.exponential(size=10), 0.95, 0.9)
    assert np.isnan(few.high)  # ten cases bound no such quantile from above


def test_intervals_of_rank_correlations_cover():
    rng, true = np.random.default_rng(3), 6.0 / np.pi * np.arcsin(0.25)  # of normal ones with 0.5
    held = []
    for _ in range(REPEATS):
        x = rng.standard_normal(200)
        y = 0.5 * x + np.sqrt(0.75) * rng.standard_normal(200)
        ((found,),) = (influences(["x"], [x], y, 0.95),)
        held.append(found.low <= true <= found.high)
    assert 0.92 <= np.mean(held) <= 0.985


def test_the_strongest_comes_first_and_what_does_nothing_is_not_distinct():
    rng = np.random.default_rng(4)
    a, b, c = rng.standard_normal((3, 500))
    first, second, third = influences(["a", "b", "c"], [a, b, c], -3.0 * a + b, 0.999)
    assert [first.quantity, second.quantity, third.quantity] == ["a", "b", "c"]
    assert first.correlation < 0.0
    assert (first.is_distinct, second.is_distinct, third.is_distinct) == (True, True, False)


def test_what_follows_exactly_lies_within_its_interval():
    x = np.arange(50.0)
    for sign in (1.0, -1.0):
        (found,) = influences(["x"], [x], sign * x**3, 0.95)
        assert found.correlation == pytest.approx(sign)
        assert found.low <= found.correlation <= found.high


@pytest.mark.parametrize(
    ("met", "wanted", "outcome"),
    [
        (1000, 0.99, "met"),
        (1000, 0.999, "undecided"),
        (980, 0.999, "missed"),
        (990, 0.99, "undecided"),
    ],
)
def test_a_verdict_needs_the_whole_interval(met, wanted, outcome):
    found = share(met, 1000, 0.95)
    assert judged(found, found, wanted) == outcome


def test_cases_too_close_to_their_limit_decide_nothing():
    assert judged(share(1000, 1000, 0.95), share(900, 1000, 0.95), 0.95) == "undecided"


def test_what_a_correlated_quantity_only_inherits_is_no_influence():
    """Of two that go together, one drives the figure."""
    rng = np.random.default_rng(3)
    x = rng.multivariate_normal([0.0, 0.0], [[1.0, -0.6], [-0.6, 1.0]], 4000)
    figure = x[:, 0] + 0.5 * rng.standard_normal(4000)
    columns = [x[:, 0], x[:, 1]]
    plain = {i.quantity: i for i in influences(["a", "b"], columns, figure, 0.95)}
    apart = influences(["a", "b"], columns, figure, 0.95, is_partial=True)
    partial = {i.quantity: i for i in apart}
    assert plain["b"].correlation == pytest.approx(-0.52, abs=0.04)
    assert not partial["b"].is_distinct
    assert partial["a"].correlation == pytest.approx(0.8 / np.hypot(0.8, 0.5), abs=0.03)
