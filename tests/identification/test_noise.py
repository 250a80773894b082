"""Noise of a signal, told from itself: when it is one, and when the signal itself is seen."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from bywire.identification.measured import (
    NOISE_OF_SAMPLES,
    as_even,
    determines_its_noise,
    noise_of,
    outliers,
    robust_scale,
)


@pytest.mark.parametrize("count", [30, 130, 1300])
def test_white_noise_on_a_slow_signal_is_told(count: int) -> None:
    slow = 5.0 * np.sin(np.linspace(0.0, 6.0, count))
    for seed in range(50):
        values = slow + np.random.default_rng(seed).normal(0.0, 0.2, count)
        assert determines_its_noise(values)
    assert noise_of(values) == pytest.approx(0.2, rel=4.0 / np.sqrt(count))


def test_a_signal_that_alternates_or_is_coarse_is_no_noise() -> None:
    t, random = np.arange(130), np.random.default_rng(1)
    dither = (-1.0) ** t + random.normal(0.0, 0.1, t.size)
    assert noise_of(dither) > 1.5
    assert not determines_its_noise(dither)
    assert not determines_its_noise(np.sin(0.5 * t) + random.normal(0.0, 1e-4, t.size))


def test_what_a_converter_rounded_is_not_judged() -> None:
    steps = np.round(np.linspace(0.0, 40.0, 1000))
    assert determines_its_noise(steps)


def test_outliers_are_told_from_noise_and_from_a_wrong_model() -> None:
    r = np.random.default_rng(1).normal(size=1000)
    spoiled = r.copy()
    spoiled[::50] += 30.0
    assert robust_scale(spoiled) == pytest.approx(1.0, abs=0.1)
    assert outliers(spoiled).sum() == 20
    assert outliers(10.0 * r).mean() < 0.001  # all are too large: none stands out


def test_resampling_remembers_the_noise_of_the_samples() -> None:
    """Between two samples the noise is smaller, and neighbors share it."""
    random = np.random.default_rng(1)
    t = 1e-3 * (np.arange(1000) + random.uniform(-0.3, 0.3, 1000))
    values = np.sin(5.0 * t) + random.normal(0.0, 0.1, t.size)
    data = xr.Dataset({"p": ("time", values)}, {"time": t})
    even, said = as_even(data, multiple=1e-4)
    assert len(said) == 1
    assert round((even["time"].values[1] - even["time"].values[0]) / 1e-4, 6) == 10
    assert even["p"].attrs[NOISE_OF_SAMPLES] == pytest.approx(0.1, rel=0.1)
    assert noise_of(even["p"].values) < 0.08
