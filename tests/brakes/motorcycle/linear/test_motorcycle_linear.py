"""Eqs. (14) and (15) of Dardanelli et al. (2010) against each other and against Table 2."""

import control
import numpy as np
import pytest

from bywire.brakes.motorcycle.linear.brake import (
    linear_model,
    theoretical,
)
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
