"""Figures of linear loops against closed forms: margins, peaks, bandwidth, step response."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.loop_figures import LoopFigures
from bywire.analysis.margins import UNSTABLE, margins_of


def model(A: list[list[float]], B: list[float], C: list[float], period: float = 0.0) -> LinearModel:
    n = len(A)
    return LinearModel(
        "loop",
        np.array(A),
        np.array(B)[:, None],
        np.array([C]),
        np.zeros((1, 1)),
        tuple(f"x_{k}" for k in range(n)),
        ("u",),
        ("y",),
        ("1",) * n,
        ("1",),
        ("1",),
        np.zeros(n),
        period,
    )


def lags(K: float, back: float = 0.0) -> LinearModel:
    """Return K/(1 + s)^3, fed back with a gain."""
    return model(
        [[-1.0, 0.0, -back * K], [1.0, -1.0, 0.0], [0.0, 1.0, -1.0]], [K, 0.0, 0.0], [0.0, 0.0, 1.0]
    )


class Bounded(LinearModel):
    """A continuous model that is looked at up to 50 Hz."""

    @property
    def nyquist(self) -> float:
        return 50.0


def figures(K: float, **how: object) -> LoopFigures:
    gain, closed = (Bounded(**vars(lags(K, back))) for back in (0.0, 1.0))
    return LoopFigures(gain, closed, **how)  # type: ignore[arg-type]


@pytest.mark.parametrize(("exact", "points", "rel"), [(True, 1000, 1e-9), (False, 4000, 1e-5)])
def test_three_lags(exact: bool, points: int, rel: float) -> None:
    K = 4.0
    read = figures(K, exact=exact, points=points)
    w = math.sqrt(K ** (2.0 / 3.0) - 1.0)  # where (1 + w^2)^(3/2) = K
    margin = 180.0 - 3.0 * math.degrees(math.atan(w))
    assert read.crossover == pytest.approx(w / 2.0 / math.pi, rel=rel)
    assert read.phase_margin == pytest.approx(margin, rel=10.0 * rel)
    assert read.delay_margin == pytest.approx(math.radians(margin) / w, rel=20.0 * rel)
    assert read.gain_margin == pytest.approx(8.0 / K, rel=1e-3)
    # |T| = K/|(1 + jw)^3 + K|, from K/(1 + K) at rest.
    f = np.linspace(1e-4, 1.0, 400_001)
    T = K / ((1.0 + 2j * math.pi * f) ** 3 + K)
    fallen = f[np.flatnonzero(np.abs(T) < math.sqrt(0.5) * K / (1.0 + K))[0]]
    assert read.bandwidth == pytest.approx(fallen, rel=1e-4)
    assert read.complementary_peak == pytest.approx(np.abs(T).max(), rel=1e-3)
    assert read.sensitivity_peak == pytest.approx(np.abs(1.0 - T).max(), rel=1e-3)
    assert read.disk_margin == pytest.approx(2.0 / np.abs(1.0 - 2.0 * T).max(), rel=1e-3)
    assert math.isnan(read.noise_gain)


def test_margins_are_the_figures_and_none_where_nothing_crosses() -> None:
    read = figures(4.0, exact=True, points=300)
    shown = margins_of(read)
    assert (shown.gain, shown.disk) == (read.gain_margin, read.disk_margin)
    assert (shown.crossover, shown.phase_at) == (read.crossover, read.crossover)
    assert shown.phase == pytest.approx(read.phase_margin)
    assert shown.delay == pytest.approx(shown.phase / 360.0 / shown.phase_at)
    assert margins_of(figures(9.0)) is UNSTABLE
    low = margins_of(figures(0.5))
    assert math.isnan(low.crossover)
    assert math.isnan(low.delay)
    assert low.gain == pytest.approx(16.0, rel=1e-2)
    assert (figures(0.5).phase_margin, figures(0.5).delay_margin) == (180.0, math.inf)


def test_a_bandwidth_below_and_above_the_grid() -> None:
    slow = model([[-1e-3]], [1e-3], [1.0])  # a corner at 0.16 mHz
    gain = Bounded(**vars(model([[0.0]], [1e-3], [1.0])))
    for exact in (True, False):
        read = LoopFigures(gain, Bounded(**vars(slow)), 2000, exact=exact)
        assert read.bandwidth == pytest.approx(1e-3 / 2.0 / math.pi, rel=1e-4)
    fast = Bounded(**vars(model([[-1e4]], [1e4], [1.0])))
    read = LoopFigures(gain, fast, 400)
    assert read.bandwidth == pytest.approx(0.998 * 50.0)
    assert math.isnan(margins_of(read).bandwidth)


def test_half_the_sampling_frequency_limits_the_gain() -> None:
    """A sampled integrator K/(z - 1): real and -K/2 at half the sampling frequency."""
    K, T = 0.4, 1e-2
    read = LoopFigures(model([[1.0]], [K], [1.0], T), model([[1.0 - K]], [K], [1.0], T), 400)
    assert read.gain_margin == pytest.approx(2.0 / K)
    assert read.growth == pytest.approx(1.0 - K)
    np.testing.assert_allclose(read.step[:5], 1.0 - (1.0 - K) ** np.arange(5.0))
    assert read.overshoot == 0.0
    # 2 % are left after n samples, between two of them.
    assert read.settling_time == pytest.approx(math.log(0.02) / math.log(1.0 - K) * T, rel=0.1)
    # White noise through K z/(z - 1 + K), less its feedthrough: K^2/(1 - (1 - K)^2).
    assert read.noise_gain == pytest.approx(math.sqrt(K / (2.0 - K)), rel=1e-3)
