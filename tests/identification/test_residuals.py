"""The test of nested models: how often it cries wolf, and what it sees."""

from __future__ import annotations

import numpy as np
from scipy import signal

from bywire.identification.residuals import lack_of_fit

X = np.linspace(-1.0, 1.0, 200)
RICHER = np.vander(X, 4)


def left_over(e: np.ndarray) -> np.ndarray:
    A = np.vander(X, 2)
    return e - A @ np.linalg.lstsq(A, e, rcond=None)[0]


def holds(e: np.ndarray) -> bool:
    return lack_of_fit("fit", left_over(e), np.ones(X.size), RICHER, 2, "").holds


def test_noise_is_let_pass_white_or_colored() -> None:
    white = [np.random.default_rng(seed).normal(size=X.size) for seed in range(300)]
    slow = [signal.lfilter([1.0], [1.0, -0.7], e) for e in white]
    assert sum(not holds(e) for e in white) <= 3
    assert sum(not holds(e) for e in slow) <= 9


def test_a_bend_is_seen() -> None:
    noise = np.random.default_rng(1).normal(size=X.size)
    assert not holds(noise + 1.0 * X**2 * 3.0)


def test_the_value_is_that_of_a_plain_comparison() -> None:
    e = left_over(np.random.default_rng(2).normal(size=X.size))
    rest = e - RICHER @ np.linalg.lstsq(RICHER, e, rcond=None)[0]
    wanted = ((e @ e - rest @ rest) / 2) / ((rest @ rest) / (X.size - 4))
    found = lack_of_fit("fit", e, np.ones(X.size), RICHER, 2, "")
    np.testing.assert_allclose(found.value, wanted, rtol=1e-10)


def test_too_few_readings_judge_nothing() -> None:
    found = lack_of_fit("fit", np.ones(4), np.ones(4), np.vander(np.arange(4.0), 4), 2, "bend")
    assert found.holds
    assert "too few readings" in found.note
