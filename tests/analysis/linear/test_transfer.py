"""Transfer functions of linear models: minimal, accurate, named."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest

from analysis.small_linear_models import model_of
from bywire.analysis.linear.linear_model import Realization, minimal
from bywire.analysis.loop import LOOPS
from bywire.brakes.motorcycle.linear import linear_model, theoretical
from bywire.brakes.wedge.plants import INPUTS, full, mechanical
from bywire.core.catalog import main_set, parameters
from bywire.core.errors import ParameterError, UnknownNameError


@pytest.mark.parametrize("name", sorted(LOOPS.all()))
def test_response_is_that_of_the_model_to_1e_9_over_the_band(name: str) -> None:
    loop = LOOPS.find(name)
    par = parameters(main_set(loop.assembly))
    for model in (loop.closed(par, loop.at.default), loop.gain(par, loop.at.default)):
        nyquist = 0.499 / model.period if model.period else math.inf
        f = np.geomspace(loop.band[0], min(loop.band[1], nyquist), 100)
        found = model.transfer()
        np.testing.assert_allclose(found.response(f), model.response(f)[:, 0, 0], rtol=1e-9)
        assert len(found.zeros) < len(found.poles) <= len(model.effective())
        assert found.period == model.period


@pytest.mark.parametrize("name", ["dardanelli2010", "dardanelli2010-table1"])
def test_eq_14_gives_eq_15(name: str) -> None:
    par = parameters(name)
    model, closed_form = linear_model(par), theoretical(par)
    found = model.transfer("i_source", "p_mc")
    np.testing.assert_allclose(found.poles, closed_form.poles, rtol=1e-9)
    np.testing.assert_allclose(found.zeros, closed_form.zeros, rtol=1e-9)
    assert found.static_gain == pytest.approx(closed_form.gain, rel=1e-9)
    f = np.geomspace(1e-2, 1e5, 60)
    system = model.transfer_function("i_source", "p_mc")
    assert isinstance(system, control.TransferFunction)
    assert (system.input_labels, system.output_labels) == (["i_source"], ["p_mc"])
    got = control.frequency_response(system, 2.0 * math.pi * f).complex
    np.testing.assert_allclose(np.squeeze(got), closed_form.response(f), rtol=1e-9)


@pytest.mark.parametrize("period", [0.0, 0.1])
def test_what_cancels_is_left_out(period: float) -> None:
    """Hidden behind a rotation: an unreached copy of a pole, an unseen one, an integrator."""
    poles = np.array([-2.0, -2.0, -5.0, -9.0, 0.0])
    b, c = np.array([1.0, 0.0, 1.0, 3.0, 0.0]), np.array([1.0, 4.0, -1.0, 0.0, 2.0])
    Q = np.linalg.qr(np.random.default_rng(1).normal(size=(5, 5)))[0]
    A = Q @ np.diag(np.exp(poles * period) if period else poles) @ Q.T
    found = model_of(A, (Q @ b)[:, None], (Q @ c)[None], period=period).transfer()
    kept = np.array([-2.0, -5.0])
    expected = np.exp(kept * period) if period else kept
    np.testing.assert_allclose(np.sort(found.poles.real), np.sort(expected), rtol=1e-10)
    assert found.zeros.size == 0  # 1/(s + 2) - 1/(s + 5)
    assert found.factor == pytest.approx(expected[0] - expected[1], rel=1e-10)


def test_zeros_right_of_the_axis_and_direct_passage() -> None:
    system = control.tf2ss(control.tf([2.0, -6.0, 20.0], [1.0, 4.0, 5.0]))
    found = model_of(system.A, system.B, system.C, system.D).transfer()
    np.testing.assert_allclose(np.sort_complex(found.zeros), [1.5 - 2.78388218j, 1.5 + 2.78388218j])
    assert found.factor == pytest.approx(2.0)
    assert found.static_gain == pytest.approx(4.0)


def test_integrators_and_paths_without_effect() -> None:
    both = model_of([[0.0, 1.0], [0.0, -3.0]], [[0.0], [1.0]], [[1.0, 0.0], [0.0, 0.0]])
    assert both.transfer("u0", "y0").static_gain == math.inf
    nothing = both.transfer("u0", "y1")
    assert (nothing.factor, nothing.poles.size, nothing.static_gain) == (0.0, 0, 0.0)
    assert float(nothing.transfer_function().dcgain()) == 0.0
    with pytest.raises(UnknownNameError, match="y0"):
        both.transfer("u0", "y")


def test_motors_driven_as_one_do_not_move_against_each_other() -> None:
    """Of six states rotor against rotor, two, are out of reach."""
    plant = mechanical(full(parameters("roberts2003"), 2e3)).together(INPUTS)
    found = plant.transfer("i_1_ref", "F_N")
    assert len(found.poles) == 4
    f = np.geomspace(0.1, 150.0, 50)
    row = plant.outputs.index("F_N")
    np.testing.assert_allclose(found.response(f), plant.response(f)[:, row, 0], rtol=1e-9)


def test_polynomials_that_cannot_hold_the_model_are_refused() -> None:
    loop = LOOPS.find("position")
    found = loop.gain(parameters(main_set(loop.assembly)), loop.at.default).transfer()
    assert isinstance(found.transfer_function(), control.TransferFunction)
    with pytest.raises(ParameterError, match="polynomials of degree"):
        found.transfer_function(tolerance=1e-12)


def test_minimal_realization_of_nothing() -> None:
    assert len(minimal(Realization(np.eye(2), np.zeros(2), np.ones(2), 1.0)).A) == 0
