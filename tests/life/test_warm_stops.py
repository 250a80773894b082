"""Temperatures of stops that repeat, and the wear of stops that get hot, against closed forms."""

import numpy as np
import pytest
from scipy.integrate import quad

from bywire.core.errors import ParameterError
from bywire.life import warm_stops
from bywire.plant import pad_wear
from raising import raises

PADS = pad_wear.Parameters(
    kappa_0=3.6e-14, T_hot=503.0, T_act=2760.0, n_pads=2.0, A_pad=50e-4, E_pad=5e8
)
DISC = warm_stops.Parameters(C_d=3400.0, tau_d=300.0)
AIR = 293.15


def test_equal_stops_settle_where_heat_and_cooling_balance():
    work, pause = np.full(3, 170e3), np.full(3, 200.0)
    before, after = warm_stops.temperatures(work, pause, np.full(3, AIR), DISC)
    rise = 170e3 / 3400.0
    assert after - before == pytest.approx(rise)
    assert before == pytest.approx(AIR + rise / (np.exp(200.0 / 300.0) - 1.0), rel=1e-12)


def test_stops_that_repeat_go_on_where_the_last_one_ends():
    rng = np.random.default_rng(1)
    work, pause, air = rng.uniform(1e4, 3e5, 9), rng.uniform(10, 900, 9), rng.uniform(260, 300, 9)
    before, after = warm_stops.temperatures(work, pause, air, DISC)
    T = before[0]
    for _ in range(2):
        for k in range(9):
            assert before[k] == pytest.approx(T, rel=1e-12)
            assert after[k] == pytest.approx(T + work[k] / DISC.C_d, rel=1e-12)
            T = air[k] + (after[k] - air[k]) * np.exp(-pause[k] / DISC.tau_d)


def test_shorter_pauses_wear_more_than_they_warm():
    work, air = np.full(4, 300e3), np.full(4, AIR)
    worn = []
    for pause in (600.0, 60.0):
        pauses = np.full(4, pause)
        before, after = warm_stops.temperatures(work, pauses, air, DISC)
        worn.append(float(warm_stops.thinned(work, before, after, PADS).mean()))
    assert worn[0] == pytest.approx(300e3 * 3.6e-14 / 1e-2)
    assert worn[1] > 5.0 * worn[0]


@pytest.mark.parametrize(("begin", "end"), [(300, 450), (450, 600), (503, 503), (600, 900)])
def test_wear_of_a_stop_is_the_integral_over_its_temperature(begin, end):
    T = np.array([[begin], [end]], dtype=float)
    worn = warm_stops.thinned(np.array([1e5]), *T, PADS)
    mean = pad_wear.wear_per_work(float(begin), PADS)
    if end > begin:
        whole = quad(lambda T: pad_wear.wear_per_work(T, PADS), begin, end, points=[503.0])[0]
        mean = whole / (end - begin)
    assert worn[0] == pytest.approx(1e5 * mean / (2.0 * 50e-4), rel=1e-8)


def test_a_disc_that_would_melt_is_refused():
    one = np.ones(1)
    with raises(ParameterError, name="stop.pause"):
        warm_stops.temperatures(1e6 * one, 10.0 * one, AIR * one, DISC)
