"""Plants as linear models: operating points, friction, and how far simplified ones are off."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bywire.analysis.linear.linearize import linearize
from bywire.analysis.loop import PLANTS
from bywire.analysis.reduction import reduction_error
from bywire.brakes.motorcycle.linear import theoretical, two_pole, two_pole_error, with_slow_pair
from bywire.brakes.motorcycle.paper.facts import FACTS, table4_model
from bywire.brakes.motorcycle.trim import holding_current, travel_at
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.model import WedgeBrake, force_for
from bywire.brakes.wedge.plants import (
    MECHANICAL_STATES,
    SMOOTH,
    full,
    mechanical,
    point,
    rigid,
    rigid_rate,
)
from bywire.core.catalog import main_set, parameters
from bywire.core.errors import ParameterError, UnknownNameError
from bywire.plant import roller_screw
from bywire.simulation.run import simulate

NAMES = sorted(PLANTS.all())


def of(name: str):
    plant = PLANTS.find(name)
    return plant, parameters(main_set(plant.assembly))


@pytest.mark.parametrize("name", NAMES)
def test_every_way_to_give_an_operating_point(name: str) -> None:
    plant, par = of(name)
    for quantity in plant.at:
        found = plant.model(par, replace(plant.usual, quantity=quantity, value=quantity.default))
        assert np.isfinite(found.response(np.array([1.0]))).all()
        for value in (0.0, -quantity.default):
            with pytest.raises(
                ParameterError, match=r"no operating point|not a valid operating point|is not valid"
            ):
                plant.model(par, replace(plant.usual, quantity=quantity, value=value))


@pytest.mark.parametrize("mu_B", [0.2, 0.35, 0.5])
def test_the_wedge_rests_where_it_is_linearized(mu_B: float) -> None:
    par = parameters("roberts2003").replace({"wedge.mu_B": mu_B})
    at, F_N = point(par, 3e3), 3e3
    model = full(par, F_N)
    still = [k for k, name in enumerate(model.states) if name != "phi"]
    assert np.abs(model.rate[still]).max() < 1e-8
    torque = par.motor_1.K_ref * (at.memory.i_1_ref + at.memory.i_2_ref)
    need = (wedge.slope(par.wedge) - mu_B) * F_N
    assert torque / roller_screw.slope(par.screw) == pytest.approx(need, abs=1e-6)
    assert at.state.y_M == pytest.approx(3e3 / force_for(1.0, par))
    f_1 = par.heart.K_S * par.heart.K_W / (par.heart.K_S + par.heart.K_W)
    apart = roller_screw.slope(par.screw) * (at.state.theta_2 - at.state.theta_1)
    preload = f_1 * 0.5 * (apart - par.heart.g_1 - par.heart.g_2)
    both = par.motor_1.K_ref * (at.memory.i_2_ref - at.memory.i_1_ref)
    assert both / roller_screw.slope(par.screw) == pytest.approx(2.0 * preload)


@pytest.mark.parametrize("mu_B", [0.2, 0.5])
def test_poles_of_the_simplified_wedges(mu_B: float) -> None:
    par = parameters("roberts2003").replace({"wedge.mu_B": mu_B})
    model = full(par, 3e3)
    near = mechanical(model, corrected=True)
    plain = mechanical(model)

    def off(one) -> float:
        return max(float(np.abs(model.poles() - s).min() / abs(s)) for s in one.poles()[:2])

    assert off(near) < 5e-4
    # What the drives add to the rotors' inertia, K_T^2/(V_dc k_i), is missing: half its share.
    added = par.motor_1.K_ref**2 / (par.drive.V_dc * par.drive.k_i)
    assert off(plain) == pytest.approx(0.5 * added / par.motor_1.J_M, rel=0.15)
    undamped = par.replace({"motor_1.D_M": 0.0, "motor_2.D_M": 0.0, "caliper.tau_cal": 0.0})
    one = rigid(mechanical(full(undamped, 3e3)), undamped)
    assert one.states == ("x", "v")
    assert np.abs(one.poles() - rigid_rate(par)).min() < 1e-6 * abs(rigid_rate(par))


def test_the_error_of_a_simplified_plant_is_told_and_small() -> None:
    plant, par = of("wedge-mechanical")
    model, exact = plant.model(par, plant.usual), plant.whole(par, plant.usual)
    assert model.states == MECHANICAL_STATES
    error = reduction_error(exact, model, 10.0)
    assert error.relative < 0.03
    # At the end of its band the drives' lag is left: demand filter and current loop.
    assert 5.0 < reduction_error(exact, model, plant.band).phase < 20.0
    rigid_plant, _ = of("wedge-rigid")
    stiff = reduction_error(
        rigid_plant.whole(par, plant.usual), rigid_plant.model(par, plant.usual), 0.5
    )
    assert stiff.relative < 0.05


def test_the_motorcycle_plant_is_eq_15() -> None:
    plant, par = of("motorcycle-plant")
    par = par.replace({"seal.mu_T": 0.0})  # friction: removed from the one, part of the other
    model = plant.model(par, plant.usual)
    f = np.geomspace(0.01, 1e3, 30)
    closed_form = theoretical(par, 20e5, travel_at(20e5, par)).response(f)
    np.testing.assert_allclose(model.response(f)[:, 0, 0], closed_form, rtol=1e-9)
    current = replace(plant.usual, quantity=plant.at[1], value=holding_current(20e5, par))
    np.testing.assert_allclose(plant.model(par, current).A, model.A, rtol=1e-12)


def test_friction_of_plants() -> None:
    plant, par = of("motorcycle-voltage")
    stuck = plant.model(par, replace(plant.usual, friction="stuck"))
    assert not stuck.response(np.array([1.0]))[0, 1:].any()  # current flows, nothing moves
    assert stuck.response(np.array([0.0]))[0, 0, 0].real == pytest.approx(1.0 / par.motor.R_m)
    own, wedge_par = of("wedge-plant")
    held = own.model(wedge_par, replace(own.usual, friction="stuck"))
    assert not held.effective()
    at = point(wedge_par, 2e3)
    kinds = {"omega_1": "stuck", "Omega": "sliding"}
    options = {"inputs": ("i_1_ref", "i_2_ref"), "outputs": ("F_N",)}
    one = linearize(at.model, at.par, at.state, at.memory, **options, friction=kinds)
    assert not one.A[one.states.index("omega_1")].any()
    assert one.A[one.states.index("omega_2")].any()
    with pytest.raises(UnknownNameError, match="omega_1"):
        linearize(at.model, at.par, at.state, at.memory, **options, friction={"omega": "stuck"})


def test_a_small_step_of_one_current_moves_the_nonlinear_wedge_as_the_linear_one() -> None:
    frictionless = {
        "bearing.C_0": 0.0,
        "bearing.C_2": 0.0,
        "bearing.T_nu": 0.0,
        "screw.eta_f": 1.0,
        "screw.eta_b": 1.0,
        "wedge_friction.mu_int": 0.0,
        "wedge_friction.mu_R": 0.0,
        "encoder.law": "ideal",
        "wedge.mu_B": 0.2,
    }
    par = parameters("roberts2003").replace(frictionless)
    at, height = point(par, 3e3), 0.05
    stimulus = at.stimulus._replace(i_1_set=at.memory.i_1_ref, i_2_set=at.memory.i_2_ref + height)
    run = simulate(replace(replace(at, stimulus=stimulus).run(), duration=0.3), signals=("F_N",))
    linear = full(par, 3e3).channels(inputs=("i_2_ref",), outputs=("F_N",))
    step, x, expected = linear.sampled(1e-3), np.zeros(len(linear.states)), []
    for _ in run.time:
        expected.append(float((step.C @ x)[0]))
        x = step.A @ x + height * step.B[:, 0]
    got = run["F_N"] - 3e3
    assert np.max(np.abs(got - expected)) < 2e-3 * np.max(np.abs(expected))
    assert np.max(np.abs(expected)) > 10.0


def test_wedge_points_that_do_not_exist() -> None:
    plant, par = of("wedge-plant")
    force, current = plant.at[1], plant.at[2]
    with pytest.raises(ParameterError, match="wedge travel"):
        plant.model(par, replace(plant.usual, quantity=force, value=1e5))
    above, weak = par.replace({"wedge.mu_B": 0.5}), par.replace({"drive.i_max": 0.2})
    with pytest.raises(ParameterError, match="< 0 A"):
        plant.model(above, replace(plant.usual, quantity=current, value=1.0))
    with pytest.raises(ParameterError, match=r"drive\.i_max"):
        plant.model(weak, plant.usual)


def test_run_out_and_cogging_are_what_is_left_out() -> None:
    par = parameters("roberts2003")
    assert set(SMOOTH) <= {*par.leaves(), "flywheel.law"}
    assert point(par, 2e3).par.motor_1.T_cog == 0.0
    assert WedgeBrake.frictions == ("omega_1", "omega_2", "v", "Omega")


def test_eq_21_drops_the_zero_and_the_fast_pole_of_eq_15() -> None:
    par = parameters("dardanelli2010")
    whole, less = theoretical(par), two_pole(par)
    np.testing.assert_allclose(less.poles, whole.poles[:2], rtol=1e-12)
    assert less.gain == pytest.approx(whole.gain, rel=1e-12)
    assert less.zeros.size == 0
    s = 2j * math.pi * 50.0
    left = (1.0 - s / whole.zeros[0]) / (1.0 - s / whole.poles[2])
    error = two_pole_error(par)
    assert error.gain == pytest.approx(20.0 * math.log10(abs(left)), rel=1e-6)
    assert error.phase == pytest.approx(math.degrees(np.angle(left)), rel=1e-6)


@pytest.mark.parametrize("region", ["low", "medium", "high"])
def test_eq_22_with_table_4_overshoots_and_falls(region: str) -> None:
    row = {name: fact.value for name, fact in FACTS.table(f"table4.{region}").items()}
    times = [1.0 / (2.0 * math.pi * row[name]) for name in ("zero", "T1", "T2", "T_L")]
    model = with_slow_pair(1e5 * row["K"], *times)
    f = np.geomspace(0.01, 20.0, 40)
    np.testing.assert_allclose(model.response(f), table4_model(region).response(f))
    t = np.linspace(0.0, 20.0, 2000)
    assert model.step(t).max() > 1.02 * model.gain
    swapped = with_slow_pair(1e5 * row["K"], times[3], times[1], times[2], times[0])
    assert swapped.step(t).max() < 1.001 * swapped.gain
    with pytest.raises(ParameterError, match="tau_L"):
        with_slow_pair(1e6, 0.0, 0.1, 0.02, 1.5)
