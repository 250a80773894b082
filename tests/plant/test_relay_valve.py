"""The relay valve: crack pressure, hysteresis, and exactly closed seats."""

import numpy as np
import pytest

from bywire.core.errors import ParameterError
from bywire.plant import relay_valve

NUMBERS = {
    "law": "mechanical",
    "tau": 12e-3,
    "overlap": 0.05,
    "p_full": 0.3e5,
    "a": 1.0,
    "p_crack": 0.1e5,
    "p_fr": 0.04e5,
}
PAR = relay_valve.Parameters.create(NUMBERS)
SLOW = np.concatenate((np.linspace(0.0, 0.35e5, 20001), np.linspace(0.35e5, -0.35e5, 40001)))


def swept(par, differences=SLOW, s=0.0, h=1e-3):
    """Return the openings while the pressure difference at the spool changes slowly."""
    seats = []
    for difference in differences:
        u = relay_valve.Input(5e5 + difference, 5e5)
        x = relay_valve.State(s)
        s += h * relay_valve.balance(x, u, par) / relay_valve.mass(par)
        seats.append(relay_valve.output(relay_valve.State(s), par))
    return np.array(seats).T


def ends(opening, differences):
    """Return the pressure differences at which a seat opens and closes."""
    open_rows = np.flatnonzero(opening > 0.0)
    return differences[open_rows[0]], differences[open_rows[-1]]


def test_the_feed_opens_at_the_crack_pressure_and_closes_below_it():
    feed, _ = swept(PAR)
    opened, closed = ends(feed, SLOW)
    lap = PAR.overlap * PAR.p_full
    assert opened == pytest.approx(PAR.p_crack + lap + PAR.p_fr, rel=5e-3)
    assert closed == pytest.approx(PAR.p_crack + lap - PAR.p_fr, rel=5e-3)


def test_the_exhaust_opens_without_preload():
    _, exhaust = swept(PAR)
    opened, _ = ends(exhaust, SLOW)
    assert opened == pytest.approx(-(PAR.overlap * PAR.p_full + PAR.p_fr), rel=5e-3)


def test_friction_holds_the_spool_exactly_with_both_seats_closed():
    within = 0.9 * (PAR.p_fr + PAR.overlap * PAR.p_full)
    feed, exhaust = swept(PAR, np.full(5000, -within))
    assert not feed.any()
    assert not exhaust.any()
    u = relay_valve.Input(5e5 + 0.5 * PAR.p_fr, 5e5)
    assert relay_valve.balance(relay_valve.State(0.0), u, PAR) == 0.0


def test_without_friction_and_preload_both_laws_are_the_same():
    bare = PAR.replace({"p_fr": 0.0, "p_crack": 0.0})
    lag = PAR.replace({"law": "lag"})
    for s, difference in ((0.0, 0.1e5), (0.5, -0.2e5), (-0.3, 0.9e5)):
        u, x = relay_valve.Input(4e5 + difference, 4e5), relay_valve.State(s)
        assert relay_valve.balance(x, u, bare) == relay_valve.balance(x, u, lag)


def test_the_area_ratio_raises_the_output_pressure():
    par = PAR.replace({"a": 1.1, "p_fr": 0.0})
    u = relay_valve.Input(5e5, 5.5e5)
    assert relay_valve.balance(relay_valve.State(0.0), u, par) == pytest.approx(0.0, abs=1e-12)


def test_a_preload_without_overlap_is_rejected():
    with pytest.raises(ParameterError, match="overlap"):
        relay_valve.Parameters.create(NUMBERS | {"overlap": 0.0})
