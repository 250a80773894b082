"""Jumps, loop widths and harmonics of made-up signals."""

import math

import numpy as np
import pytest
import xarray as xr

from bywire.analysis.loop_width import closed_above, widths
from bywire.analysis.response.harmonics import amplitudes, total_distortion
from bywire.bench.kpis.hysteresis import Loop
from bywire.brakes.motorcycle.paper.fig5 import jumps


def test_jumps_are_counted_with_their_heights_and_creeping_is_not() -> None:
    p = np.array([0, 0, 1, 2, 2, 2, 5, 5, 5.01, 5.01, 4, 4]) * 1e5
    stuck = np.array([1, 1, 0, 0, 1, 1, 0, 1, 0, 1, 0, 1.0])
    recording = xr.Dataset(
        {"p_mc": ("time", p), "stuck": ("time", stuck)}, coords={"time": np.arange(12.0)}
    )
    found = jumps(recording)
    np.testing.assert_allclose(found.rises, [2e5, 3e5])
    np.testing.assert_allclose(found.levels, [2e5, 5e5])
    np.testing.assert_allclose(found.times, [1.0, 5.0])
    assert jumps(recording.assign(stuck=("time", np.ones(12)))).levels.size == 0


def wedge(width: float, closed_from: float) -> Loop:
    """Return a loop that narrows linearly to nothing at a level."""
    up = np.linspace(0.0, 10.0, 101)
    half = 0.5 * width * np.clip(1.0 - up / closed_from, 0.0, None)
    y = np.concatenate((up, up[::-1][1:]))
    x = np.concatenate((up + half, (up - half)[::-1][1:]))
    return Loop(np.arange(y.size, dtype=float), x, y)


def test_widths_and_the_level_from_which_a_loop_is_closed() -> None:
    loop, levels = wedge(2.0, 5.0), np.arange(0.5, 9.9, 0.1)
    expected = 2.0 * np.clip(1.0 - levels / 5.0, 0.0, None)
    np.testing.assert_allclose(widths(loop, levels), expected, atol=1e-9)
    assert closed_above(loop, 0.4, levels) == pytest.approx(4.0, abs=0.11)
    assert closed_above(loop, 3.0, levels) == pytest.approx(levels[0])
    assert math.isnan(closed_above(loop, -1.0, levels))
    assert np.isnan(widths(loop, np.array([11.0]))[0])


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
