"""Linear models about periodic motion: closed forms, the friction-free model, measured sines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bywire.analysis.loop import LOOPS, Point
from bywire.analysis.periodic import (
    PeriodicModel,
    Stroboscope,
    dithered_loop,
    find_orbit,
    period_of,
    periodic_model,
    unrounded,
)
from bywire.analysis.response.frequency_response import frequency_response
from bywire.analysis.response.sweep import Sweep
from bywire.brakes.motorcycle.dither.dithered_plant import dithered_plant
from bywire.brakes.motorcycle.trim import holding_current
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import ParameterError, SolverError
from systems.describing import Held
from systems.dithered import DITHERED, Dithered, Driven, Shaken, mobility, multiplier

PRESSURE = LOOPS.find("pressure")
RETUNED = PARAMETER_SETS.find("dardanelli2010-retuned").parameters()
STEP = 2e-6


def mass(F: float = 0.0, F_c: float = DITHERED.F_c) -> Point:
    """Return the shaken mass under a mean force; at the start it has the velocity of the orbit."""
    par = DITHERED.replace({"F_c": F_c})
    v = -par.A / (2.0 * np.pi * par.f * par.m)
    return Point(Dithered(), par, Shaken(v, 0.0), Driven(0.0, 0.0, 0.0), Held(F))


def shaken(F: float = 0.0, F_c: float = DITHERED.F_c) -> PeriodicModel:
    """Return its linear model."""
    return periodic_model(mass(F, F_c), ("u",), "y", (DITHERED.f,), STEP)


@pytest.mark.parametrize("F_c", [5.0, 20.0])
def test_dither_turns_dry_friction_into_the_damping_of_the_closed_form(F_c) -> None:
    poles = shaken(F_c=F_c).averaged.poles()
    (z,) = (p.real for p in poles if 1e-3 < abs(p) < 1.0 - 1e-6)
    assert z == pytest.approx(multiplier(DITHERED.replace({"F_c": F_c})), abs=1e-3)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6])
def test_the_relay_with_a_sine_has_its_textbook_slope(share) -> None:
    """The arcsine law is that of little friction: its error falls with (F_c / A)^2."""
    found = shaken(share * DITHERED.F_c).steady_gain
    assert found == pytest.approx(mobility(DITHERED, share * DITHERED.F_c), rel=0.01)


def test_the_slope_is_that_of_the_mean_between_two_orbits() -> None:
    F, apart = 0.3 * DITHERED.F_c, 0.15 * DITHERED.F_c
    slope = (shaken(F + apart).mean - shaken(F - apart).mean) / (2.0 * apart)
    assert slope == pytest.approx(shaken(F).steady_gain, rel=0.02)


def test_differences_agree_over_a_decade_of_their_size() -> None:
    point = mass()
    run = replace(point.run(STEP), duration=1.0 / DITHERED.f, record=DITHERED.T_s)
    map_ = Stroboscope(run, ("u",), ("y",))
    start = find_orbit(map_, run).start
    exact = map_.derivatives(start).A[0, 0]
    V = DITHERED.A / (2.0 * np.pi * DITHERED.f)
    for size in (0.03 * V, 0.1 * V, 0.3 * V):
        aside = size * np.eye(start.size)[0]
        apart = map_.advance(start + aside).end[0] - map_.advance(start - aside).end[0]
        assert apart / (2.0 * size) == pytest.approx(exact, abs=0.01)
    # Tiny ones as well: reversals move in time as finely as the numbers do.
    aside = 1e-8 * np.eye(start.size)[0]
    raw = (map_.advance(start + aside).end[0] - map_.advance(start).end[0]) / 1e-8
    assert raw == pytest.approx(exact, rel=1e-5)
    assert 0.7 < exact < 0.9


def without_friction(step: float) -> PeriodicModel:
    """Return the pressure loop without friction, over the period of a dither without amplitude."""
    own = PRESSURE.smooth(RETUNED, "dither").replace({"ecu.dither.gain": 0.0})
    return dithered_loop(PRESSURE, own, 20e5, step)


def test_without_friction_it_is_the_exact_sampled_model() -> None:
    """Order 2 in the step, and to 1e-6 where the step's error is extrapolated away."""
    f = np.array([0.7, 3.0, 12.0, 23.0])
    exact = PRESSURE.closed(RETUNED, 20e5)
    coarse, fine = (without_friction(step) for step in (10e-6, 5e-6))
    wanted = exact.response(f)[:, 0, 0]
    errors = [np.abs(one.response(f) - wanted) for one in (coarse, fine)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.15)
    better = (4.0 * fine.response(f) - coarse.response(f)) / 3.0
    assert np.abs(better - wanted).max() < 1e-6
    lifted = averaged(exact, 20).response(f)[:, 0, 0]
    better = (4.0 * fine.averaged.response(f) - coarse.averaged.response(f))[:, 0, 0] / 3.0
    assert np.abs(better - lifted).max() < 1e-6


def averaged(model, count):
    """Return a sampled model over several samples: input held, output averaged."""
    A, B, C, D = model.A, model.B, model.C, model.D
    X, U = np.eye(len(A)), np.zeros_like(B)
    C_mean, D_mean = np.zeros_like(C), np.zeros_like(D)
    for _ in range(count):
        C_mean, D_mean = C_mean + C @ X / count, D_mean + (C @ U + D) / count
        X, U = A @ X, A @ U + B
    return replace(model, A=X, B=U, C=C_mean, D=D_mean, period=count * model.period)


def test_small_sines_on_the_nonlinear_brake_answer_as_the_model_says() -> None:
    f, size, step = [1.0, 4.0, 10.0], 1e3, 10e-6
    own = unrounded(PRESSURE, RETUNED)
    model = dithered_loop(PRESSURE, RETUNED, 20e5, step)
    sweep = Sweep(PRESSURE.inputs, PRESSURE.output, f, (size,), whole=PRESSURE.whole(own))
    found = frequency_response(PRESSURE.point(own, 20e5).run(step), sweep)
    one = found.isel(variant=0, amplitude=0)
    measured = one["gain"].values * np.exp(1j * np.radians(one["phase"].values))
    predicted = model.response(one["frequency"].values)
    assert np.abs(measured / predicted - 1.0).max() < 0.02
    free = PRESSURE.closed(RETUNED, 20e5).response(one["frequency"].values)[:, 0, 0]
    assert np.abs(measured / free - 1.0).max() > 0.3  # the model without friction says otherwise
    assert model.steady_gain == pytest.approx(1.0, abs=1e-4)  # no steady-state error
    assert model.averaged.is_stable
    assert model.mean == pytest.approx(20e5, rel=1e-5)


def test_the_dithered_plant_has_the_slope_of_its_own_mean() -> None:
    par = PARAMETER_SETS.find("dardanelli2010").parameters()
    low, high = (dithered_plant(par, p, 20e-6) for p in (19e5, 21e5))
    slope = (high.model.mean - low.model.mean) / (high.i - low.i)
    assert slope == pytest.approx(0.5 * (low.gain + high.gain), rel=2e-3)
    free = 1e5 / holding_current(1e5, par)
    assert 0.7 * free < slope < 0.8 * free  # seals rub more while applying
    assert 0.3 < low.slowest < 0.866  # and dither turns friction into damping


def test_weak_dither_is_refused_with_the_reason() -> None:
    weak = RETUNED.replace({"ecu.dither.gain": 0.3})
    with pytest.raises(SolverError, match="sticks during the whole period"):
        dithered_plant(weak, 20e5, 20e-6)
    with pytest.raises(SolverError, match="sticks during the whole period"):
        dithered_loop(PRESSURE, weak, 20e5, 20e-6)
    with pytest.raises(ParameterError, match="not a multiple of the step"):
        period_of((30.0,), (1e-3,), 20e-6)
    rounded = PRESSURE.point(RETUNED, 20e5)
    with pytest.raises(ParameterError, match=r"adc\.law = 'ideal'"):
        periodic_model(rounded, PRESSURE.inputs, PRESSURE.output, (50.0,))
