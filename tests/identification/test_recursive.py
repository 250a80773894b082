"""Recursive estimators against closed forms and known drifts."""

from __future__ import annotations

import numpy as np
import pytest

from bywire.core.errors import ParameterError
from bywire.identification.tracking import Walk, forgetting, kalman, likeliest

N, T = 600, 0.1


def drifting(seed: int, drift: float, noise: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    steps = drift * np.sqrt(T) * random.standard_normal((N, 2))
    theta = np.array([1.0, -2.0]) + np.cumsum(steps, axis=0)
    phi = random.uniform(-1.0, 1.0, (N, 2))
    y = np.einsum("np,np->n", phi, theta) + noise * random.standard_normal(N)
    return phi, y, theta


def test_without_drift_it_is_least_squares() -> None:
    phi, y, _ = drifting(1, 0.0, 0.1)
    walk = Walk(np.zeros(2), 0.1)
    found = kalman(phi, y, T, walk, np.zeros(2), np.full(2, 1e4))
    wanted = np.linalg.lstsq(phi, y, rcond=None)[0]
    np.testing.assert_allclose(found.values[-1], wanted, rtol=1e-6)
    cov = 0.01 * np.linalg.inv(phi.T @ phi)
    np.testing.assert_allclose(found.deviations[-1], np.sqrt(np.diag(cov)), rtol=1e-5)


def test_long_memory_is_least_squares_too_and_weights_are_exponential() -> None:
    phi, y, _ = drifting(2, 0.0, 0.1)
    found = forgetting(phi, y, T, memory=1e9)
    wanted = np.linalg.lstsq(phi, y, rcond=None)[0]
    np.testing.assert_allclose(found.values[-1], wanted, rtol=1e-6)
    left = y - phi @ wanted
    cov = float(left @ left) / (N - 2) * np.linalg.inv(phi.T @ phi)
    np.testing.assert_allclose(found.deviations[-1], np.sqrt(np.diag(cov)), rtol=1e-4)
    short = forgetting(phi, y, T, memory=4.0)
    root = np.exp(-0.5 * T * np.arange(N)[::-1] / 4.0)
    wanted = np.linalg.lstsq(phi * root[:, None], y * root, rcond=None)[0]
    np.testing.assert_allclose(short.values[-1], wanted, rtol=1e-8)


def test_bands_hold_a_drift_and_the_innovations_are_white() -> None:
    inside, squares = [], []
    for seed in range(10):
        phi, y, theta = drifting(seed, 0.2, 0.1)
        walk = Walk(np.full(2, 0.2), 0.1)
        found = kalman(phi, y, T, walk, np.array([1.0, -2.0]), np.full(2, 0.5))
        inside.append(np.abs(found.values - theta) < 1.96 * found.deviations)
        square, neighbor = found.consistency()
        squares.append(square)
        assert abs(neighbor) < 4.0 / np.sqrt(N)
    assert 0.93 < np.mean(inside) < 0.97
    assert np.mean(squares) == pytest.approx(1.0, abs=0.06)
    # Without drift in the filter the same bands are wrong, and the innovations say so.
    stiff = kalman(phi, y, T, Walk(np.zeros(2), 0.1), np.array([1.0, -2.0]), np.full(2, 0.5))
    assert np.mean(np.abs(stiff.values - theta) < 1.96 * stiff.deviations) < 0.5
    assert stiff.consistency()[0] > 2.0


def test_drift_and_noise_are_found() -> None:
    walks = []
    for seed in range(2):
        phi, y, _ = drifting(seed, 0.2, 0.1)
        walks.append(likeliest(phi, y, T, np.array([1.0, -2.0]), np.ones(2)))
    assert np.mean([w.drift for w in walks]) == pytest.approx(0.2, rel=0.2)
    assert np.mean([w.noise for w in walks]) == pytest.approx(0.1, rel=0.2)


def test_samples_that_do_not_count_widen_the_band_alone() -> None:
    phi, y, _ = drifting(3, 0.2, 0.1)
    y[200:300] = np.nan
    walk = Walk(np.full(2, 0.2), 0.1)
    found = kalman(phi, y, T, walk, np.zeros(2), np.ones(2))
    assert np.all(found.values[200:300] == found.values[199])
    grown = np.sqrt(found.deviations[199] ** 2 + 100 * T * 0.2**2)
    np.testing.assert_allclose(found.deviations[299], grown, rtol=1e-9)
    with pytest.raises(ParameterError, match="too few to track 2 parameters"):
        likeliest(phi[:15], y[:15], T, np.zeros(2), np.ones(2))
