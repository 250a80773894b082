"""Remarks on slip control that holds far less slip than that of the maximum adhesion."""

import numpy as np
import pytest

import bywire
from bywire.brakes.two_wheeler.model import TwoWheelerByWire
from bywire.vehicle.slip_control import far_from_peak
from bywire.vehicle.surfaces import laid

PLACE = np.linspace(0.0, 40.0, 81)
ACTS = np.ones(81)


def said(first, further=None, place=PLACE, acts=ACTS, slip_set=0.105, **changes):
    par = bywire.parameters("sport600").replace(laid("vehicle.road", first, further) | changes)
    return far_from_peak(
        place, acts, slip_set, "slip_set", par.vehicle.front_tyre, par.vehicle.road
    )


@pytest.mark.parametrize("curve", ["burckhardt", "magic-formula"])
def test_dry_cobble_is_told_and_where_it_comes_from(curve):
    (text,) = said("dry-cobble", **{"vehicle.front_tyre.curve": curve})
    peak = np.log(1.3713 * 6.4565 / 0.6691) / 6.4565
    Bs = 2.565 * 0.105
    share = {
        "burckhardt": 1.3713 * (1 - np.exp(-6.4565 * 0.105)) - 0.6691 * 0.105,
        "magic-formula": np.sin(2.117 * np.arctan(Bs - 0.4782 * (Bs - np.arctan(Bs)))),
    }[curve]
    assert "slip set point of 0.105 (slip_set), but dry-cobble has its maximum adhesion" in text
    assert f"at {peak:.3g}. The wheel uses {100 * share / 0.9999:.0f} % of it" in text


def test_surfaces_whose_peak_is_near_are_not():
    for surface in ("dry-asphalt", "wet-asphalt", "dry-concrete", "wet-cobble", "snow", "ice"):
        assert said(surface) == []
    assert said("dry-cobble", slip_set=0.21) == []
    assert len(said("dry-cobble", slip_set=0.19)) == 1


def test_only_where_slip_control_acts():
    change = {"vehicle.road.x_change": 20.0, "vehicle.road.x_back": 30.0}
    assert said("dry-cobble", acts=np.zeros(81)) == []
    assert len(said("wet-asphalt", "dry-cobble", **change)) == 1
    before = np.where(PLACE < 19.0, 1.0, 0.0)
    assert said("wet-asphalt", "dry-cobble", acts=before, **change) == []
    assert said("wet-asphalt", "dry-cobble", acts=np.where(PLACE > 31.0, 1.0, 0.0), **change) == []
    assert len(said("dry-cobble", "wet-asphalt", acts=before, **change)) == 1


def test_a_stop_by_pi_on_cobble_says_so_above_its_figures():
    options = {"v_0": 15.0, "surface": "dry-cobble"}
    result = bywire.run(
        bywire.Bench("straight-stop", "sport600", options=options), estimate_error=False
    )
    told = [text for text in result.document().data["remarks"] if "maximum adhesion at 0.4" in text]
    assert ["ecu.front_slip.slip_set" in text for text in told] == [True, False]
    run, par = result.recording, result.bench.par.replace(laid("vehicle.road", "dry-cobble"))
    assert TwoWheelerByWire().remarks(run, par) == told
    for other in ({"ecu.abs": "rules"}, {"ecu.mix.alpha": 0.5}):
        assert TwoWheelerByWire().remarks(run, par.replace(other)) == []
