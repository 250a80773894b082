"""Closed forms of adhesion, load transfer and ideal stops."""

import math

import pytest

import bywire
from bywire.brakes.two_wheeler.case import on_surface
from bywire.core.errors import ParameterError
from bywire.plant import adhesion, brake_disc, road
from bywire.vehicle.ideal_stop import ideal_distance, peak_adhesion
from raising import raises

G, L, L_F, H = 9.81, 1.40, 0.69, 0.62
K_DRAG = 1.225 * 0.40 / (2.0 * 265.0)


def vehicle(surface="dry-asphalt", **changes):
    par = bywire.parameters("sport600")
    return par.replace({**on_surface(surface), **changes})


@pytest.mark.parametrize(
    ("surface", "slip", "peak", "locked"),
    [
        ("dry-asphalt", 0.170, 1.170, 0.760),
        ("wet-asphalt", 0.131, 0.801, 0.510),
        ("dry-cobble", 0.400, 1.000, 0.700),
        ("snow", 0.060, 0.190, 0.130),
    ],
)
def test_surfaces_have_their_published_peaks(surface, slip, peak, locked):
    ground, tyre = road.SURFACES[surface], vehicle(surface).vehicle.front_tyre
    c1, c2, c3 = ground[:3]
    assert adhesion.peak_slip(ground, tyre) == pytest.approx(math.log(c1 * c2 / c3) / c2, rel=1e-12)
    assert adhesion.peak_slip(ground, tyre) == pytest.approx(slip, abs=6e-4)
    assert peak_adhesion(vehicle(surface).vehicle) == pytest.approx((peak, peak), abs=6e-4)
    assert adhesion.adhesion(1.0, ground, tyre) == pytest.approx(locked, abs=6e-4)
    # A peak indeed: to either side there is less.
    top = adhesion.peak_slip(ground, tyre)
    assert max(adhesion.adhesion(top * f, ground, tyre) for f in (0.99, 1.01)) < peak + 5e-4


@pytest.mark.parametrize(
    ("surface", "v", "front_only", "distance"),
    [
        ("dry-asphalt", 100 / 3.6, False, 34.23),
        ("dry-asphalt", 30.0, False, 39.72),
        ("wet-asphalt", 100 / 3.6, False, 46.98),
        ("wet-asphalt", 30.0, False, 54.41),
        ("wet-asphalt", 100 / 3.6, True, 59.08),
        ("wet-asphalt", 30.0, True, 68.32),
        ("snow", 100 / 3.6, False, 175.2),
        ("snow", 30.0, False, 199.6),
    ],
)
def test_ideal_stops(surface, v, front_only, distance):
    par = vehicle(surface).vehicle
    c1, c2, c3 = road.SURFACES[surface][:3]
    slip = math.log(c1 * c2 / c3) / c2
    mu = c1 * (1.0 - math.exp(-c2 * slip)) - c3 * slip
    a = min(mu, L_F / H) * G
    if front_only:
        a = mu * G * (1.0 - L_F / L) / (1.0 - mu * H / L)
    expected = math.log(1.0 + K_DRAG * v * v / a) / (2.0 * K_DRAG)
    got = ideal_distance(v, par, front_only=front_only)
    assert got == pytest.approx(expected, rel=1e-6)
    assert got == pytest.approx(distance, abs=0.06 if surface == "snow" else 0.006)


def test_no_ideal_stop_where_the_road_falls_more_steeply_than_tyres_hold():
    steep = vehicle("snow", **{"vehicle.road.gradient": -0.2})
    assert ideal_distance(30.0, steep.vehicle) == math.inf


def test_brakes_hold_what_their_discs_say():
    par = vehicle()
    assert brake_disc.torque_per_pressure(par.front.disc) == pytest.approx(33.1e-5, rel=5e-3)
    assert brake_disc.torque_per_pressure(par.rear.disc) == pytest.approx(2.28e-5, rel=1e-3)
    assert par.ecu.front_slip.k_hat == pytest.approx(brake_disc.torque_per_pressure(par.front.disc))
    assert par.ecu.rear_slip.k_hat == pytest.approx(brake_disc.torque_per_pressure(par.rear.disc))


@pytest.mark.parametrize(
    ("changes", "name", "valid"),
    [
        ({"vehicle.body.l_f": 1.5}, "vehicle.body.l_f", "< the wheelbase L"),
        ({"vehicle.road.first.c3": 40.0}, "vehicle.road.first.c1 c2", "> c3 = 40"),
        ({"vehicle.road.x_back": 10.0}, "vehicle.road.x_back", ">= x_change + ramp"),
    ],
)
def test_impossible_geometry_and_roads_are_refused(changes, name, valid):
    with raises(ParameterError, name=name, valid=valid):
        vehicle(**changes)
