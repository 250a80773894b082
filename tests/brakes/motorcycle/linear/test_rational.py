"""Transfer functions as numbers against python-control."""

import math

import control
import numpy as np
import pytest

from bywire.brakes.motorcycle.linear.brake import Rational, first_orders


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
