"""Reduced linear models: bounds that hold, what is kept, errors that are told."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.small_linear_models import model_of
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.loop import LOOPS
from bywire.analysis.reduction import reduce, reduction_error, residualized
from bywire.brakes.motorcycle.linear import linear_model
from bywire.brakes.wedge.plants import full
from bywire.core.catalog import main_set, parameters
from bywire.core.errors import ParameterError, UnknownNameError


def wedge(mu_B: float = 0.35) -> LinearModel:
    par = parameters("roberts2003").replace({"wedge.mu_B": mu_B})
    return full(par, 2e3).channels(outputs=("F_N", "x", "M_B"))


def moment_loop() -> LinearModel:
    loop = LOOPS.find("moment")
    return loop.closed(parameters(main_set(loop.assembly)), loop.at.default)


@pytest.mark.parametrize("made", [wedge, moment_loop])
def test_no_response_is_off_by_more_than_the_bound(made) -> None:
    model = made()
    f = np.geomspace(1e-2, 0.499 / model.period if model.period else 1e4, 400)
    exact = model.response(f)
    tight = 0.0
    for order in (2, 3, 4, 6, 8):
        found = reduce(model, order=order)
        off = np.abs(found.model.response(f) - exact).max(axis=0)
        rounding = 1e-9 * np.abs(exact).max(axis=0)
        assert np.all(off <= found.bound + rounding)
        tight = max(tight, float(np.max(off / np.maximum(found.bound, rounding))))
        assert found.error.channel[1] in model.inputs
    assert tight > 0.3  # a bound, not a number that is always large


def test_hankel_singular_value_of_a_lag() -> None:
    """k/(s + a) has k/(2 a), half its largest response."""
    lag = model_of([[-4.0]], [[3.0]], [[1.0]])
    assert reduce(lag, order=1).hankel == pytest.approx([0.5])
    held = lag.sampled(0.1)
    # Discrete: Gramians b^2/(1 - a^2) and 1/(1 - a^2).
    a, b = float(held.A[0, 0]), float(held.B[0, 0])
    expected = b / (1.0 - a * a) / (b / (1.0 - a))
    assert reduce(held, order=1).hankel == pytest.approx([expected])


@pytest.mark.parametrize("method", ["balanced", "modal"])
def test_exact_at_rest(method) -> None:
    model = moment_loop()
    f = np.array([1e-4])
    found = reduce(model, order=3, method=method)
    np.testing.assert_allclose(found.model.response(f), model.response(f), rtol=1e-6)


def test_integrators_and_unstable_poles_are_kept() -> None:
    plant = wedge(0.5)
    found = reduce(plant, order=4)
    (grows,) = (s for s in plant.poles() if s.real > 1.0)
    assert found.kept == 1
    assert np.abs(found.model.poles() - grows).min() < 1e-8 * abs(grows)
    assert not found.model.is_stable
    gain = LOOPS.find("moment").gain(parameters("roberts2003"), 200.0)
    less = reduce(gain, band=50.0)
    assert less.kept == 1
    assert np.abs(less.model.poles() - 1.0).min() < 1e-9


def test_a_band_is_met_with_as_few_states_as_can_be() -> None:
    model = wedge()
    found = reduce(model, band=150.0, tolerance=0.01)
    order = len(found.model.states)
    assert found.error.relative <= 0.01
    assert found.error.high == pytest.approx(150.0)
    assert reduce(model, order=order - 1, band=150.0).error.relative > 0.01
    assert order < len(model.effective())


def test_modes_keep_their_poles_and_pairs_stay_whole() -> None:
    model = wedge(0.2)  # two swinging pairs are the slowest modes that act on these outputs
    found = reduce(model, order=3, method="modal")
    assert len(found.model.states) == 4
    for pole in found.model.poles():
        assert np.abs(model.poles() - pole).min() < 1e-7 * abs(pole)


def test_errors_are_those_of_the_responses() -> None:
    model = linear_model(parameters("dardanelli2010"))
    found = reduce(model, order=1, band=50.0)
    ratio = found.model.response(np.array([50.0])) / model.response(np.array([50.0]))
    assert found.error.at == pytest.approx(50.0)
    assert found.error.relative == pytest.approx(float(np.abs(ratio - 1.0)[0, 0, 0]))
    assert found.error.gain == pytest.approx(20.0 * math.log10(abs(ratio[0, 0, 0])))
    moved = abs(found.model.poles()[0] / model.poles()[0] - 1.0)
    assert found.error.poles == pytest.approx(moved / (1.0 + moved), rel=0.2)
    two = reduce(model, order=2, band=50.0)
    assert two.error.relative < 1e-6
    np.testing.assert_allclose(two.model.poles(), model.poles()[:2], rtol=1e-4)


def fast(eps: float) -> LinearModel:
    """Return an oscillator with a sensor and an actuator that are 1/eps faster."""
    A = [[0.0, 1.0, 0.0], [-1.0, -0.2, 1.0], [0.0, -0.5 / eps, -1.0 / eps]]
    return model_of(A, [[0.0], [0.0], [1.0 / eps]], [[1.0, 0.0, 0.0]])


@pytest.mark.parametrize(("corrected", "order"), [(False, 1), (True, 2)])
def test_poles_of_quasi_static_models_converge(corrected: bool, order: int) -> None:
    off = []
    for eps in (1e-2, 1e-3):
        less = residualized(fast(eps), ("x0", "x1"), corrected=corrected)
        off.append(np.abs(np.sort(less.poles()) - np.sort(fast(eps).poles()[:2])).max())
        f = np.array([1e-6])
        np.testing.assert_allclose(less.response(f), fast(eps).response(f), rtol=1e-4)
    assert math.log10(off[0] / off[1]) == pytest.approx(order, abs=0.15)


def test_quasi_static_states_of_a_sampled_model() -> None:
    model = fast(1e-2).sampled(0.05)
    less = residualized(model, ("x0", "x1"))
    gain = less.transfer().static_gain
    assert gain == pytest.approx(model.transfer().static_gain, rel=1e-10)
    with pytest.raises(ParameterError, match="continuous"):
        residualized(model, ("x0", "x1"), corrected=True)


def test_refusals() -> None:
    model = wedge()
    for order in (0, 99):
        with pytest.raises(ParameterError, match="order"):
            reduce(model, order=order)
    with pytest.raises(ParameterError, match="tolerance"):
        reduce(model, band=10.0, tolerance=2.0)
    with pytest.raises(ParameterError, match="half the sampling"):
        reduce(moment_loop(), band=600.0)
    with pytest.raises(ParameterError, match="> 0 Hz"):
        reduce(model, order=4, band=0.0)
    with pytest.raises(ParameterError, match="integrates"):
        residualized(model_of([[0.0, 0.0], [1.0, -1.0]], [[1.0], [0.0]], [[0.0, 1.0]]), ("x1",))
    with pytest.raises(UnknownNameError, match="x0"):
        residualized(fast(0.1), ("x",))
    with pytest.raises(ParameterError, match="cannot be compared"):
        reduction_error(model, moment_loop(), 10.0)
