"""Bandwidth and margins against closed forms."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from bywire.analysis.crossings import bandwidth, margin
from bywire.analysis.loop import LOOPS
from bywire.analysis.margins import SENSES, UNSTABLE, LoopMargins, margins, worst
from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError

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


def margins_by(**changes: float) -> LoopMargins:
    """Return margins of a stable loop, all 5 but some."""
    every = dict.fromkeys((*SENSES, "crossover"), 5.0)
    return LoopMargins(**{**every, **changes}, stable=True)  # type: ignore[arg-type]


@pytest.mark.parametrize("field", SENSES)
def test_worst_is_the_least_margin_and_the_largest_peak(field: str) -> None:
    cases = [margins_by(), margins_by(**{field: 4.0}), margins_by(**{field: 6.0})]
    bad = 6.0 if field in ("sensitivity", "complementary") else 4.0
    at = {4.0: 20.0, 6.0: 30.0}[bad]
    found = worst(cases, [10.0, 20.0, 30.0])
    assert found[field] == (bad, at)
    assert all(pair == (5.0, 10.0) for name, pair in found.items() if name != field)


def test_what_nothing_has_is_worst_nowhere() -> None:
    """A delay margin that no case has; one that only some have."""
    none, some = margins_by(delay=math.nan), margins_by(delay=7.0)
    value, at = worst([none, none], [1.0, 2.0])["delay"]
    assert math.isnan(value)
    assert at == 1.0  # nowhere worse than where it was looked first
    assert worst([none, some], [1.0, 2.0])["delay"] == (7.0, 2.0)
    with pytest.raises(ParameterError, match="give at least one value"):
        worst([], [])


def test_nothing_is_worse_than_an_unstable_loop() -> None:
    """Not even margins of zero beside peaks of 1e300."""
    awful = dict.fromkeys(SENSES, 0.0) | {"sensitivity": 1e300, "complementary": 1e300}
    rows = [margins_by(), UNSTABLE, margins_by(**awful)]
    for value, at in worst(rows, [10.0, 20.0, 30.0]).values():
        assert math.isnan(value)
        assert at == 20.0


def test_margins_of_a_loop_are_solved_and_not_read_between_points() -> None:
    loop, par = LOOPS.find("pressure"), parameters("dardanelli2010")
    found = margins(loop, par, 20e5)
    L = loop.gain(par, 20e5).response(np.array([found.crossover]))
    assert abs(complex(np.ravel(L)[0])) == pytest.approx(1.0, abs=1e-9)
