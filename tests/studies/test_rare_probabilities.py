"""Methods for rare failures give the probabilities of closed forms, in intervals that hold."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from scipy import stats

from bywire.bench.requirements import read_limit
from bywire.studies.limit_state import (
    BEYOND,
    BudgetSpentError,
    importance_sampling,
    margins_of,
    subset_simulation,
)
from bywire.studies.statistics import FailureProbability

pytest.importorskip("openturns")

WEIGHTS = np.array([3.0, 2.0, 1.0, 0.0])


def plane(z, beta: float = 3.7):
    """Fail beyond a plane: with Phi(-beta)."""
    return beta - z @ (WEIGHTS / np.linalg.norm(WEIGHTS))


def both_sides(z):
    """Fail on both sides: with 2 Phi(-3.5)."""
    return 3.5 - np.abs(z[:, 0])


def corner(z):
    """Fail where a seldom single value meets a large quantity, or with a very large one."""
    choice = np.where(z[:, 0] > stats.norm.isf(0.03), 1.0, 0.0)
    return np.where((choice > 0.5) & (z[:, 1] > 2.5), -1.0, 4.0 - choice - z[:, 1])


def sphere(z):
    """Fail far from the middle, in whatever direction: a chi-squared tail."""
    return 4.9 - np.linalg.norm(z[:, :3], axis=1)


CLOSED: dict[str, tuple[Callable[..., np.ndarray], float]] = {
    "plane": (plane, float(stats.norm.sf(3.7))),
    "both sides": (both_sides, 2.0 * float(stats.norm.sf(3.5))),
    "corner": (corner, 0.03 * float(stats.norm.sf(2.5)) + 0.97 * float(stats.norm.sf(4.0))),
    "sphere": (sphere, float(stats.chi2(3).sf(4.9**2))),
}

FAR = {"far plane": (partial(plane, beta=5.2), float(stats.norm.sf(5.2)))}  # with 1e-7


def subset(margins, seed: int, level: int = 1280, **more) -> FailureProbability:
    return subset_simulation(margins, 4, level, seed, 0.95, **more)


def importance(margins, seed: int, cases: int = 1024) -> FailureProbability:
    return importance_sampling(margins, margins, 4, cases, seed, 0.95)


def require_right(found: list[FailureProbability], true: float, held: float) -> None:
    """Require that the mean is right within 3 standard errors, and that intervals hold."""
    values = np.array([each.estimate.value for each in found])
    assert {each.state for each in found} == {"done"}
    assert abs(values.mean() - true) < 3.0 * values.std(ddof=1) / np.sqrt(values.size)
    holds = [each.estimate.low <= true <= each.estimate.high for each in found]
    # Fewer than in one suite of a thousand, were the claim true.
    assert sum(holds) >= stats.binom(len(found), held).ppf(1e-3)


@pytest.mark.parametrize("name", CLOSED)
def test_subset_simulation_is_right_and_knows_how_sure_it_is(name):
    margins, true = CLOSED[name]
    require_right([subset(margins, seed) for seed in range(40)], true, 0.95)


def test_importance_sampling_is_right_and_knows_how_sure_it_is():
    require_right([importance(plane, seed) for seed in range(60)], CLOSED["plane"][1], 0.95)


def test_one_failure_in_ten_million_agrees_with_importance_sampling():
    """Each of 20 seeds, by its own standard error, and all together by their scatter."""
    margins, true = FAR["far plane"]
    reference = importance(margins, 1, 16_384).estimate
    assert abs(reference.value - true) < 3.0 * reference.variation * true
    found = [subset(margins, seed, 2560).estimate for seed in range(20)]
    values = np.array([each.value for each in found])
    stated = np.array([each.variation for each in found])
    assert np.all(np.abs(values - reference.value) < 5.0 * stated * values)
    scatter = values.std(ddof=1) / values.mean()
    assert abs(values.mean() - true) < 3.0 * scatter * true / np.sqrt(values.size)
    assert 0.4 * stated.mean() < scatter < stated.mean()  # an upper bound, but a close one


@pytest.mark.trust
@pytest.mark.parametrize("name", [*CLOSED, *FAR])
def test_intervals_of_subset_simulation_hold_what_they_claim(name):
    margins, true = {**CLOSED, **FAR}[name]
    found = [subset(margins, seed).estimate for seed in range(1000)]
    assert np.mean([each.low <= true <= each.high for each in found]) >= 0.95
    mean = np.mean([each.value for each in found])
    assert mean == pytest.approx(true, rel=0.08)  # a bias that falls with the cases of a level


@pytest.mark.trust
def test_intervals_of_importance_sampling_hold_what_they_claim():
    true = CLOSED["plane"][1]
    found = [importance(plane, seed).estimate for seed in range(1000)]
    assert np.mean([each.low <= true <= each.high for each in found]) >= 0.93


def test_a_level_that_ends_just_before_failure_is_the_last():
    found = subset(plane, 171)  # its threshold is 0.0002 above
    assert found.state == "done"
    assert found.estimate.low < CLOSED["plane"][1] < found.estimate.high
    assert found.levels[-1].margin == 0.0


def test_where_failures_lie():
    exact = WEIGHTS / np.linalg.norm(WEIGHTS)
    form = importance(plane, 1)
    assert form.first_order == pytest.approx(3.7, abs=1e-3)
    np.testing.assert_allclose(form.center, 3.7 * exact, atol=1e-2)
    for found in (form, subset(plane, 1)):
        near = found.scores
        assert near is not None
        assert plane(near[None, :])[0] <= 0.0
        assert 3.7 <= np.linalg.norm(near) < 4.3  # no failure is more probable than the exact one
        center = found.center / np.linalg.norm(found.center)
        assert center @ exact > 0.98


@pytest.mark.parametrize("method", [subset, importance])
def test_it_is_said_how_probable_other_limits_are(method):
    found = method(plane, 1)
    for margin in (0.4, 0.0, -0.3):
        near, true = found.below(margin), stats.norm.sf(3.7 - margin)
        assert near.low < true < near.high
    # As far from the limit as the figure may be off, cases count for neither side.
    assert found.outcome(0.999, 0.0) == "met"
    assert found.outcome(0.999, 0.9) == "undecided"
    assert found.outcome(0.999999, 0.0) == "missed"
    # The interval that is shown is the one that decides.
    shown = found.within(0.9)
    assert (shown.low, shown.high) == (found.below(-0.9).low, found.below(0.9).high)
    assert shown.value == found.estimate.value


@pytest.mark.parametrize("method", [subset, importance])
def test_a_seed_says_all(method):
    import openturns as ot

    first = method(plane, 3)
    ot.RandomGenerator.SetSeed(99)
    state = ot.RandomGenerator.GetState()
    again = method(plane, 3)
    assert (again.estimate, again.place) == (first.estimate, first.place)
    assert ot.RandomGenerator.GetState().getIndex() == state.getIndex()
    assert method(plane, 4).estimate != first.estimate


def limited(most: int, margins, z):
    """Admit so many batches."""
    if most <= len(limited.calls):
        raise BudgetSpentError
    limited.calls.append(len(z))
    return margins(z)


@pytest.mark.parametrize(("method", "most"), [(subset, 25), (subset, 5), (importance, 4)])
def test_a_spent_budget_is_undecided(method, most):
    limited.calls = []
    found = method(partial(limited, most, plane), 1)
    assert found.state == "budget spent"
    assert found.runs == sum(limited.calls)
    assert np.isnan(found.estimate.value)
    assert found.estimate.low == 0.0
    assert found.outcome(0.9999, 0.0) == "undecided"
    if most == 25:  # two levels are whole: no more than a hundredth fails, which may do
        assert [level.probability for level in found.levels] == pytest.approx([0.1, 0.01])
        assert found.outcome(0.97, 0.0) == "met"


def test_what_is_said_where_there_is_nothing_to_find():
    flat = importance(lambda z: np.full(len(z), 3.0), 1)
    assert (flat.state, flat.outcome(0.9, 0.0)) == ("no design point", "undecided")
    assert subset(lambda z: np.full(len(z), 3.0), 1).state == "level"
    never = subset(partial(plane, beta=40.0), 1, negligible=1e-6)
    assert (never.state, never.outcome(0.9999, 0.0)) == ("negligible", "met")
    assert never.estimate.high < 1e-4
    for method in (subset, importance):  # the middle itself fails
        always = method(lambda z: np.full(len(z), -1.0), 1)
        assert (always.estimate.value, always.outcome(0.9, 0.0)) == (1.0, "missed")
        assert always.estimate.low < 1.0


def test_cases_without_a_figure_fail():
    given = np.array([14.0, 15.0, 16.0, np.nan, np.inf])
    at_most, below, at_least = (
        read_limit("overshoot", f"{sign} 15 %", "%") for sign in ("<=", "<", ">=")
    )
    assert margins_of(given, at_most)[[0, 2, 3]].tolist() == [1.0, -1.0, BEYOND]
    assert (margins_of(given, at_most) > 0).tolist() == [True, True, False, False, False]
    assert (margins_of(given, below) > 0).tolist() == [True, False, False, False, False]
    assert (margins_of(given, at_least) > 0).tolist() == [False, True, True, False, True]

    def failing(z):  # beyond the plane no case has a result
        return np.where(plane(z) > 0.0, plane(z), BEYOND)

    assert subset(failing, 1).estimate == subset(plane, 1).estimate
    searched = importance(lambda z: np.full(len(z), BEYOND) if len(z) > 1 else plane(z), 1)
    assert searched.why == "a case of the search has no result"
