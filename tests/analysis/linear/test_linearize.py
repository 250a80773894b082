"""Exact linear models of the motorcycle brake against eq. (14) and against its simulation."""

from typing import Any

import numpy as np
import pytest

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import linearize
from bywire.bench.experiment import as_run
from bywire.brakes.motorcycle.case import case_from_rest
from bywire.brakes.motorcycle.linear import linear_model, theoretical
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current, memory_at, state_at, travel_at
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import ParameterError, UnknownNameError
from bywire.simulation.run import simulate
from raising import raises

SETS = ("dardanelli2010", "dardanelli2010-table1")
NO_COULOMB = {"seal.T_pr": 0.0, "seal.f_cfr_p": 0.0, "seal.f_cfr_n": 0.0}
P = 20e5


def brake(name: str, **changes: Any) -> MotorcycleParameters:
    base = PARAMETER_SETS.find(name).parameters()
    own = {"drive.mode": "current-source", **NO_COULOMB, **changes}
    found = base.replace(own)
    assert isinstance(found, MotorcycleParameters)
    return found


def generic(par: MotorcycleParameters, **changes: Any) -> LinearModel:
    """Return the generic model at 20 bar, of the states that eq. (14) keeps."""
    state = state_at(P, par)
    options = {"inputs": ("i_source",), "outputs": ("p_mc",)} | changes
    if options.get("friction") == "sliding":
        state = state._replace(omega=1e-9)
    model = linearize(MotorcycleBrake(), par, state, memory_at(P, par), **options)
    return model.reduced(("omega", "p_mc", "p_pd"))


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("law", ["paper", "directional"])
def test_generic_model_without_friction_is_eq_14(name: str, law: str) -> None:
    par = brake(name, **{"gear.law": law, "seal.mu_T": 0.0})
    expected, got = linear_model(par, P, travel_at(P, par)), generic(par)
    for matrix in "ABCD":
        np.testing.assert_allclose(getattr(got, matrix), getattr(expected, matrix), rtol=1e-12)
    for named in ("states", "inputs", "outputs", "state_units", "input_units", "output_units"):
        assert getattr(got, named) == getattr(expected, named)
    np.testing.assert_allclose(got.rate, 0.0, atol=1e-9)


@pytest.mark.parametrize("name", SETS)
def test_generic_model_while_sliding_has_the_viscous_friction_of_eq_14(name: str) -> None:
    par = brake(name)
    expected = linear_model(par, P, travel_at(P, par))
    got = generic(par, friction="sliding")
    np.testing.assert_allclose(got.A, expected.A, rtol=1e-9, atol=1e-12)
    assert abs(generic(par).A[0, 0] / expected.A[0, 0] - 1.0) > 1e-5  # it is there to be seen


def test_sliding_friction_has_the_slope_of_the_stribeck_curve() -> None:
    par = brake("dardanelli2010", **{"seal.T_pr": 2e-3, "seal.mu_T": 0.0})
    omega, seal = 0.3, par.seal
    state = state_at(P, par)._replace(omega=omega)
    model = linearize(
        MotorcycleBrake(),
        par,
        state,
        memory_at(P, par),
        inputs=("i_source",),
        outputs=("p_mc",),
        friction="sliding",
    )
    free = linearize(
        MotorcycleBrake(), par, state, memory_at(P, par), inputs=("i_source",), outputs=("p_mc",)
    )
    slope = seal.T_pr * (seal.k_brk_p - 1.0) * seal.c * np.exp(-seal.c * omega)
    inertia = par.gear.eta_g * par.gear.J_mot + par.gear.k_g**2 * par.gear.M_mc
    assert (model.A - free.A)[2, 2] == pytest.approx(slope / inertia, rel=1e-12)


@pytest.mark.parametrize("name", SETS)
def test_linear_step_approaches_the_nonlinear_one_as_the_step_shrinks(name: str) -> None:
    """The error is second order in the step's height: over the height it falls in proportion."""
    par = brake(name, **{"seal.mu_T": 0.0})
    hold, x = holding_current(P, par), travel_at(P, par)
    shares = []
    for height in (1.0, 0.1, 0.01):
        case = case_from_rest(
            "step",
            par,
            "current-source",
            P,
            lambda t, h=height: {"i_set": hold + h * (t >= -1e-9)},
            1.0,
        )
        run = simulate(as_run(case, 20e-6), signals=("p_mc",))
        linear = theoretical(par, P, x)
        error = run["p_mc"] - P - height * linear.step(run.time)
        shares.append(float(np.max(np.abs(error))) / (height * linear.gain))
    assert shares[0] < 4e-4
    assert shares[-1] < 4e-6
    assert shares[0] / shares[1] == pytest.approx(10.0, rel=0.02)
    assert shares[1] / shares[2] == pytest.approx(10.0, rel=0.02)


def test_operating_points_that_have_no_slope_are_refused() -> None:
    par = brake("dardanelli2010")
    state, memory = state_at(P, par), memory_at(P, par)
    options: dict[str, Any] = {"inputs": ("i_source",), "outputs": ("p_mc",)}
    with pytest.raises(ParameterError, match="at rest"):
        linearize(MotorcycleBrake(), par, state, memory, friction="sliding", **options)
    touching = state._replace(theta=par.master_cylinder.x_rest / par.gear.k_g)
    with raises(ParameterError, name="contact"):
        linearize(MotorcycleBrake(), par, touching, memory, **options)
    moving = state._replace(omega=1e-3)
    with pytest.raises(ParameterError, match="not stuck"):
        linearize(MotorcycleBrake(), par, moving, memory, friction="stuck", **options)
    with pytest.raises(UnknownNameError, match="i_sorce"):
        linearize(MotorcycleBrake(), par, state, memory, inputs=("i_sorce",), outputs=("p_mc",))
    with pytest.raises(UnknownNameError, match="p_cm"):
        linearize(MotorcycleBrake(), par, state, memory, inputs=("i_source",), outputs=("p_cm",))


def test_closed_contact_acts_with_its_stiffness_and_damping() -> None:
    par = brake("dardanelli2010")
    free = state_at(P, par)
    pressed = free._replace(theta=(par.master_cylinder.x_rest - 1e-5) / par.gear.k_g)
    memory = memory_at(P, par)
    options: dict[str, Any] = {"inputs": ("i_source",), "outputs": ("p_mc",)}
    model, apart = (
        linearize(MotorcycleBrake(), par, state, memory, **options) for state in (pressed, free)
    )
    row, angle = (model.states.index(name) for name in ("omega", "theta"))
    inertia = par.gear.eta_g * par.gear.J_mot + par.gear.k_g**2 * par.gear.M_mc
    stiffness = par.gear.k_g**2 * par.stop.k_stop / inertia
    assert model.A[row, angle] - apart.A[row, angle] == pytest.approx(-stiffness, rel=1e-9)
    damping = stiffness * par.stop.tau_stop
    assert model.A[row, row] - apart.A[row, row] == pytest.approx(-damping, rel=1e-6)


def test_stuck_velocity_stays_zero() -> None:
    par = brake("dardanelli2010", **{"seal.T_pr": 2e-3})
    model = linearize(
        MotorcycleBrake(),
        par,
        state_at(P, par),
        memory_at(P, par),
        inputs=("i_source",),
        outputs=("p_mc",),
        friction="stuck",
    )
    row = model.states.index("omega")
    assert not model.A[row].any()
    assert not model.B[row].any()
    assert model.A[model.states.index("p_mc")].any()
