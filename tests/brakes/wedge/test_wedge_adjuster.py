"""The wedge brake's adjuster over thousands of stops with constant wear, and its faults."""

import numpy as np
import pytest

import bywire
from bywire.brakes.wedge import life
from bywire.brakes.wedge.life import WEDGE_PADS
from bywire.control import wear_adjuster
from bywire.control.wear_adjuster import Input, State

PAR = bywire.parameters("roberts2003-corner")
WEAR = WEDGE_PADS.defaults()
COLD = {"beyond": 0.0, "T_disc": 293.15}


def _stops(count, wear=WEAR, each=1.25e-6, readings=COLD):
    """Return clearance and clicks after each of some stops of constant wear."""
    z = life.begin(PAR, wear)
    path = [z]
    for _ in range(count):
        z = {**z, "clearance": z["clearance"] + each, "h_pad": z["h_pad"] - 0.5 * each}
        z = life.between(z, readings, PAR, wear)
        path.append(z)
    return {name: np.array([each[name] for each in path]) for name in z}


def test_four_thousand_stops_take_sixty_two_clicks():
    z = _stops(4000)
    assert z["h_pad"][0] - z["h_pad"][-1] == pytest.approx(2.5e-3)  # 5.0 mm for both
    assert z["clicks"][-1] == pytest.approx(62, abs=1)
    assert z["counted"][-1] == z["clicks"][-1]
    # 0.300 mm and the wear of the three applications that have to show it
    assert 0.300e-3 < z["clearance"].max() <= 0.3e-3 + 3 * 1.25e-6
    assert z["clearance"].min() >= 0.2e-3


def test_the_count_is_a_log_of_the_wear():
    z = _stops(4000)
    worn = 2.0 * (z["h_pad"][0] - z["h_pad"])
    assert np.abs(worn - z["counted"] * WEAR.adjuster.tooth).max() < 0.11e-3


@pytest.mark.parametrize(
    ("fault", "clicks", "counted", "largest"),
    [
        ("stuck", 0, 1e4, 5.2e-3),
        ("slips", 61, 122, 0.3e-3 + 5 * 1.25e-6),  # it turns again after three more
        ("over-adjusts", 61, 30.5, 0.3e-3 + 2 * 1.25e-6),
    ],
)
def test_faults_show_in_clearance_and_clicks(fault, clicks, counted, largest):
    z = _stops(4000, WEAR.replace({"adjuster.fault": fault}))
    assert z["clicks"][-1] == pytest.approx(clicks, abs=1)
    assert z["counted"][-1] > counted if fault == "stuck" else abs(z["counted"][-1] - counted) < 2
    assert z["clearance"].max() == pytest.approx(largest, abs=1.5e-6 if clicks else 0.1e-3)


def test_heat_is_told_from_wear_unless_it_is_blind_to_it():
    hot = {**COLD, "T_disc": 293.15 + 250.0}
    sound = _stops(2000, readings=hot)
    assert sound["clearance"].max() == pytest.approx(_stops(2000)["clearance"].max(), abs=1e-9)
    blind = _stops(2000, WEAR.replace({"adjuster.fault": "blind-to-heat"}), readings=hot)
    growth = WEAR.adjuster.growth * 250.0
    assert blind["clearance"].max() == pytest.approx(sound["clearance"].max() + growth, abs=2e-6)


def test_it_acts_when_parked_and_not_braking_alone():
    law = WEAR.adjuster
    seen = Input(gap=0.5e-3, T=293.15, touching=0.0, parked=0.0, wanted=1.0)
    x, turned = State(0.0, 0.0, 0.0), []
    # The brake is applied again before it is parked, left before contact, and parked again.
    crossing, pressing = (0, 0, 1), (1, 0, 1)
    twice = [crossing, pressing, (0, 0, 0), crossing, pressing, (0, 0, 0), (0, 1, 1)]
    for touching, parked, wanted in [*twice, (0, 1, 0), (0, 1, 0), crossing, (0, 1, 0)] * 4:
        now = seen._replace(touching=touching, parked=parked, wanted=wanted)
        x, out = wear_adjuster.output(x, now, law)
        turned.append((out.turned, parked, wanted))
    # Each of three applications counts once, however long the brake is parked, then it turns.
    assert [n for n, *_ in turned].count(3.0) == 1
    assert turned.index((3.0, 1, 0)) == 2 * 11 + 7
    assert all(n == 0 for n, parked, wanted in turned if not parked or wanted)


@pytest.mark.parametrize("ways", ["closing", "both"])
def test_it_never_turns_below_the_least_clearance(ways):
    law = WEAR.adjuster.replace({"gap_min": 0.25e-3, "ways": ways})
    for gap in np.linspace(0.1e-3, 2e-3, 500):
        left = gap - law.tooth * wear_adjuster.due(float(gap), law)
        assert left >= min(gap, 0.25e-3) - 1e-12
        if ways == "both":  # as few teeth as make it up
            assert 0.25e-3 - 1e-12 <= left < max(gap, 0.25e-3 + law.tooth + 1e-12)


@pytest.mark.parametrize(("fault", "turned"), [("none", -2.0), ("one-way", 0.0), ("stuck", 0.0)])
def test_too_little_clearance_is_given_back_where_it_turns_both_ways(fault, turned):
    law = WEAR.adjuster.replace({"ways": "both", "fault": fault})
    seen = Input(gap=0.04e-3, T=293.15, touching=0.0, parked=1.0, wanted=0.0)
    x, acts = State(1.0, 0.0, 0.0), []
    for _ in range(4):
        x, out = wear_adjuster.output(x._replace(applied=1.0), seen, law)
        acts.append((out.turned, x.wide, x.teeth))
    assert acts == [(0.0, -1.0, 0.0), (0.0, -2.0, 0.0), (turned, 0.0, -2.0), (0.0, -1.0, -2.0)]
    wide = seen._replace(gap=0.5e-3)  # a wide gap begins another row
    assert wear_adjuster.output(x._replace(applied=1.0), wide, law)[0].wide == 1.0
