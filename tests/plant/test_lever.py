"""The lever of an air brake against the geometry of its drawing."""

import math

import pytest

from bywire.core.errors import ParameterError
from bywire.plant import lever

NUMBERS = {"law": "turning", "i": 15.0, "L": 0.08, "phi_0": 0.25, "F_fr": 60.0, "mu": 0.04}
PAR = lever.Parameters.create(NUMBERS)


def test_the_ratio_is_largest_in_the_perpendicular_position():
    middle = PAR.L * math.sin(PAR.phi_0)
    assert lever.slope(middle, PAR) == pytest.approx(1.0 / 15.0)
    assert lever.travel(0.0, PAR) == pytest.approx(0.0, abs=1e-18)
    assert lever.travel(middle, PAR) == pytest.approx(PAR.L / 15.0 * 0.25)
    # By the same angle on both sides of the middle, the lever has the same ratio.
    assert lever.slope(0.0, PAR) == pytest.approx(1.0 / (15.0 * math.cos(0.25)))
    assert lever.slope(2.0 * middle, PAR) == pytest.approx(lever.slope(0.0, PAR))


def test_travel_is_the_integral_of_the_slope():
    rest, step = 5e-3, 1e-6
    rise = lever.travel(rest + step, PAR) - lever.travel(rest - step, PAR)
    assert rise / (2.0 * step) == pytest.approx(lever.slope(rest, PAR), rel=1e-8)


def test_friction_separates_applying_and_releasing():
    par = PAR.replace({"law": "constant"})
    u = lever.Input(0.02, 0.0, 60e3)
    assert lever.load(u, par) == pytest.approx(4e3)
    applying = lever.load(u, par) + lever.friction(u, par)
    releasing = lever.load(u, par) - lever.friction(u, par)
    assert (applying, releasing) == pytest.approx((4220.0, 3780.0))
    assert 15.0 * (applying - par.F_fr) / (1.0 + par.mu) == pytest.approx(60e3)
    assert 15.0 * (releasing + par.F_fr) / (1.0 - par.mu) == pytest.approx(60e3)


@pytest.mark.parametrize("values", [{"mu": 1.0}, {"i": 0.0}, {"L": 0.0}, {"phi_0": 1.3}])
def test_an_impossible_lever_is_rejected(values):
    with pytest.raises(ParameterError):
        lever.Parameters.create(NUMBERS | values)
