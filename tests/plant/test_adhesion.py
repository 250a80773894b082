"""The Magic Formula against closed forms of peak, slope and rising branch."""

import math

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq, minimize

import bywire
from bywire.core.errors import ParameterError
from bywire.plant import adhesion
from bywire.plant.road import SURFACES
from raising import raises

# A set for dry tarmac as it circulates; a stiff tire with E < 0, one with E = 1.
TYRES = [
    {"B": 10.0, "C": 1.9, "D": 1.0, "E": 0.97},
    {"B": 12.0, "C": 2.3, "D": 0.82, "E": 1.0},
    {"B": 7.0, "C": 1.65, "D": 1.17, "E": -0.6},
]
TYRES = [*(SURFACES["dry-asphalt"]._replace(**each) for each in TYRES), *SURFACES.values()]
STEEP = adhesion.Parameters(curve="magic-formula")
SMOOTH = adhesion.Parameters(curve="burckhardt")


@pytest.mark.parametrize("ground", TYRES)
def test_the_peak_is_D_where_the_angle_is_a_right_one(ground):
    def angle_left(slip):
        z = ground.B * slip
        return ground.C * math.atan(z - ground.E * (z - math.atan(z))) - 0.5 * math.pi

    expected = brentq(angle_left, 1e-6, 1.0, xtol=1e-15, rtol=1e-14)
    peak = adhesion.peak_slip(ground, STEEP)
    assert peak == pytest.approx(expected, rel=1e-6)
    assert adhesion.adhesion(peak, ground, STEEP) == pytest.approx(ground.D, rel=1e-11)
    beside = [adhesion.adhesion(peak * f, ground, STEEP) for f in (0.97, 1.03)]
    assert max(beside) < ground.D


@pytest.mark.parametrize("ground", TYRES)
def test_slope_at_no_slip_is_BCD_and_the_curve_is_odd(ground):
    slip = ca.SX.sym("slip")
    curve = adhesion.magic_formula(slip, ground)
    slope = ca.Function("slope", [slip], [ca.jacobian(curve, slip)])
    assert float(slope(0.0)) == pytest.approx(ground.B * ground.C * ground.D, rel=1e-12)
    for each in (0.01, 0.1, 0.7):
        up, down = (adhesion.magic_formula(s, ground) for s in (each, -each))
        assert up == -down


@pytest.mark.parametrize("ground", TYRES)
@pytest.mark.parametrize("share", [1.05, 1.5, 3.0])
def test_beyond_the_peak_the_rising_branch_holds_as_much(ground, share):
    peak = adhesion.peak_slip(ground, STEEP)
    beyond = min(share * peak, 1.0)
    mu, slip = adhesion.held(beyond, ground, STEEP)
    assert mu == pytest.approx(adhesion.adhesion(beyond, ground, STEEP), rel=1e-12)
    assert slip < peak
    assert adhesion.adhesion(slip, ground, STEEP) == pytest.approx(mu, rel=1e-7)
    before = adhesion.held(0.5 * peak, ground, STEEP)
    assert before == pytest.approx((ground.D, peak), rel=1e-12)


@pytest.mark.parametrize("name", SURFACES)
def test_formulas_of_surfaces_are_fitted_to_burckhardts(name):
    """Peak and slip at the peak agree. The fit has the least squares over all slips."""
    surface, slips = SURFACES[name], np.linspace(0.0, 1.0, 1001)
    peak = adhesion.peak_slip(surface, SMOOTH)
    assert adhesion.peak_slip(surface, STEEP) == pytest.approx(peak, rel=2e-3)
    top = adhesion.adhesion(peak, surface, SMOOTH)
    assert surface.D / top == pytest.approx(1.0, abs=3e-4)
    wanted = adhesion.adhesion(slips, surface, SMOOTH)

    def squares(numbers):
        B, C = numbers
        z, most = B * peak, math.tan(0.5 * math.pi / C)
        E = (z - most) / (z - math.atan(z))
        fitted = adhesion.magic_formula(slips, surface._replace(B=B, C=C, D=top, E=min(E, 1.0)))
        return float(np.mean((fitted - wanted) ** 2)) if E <= 1.0 else 1.0

    best = minimize(squares, (surface.B, surface.C), method="Nelder-Mead").fun
    kept = float(np.mean((adhesion.adhesion(slips, surface, STEEP) - wanted) ** 2))
    assert kept <= 1.02 * best + 1e-9


@pytest.mark.parametrize(
    ("changes", "name", "valid"),
    [
        ({"B": 0.5}, "C arctan(B", "between pi/2 and pi"),
        ({"C": 3.9}, "C arctan(B", "between pi/2 and pi"),
        ({"C": 0.9}, "C", "> 1"),
        ({"E": 1.1}, "E", "<= 1"),
    ],
)
def test_formulas_without_a_peak_are_refused(changes, name, valid):
    given = {f"vehicle.road.first.{name}": value for name, value in changes.items()}
    with raises(ParameterError, name=f"vehicle.road.first.{name}", valid=valid):
        bywire.parameters("sport600").replace(given)
