"""Fits that leave more than noise never pass in silence, and intervals hold for measured noise."""

from __future__ import annotations

import tracemalloc
import warnings
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from bywire.core.errors import SolverError
from bywire.identification import Estimate, MisfitWarning, Problem, Unknown, estimate
from bywire.identification.confidence import uncertainty
from bywire.identification.equation import _require_told
from bywire.identification.estimate import Part

Array = NDArray[np.float64]

T = np.arange(0.0, 10.0, 5e-3)
NOISE = 1e-3


def ringing(stiffness: float, damping: float, t: Array = T) -> Array:
    """Return how a mass of 1 kg on a spring rings off from 1 m."""
    swing = np.sqrt(stiffness - damping**2)
    return np.asarray(np.exp(-damping * t) * np.cos(swing * t))


def fit_of(
    measured: Array,
    noise: float = NOISE,
    start: float = 40.0,
    size: float = 1.0,
    finer: Array | None = None,
) -> Estimate:
    """Return stiffness and damping of what rang off; ``finer``: what half steps change."""
    unknowns = (Unknown("k", start, 1.0, 400.0, 40.0, "N/m"), Unknown("d", 0.1, 0.0, 2.0, 0.1))

    def evaluate(values: Array) -> tuple[Array, Array]:
        steps = np.array([1e-5, 1e-7])
        J = np.column_stack(
            [
                (ringing(*(values + e)) - ringing(*(values - e))) / (2.0 * h)
                for e, h in zip(np.diag(steps), steps, strict=True)
            ]
        )
        return (ringing(*values) - measured) / noise, J / noise

    def in_half_steps(values: Array) -> tuple[Array, Array]:
        r, J = evaluate(values)
        return r + finer / noise, J

    return estimate(
        Problem(
            unknowns,
            evaluate,
            parts=(Part("x", "", T.size, "m", noise, float(np.std(measured)), size),),
            finer=None if finer is None else in_half_steps,
        )
    )


def noise(seed: int, size: float = NOISE) -> Array:
    return np.random.default_rng(seed).normal(0.0, size, T.size)


def hardening(t: Array) -> Array:
    """Return a mass whose spring hardens: its frequency falls as it rings off."""
    damping, phase = 0.1, np.cumsum(np.sqrt(36.0 + 3.0 * np.exp(-0.2 * t))) * (t[1] - t[0])
    return np.asarray(np.exp(-damping * t) * np.cos(phase))


def test_a_barely_damped_model_that_is_wrong_is_warned_of() -> None:
    with pytest.warns(MisfitWarning, match=r"x: the residual is .* mm, .* times the noise"):
        fit = fit_of(hardening(T) + noise(1))
    low, high = fit.intervals()[0]
    assert not low < 36.0 < high  # the stiffness of small motion
    assert any("the intervals are invalid" in note for note in fit.notes)
    assert fit.leftovers()[0].over_noise > 20.0
    assert "the intervals are invalid" in str(fit)


@pytest.mark.parametrize("stored", [float, np.float32], ids=["double", "single"])
@pytest.mark.parametrize("rest", [0.0, 30.0])
def test_what_rounding_leaves_is_no_misfit(stored: type, rest: float) -> None:
    """A record of the model itself, stored in so many digits: 36 N/m come back."""
    measured = (ringing(36.0, 0.1) + rest).astype(stored).astype(float) - rest
    with warnings.catch_warnings():
        warnings.simplefilter("error", MisfitWarning)
        fit = fit_of(measured, size=1.0 + rest)
    assert fit["k"] == pytest.approx(36.0, rel=1e-5)
    assert fit.is_exact
    assert any("the residual is only rounding" in note for note in fit.notes)


def test_a_misfit_of_a_millionth_is_still_one() -> None:
    with pytest.warns(MisfitWarning, match="model is incomplete or wrong"):
        fit = fit_of(ringing(36.0, 0.1) + 1e-6 * np.sin(T) * T)
    assert not fit.is_exact


@pytest.mark.parametrize(("off", "is_said"), [(3e-4, False), (3e-6, True)])
def test_what_the_step_of_the_simulation_explains_is_no_misfit(off: float, is_said: bool) -> None:
    """Half steps change the model by more, or by less, than it leaves."""
    measured = ringing(36.0, 0.1) + 1e-5 * np.sin(T)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", MisfitWarning)
        fit = fit_of(measured, finer=off * np.cos(0.7 * T))
    assert is_said == any("model is incomplete" in str(each.message) for each in said)
    assert fit.leftovers()[0].numerical == pytest.approx(off / np.sqrt(2.0), rel=0.2)


@pytest.mark.parametrize("kind", ["white", "wrong scale", "rounded", "spikes", "filtered"])
def test_what_is_noise_is_not_warned_of(kind: str) -> None:
    """Also where it was assumed ten times too small, or is the rounding of an encoder."""
    measured = ringing(36.0, 0.1) + noise(2)
    if kind == "rounded":
        measured = np.round(ringing(36.0, 0.1) / 0.02) * 0.02
    if kind == "spikes":
        measured[::97] += 0.3
    if kind == "filtered":
        e = noise(3)
        for k in range(1, T.size):
            e[k] += 0.7 * e[k - 1]
        measured = ringing(36.0, 0.1) + e
    with warnings.catch_warnings():
        warnings.simplefilter("error", MisfitWarning)
        fit = fit_of(measured, noise=0.1 * NOISE if kind == "wrong scale" else NOISE, start=37.0)
    assert not any("are invalid" in note for note in fit.notes)


def test_what_is_left_has_the_unit_of_what_was_measured() -> None:
    fit = fit_of(ringing(36.0, 0.1) + noise(4), noise=7.0 * NOISE, start=37.0)
    (left,) = fit.leftovers()
    assert left.rms == pytest.approx(NOISE, rel=0.05)
    spread = np.std(ringing(36.0, 0.1))
    assert left.fit == pytest.approx(100.0 * (1.0 - NOISE / spread), abs=0.05)
    assert fit.rms == pytest.approx(1.0 / 7.0, rel=0.05)
    assert "residual of x 0.992 mm, fit 99.8 %" in str(fit)


def coverage(kind: str, count: int = 150, n: int = 800) -> tuple[float, float]:
    """Return how often the interval of a slope holds it, and claimed over real deviation."""
    hits, claimed, errors = [], [], []
    for seed in range(count):
        random = np.random.default_rng(seed)
        x = random.normal(size=n)
        J, e = np.column_stack((np.ones(n), x)), random.normal(size=n)
        if kind == "grows with the signal":
            e = e * x
        if kind == "differs by stretch":
            e = 0.3 * e + x * np.repeat(random.normal(size=10) * 0.3, n // 10)
        values = np.linalg.lstsq(J, e, rcond=None)[0]
        sure = uncertainty(J, e - J @ values)
        deviation = np.sqrt(sure.covariance[1, 1])
        hits.append(abs(values[1]) < stats.t.ppf(0.975, sure.freedom) * deviation)
        claimed.append(deviation)
        errors.append(values[1])
    return float(np.mean(hits)), float(np.sqrt(np.mean(np.square(claimed))) / np.std(errors))


@pytest.mark.parametrize("kind", ["white", "grows with the signal", "differs by stretch"])
def test_intervals_hold_for_noise_that_goes_with_the_signal(kind: str) -> None:
    """White residuals whose size goes with the regressor: the plain formula holds 70, 20 in 100."""
    held, claimed = coverage(kind)
    assert 0.88 <= held <= 0.99
    assert 0.75 <= claimed <= 1.25


def test_what_the_data_tells_is_asked_in_memory_that_grows_with_it() -> None:
    """An equation over a long record: no matrix of samples by samples."""
    W = np.random.default_rng(1).normal(size=(4000, 3))
    tracemalloc.start()
    _require_told(W, [Unknown(name, 1.0) for name in "abc"])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20 * W.nbytes


def slope_of(shift: float, off: float = 0.0) -> Estimate:
    """Return a slope under noise that half steps move by ``shift``; further off, they fail."""
    y = 2.0 * T + noise(4)

    def evaluate(moved: float, values: Array) -> tuple[Array, Array]:
        return ((values[0] + moved) * T - y) / NOISE, T[:, None] / NOISE

    def finer(values: Array) -> tuple[Array, Array]:
        if off:
            raise SolverError("left the numbers")
        return evaluate(shift, values)

    unknown = Unknown("a", 1.0, scale=1.0, unit="m/s")
    return estimate(Problem((unknown,), partial(evaluate, 0.0), finer=finer))


def test_an_error_from_the_step_beyond_the_interval_is_warned_of() -> None:
    with pytest.warns(
        MisfitWarning, match=r"a has an error of about 0\.0013 m/s from the simulation step"
    ):
        coarse = slope_of(1e-3)
    assert coarse.step_errors == pytest.approx([4e-3 / 3.0])
    assert "a smaller step" in coarse.notes[-1]
    with warnings.catch_warnings():
        warnings.simplefilter("error", MisfitWarning)
        fine = slope_of(1e-7)
    assert fine.step_errors == pytest.approx([4e-7 / 3.0])


def test_half_steps_that_fail_are_said_to() -> None:
    with pytest.warns(MisfitWarning, match="is unknown: left the numbers"):
        fit = slope_of(0.0, off=1.0)
    assert fit.step_errors is None


@pytest.mark.parametrize("share", [-0.4, 0.6])
def test_intervals_hold_where_neighbors_cancel_out_or_add_up(share: float) -> None:
    """The mean of 400 readings, of whose noise a share comes again in the next one: closed form."""
    count, n, size = 200, 400, 1.0
    random = np.random.default_rng(11)
    deviations = []
    for _ in range(count):
        e = random.normal(0.0, size, n + 1)
        deviations.append(np.sqrt(uncertainty(np.ones((n, 1)), e[1:] + share * e[:-1]).covariance))
    true = size * (1.0 + share) / np.sqrt(n)
    assert float(np.mean(deviations)) == pytest.approx(true, rel=0.15)
