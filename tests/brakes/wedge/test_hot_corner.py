"""Heat and fade of the wedge brake on a quarter car: energy, closed forms, longer stops."""

from __future__ import annotations

import numpy as np
import pytest

import bywire
from bywire.bench.energy_ledger import actuator_ledger, further_ledgers
from bywire.core.catalog import PARAMETER_SETS
from bywire.plant import disc_heat

WARM = {"corner.heat.law": "lumped", "options.t_hold": "4.5 s", "options.t_end": "0.1 s"}
HEAT = PARAMETER_SETS.find("roberts2003-corner").parameters().corner.heat.replace({"law": "lumped"})


def stop(**changes):
    return bywire.run("corner-stop", {**WARM, **changes}, estimate_error=False)


@pytest.fixture(scope="module")
def cold():
    return stop()


@pytest.fixture(scope="module")
def faded():
    return stop(**{"options.T_disc": "550 degC"})


def growth(run, name):
    return float(run[name][-1] - run[name][0])


def test_every_book_closes(cold, faded):
    for result in (cold, faded):
        books = further_ledgers(result.recording)
        assert set(books) == {"vehicle", "heat", "with disc"}
        assert abs(books["heat"].closing_error) < 1e-8 * books["heat"].turnover
        assert abs(books["vehicle"].closing_error) < 1e-10 * books["vehicle"].turnover
        assert abs(books["with disc"].closing_error) < 1e-10 * books["with disc"].turnover
        own = actuator_ledger(result.recording)
        assert abs(own.closing_error) < 1e-8 * own.turnover
        assert growth(result.recording, "E_friction") == growth(result.recording, "E_brake")
    off = stop(**{"corner.heat.law": "off"})
    assert "heat" not in further_ledgers(off.recording)
    assert growth(off.recording, "T_disc") == 0.0
    # the brake is unchanged at the initial temperature
    for kpi in ("stopping_distance", "energy_braked"):
        assert off.kpi(kpi).value == pytest.approx(cold.kpi(kpi).value, rel=1e-6)


def test_a_disc_that_loses_nothing_keeps_its_share_of_the_heat():
    none = {
        f"corner.heat.{name}": f"0 {unit}"
        for unit, names in {
            "W/m^2/K": ("h_0", "h_1"),
            "W/K": ("G_dp", "G_open", "G_pf", "G_f"),
            "": ("epsilon",),
        }.items()
        for name in names
    }
    run = stop(**none).recording
    taken = growth(run, "E_brake")
    assert growth(run, "T_disc") == pytest.approx(HEAT.psi * taken / HEAT.C_d, rel=1e-7)
    assert growth(run, "T_pads") == pytest.approx((1 - HEAT.psi) * taken / HEAT.C_p, rel=1e-7)


def test_a_wheel_that_stands_gives_no_heat(cold):
    run = cold.recording.sel(time=slice(cold.kpi("stopping_time").value + 0.05, 4.4))
    assert not run["Omega"].values.any()
    assert growth(run, "E_friction") == 0.0
    assert float(run["F_N"].min()) > 1e3
    assert growth(run, "T_disc") < 0.0


def test_faded_pads_take_more_force_and_the_motors_what_the_road_gave(cold, faded):
    now = slice(1.5, 2.5)
    ours, theirs = (result.recording.sel(time=now) for result in (cold, faded))
    left = disc_heat.friction(theirs["T_disc"].values, HEAT)
    assert (left > 0.66).all()
    assert (left < 0.70).all()
    # as the moment is controlled, the normal force makes up for friction
    assert float(theirs["M_B"].mean()) == pytest.approx(float(ours["M_B"].mean()), rel=2e-3)
    ratio = float(theirs["F_N"].mean()) / float(ours["F_N"].mean())
    assert ratio == pytest.approx(float(np.mean(1.0 / left)), rel=2e-3)
    # and the wedge is pushed by (tan alpha - mu) F_N, which the road no longer gives
    par = bywire.parameters("roberts2003-corner")
    pushed = np.mean((np.tan(par.wedge.alpha) - left * par.wedge.mu_B) * theirs["F_N"].values)
    assert float(theirs["F_M"].mean()) == pytest.approx(float(pushed), rel=0.1)
    assert float(theirs["F_M"].mean()) > 10.0 * float(ours["F_M"].mean())
    assert faded.kpi("stopping_distance").value == pytest.approx(23.38, abs=0.02)
    assert cold.kpi("disc_temperature").value == pytest.approx(293.15 + 10.57, abs=0.05)


def test_a_disc_hotter_than_the_numbers_hold_is_reported():
    result = stop(**{"options.T_disc": "700 degC"})
    assert any("the discs exceed 650 degC" in text for text in result.warnings)
