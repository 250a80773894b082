"""Mixed slip and deceleration control: one tuning for all surfaces, by linear poles."""

from __future__ import annotations

import numpy as np
import pytest

import bywire
from bywire.plant import adhesion, brake_disc
from bywire.plant.road import SURFACES

BENCH = "benches/wet_stop_mixed.toml"
ROADS = ["dry-asphalt", "wet-asphalt", "snow", "dry-cobble", "wet-cobble"]
LESS_SNOW = [pytest.param(r, marks=pytest.mark.trust) if r == "snow" else r for r in ROADS]
"""stops on snow take as long as all others; its poles are looked at with the others'"""
SLIPS = np.linspace(0.01, 0.45, 30)


def growth(par, road, v, slip):
    """Return the largest real part of a single corner's poles [1/s].

    Slip, pressure and its rate, filtered deceleration, integral; the tire at once.
    """
    vehicle, gains, mix = par.vehicle, par.ecu.front_slip, par.ecu.mix
    body, wheel, circuit = vehicle.body, vehicle.front_wheel, par.front.circuit
    ground = SURFACES[road]
    c1, c2, c3 = ground[:3]
    mu, slope = adhesion.burckhardt(slip, ground), c1 * c2 * np.exp(-c2 * slip) - c3
    load = body.m * body.g * min(1.0 - body.l_f / body.L + mu * body.h / body.L, 1.0)
    k, r, w = brake_disc.torque_per_pressure(par.front.disc), wheel.r, 2 * np.pi * circuit.f_n
    speed = gains.v_fixed if gains.schedule == "fixed" else v
    gain = gains.omega_c * gains.J_hat * speed / (gains.r_hat * gains.k_hat)
    bar = r * k / wheel.J  # deceleration of the wheel by a pressure
    held = r**2 / wheel.J * load * slope  # and by a slip
    mixed = np.array([mix.alpha, 0.0, 0.0, 1.0 - mix.alpha, 0.0])
    A = np.zeros((5, 5))
    A[0, :2] = -(held + load * slope * (1.0 - slip) / body.m) / v, bar / v
    A[1, 2] = 1.0
    A[2] = -(w**2) * gain * mixed + [0.0, -(w**2), -2 * circuit.zeta * w, 0.0, w**2]
    A[3, [0, 1, 3]] = np.array([-held / mix.g, bar / mix.g, -1.0]) / mix.tau
    A[4] = -gain / gains.T_i * mixed
    scale = np.array([1.0, 1e6, 1e8, 1.0, 1e6])
    return np.linalg.eigvals(A / scale[:, None] * scale).real.max()


def slowest_stable(par, road):
    """Return the speed above which every slip stays [m/s]."""
    unstable = [v for v in range(3, 41) if max(growth(par, road, v, s) for s in SLIPS) > 0.0]
    return max(unstable, default=2) + 1


@pytest.mark.parametrize("alpha", [0.6, 0.7, 0.8])
def test_one_tuning_is_stable_on_every_curve_and_for_every_share(alpha):
    par = bywire.load(BENCH).par.replace({"ecu.mix.alpha": alpha})
    found = {road: slowest_stable(par, road) for road in ROADS}
    assert found["snow"] == found["wet-cobble"] == 3
    assert found["dry-cobble"] <= 4
    assert found["wet-asphalt"] <= 6
    assert found["dry-asphalt"] <= 11


def test_gains_of_slip_control_are_stable_for_slip_alone():
    par = bywire.parameters("sport600")
    assert slowest_stable(par, "wet-asphalt") == 9
    mixed = par.replace({"ecu.mix.alpha": 0.95})
    assert all(slowest_stable(mixed, road) == 41 for road in ROADS)


@pytest.mark.parametrize("surface", LESS_SNOW)
def test_the_tuning_does_for_every_surface(surface):
    result = bywire.run(BENCH, {"options.surface": surface}, estimate_error=False)
    assert result.kpi("braking_efficiency").value > 80.0
    assert result.kpi("jerk").value < 15.0
    assert all(verdict.met for verdict in result.verdicts)
