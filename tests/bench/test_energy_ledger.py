"""The books of a run: they close, parts stand for wholes, and nothing is counted twice."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from bywire.api.run import run
from bywire.api.run_sections import energy_table
from bywire.bench.bench import Bench
from bywire.bench.energy_ledger import actuator_ledger, further_ledgers, role_attributes
from bywire.core.signals import Role

T = np.linspace(0.0, 1.0, 5)


def recording(**energies: float) -> xr.Dataset:
    """Return a recording in which every energy grows evenly from zero."""
    rows = {name: ("time", value * T, {"units": "J"}) for name, value in energies.items()}
    return xr.Dataset(rows, coords={"time": T})


def by_name(postings):
    return {one.name: one.energy for one in postings}


@pytest.fixture(scope="module")
def braking():
    options = {"t_hold": 0.15, "t_low": 0.05, "t_high": 0.05, "pulses": 1}
    return run(Bench("moment-pulses", "roberts2003", options=options))


def test_books_of_both_brakes_close(braking):
    hydraulic = run(Bench("hard-braking", "dardanelli2010", options={"duration": 0.2}))
    for result in (braking, hydraulic):
        for label, books in result.as_object()["energy"].items():
            given, taken = (sum(books[side].values()) for side in ("sources", "sinks"))
            assert given - taken == pytest.approx(books["closing_error"], abs=1e-12)
            assert abs(books["closing_error"]) < 1e-6 * given, label
            assert given > 1.0


def test_disc_gives_what_the_pads_turn_into_heat(braking):
    """Heat is the friction force times the slip: of both pads, one of them moving."""
    one = braking.recordings["run"].sel(time=slice(-1e-9, None))
    books = further_ledgers(one)["with disc"]
    sinks = by_name(books.sinks)
    par = braking.bench.par.flat()
    slip = 2.0 * par["caliper.r_B"] * one["Omega"].values - one["v"].values
    heat = np.trapezoid(par["wedge.mu_B"] * one["F_N"].values * slip, one["time"].values)
    assert sinks["E_pads"] == pytest.approx(heat, rel=1e-3)
    assert sinks["E_pads"] > 100.0 * sinks["E_copper_moving"]


def test_standby_and_both_kinds_of_copper_stand_for_the_whole(braking):
    one = braking.recordings["run"].sel(time=slice(-1e-9, None))
    sinks = by_name(actuator_ledger(one).sinks)
    length = float(one["time"].values[-1] - one["time"].values[0])
    assert sinks["E_standby"] == pytest.approx(
        braking.bench.par.flat()["supply.P_standby"] * length
    )
    copper = float(one["E_copper"].values[-1] - one["E_copper"].values[0])
    assert sinks["E_copper_moving"] + sinks["E_copper_holding"] == pytest.approx(copper)
    assert 0.0 < sinks["E_copper_holding"] < copper
    assert "E_copper" not in sinks


def test_copper_counts_as_holding_while_all_stuck():
    one = recording(E_source=5.0, E_copper=4.0, E_stored=1.0, t_stuck=0.25)
    one["E_copper"].attrs |= role_attributes(Role("sink", "copper", split=True))
    one["t_stuck"].attrs |= role_attributes(Role("standstill"))
    books = actuator_ledger(one)
    sinks = by_name(books.sinks)
    assert sinks["E_copper_holding"] == pytest.approx(1.0)
    assert books.closing_error == pytest.approx(0.0, abs=1e-12)


def test_what_is_missing_and_what_others_call_their_losses():
    one = recording(E_source=5.0, E_clutch=3.0, E_stored=1.0)
    one["E_clutch"].attrs["long_name"] = "slip of the clutch"
    books = actuator_ledger(one)
    assert books.closing_error == pytest.approx(1.0)
    assert [p.label for p in books.sinks] == ["stored", "slip of the clutch"]
    assert further_ledgers(one) == {}
    texts = [[cell.text for cell in row] for row in energy_table(books).rows]
    assert texts[-1] == ["", "closing error", "1 J", "20 %"]


def test_energy_given_back_is_turned_over():
    books = actuator_ledger(recording(E_source=-1.0, E_gear=-0.5, E_stored=-0.5))
    assert books.turnover == pytest.approx(1.0)
    assert books.closing_error == pytest.approx(0.0, abs=1e-12)
