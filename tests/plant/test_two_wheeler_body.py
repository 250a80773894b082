"""Loads of the wheels of a rigid two-wheeler, against the conditions that ground sets."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

import bywire
from bywire.core.catalog import parameters
from bywire.plant import two_wheeler_body as body
from bywire.plant.two_wheeler_body import rear_load, rigid_rear_load

PAR = parameters("sport600").vehicle.body.replace({"load": "rigid"})
WEIGHT = PAR.m * PAR.g


def turning(N_r: float, mu_f: float, mu_r: float, F_d: float) -> float:
    """Return the torque that pitches the level body nose down, over the wheelbase [N]."""
    F = mu_f * (WEIGHT - N_r) + mu_r * N_r
    torque = F * PAR.h + F_d * (PAR.h - PAR.h_a) - WEIGHT * PAR.l_f + N_r * PAR.L
    return torque / PAR.L


@pytest.mark.parametrize("mu_f", [-4.0, -1.0, 0.0, 0.5, 1.0, 1.5, 2.2, 2.3, 2.5, 4.0])
@pytest.mark.parametrize("mu_r", [-4.0, -1.0, 0.0, 0.5, 1.5, 4.0])
@pytest.mark.parametrize("F_d", [0.0, 300.0, 2000.0])
def test_wheels_carry_what_holds_the_body_or_one_of_them_carries_all(
    mu_f: float, mu_r: float, F_d: float
) -> None:
    N_r = rigid_rear_load(mu_f, mu_r, F_d, 1.0, PAR)
    assert 0.0 <= N_r <= WEIGHT
    left = turning(N_r, mu_f, mu_r, F_d)
    if N_r == 0.0:
        assert left >= -1e-9 * WEIGHT  # it pitches nose down, or is about to
    elif N_r == WEIGHT:
        assert left <= 1e-9 * WEIGHT
    else:
        assert left == pytest.approx(0.0, abs=1e-9 * WEIGHT)
        more = turning(N_r + 1.0, mu_f, mu_r, F_d)
        assert more > left  # load on the rear wheel lifts it: the equilibrium is stable


def test_a_lifted_wheel_stays_lifted_as_the_front_tyre_grips_more() -> None:
    """The limit is mu_f = l_f/h. Far above it, beyond L/h, both sides change their sign."""
    lift = PAR.l_f / PAR.h
    loads = [rigid_rear_load(mu_f, 0.0, 0.0, 1.0, PAR) for mu_f in np.linspace(lift, 6.0, 200)]
    assert max(loads) < 1e-9 * WEIGHT
    assert rigid_rear_load(0.99 * lift, 0.0, 0.0, 1.0, PAR) > 0.0


@pytest.mark.parametrize("F", [-5000.0, -1000.0, 0.0, 1000.0, 5000.0])
def test_a_given_force_loads_no_wheel_with_less_than_nothing(F: float) -> None:
    loads = body.loads(rear_load(F, 0.0, 1.0, PAR), 1.0, PAR)
    assert min(loads) >= 0.0
    assert sum(loads) == pytest.approx(WEIGHT)


def test_a_rider_who_goes_over_the_handlebar_is_told_of() -> None:
    """The center of gravity is above the front contact at arctan(l_f/h)."""
    over = math.atan(PAR.l_f / PAR.h)
    there = body.center(body.State(0.0, 0.0, 0.0, over, 0.0), PAR)
    assert there.l_f == pytest.approx(0.0, abs=1e-12)
    t = np.array([0.0, 0.1, 0.2])

    def warned(pitch: float) -> list[str]:
        phi = np.array([0.0, pitch, 0.0])
        return body.watch(t, body.State(t, t, t, phi, t), PAR)

    assert warned(over - 1e-6) == []
    (text,) = warned(over + 0.1)
    assert "goes over the handlebars" in text
    assert "at t = 0.1 s (pitch up to 53.8 deg, limit 48.1 deg)" in text


def test_many_cases_with_heights_of_their_own_are_asked_at_once() -> None:
    """As studies do: one row of a case is enough, and each case has its own limit."""
    t = np.array([0.0, 0.1])
    pitch = np.full((2, 2), math.atan(PAR.l_f / PAR.h) - 0.01)
    many = body.State(pitch, pitch, pitch, pitch, pitch)
    same = SimpleNamespace(l_f=PAR.l_f, h=np.array([[PAR.h], [PAR.h]]))
    higher = SimpleNamespace(l_f=PAR.l_f, h=np.array([[PAR.h], [1.1 * PAR.h]]))
    assert body.watch(t, many, same) == []
    assert len(body.watch(t, many, higher)) == 1


def test_a_stop_names_the_rider_thrown_and_the_lift_limit_that_did_not_follow() -> None:
    changes = {"vehicle.body.h": "0.7 m", "options.v_0": "30 m/s", "options.duration": "2.5 s"}
    result = bywire.run("straight-stop", changes, estimate_error=False)
    derived, thrown = result.warnings
    assert derived.startswith("ecu.front_lift.a_lim = 10.37")
    assert "now gives 9.186" in derived
    assert "goes over the handlebars" in thrown
