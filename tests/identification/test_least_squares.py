"""Least squares with confidence: closed forms, what the data does not tell, several starts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bywire.core.errors import ParameterError
from bywire.identification.confidence import autocorrelation, is_white, uncertainty
from bywire.identification.estimate import Part
from bywire.identification.least_squares import Problem, estimate, solve
from bywire.identification.unknown import Unknown
from raising import raises

Array = NDArray[np.float64]

T = np.linspace(0.0, 5.0, 400)
TRUTH = np.array([2.0, 0.7])


def decay(noise: Array, *, more: bool = False) -> Problem:
    """Return the fit of a exp(-b t), with a third unknown that hardly shows if asked for."""
    measured = TRUTH[0] * np.exp(-TRUTH[1] * T) + noise
    unknowns = [Unknown("a", 1.5), Unknown("b", 1.0, low=0.0)]
    unknowns += [Unknown("c", 3.0, scale=3.0)] if more else []

    def evaluate(values: Array) -> tuple[Array, Array]:
        a, b = values[:2]
        e = np.exp(-b * T)
        r, J = a * e - measured, np.column_stack((e, -a * T * e))
        if more:
            r, J = r + 1e-6 * values[2] * T, np.column_stack((J, 1e-6 * T))
        return r / 0.01, J / 0.01

    return Problem(tuple(unknowns), evaluate)


def white(seed: int, size: float = 0.01) -> Array:
    return np.random.default_rng(seed).normal(0.0, size, T.size)


def colored(seed: int) -> Array:
    e = np.random.default_rng(seed).normal(0.0, 0.01, T.size)
    for k in range(1, T.size):
        e[k] += 0.8 * e[k - 1]
    return e


@pytest.mark.parametrize("make", [white, colored])
def test_parameters_put_in_come_back_with_honest_intervals(make: object) -> None:
    found = [estimate(decay(make(seed))) for seed in range(100)]  # type: ignore[operator]
    values = np.array([f.values for f in found])
    error = values.mean(axis=0) - TRUTH
    assert np.all(np.abs(error) < 3.0 * values.std(axis=0, ddof=1) / np.sqrt(len(found)))
    inside = [(f.intervals()[:, 0] < TRUTH) & (f.intervals()[:, 1] > TRUTH) for f in found]
    coverage = np.mean(inside, axis=0)
    assert np.all((coverage >= 0.9) & (coverage <= 0.99)), coverage


def test_white_residuals_counted_as_independent_would_lie_about_colored_ones() -> None:
    """The gate of the test above can fail: the plain formula covers far too little."""
    hits = []
    for seed in range(40):
        found = estimate(decay(colored(seed)))
        r, J = decay(colored(seed)).evaluate(found.values)
        plain = np.sqrt(np.diag(np.linalg.inv(J.T @ J)) * (r @ r) / (r.size - 2))
        hits.append(np.abs(found.values - TRUTH) < 1.96 * plain)
    assert np.mean(hits) < 0.8


def test_linear_covariance_equals_the_closed_form() -> None:
    J = np.column_stack((np.ones(400), T))
    r = white(5, 1.0)
    r -= J @ np.linalg.lstsq(J, r, rcond=None)[0]
    wanted = np.linalg.inv(J.T @ J) * (r @ r) / (400 - 2)
    found = uncertainty(J, r)
    assert not found.colored
    np.testing.assert_allclose(found.covariance, wanted, rtol=1e-10)


def test_single_statements_have_no_order() -> None:
    """The same residuals, as a record and as statements: only a record has neighbors."""
    record = decay(colored(1))
    statements = replace(record, parts=tuple(Part(f"s{k}", "", 1) for k in range(T.size)))
    found, single = estimate(record), estimate(statements)
    assert found.colored
    assert not single.colored
    assert single.freedom == T.size - 2
    assert (np.diff(single.intervals()) < 0.6 * np.diff(found.intervals())).all()


def test_whiteness() -> None:
    assert sum(not is_white(white(seed)) for seed in range(200)) <= 8  # 1 in 100, by chance
    away = np.random.default_rng(2).normal(0.0, 0.01, (50, 370))
    turned = away[:, 1:] - 0.3 * away[:, :-1]  # neighbors that partly cancel out
    assert sum(not is_white(row) for row in turned) >= 48
    assert not is_white(colored(1))
    rho = autocorrelation(colored(2), 1)
    assert rho[0] == pytest.approx(1.0)
    assert rho[1] == pytest.approx(0.8, abs=0.1)


def test_what_the_data_does_not_tell_is_kept_and_named() -> None:
    found = estimate(decay(white(1), more=True))
    assert found.names == ("a", "b")
    assert [k.unknown.name for k in found.kept] == ["c"]
    assert "times its usual magnitude of 3" in found.kept[0].reason
    assert found["a"] == pytest.approx(2.0, abs=0.02)


def test_an_unknown_that_nothing_depends_on_is_named_too() -> None:
    inner = decay(white(1))

    def evaluate(values: Array) -> tuple[Array, Array]:
        r, J = inner.evaluate(values[:2])
        return r, np.column_stack((J, np.zeros(r.size)))

    found = estimate(Problem((*inner.unknowns, Unknown("d", 1.0)), evaluate))
    assert found.kept[0].unknown.name == "d"
    assert found.kept[0].reason == "no measured signal depends on it"


def test_a_prior_weighs_like_a_measurement() -> None:
    """Estimate of a mean with a prior: the closed form of two Gaussians."""
    y = np.random.default_rng(3).normal(1.0, 0.5, 50)
    unknown = Unknown("mean", 0.0, prior=(3.0, 0.1))
    problem = Problem((unknown,), lambda v: ((v[0] - y) / 0.5, np.full((50, 1), 2.0)))
    weights = np.array([50 / 0.25, 1 / 0.01])
    wanted = weights @ [y.mean(), 3.0] / weights.sum()
    assert estimate(problem)["mean"] == pytest.approx(wanted, rel=1e-9)


def test_what_is_left_tells_the_noise_of_the_data_and_not_the_priors() -> None:
    y = np.random.default_rng(3).normal(1.0, 1.0, 50)  # twice the noise that is assumed
    unknown = Unknown("mean", 0.0, prior=(1.0, 0.1))
    found = estimate(Problem((unknown,), lambda v: ((v[0] - y) / 0.5, np.full((50, 1), 2.0))))
    r = (found["mean"] - y) / 0.5
    data, prior = 50 / 0.25, 1 / 0.1**2  # the weights that both had
    scattered = (r @ r / 49 * data + prior) / (data + prior) ** 2
    assert found.deviations == pytest.approx([scattered**0.5], rel=1e-6)


def test_a_robust_loss_shrugs_off_outliers() -> None:
    spoiled = white(2)
    spoiled[::20] += 1.0
    plain, robust = (estimate(decay(spoiled), loss) for loss in ("linear", "soft_l1"))
    assert abs(plain["a"] - 2.0) > 5.0 * abs(robust["a"] - 2.0)
    assert abs(robust["a"] - 2.0) < 0.01


def test_a_prior_that_the_data_contradicts_is_named() -> None:
    y = np.random.default_rng(3).normal(1.0, 0.5, 50)
    unknown = Unknown("mean", 0.0, prior=(3.0, 0.01), unit="A")
    far = Problem((unknown,), lambda v: ((v[0] - y) / 0.05, np.full((50, 1), 20.0)))
    (note,) = estimate(far).notes
    assert "deviations from its prior (3 A ± 0.01 A)" in note
    near = replace(far, unknowns=(replace(unknown, prior=(1.0, 1.0)),))
    assert not estimate(near).notes


def test_a_value_just_inside_its_bound_lies_at_it() -> None:
    """Rough residuals keep the search from the last step; the data cannot tell the difference."""
    y = np.random.default_rng(3).normal(1.0, 0.5, 50)
    unknown = Unknown("mean", 2.0, low=1.5)

    def rough(values: Array) -> tuple[Array, Array]:
        wave = 1e-3 * np.cos(2e5 * (values[0] - 1.50003))
        return (values[0] - y) / 0.5 - wave, np.full((50, 1), 2.0)

    found = estimate(Problem((unknown,), rough))
    assert 1.5 <= found["mean"] < 1.501
    assert found.at_bounds() == {"mean": 1.5}
    assert not estimate(Problem((replace(unknown, low=0.5),), rough)).at_bounds()


def test_a_model_that_does_not_fit_is_not_sent_for_excitation() -> None:
    y = np.linspace(0.0, 5.0, 50)
    unknown = Unknown("x", 1.0, scale=1e-3)
    poor = Problem((unknown,), lambda v: ((v[0] - y) / 0.01, np.full((50, 1), 100.0)))
    with pytest.raises(ParameterError, match="The model does not fit"):
        estimate(poor)
    fair = Problem((unknown,), lambda v: ((v[0] - y) / 2.0, np.full((50, 1), 0.5)))
    with pytest.raises(ParameterError, match="Excite the system more"):
        estimate(fair)
    off = Problem((unknown,), lambda v: (y - 2.5, np.zeros((50, 1))), silent={"x": "law = none"})
    with pytest.raises(ParameterError, match=r"depends on it \(law = none\)\. Switch it on"):
        estimate(off)


def test_a_bound_that_is_met_is_said() -> None:
    problem = decay(white(1))
    tight = Problem((Unknown("a", 1.5, high=1.8), problem.unknowns[1]), problem.evaluate)
    found = estimate(tight)
    assert found["a"] == 1.8
    assert any("a is at its bound, 1.8" in note for note in found.notes)


def test_too_few_measurements_are_refused() -> None:
    problem = Problem((Unknown("a", 1.0),), lambda v: (v, np.ones((1, 1))))
    with raises(ParameterError, name="unknowns", value="1"):
        estimate(problem)


def test_an_instrument_takes_off_the_bias_of_a_noisy_input() -> None:
    """A gain of 2 whose input is measured with a tenth of its size as noise (errors in variables).

    Least squares find 2 / (1 + 0.1^2); from there, derivatives by an input without noise lead to 2.
    """
    random = np.random.default_rng(4)
    clean = random.normal(size=40000)
    seen = clean + 0.1 * random.normal(size=clean.size)
    y = 2.0 * clean + 0.1 * random.normal(size=clean.size)
    biased = 2.0 / 1.01

    def found(derivative: Array, instrument: bool) -> float:
        problem = Problem(
            (Unknown("gain", biased, scale=7.0),),
            lambda v: (v[0] * seen - y, derivative[:, None]),
            instrument=instrument,
        )
        return estimate(problem)["gain"]

    assert found(seen, False) == pytest.approx(biased, abs=0.005)
    assert found(clean, False) == pytest.approx(biased, abs=0.005)
    assert found(clean, True) == pytest.approx(2.0, abs=0.005)


def test_an_instrument_that_leads_away_from_the_least_sum_is_left() -> None:
    """An offset that the model lacks goes with it: where it leads to leaves half as much more."""
    seen = np.random.default_rng(5).normal(size=4000)
    y = 2.0 * seen + 1.0

    def found(offset: float) -> float:
        slope = (seen + offset)[:, None]
        return estimate(
            Problem((Unknown("gain", 2.0),), lambda v: (v[0] * seen - y, slope), instrument=True)
        )["gain"]

    assert found(0.0) == pytest.approx(2.0, abs=0.05)
    assert found(0.7) == pytest.approx(2.0, abs=0.05)  # and not 2.7
    assert found(0.1) == pytest.approx(2.1, abs=0.05)


def test_singular_values_are_those_of_the_jacobian_per_scale() -> None:
    problem = decay(white(1))
    scales = np.array([4.0, 0.5])
    unknowns = tuple(replace(u, scale=s) for u, s in zip(problem.unknowns, scales, strict=True))
    found = estimate(replace(problem, unknowns=unknowns))
    _, J = problem.evaluate(found.values)
    np.testing.assert_allclose(found.singular_values, np.linalg.svd(J * scales)[1])
    np.testing.assert_allclose(found.covariance, estimate(problem).covariance, rtol=1e-4)


def test_a_search_ends_where_the_residuals_are_rough() -> None:
    """Beyond what is resolved, it would follow the roughness for many more evaluations."""
    counts = []
    for resolved in (0.0, 1e-4):
        problem, seen = decay(np.random.default_rng(1).normal(0.0, 0.01, T.size)), []

        def rough(values: Array, problem: Problem = problem, seen: list[Array] = seen) -> Any:
            seen.append(values)
            r, J = problem.evaluate(values)
            return r + 1e-4 * np.sin(1e9 * values.sum() + 40.0 * T), J

        solution = solve(replace(problem, evaluate=rough, resolved=resolved), np.array([1.5, 1.0]))
        assert solution.values == pytest.approx(TRUTH, rel=0.02)
        counts.append(len(seen))
    assert counts[1] < counts[0]


def test_values_are_taken_as_they_are_without_a_search() -> None:
    problem = decay(np.random.default_rng(1).normal(0.0, 0.01, T.size))
    beside = TRUTH + 0.01
    assert estimate(problem, start=beside, search=False).values == pytest.approx(beside, rel=1e-15)
    assert estimate(problem, start=beside).values != pytest.approx(beside, rel=1e-3)
