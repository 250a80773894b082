"""A motor and the wedge brake at one wheel: shares of the moment, slip control, gaps."""

from __future__ import annotations

import numpy as np
import pytest

import bywire
from bywire.bench.energy_ledger import actuator_ledger, further_ledgers
from bywire.core.errors import ParameterError
from raising import raises
from run_once import run_once


def stop(**changes):
    overrides = {key.replace("__", "."): value for key, value in changes.items()}
    return bywire.run("corner-blending", overrides, estimate_error=False)


@pytest.fixture(scope="module")
def dry():
    return stop()


def figures(result):
    return {kpi.name: kpi.value for kpi in result.kpis}


def test_the_motor_brakes_first(dry):
    run, found = dry.recording, figures(dry)
    middle = run.sel(time=5.0, method="nearest")
    assert float(middle["T_m"]) == pytest.approx(380.0, rel=1e-6)  # 400 N m less T_least
    assert found["recovery_efficiency"] == pytest.approx(97.0, abs=0.3)
    assert found["largest_dip"] < 6.0


def test_all_books_close(dry):
    run = dry.recording
    for each in (actuator_ledger(run), *further_ledgers(run).values()):
        assert abs(each.closing_error) < 1e-6 * each.turnover, each
    assert {"vehicle", "battery"} <= further_ledgers(run).keys()


def test_the_torque_deviates_as_without_a_motor(dry):
    """What remains is the runout of the disc, which the moment control does not remove."""
    alone = figures(stop(options__soc=1.0))
    assert alone["recovered_energy"] == 0.0
    assert figures(dry)["steady_error"] == pytest.approx(alone["steady_error"], abs=0.3)


def test_slip_control_takes_the_motor_out_within_50_ms():
    panic = {"options__surface": "wet-asphalt", "options__T_demand": "1500 N*m"}
    result = stop(**panic, options__duration="6 s")
    run = result.recording
    t = run["time"].values
    first = int(np.argmax(run["T_m_ref"].values[1:] < run["T_m_ref"].values[:-1] - 1.0))
    assert float(run["abs"][first]) == 1.0
    assert float(run["T_m"][first]) > 200.0
    after = run.sel(time=slice(t[first] + 0.051, None))
    assert float(np.abs(after["T_m_ref"]).max()) == 0.0
    assert float(after["T_m"].sel(time=t[first] + 0.1, method="nearest")) < 2.0
    alone = run_once("corner-panic", {"options.surface": "wet-asphalt"})
    distance = alone.kpi("stopping_distance").value
    assert result.kpi("stopping_distance").value == pytest.approx(distance, rel=0.03)


def test_the_pads_must_stay_on_the_disc_below_slip_control():
    with raises(ParameterError, name="regeneration.blending.T_least", value="0 N m"):
        stop(regeneration__blending__T_least="0 N*m")


def test_pads_that_leave_the_disc_brake_late():
    """Without slip control, the gap may open, and closing it adds to the dip."""
    without = {"regeneration__blending__T_least": "0 N*m", "ecu__abs": "off"}
    found = figures(stop(**without))
    assert found["largest_dip"] > figures(stop(ecu__abs="off"))["largest_dip"] + 2.0


def test_a_battery_that_is_full_at_the_top_of_a_hill():
    result = stop(options__soc=1.0, options__gradient="-8 %", options__duration="25 s")
    found = figures(result)
    assert found["recovered_energy"] == 0.0
    assert found["largest_dip"] < 5.0
