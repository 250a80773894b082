"""Warnings on runs of the wedge brake that go wrong or are recorded badly."""

from __future__ import annotations

import math
import re
import warnings

import numpy as np
import pytest

import bywire
from bywire.brakes.wedge.model import warnings_of
from bywire.core.errors import InputError
from bywire.report.answer import AnswerWarning
from raising import raises
from run_once import run_once


def run(name, overrides=None, options=None, **timing):
    timing = {"step": 40e-6, **timing}
    bench = bywire.Bench(name, "roberts2003", overrides or {}, options or {}, **timing)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # numpy's means of nothing
        warnings.simplefilter("ignore", AnswerWarning)
        return run_once(bench)


def values(result):
    return {kpi.name: kpi.value for kpi in result.kpis}


# Rows that are missing

SHORT = [
    ("moment-pulses", {"t_hold": "0.4 ms"}, {}),
    *(
        pytest.param(name, options, {"record": record}, marks=[pytest.mark.trust] * (k > 0))
        for name, options, records in (
            ("moment-pulses", {}, (0.25, 0.6)),
            ("moment-pulse-950", {}, (0.4, 0.15)),
            ("moment-ramp", {}, (0.6, 0.25)),
            ("moment-release", {}, (0.15, 0.4)),
            ("power-off-hold", {}, (0.6,)),
            ("disc-stop", {}, (0.6,)),
            ("friction-sweep", {"mu_B": (0.3,)}, (0.6,)),
            ("static-force", {"mu_B": (0.3,)}, (2.0, 0.6)),
        )
        for k, record in enumerate(records)
    ),
]


@pytest.mark.parametrize(("name", "options", "timing"), SHORT)
def test_figures_without_rows_say_so(name, options, timing):
    for kpi in run(name, options=options, **timing).kpis:
        assert math.isfinite(kpi.value) or kpi.note, kpi.name


def test_ramp_is_judged_on_enough_rows_only():
    fine = values(run("moment-ramp"))
    assert fine["ramp_slope"] == pytest.approx(40.0, rel=0.02)
    coarse = {kpi.name: kpi for kpi in run("moment-ramp", record=0.5).kpis}
    interval = re.search(r"every ([\d.e-]+) s", coarse["ramp_slope"].note)
    assert math.isnan(coarse["ramp_slope"].value)
    assert interval is not None
    # What the note asks for is enough.
    found = values(run("moment-ramp", record=float(interval[1])))
    assert found["ramp_slope"] == pytest.approx(fine["ramp_slope"], rel=0.05)


def test_ramp_downward_is_refused():
    with raises(InputError, name="M_low", value="300 N*m", valid="<= M_high = 200 N*m"):
        bywire.Bench("moment-ramp", "roberts2003", options={"M_low": 300.0})


# What is judged


def test_pulse_moment_does_not_depend_on_where_the_runout_stands():
    """Over less than a revolution, it does, by a third of the runout's ripple."""
    for settle in (0.05, 0.08, 0.1):
        found = values(run("moment-pulses", options={"settle": settle}))
        assert found["pulse_moment"] == pytest.approx(160.0, abs=1.0)


def test_disc_that_turns_backward_is_judged_alike():
    """On a true disc without cogging, both directions are mirror images."""
    same = {"flywheel.runout": 0.0, "motor_1.T_cog": 0.0, "motor_2.T_cog": 0.0}
    for name in ("moment-pulses", "moment-pulse-950", "moment-ramp", "moment-release"):
        forward, backward = (
            values(run(name, same | {"flywheel.Omega_0": speed})) for speed in (60.0, -60.0)
        )
        for key, value in forward.items():
            if key != "energy_left":
                assert backward[key] == pytest.approx(value, rel=0.02, abs=1e-3), (name, key)


def test_pads_that_touch_from_the_start():
    for runout in (0.0, 30e-6):
        changes = {"caliper.clearance": 0.0, "flywheel.runout": runout}
        assert values(run("moment-pulses", changes))["contact_time"] == 0.0


# Demands that are not met

UNMET = [
    ("moment-pulse-950", {"wedge.mu_B": 0.0}, {}, "950 N*m"),
    ("moment-pulses", {"flywheel.Omega_0": 0.0}, {}, "at rest"),
    ("moment-pulses", {}, {"M_high": 5.0}, "control.moment.M_on = "),
]


@pytest.mark.parametrize(("name", "changes", "options", "text"), UNMET)
def test_unmet_demand_is_said_once(name, changes, options, text):
    (said,) = [w for w in run(name, changes, options).warnings if "reach" in w and "limit" not in w]
    assert text in said


def test_end_stop_leaves_a_demand_unmet():
    result = run("moment-pulse-950", {"wedge.mu_B": 0.2}, {"M_high": 2000.0})
    most = np.abs(result.recordings["run"]["M_B"].values).max()
    assert any("2000 N*m" in text and f"{most:.4g} N*m" in text for text in result.warnings)
    assert any("end stop at t = " in text for text in result.warnings)


@pytest.mark.parametrize("changes", [{"control.position.f_n": 400.0}, {"control.T_fast": 0.01}])
def test_chatter_is_no_lack_of_torque(changes):
    result = run("moment-pulses", changes)
    assert np.abs(result.recordings["run"]["M_B"].values).max() > 200.0
    (text,) = result.warnings
    assert text.startswith("the demanded current swings between its limits of -20 A and 20 A, ")
    assert text.endswith("(see 'bywire margins position' and 'bywire margins moment')")


def test_moment_that_comes_late_is_not_out_of_reach():
    result = run("moment-pulses", {"drive.V_dc": 1.0})
    assert np.abs(result.recordings["run"]["M_B"].values).max() > 200.0
    assert not any("cannot reach" in text for text in result.warnings)


def test_what_begins_before_the_recording_is_not_dated():
    """A release from beyond the stop records only its last 0.1 s."""
    result = run("moment-release", {"wedge.mu_B": 0.2}, {"M_hold": 2000.0})
    (text,) = [w for w in result.warnings if "end stop" in w]
    assert text.startswith("the wedge reached its end stop before the recording starts, x = 2")
    par = bywire.parameters("roberts2003").replace({"command.mode": "moment"})
    later = result.recordings["run"].assign(F_end=lambda r: r["F_end"].where(r["time"] > -0.05, 0))
    assert "end stop at t = -0.049 s" in warnings_of(later, par)[0]


def test_preload_has_no_negative_zero():
    for changes in ({"wedge.mu_B": 0.0}, {"control.offset.delta_preload": 0.0}):
        for kpi in run("power-off-hold", changes).kpis:
            assert not (kpi.value == 0.0 and math.copysign(1.0, kpi.value) < 0), kpi.name
