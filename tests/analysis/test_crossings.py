"""Where a response passes a level: exact on what is straight, and what counts at the ends."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bywire.analysis.crossings import (
    DROP,
    Crossing,
    disk_margin,
    fall,
    gain_crossings,
    gain_factors,
    lower_factor,
    margin_of,
    measured_margin,
    upper_factor,
)

COARSE = np.array([1.0, 4.0, 30.0, 100.0])


def power(f: np.ndarray, slope: float, phase: float) -> np.ndarray:
    """Return a gain that is 1 at 10 Hz and straight on logarithmic axes; phase in degree."""
    return (f / 10.0) ** slope * np.exp(1j * math.radians(phase))


def test_what_is_straight_is_read_exactly_between_points() -> None:
    share = math.log(10.0 / 4.0) / math.log(30.0 / 4.0)
    L = power(COARSE, -2.0, 0.0) * np.exp(1j * np.radians([-90.0, -100.0, -140.0, -150.0]))
    (at,) = gain_crossings(COARSE, L)
    assert at.frequency == pytest.approx(10.0)
    assert at.margin == pytest.approx(80.0 - 40.0 * share)
    assert at.falls


@pytest.mark.parametrize(("phase", "margin"), [(0.9, 180.9), (1.1, -178.9), (-359.0, 181.0)])
def test_a_phase_begins_between_minus_360_and_zero_or_next_to_it(
    phase: float, margin: float
) -> None:
    (at,) = gain_crossings(COARSE, power(COARSE, -1.0, phase))
    assert at.margin == pytest.approx(margin)


def test_phase_is_followed_without_jumps() -> None:
    """Down to -500 degree, in steps below 180: the margin is -320 and not 40."""
    f = np.geomspace(1.0, 10.0, 11)
    L = power(f, -1.0, 0.0) * np.exp(1j * np.radians(np.linspace(-90.0, -500.0, 11)))
    L[-1] *= 0.99
    (at,) = gain_crossings(f, L)
    assert at.margin == pytest.approx(-320.0, abs=10.0)
    assert at.distance == pytest.approx(40.0, abs=10.0)


def test_the_crossing_nearest_to_minus_one_has_the_margin() -> None:
    """Whether it rises or falls; the crossover is where the gain falls for the last time."""
    passes = [Crossing(1.0, 60.0, True), Crossing(2.0, 350.0, False), Crossing(3.0, 90.0, True)]
    assert [p.distance for p in passes] == [60.0, 10.0, 90.0]
    margin = margin_of(passes)
    assert (margin.crossover, margin.phase, margin.at) == (3.0, 350.0, 2.0)
    assert math.isnan(margin_of([Crossing(2.0, 20.0, False)]).phase)
    f = np.array([1.0, 2.0, 4.0, 8.0])
    ways = gain_crossings(f, np.array([2.0, 0.5, 2.0, 0.5]) * np.exp(-1j))
    assert [way.falls for way in ways] == [True, False, True]
    assert [way.frequency for way in ways] == pytest.approx([2.0**0.5, 2.0**1.5, 2.0**2.5])


def test_margin_of_a_measured_response() -> None:
    L = power(COARSE, -1.0, -150.0)
    margin = measured_margin(COARSE, L)
    assert (margin.crossover, margin.phase) == pytest.approx((10.0, 30.0))
    assert measured_margin(COARSE[:3], L[:3]) == margin  # only the last point lies below
    f, angles = np.array([1.0, 2.0, 4.0, 8.0]), np.radians([-100.0, -100.0, -140.0, -140.0])
    several = measured_margin(f, np.array([2.0, 0.5, 2.0, 0.5]) * np.exp(1j * angles))
    assert (several.crossover, several.phase) == pytest.approx((2.0**2.5, 40.0))
    beyond = measured_margin(COARSE, -L)  # -330 degree: 150 below -1 is 150 above it
    assert beyond.phase == pytest.approx(150.0)
    ended = measured_margin(COARSE[:2], L[:2])
    assert ended.crossover == math.inf
    assert math.isnan(ended.phase)
    never = measured_margin(COARSE, 0.05 * L)
    assert math.isnan(never.crossover)
    assert math.isnan(never.phase)
    at_one = measured_margin(COARSE, np.array([4.0, 3.0, 2.0, 1.0]) * 1j)
    assert at_one.crossover == math.inf


def test_a_fall_is_read_exactly_and_the_ends_have_their_say() -> None:
    gain = 10.0 / COARSE
    assert fall(gain, COARSE) == pytest.approx(10.0 / DROP)
    assert fall(3.0 * gain, COARSE, start=3.0) == pytest.approx(10.0 / DROP)
    ends = COARSE[[0, 2]]  # far apart, where nothing is straight: solved
    lag = np.sqrt(2.0) / np.hypot(1.0, ends)
    solved = fall(lag, ends, response=lambda f: np.sqrt(2.0) / (1.0 + 1j * f))
    assert solved == pytest.approx(math.sqrt(3.0))
    assert fall(0.05 * gain, COARSE) == 0.0  # below from the first point on
    assert fall(20.0 * gain, COARSE) == math.inf
    assert fall(np.array([1.0, 1.0, math.nan, math.nan]), COARSE) == 4.0  # stuck from there on
    assert fall(np.array([1.0, 1.0, 0.0, 2.0]), COARSE) == 4.0


def test_disk_margin_and_crossings_of_the_negative_axis() -> None:
    assert disk_margin(np.array([1.0, 1j, -0.5])) == pytest.approx(2.0 / 3.0)
    assert disk_margin(np.array([-3.0 + 0j, 1.0])) == pytest.approx(1.0)


def test_factors_are_those_of_the_negative_axis_alone() -> None:
    turning = np.array([1j, -1 + 1j, -1 - 1j, 1 - 1j, 1 + 1j, -4 + 1j, -4 - 1j, -0.1 - 1j, 1 + 1j])
    factors = gain_factors(np.arange(1.0, 10.0), turning)
    assert [each.factor for each in factors] == pytest.approx([1.0, 0.25])
    assert upper_factor(factors).factor == math.inf
    assert lower_factor(factors).factor == pytest.approx(0.25)
