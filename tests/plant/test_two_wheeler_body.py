"""Loads of the wheels of a rigid two-wheeler, against the conditions that ground sets."""

from __future__ import annotations

import numpy as np
import pytest

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
    """The limit is mu_f = l_f/h; far above it, beyond L/h, both sides of the equation turn."""
    lift = PAR.l_f / PAR.h
    loads = [rigid_rear_load(mu_f, 0.0, 0.0, 1.0, PAR) for mu_f in np.linspace(lift, 6.0, 200)]
    assert max(loads) < 1e-9 * WEIGHT
    assert rigid_rear_load(0.99 * lift, 0.0, 0.0, 1.0, PAR) > 0.0


@pytest.mark.parametrize("F", [-5000.0, -1000.0, 0.0, 1000.0, 5000.0])
def test_a_given_force_loads_no_wheel_with_less_than_nothing(F: float) -> None:
    loads = body.loads(rear_load(F, 0.0, 1.0, PAR), 1.0, PAR)
    assert min(loads) >= 0.0
    assert sum(loads) == pytest.approx(WEIGHT)
