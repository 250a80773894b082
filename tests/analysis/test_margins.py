"""Bandwidth and margins against closed forms."""

import math

import control
import numpy as np
import pytest
from numpy.typing import NDArray
from small_linear_models import model_of

from bywire.analysis.crossings import bandwidth, margin
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.loop import LOOPS
from bywire.analysis.loop_figures import LoopFigures
from bywire.analysis.margins import MARGINS, UNSTABLE, LoopMargins, margins, margins_of, worst
from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError
from bywire.synthesis.linear_case import read, room, slack, values_of

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
    every = dict.fromkeys(MARGINS, 5.0)
    return LoopMargins(**{**every, **changes}, stable=True)  # type: ignore[arg-type]


@pytest.mark.parametrize("field", sorted(MARGINS.keys() - {"crossover"}))
def test_worst_is_the_least_margin_and_the_largest_peak(field: str) -> None:
    cases = [margins_by(), margins_by(**{field: 4.0}), margins_by(**{field: 6.0})]
    bad = 6.0 if field in ("lower_gain", "sensitivity", "complementary") else 4.0
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
    awful = dict.fromkeys(MARGINS, 0.0) | {"sensitivity": 1e300, "complementary": 1e300}
    rows = [margins_by(), UNSTABLE, margins_by(**awful)]
    for value, at in worst(rows, [10.0, 20.0, 30.0]).values():
        assert math.isnan(value)
        assert at == 20.0


def closed_by_hand(num: list[float], den: list[float], period: float) -> LoopFigures:
    """Return the figures of a loop gain that is held for a sample time, or continuous."""
    system = control.ss(control.tf(num, den))
    if period:
        system = control.sample_system(system, period, "zoh")
    A, B, C, D = system.A, system.B, system.C, system.D
    back = 1.0 / (1.0 + D[0, 0])
    closed = model_of(A - B @ C * back, B * back, C * back, D * back, period)
    return LoopFigures(model_of(A, B, C, D, period), closed, 2000, exact=True)


def is_stable_with(factor: float, L: LinearModel) -> bool:
    """Return whether the poles of a loop closed with a factor are stable, from its matrices."""
    back = factor / (1.0 + factor * L.D[0, 0])
    poles = np.linalg.eigvals(L.A - L.B @ L.C * back)
    return bool(np.abs(poles).max() < 1.0 if L.period else poles.real.max() < 0.0)


TURN = 2.0 * math.pi
TWO_SIDED = {
    "unstable plant, held": ([20 * TURN], [1, -10 * TURN], 1e-3, 0.5, 15.9207),
    "unstable plant": ([20 * TURN], [1, -10 * TURN], 0.0, 0.5, math.inf),
    "two integrators and two zeros, held": (
        [40, 480, 1440],
        [1, 0, 0, 0],
        1e-3,
        0.0754446,
        50.0001,
    ),
    "two integrators and two zeros": ([40, 480, 1440], [1, 0, 0, 0], 0.0, 0.075, math.inf),
    "three lags": ([4], [1, 3, 3, 1], 0.0, 0.0, 2.0),
    "positive feedback at rest": ([-0.5], [1, 1], 0.0, 0.0, 2.0),
    "slow unstable plant": ([4e-4], [1, -2e-4], 0.0, 0.5, math.inf),
}


@pytest.mark.parametrize("name", TWO_SIDED)
def test_gain_margins_in_both_directions_are_where_the_closed_loop_turns_unstable(
    name: str,
) -> None:
    num, den, period, lower, upper = TWO_SIDED[name]
    figures = closed_by_hand(num, den, period)
    found = margins_of(figures)
    assert found.gain == pytest.approx(upper, rel=1e-5)
    assert found.lower_gain == pytest.approx(lower, rel=2e-4, abs=1e-9)
    assert figures.lower_gain_margin == found.lower_gain
    for factor, inward in ((found.gain, 0.999), (found.lower_gain, 1.001)):
        if 0.0 < factor < math.inf:
            assert is_stable_with(factor * inward, figures.gain)
            assert not is_stable_with(factor / inward, figures.gain)
            L = figures.gain.response([found.gain_at if factor > 1 else found.lower_gain_at])
            assert complex(L[0, 0, 0]) * factor == pytest.approx(-1.0, rel=1e-6)


def test_a_loop_without_gain_has_no_figures_and_is_worst() -> None:
    figures = closed_by_hand([0.0], [1.0, 1.0], 1e-2)
    found = margins_of(figures)
    assert (found.stable, found.has_loop, found.state) == (True, False, "no loop")
    assert not figures.has_loop
    assert all(math.isnan(getattr(found, field)) for field in MARGINS)
    assert all(math.isnan(value) for value in values_of(figures).values())
    for requirement in read(["gain_margin >= 2", "overshoot <= 5 %", "bandwidth >= 1 Hz"]):
        assert room(figures, requirement) == slack(figures, requirement) == -math.inf
    for value, at in worst([margins_by(), found], [1.0, 2.0]).values():
        assert math.isnan(value)
        assert at == 2.0


def test_margins_of_a_loop_are_solved_and_not_read_between_points() -> None:
    loop, par = LOOPS.find("pressure"), parameters("dardanelli2010")
    found = margins(loop, par, 20e5)
    L = loop.gain(par, 20e5).response(np.array([found.crossover]))
    assert abs(complex(np.ravel(L)[0])) == pytest.approx(1.0, abs=1e-9)
