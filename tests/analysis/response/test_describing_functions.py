"""Known elements: their describing functions come back out of the measured response."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bywire.analysis.response.frequency_response import frequency_response
from bywire.analysis.response.sweep import Sweep
from systems.backlash import BACKLASH, Backlash, backlash
from systems.describing import (
    RUBBING,
    SATURATION,
    SWINGING,
    Rubbing,
    Saturation,
    Swinging,
    at_rest,
    rubbing,
    saturation,
    swinging,
)


def measured(model, par, f: float, sizes):
    sweep = Sweep(("u",), "y", (f,), tuple(sizes), flags=("flag",), tolerance=1e-5)
    found = frequency_response(at_rest(model, par), sweep).isel(variant=0, frequency=0)
    assert found["settled"].values.all()
    value = found["gain"].values * np.exp(1j * np.radians(found["phase"].values))
    return value, found, float(found["frequency"])


def test_saturation() -> None:
    sizes = np.array([0.5, 1.0, 1.2, 2.0, 5.0, 50.0]) * SATURATION.limit
    value, found, f = measured(Saturation(), SATURATION, 8.0, sizes)
    exact = [saturation(size, SATURATION, f) for size in sizes]
    np.testing.assert_allclose(value, exact, rtol=1e-5)
    share = [1.0 - 2.0 / math.pi * math.asin(min(SATURATION.limit / size, 1.0)) for size in sizes]
    np.testing.assert_allclose(found["share_flag"], share, atol=1e-3)


def test_friction() -> None:
    """A mass that sticks for a part of the time, and one that always slides."""
    sizes = np.array([1.1, 1.4, 1.8, 1.9, 3.0, 20.0]) * RUBBING.F_c
    value, found, f = measured(Rubbing(), RUBBING, 5.0, sizes)
    exact, share = zip(*(rubbing(size, RUBBING, f) for size in sizes), strict=True)
    np.testing.assert_allclose(value, exact, rtol=5e-4)
    np.testing.assert_allclose(found["share_flag"], share, atol=1e-3)


def test_backlash() -> None:
    sizes = np.array([1.05, 1.3, 2.0, 5.0, 50.0]) * BACKLASH.play
    value, _, f = measured(Backlash(), BACKLASH, 2.0, sizes)
    np.testing.assert_allclose(value, [backlash(s, BACKLASH, f) for s in sizes], rtol=5e-4)


@pytest.mark.parametrize(
    ("model", "par", "size"),
    [(Rubbing(), RUBBING, 0.99 * RUBBING.F_c), (Backlash(), BACKLASH, 0.99 * BACKLASH.play)],
)
def test_below_friction_and_play_there_is_no_gain(model, par, size) -> None:
    value, found, _ = measured(model, par, 5.0, [size])
    assert np.isnan(value).all()
    assert found["share_flag"] == 1.0
    assert np.isnan(found["coherence"]).all()


def test_coherence_is_the_share_of_the_power_at_the_line() -> None:
    size = 1e4 * SATURATION.limit  # clipped to a square wave, whose harmonics fall with their order
    _, found, f = measured(Saturation(), SATURATION, 8.0, [size])
    k = np.arange(1.0, 400.0, 2.0)
    line = 1.0 / k**2 / (1.0 + (2.0 * math.pi * f * k * SATURATION.tau) ** 2)
    assert found["coherence"].item() == pytest.approx(line[0] / line.sum(), rel=1e-5)
    assert found["distortion"].item() ** 2 == pytest.approx(line[1:5].sum() / line[0], rel=1e-3)


def test_what_never_repeats_comes_with_its_scatter() -> None:
    f, par = 8.0, SWINGING
    sweep = Sweep(("u",), "y", (f,), (1.0,), flags=(), most=11)
    found = frequency_response(at_rest(Swinging(), par), sweep).squeeze()
    f = float(found["frequency"])
    length = round(max(2.0, math.ceil(0.05 * f))) / f
    t = np.arange(0.0, length - 1e-9, par.T_s)
    wave = np.exp(-2j * math.pi * f * t)
    seen = np.array(
        [2j * np.mean(swinging(t + n * length, 1.0, par, f) * wave) for n in range(3, 11)]
    )
    assert found["settled"] == 0
    assert found["windows"] == 11
    assert found["gain"].item() == pytest.approx(abs(seen.mean()), rel=1e-3)
    scatter = math.sqrt(np.mean(np.abs(seen - seen.mean()) ** 2)) / abs(seen.mean())
    assert scatter > 0.05
    assert found["scatter"].item() == pytest.approx(scatter, rel=1e-2)
