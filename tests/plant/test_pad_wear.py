"""Wear of pads against closed forms."""

import numpy as np
import pytest

from bywire.plant import pad_wear
from bywire.plant.pad_wear import Input, Parameters

CAR = Parameters(kappa_0=3.6e-14, T_hot=503.0, T_act=2760.0, n_pads=2.0, A_pad=50e-4, E_pad=5e8)
"""a brake with two pads"""
MOTORCYCLE = CAR.replace({"n_pads": 4.0, "A_pad": 20e-4})
"""the front axle: two discs"""


def _thinned(work: float, T: float, par: Parameters) -> float:
    return pad_wear.output(Input(P=work, T=T), par).rate


def test_wear_per_work_is_constant_below_its_hot_range_and_arrhenius_above() -> None:
    for celsius, ratio in ((20.0, 1.0), (229.0, 1.0), (400.0, 4.0027), (500.0, 6.8023)):
        of_cold = pad_wear.wear_per_work(celsius + 273.15, CAR) / CAR.kappa_0
        assert of_cold == pytest.approx(ratio, rel=1e-4)
    assert pad_wear.wear_per_work(673.15, CAR) / 3.6e-14 == pytest.approx(
        np.exp(-2760.0 * (1.0 / 673.15 - 1.0 / 503.0)), rel=1e-12
    )


def test_a_stop_wears_both_pads_of_a_corner_by_a_micrometer_and_a_quarter() -> None:
    work = 0.5 * 450.0 * (100.0 / 3.6) ** 2
    assert 2.0 * _thinned(work, 300.0, CAR) == pytest.approx(1.25e-6, rel=1e-9)


def test_pads_of_a_motorcycle_wear_by_the_megajoule_and_by_the_stop() -> None:
    assert _thinned(1e6, 300.0, MOTORCYCLE) == pytest.approx(4.5e-6, rel=1e-9)
    stop = 0.8 * 0.5 * 265.0 * (100.0 / 3.6) ** 2
    assert _thinned(stop, 300.0, MOTORCYCLE) == pytest.approx(0.36805556e-6, rel=1e-6)
    mix = sum(share * (v / 100.0) ** 2 for share, v in ((0.70, 50), (0.25, 100), (0.05, 150)))
    assert _thinned(stop * mix, 300.0, MOTORCYCLE) == pytest.approx(0.197830e-6, rel=1e-6)


def test_rates_of_many_temperatures_at_once_are_those_of_each() -> None:
    T = np.array([300.0, 503.0, 600.0, 800.0])
    together = pad_wear.wear_per_work(T, CAR)
    assert np.array_equal(together, [pad_wear.wear_per_work(float(t), CAR) for t in T])


def test_a_caliper_gets_stiffer_as_its_pads_get_thinner() -> None:
    for left, K in ((10e-3, 30e6), (6e-3, 33.185841e6), (2e-3, 37.128713e6)):
        assert pad_wear.stiffness(30e6, 10e-3 - left, CAR) == pytest.approx(K, rel=1e-6)
    body = 1.0 / 30e6 - pad_wear.compliance(10e-3, CAR)
    K = pad_wear.stiffness(30e6, 7e-3, CAR)
    assert pytest.approx(body + pad_wear.compliance(3e-3, CAR), rel=1e-12) == 1.0 / K
