"""Harmonics of made-up signals."""

import math

import numpy as np
import pytest

from bywire.analysis.response.sweep import amplitudes, total_distortion


def test_harmonics_of_a_square_wave() -> None:
    t = np.arange(2000) * 1e-4
    square = np.where((50.0 * t) % 1.0 < 0.5, 1.0, -1.0)
    size = np.abs(amplitudes(t, square, 50.0, 5))
    np.testing.assert_allclose(size[[0, 2, 4]], 4.0 / (math.pi * np.array([1, 3, 5])), rtol=2e-3)
    np.testing.assert_allclose(size[[1, 3]], 0.0, atol=1e-12)
    shares = np.array([1.0 / k for k in (3, 5, 7, 9)])
    assert total_distortion(t, square, 50.0) == pytest.approx(
        math.sqrt(float(np.sum(shares**2))), rel=1e-2
    )


def test_sine_keeps_amplitude_and_phase() -> None:
    t = np.arange(1000) * 1e-3
    found = amplitudes(t, 3.0 + 2.0 * np.sin(2.0 * math.pi * 5.0 * t + 0.4), 5.0, 2)
    assert abs(found[0]) == pytest.approx(2.0)
    assert np.angle(found[0]) == pytest.approx(0.4)
    assert abs(found[1]) == pytest.approx(0.0, abs=1e-12)
    assert total_distortion(t, np.sin(2.0 * math.pi * 5.0 * t), 5.0) < 1e-12
