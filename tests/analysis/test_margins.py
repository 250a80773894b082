"""Bandwidth and margins against closed forms."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from bywire.analysis.crossings import bandwidth, margin

Array = NDArray[np.float64]


def test_margin_of_an_integrator_with_delay() -> None:
    """L = wc/s e^(-sT): crossover at wc, margin 90 degree less wc T."""
    crossover, delay = 7.0, 0.02

    def loop(f: Array) -> NDArray[np.complex128]:
        s = 2j * math.pi * f
        return np.asarray(2.0 * math.pi * crossover / s * np.exp(-s * delay))

    found = margin(loop, (0.1, 20.0))
    assert found.crossover == pytest.approx(crossover, rel=1e-9)
    assert found.phase == pytest.approx(90.0 - 360.0 * crossover * delay, abs=1e-6)


def test_unstable_loop_has_a_negative_margin() -> None:
    def loop(f: Array) -> NDArray[np.complex128]:
        return np.asarray(100.0 / (1.0 + 1j * f) ** 3)

    found = margin(loop, (0.01, 100.0))
    expected = 180.0 - 3.0 * math.degrees(math.atan(found.crossover))
    assert found.phase == pytest.approx(expected, abs=1e-6)
    assert found.phase < 0.0


def test_loop_that_stays_below_one_has_no_crossover() -> None:
    found = margin(lambda f: 0.5 / (1.0 + 1j * f), (0.01, 100.0))
    assert math.isnan(found.crossover)
    assert math.isnan(found.phase)


def test_bandwidth_of_a_lag() -> None:
    def lag(f: Array) -> NDArray[np.complex128]:
        return np.asarray(3.0 / (1.0 + 1j * f / 12.5))

    assert bandwidth(lag, (1e-4, 1e3)) == pytest.approx(12.5, rel=1e-6)
    assert math.isnan(bandwidth(lag, (1e-4, 10.0)))
