"""The slip loop of a wheel on a drum, against closed forms."""

import numpy as np
import pytest

import bywire
from bywire.analysis.linear.linearize import linearize
from bywire.brakes.two_wheeler.loops import point
from bywire.control import slip_pi
from bywire.plant import brake_disc


def spread(schedule):
    """Return the largest gain margin over the smallest, of speeds from 10 to 30 m/s."""
    given = {"slip.schedule": schedule}
    found = bywire.margins("slip", overrides=given, over="at=10 m/s:30 m/s:3")
    each = [margins.gain for margins in found.margins]
    return max(each) / min(each)


def slope_of(ground, slip, curve):
    """Return the slope of the adhesion over slip."""
    if curve == "burckhardt":
        return ground.c1 * ground.c2 * np.exp(-ground.c2 * slip) - ground.c3
    z = ground.B * slip
    inner = z - ground.E * (z - np.arctan(z))
    rise = ground.B * (1.0 - ground.E * z * z / (1.0 + z * z))
    angle = ground.C * np.arctan(inner)
    return ground.D * np.cos(angle) * ground.C * rise / (1.0 + inner * inner)


@pytest.mark.parametrize("curve", ["burckhardt", "magic-formula"])
def test_the_plant_has_the_gain_and_the_pole_of_a_single_corner(curve):
    par = bywire.parameters("front600").replace({"tyre.curve": curve})
    for v in (10.0, 30.0):
        at = point(par, v)
        model = linearize(
            at.model, at.par, at.state, at.memory, inputs=("p_ref",), outputs=("slip",)
        )
        ground, slip = par.drum.surface, par.slip.slip_set
        slope = slope_of(ground, slip, curve)
        k, wheel = brake_disc.torque_per_pressure(par.brake.disc), par.wheel
        # Gain r k/(J v a) with a = mu' N r^2/(J v), at every speed.
        gain = k / (slope * par.drum.N * wheel.r)
        low = model.response(np.array([1e-3]))[0, 0, 0]
        assert low.real == pytest.approx(gain, rel=1e-3)
        # Wheel on a tire that relaxes: s^2 + s v/sigma + mu' N r^2/(J sigma) = 0.
        sigma = par.tyre.sigma
        corner = np.roots([1.0, v / sigma, slope * par.drum.N * wheel.r**2 / (wheel.J * sigma)])
        for root in corner:
            assert np.abs(model.poles() - root).min() < 1e-6 * np.abs(root)


def test_a_gain_that_follows_the_speed_keeps_the_gain_margin():
    assert spread("speed") < 1.2
    assert spread("fixed") > 2.0


@pytest.mark.parametrize(
    ("changes", "v", "valid"),
    [({"slip.slip_set": 0.2}, 20.0, "slip.slip_set.*< 0.131"), ({}, -1.0, "speed.*> 0 m/s")],
)
def test_points_that_do_not_stay_are_refused(changes, v, valid):
    with pytest.raises(bywire.BywireError, match=valid):
        point(bywire.parameters("front600").replace(changes), v)


def climbed(eager, slip, building_up=False):
    """Return how long slip control takes from a slip to within 5 % of its set slip, 0.105.

    On a tire that is a spring, 15 kN m per unit slip at once; or how far it gets in 0.2 s while
    the demand still builds up.
    """
    par = bywire.parameters("sport600").ecu.front_slip.replace({"eager": eager, "T_t": 1e9})
    T, stiff, t = 1e-3, 15e3 / par.k_hat, 0.0
    p_rider = 3.0 * stiff * par.slip_set
    x = slip_pi.State(stiff * slip - slip_pi.gain(20.0, par) * (par.slip_set - slip))
    while abs(slip - par.slip_set) > 0.05 * par.slip_set and t < (0.2 if building_up else 30.0):
        p_most = p_rider - 1.0 if building_up else p_rider
        seen = slip_pi.Input(20.0, par.slip_set, slip, p_rider, p_most, p_most)
        x, out = slip_pi.output(x, seen, T, par)
        # the slip follows a moment later, as the tire does
        slip, t = slip + 0.2 * (out.p / stiff - slip), t + T
    return slip if building_up else t


def test_an_integral_alone_is_slow_on_a_stiff_tyre_and_hurries_below_its_slip():
    par = bywire.parameters("sport600").ecu.front_slip
    # (stiffness + K_p) T_i/K_p: exponential from 0.04 to 5 % of 0.105
    K_p = slip_pi.gain(20.0, par) * par.k_hat
    slow = par.T_i * (15e3 + K_p) / K_p * np.log(0.065 / (0.05 * 0.105))
    assert climbed(0.0, 0.04) == pytest.approx(slow, rel=0.02)
    assert climbed(10.0, 0.04) < 0.4 * slow
    # beyond the set slip and while the demand builds up, it is unchanged
    assert climbed(10.0, 0.14) == climbed(0.0, 0.14)
    assert climbed(10.0, 0.04, building_up=True) == climbed(0.0, 0.04, building_up=True)
