"""Plain linear models: exact sampling, reduction, frequency response, python-control."""

import math

import control
import numpy as np
import pytest

from analysis.small_linear_models import model_of
from bywire.analysis.linear.linear_model import LinearModel
from bywire.core.errors import ParameterError, UnknownNameError
from raising import raises


def chain(gain: float = 2.0, slow: float = 3.0, fast: float = 40.0) -> LinearModel:
    """Return two lags in a row, with an integrator of the first that acts on nothing."""
    return LinearModel(
        name="chain",
        A=np.array([[-slow, 0.0, 0.0], [fast, -fast, 0.0], [1.0, 0.0, 0.0]]),
        B=np.array([[gain * slow], [0.0], [0.0]]),
        C=np.array([[0.0, 1.0, 0.0]]),
        D=np.zeros((1, 1)),
        states=("a", "b", "way"),
        inputs=("u",),
        outputs=("y",),
        state_units=("1", "1", "s"),
        input_units=("1",),
        output_units=("1",),
        rate=np.zeros(3),
    )


def test_response_is_that_of_the_transfer_function() -> None:
    f = np.geomspace(0.01, 100.0, 30)
    s = 2j * math.pi * f
    expected = 2.0 / ((1.0 + s / 3.0) * (1.0 + s / 40.0))
    np.testing.assert_allclose(chain().response(f)[:, 0, 0], expected, rtol=1e-12)


def test_sampling_is_exact_for_held_inputs() -> None:
    T = 0.05
    sampled = chain().sampled(T)
    x, y = np.zeros(3), []
    for _ in range(40):
        y.append(float((sampled.C @ x)[0]))
        x = sampled.A @ x + sampled.B[:, 0]
    t = T * np.arange(40)
    expected = 2.0 * (1.0 - (40.0 * np.exp(-3.0 * t) - 3.0 * np.exp(-40.0 * t)) / 37.0)
    np.testing.assert_allclose(y, expected, atol=1e-12)
    assert sampled.period == T


def test_reduction_drops_only_what_does_not_act() -> None:
    reduced = chain().reduced(("a", "b"))
    assert reduced.states == ("a", "b")
    np.testing.assert_allclose(reduced.response(np.ones(1)), chain().response(np.ones(1)))
    with pytest.raises(ParameterError, match="dropped states"):
        chain().reduced(("b",))
    held = chain().reduced(("b",), held=True)
    assert np.all(held.B == 0.0)
    with pytest.raises(UnknownNameError):
        chain().reduced(("c",))


@pytest.mark.parametrize("period", [0.0, 1e-3])
def test_state_space_has_names_and_the_same_response(period: float) -> None:
    model = chain().reduced(("a", "b"))
    model = model.sampled(period) if period else model
    system = model.state_space()
    assert isinstance(system, control.StateSpace)
    assert system.state_labels == ["a", "b"]
    assert (system.input_labels, system.output_labels) == (["u"], ["y"])
    assert system.dt == period
    f = np.array([0.3, 7.0])
    got = control.frequency_response(system, 2.0 * math.pi * f).complex
    np.testing.assert_allclose(np.squeeze(got), model.response(f)[:, 0, 0], rtol=1e-10)
    np.testing.assert_allclose(np.sort(system.poles()), np.sort(model.poles()), rtol=1e-10)


def test_a_sample_time_of_ages_is_one_error():
    """Numbers of an unstable model overflow."""
    with raises(ParameterError, name="sample time", value="1.3e+19 s"):
        model_of(1.0, 1.0, 1.0).sampled(1.3e19)
