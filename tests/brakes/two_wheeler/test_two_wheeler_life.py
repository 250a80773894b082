"""Life of a motorcycle's front pads, by stops of the whole vehicle."""

import numpy as np
import pytest

import bywire
from bywire.brakes.two_wheeler.life import TWO_WHEELER_PADS
from bywire.life import warm_stops


@pytest.fixture(scope="module")
def life():
    return bywire.project_life("two-wheeler-pads")


def test_four_millimeters_last_twenty_thousand_stops(life):
    made = life.projection
    # Stated: 0.198 um a stop with 80 % of the energy in front; drag and the share differ.
    assert made.ended_by == "lining"
    assert made.stops == pytest.approx(20_200, rel=0.02)
    worn = (made.states["h_pad"][0] - made.states["h_pad"][-1]) / made.stops
    assert worn == pytest.approx(0.198e-6, rel=0.02)


def test_the_population_is_the_mix_exactly_and_three_stops_are_simulated(life):
    speeds = 3.6 * life.projection.plan.population["options.v_0"]
    assert [int(np.sum(np.isclose(speeds, v))) for v in (50, 100, 150)] == [14, 5, 1]
    assert life.document().data["interval"] == 0.0
    assert len(life.projection.plan.different[0]) == 3
    assert len(life.projection.plan.known) == 1


def test_what_the_pads_lose_is_drawn_from_the_reservoir(life):
    made, disc = life.projection, bywire.parameters("sport600").front.disc
    worn = made.states["h_pad"][0] - made.states["h_pad"]
    drawn = made.states["V_reservoir"][0] - made.states["V_reservoir"]
    assert drawn == pytest.approx(4.0 * disc.A_cal * worn, rel=1e-9)
    assert made.left["fluid"][-1] == pytest.approx(2.44e-6, rel=0.01)
    low = bywire.project_life("two-wheeler-pads", {"wear.V_new": "20 ml"}).projection
    assert low.ended_by == "fluid"
    assert low.stops < made.stops


def test_short_pauses_cost_pads(life):
    hot = bywire.project_life("two-wheeler-pads", {"stop.pause": "5 s"})
    assert hot.projection.stops < 0.6 * life.projection.stops


def test_a_speed_that_is_set_takes_the_place_of_the_mix():
    alike = bywire.project_life("two-wheeler-pads", {"options.v_0": "100 km/h"})
    assert alike.projection.plan.varied == ()
    worn = alike.projection.states["h_pad"][0] - alike.projection.states["h_pad"][1]
    assert worn == pytest.approx(0.368e-6, rel=0.01)  # as stated, with 80 % of the energy


@pytest.mark.trust
@pytest.mark.parametrize(("pause", "worn"), [("5 s", 19.13e-6), ("30 s", 7.361e-6)])
def test_twenty_stops_wear_by_the_heat_of_the_whole_brake(pause, worn):
    # An independent trial gives 21.3 um in place of 7.4: its discs are 20 K hotter at the end.
    options = {"options.stops": "20", "options.pause": pause, "options.hold": "pressure"}
    made = bywire.run("repeated-stops", options, estimate_error=False)
    before, after = (
        np.array([made.kpi(f"disc_{when}_{k + 1}").value for k in range(20)])
        for when in ("before", "after")
    )
    work = np.full(20, 0.8 * 0.5 * 265.0 * (100.0 / 3.6) ** 2)
    thinned = warm_stops.thinned(work, before, after, TWO_WHEELER_PADS.defaults().pads)
    assert thinned.sum() == pytest.approx(worn, rel=0.01)
