"""Filters of past samples, beside SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from bywire.data.recursive_filter import filtered, low_passed


@pytest.mark.parametrize(
    ("b", "a"),
    [
        ([0.2], [1.0, -0.8]),
        ([1.0], [1.0, -1.6, 0.9, -0.1]),
        ([0.3, 0.1, -0.2], [1.0, -0.5]),
        ([0.5, 0.5], [1.0]),
    ],
)
def test_a_filter_is_scipys(b: list[float], a: list[float]) -> None:
    x = np.random.default_rng(1).standard_normal((9000, 2))
    np.testing.assert_allclose(filtered(b, a, x), signal.lfilter(b, a, x, axis=0), atol=1e-12)
    begin = signal.lfilter_zi(b, a) * x[0, 0] if len(a) + len(b) > 2 else []
    settled, _ = signal.lfilter(b, a, x[:, 0], zi=begin)
    np.testing.assert_allclose(filtered(b, a, x[:, 0], settled=True), settled, atol=1e-12)


def test_short_signals() -> None:
    assert filtered([1.0], [1.0, -0.5, 0.2], np.empty(0)).size == 0
    np.testing.assert_allclose(filtered([0.5], [1.0, -0.5, 0.2, 0.1], np.ones(2)), [0.5, 0.75])
    settled = filtered([0.4, 0.4], [1.0, -0.5, 0.2, 0.1], np.full(1, 3.0), settled=True)
    np.testing.assert_allclose(settled, 3.0)


@pytest.mark.parametrize("f_c", [20.0, 1e-3, 1e-300])
def test_a_low_pass_begins_at_the_first_sample_however_low_its_corner(f_c):
    t = np.arange(1000) * 1e-3
    lag = -np.expm1(-2.0 * np.pi * f_c * t)  # answer to a step at the second sample
    np.testing.assert_allclose(low_passed(np.where(t > 0.0, 7.0, 5.0), f_c, 1e-3), 5.0 + 2.0 * lag)
