"""Linear models: eqs. (14) and (15), Table 2, and rational functions from python-control."""

import math

import control
import numpy as np
import pytest

from bywire.brakes.motorcycle.linear import Rational, first_orders, linear_model, theoretical
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.catalog import PARAMETER_SETS

SETS = ("dardanelli2010", "dardanelli2010-table1")


def brake(name: str) -> MotorcycleParameters:
    found = PARAMETER_SETS.find(name).parameters()
    assert isinstance(found, MotorcycleParameters)
    return found


@pytest.mark.parametrize("name", SETS)
def test_poles_of_eq_15_are_the_eigenvalues_of_eq_14(name: str) -> None:
    par = brake(name)
    np.testing.assert_allclose(theoretical(par).poles, linear_model(par).poles(), rtol=1e-8)


@pytest.mark.parametrize("name", SETS)
def test_eq_15_is_the_response_of_eq_14(name: str) -> None:
    f = np.geomspace(0.01, 1e5, 60)
    model = linear_model(brake(name))
    np.testing.assert_allclose(
        theoretical(brake(name)).response(f), model.response(f)[:, 0, 0], rtol=1e-7
    )


def test_gain_is_the_closed_form() -> None:
    par = brake("dardanelli2010-table1")
    expected = par.gear.eta_g * par.motor.K_e / (par.gear.k_g * par.master_cylinder.A_mc)
    assert theoretical(par).gain == pytest.approx(expected, rel=1e-12)
    assert theoretical(par).gain_bar == pytest.approx(7.6, rel=1e-9)


def test_calibrated_set_gives_table_2() -> None:
    model = theoretical(brake("dardanelli2010"))
    assert model.gain_bar == pytest.approx(10.1, rel=5e-3)
    np.testing.assert_allclose(model.zeros_hz, [160.0], rtol=5e-3)
    np.testing.assert_allclose(model.poles_hz, [0.866, 9.75, 4.7e4], rtol=5e-3)


def test_printed_set_does_not() -> None:
    model = theoretical(brake("dardanelli2010-table1"))
    assert abs(model.gain_bar / 10.1 - 1.0) > 0.2
    assert np.all(np.abs(model.poles_hz / [0.866, 9.75, 4.7e4] - 1.0) > 0.3)


def test_transfer_function_is_one_of_control() -> None:
    par = brake("dardanelli2010")
    system = theoretical(par).transfer_function()
    assert isinstance(system, control.TransferFunction)
    assert float(np.real(system.dcgain())) == pytest.approx(theoretical(par).gain, rel=1e-12)
    slow = np.sort(np.abs(system.poles()))
    np.testing.assert_allclose(slow, np.abs(theoretical(par).poles), rtol=1e-6)


def test_air_slows_the_slow_pole_and_leaves_the_gain() -> None:
    par = brake("dardanelli2010-table1")
    airy = par.replace({"fluid.air": "entrained", "fluid.V_air": 1e-6})
    clear, soft = theoretical(par, 5e5), theoretical(airy, 5e5)
    assert soft.gain == pytest.approx(clear.gain, rel=1e-12)
    assert soft.poles_hz[0] < 0.9 * clear.poles_hz[0]


# --- Rational transfer functions compared with python-control


@pytest.fixture
def model() -> Rational:
    return first_orders("m", 10.2e5, (0.096,), (1.25, 7.15, 0.104))


def test_gain_and_corners_come_back(model: Rational) -> None:
    assert model.gain_bar == pytest.approx(10.2)
    np.testing.assert_allclose(model.zeros_hz, [0.096])
    np.testing.assert_allclose(model.poles_hz, [0.104, 1.25, 7.15])


def test_step_and_response_are_those_of_control(model: Rational) -> None:
    t = np.linspace(0.0, 3.0, 301)
    system = model.transfer_function()
    assert isinstance(system, control.TransferFunction)
    expected = control.step_response(system, t).outputs
    np.testing.assert_allclose(model.step(t), expected, rtol=1e-7, atol=1e-9 * model.gain)
    f = np.geomspace(0.01, 50.0, 20)
    response = control.frequency_response(system, 2.0 * math.pi * f).complex
    np.testing.assert_allclose(model.response(f), np.squeeze(response), rtol=1e-10)


def test_step_is_zero_before_it(model: Rational) -> None:
    np.testing.assert_array_equal(model.step(np.array([-1.0, -1e-6])), 0.0)


def test_resonant_poles_give_a_real_step() -> None:
    w, d = 20.0, 0.3
    model = Rational("r", (1.0,), (1.0 / w**2, 2.0 * d / w, 1.0))
    t = np.linspace(0.0, 0.5, 50)
    wd = w * math.sqrt(1.0 - d * d)
    expected = 1.0 - np.exp(-d * w * t) * (np.cos(wd * t) + d * w / wd * np.sin(wd * t))
    np.testing.assert_allclose(model.step(t), expected, atol=1e-12)
