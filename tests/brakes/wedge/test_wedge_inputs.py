"""Bad values of the wedge brake get one clear line, and runs get warnings and notes."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest
from wedge_runs import brake, drive

import bywire
from bywire.cli.main import main
from raising import raises
from run_once import run_once

BAD = [
    ("heart.g_1=-20um", "heart.g_1 = -20 um is not valid: it must be >= 0 um"),
    ("heart.g_12=-1um", "heart.g_12 = -1 um is not valid: it must be >= 0 um"),
    ("wedge.alpha=0", "wedge.alpha = 0 rad is not valid: it must be > 0 rad and < 1.5708 rad"),
    ("wedge.alpha=-5deg", "wedge.alpha = -5 deg is not valid"),
    ("wedge.alpha=90deg", "alpha = 90 deg is not valid: it must be > 0 deg and < 90 deg\n"),
    ("wedge.alpha=1600 mrad", "alpha = 1600 mrad is not valid: it must be > 0 mrad"),
    ("wedge.alpha=1", "a pure number cannot be converted to rad"),
    ("motor_1.dT=40 degC", "degC cannot be converted to a temperature difference in K"),
    ("caliper.n_table=0 mm, 1 mm, 0.5 mm", "caliper.n_table.2 = 0.5 mm must be > 1 mm"),
    ("wedge.alpha=20mm", "mm cannot be converted to rad"),
    ("screw.eta_f=0", "screw.eta_f = 0 is not valid: it must be > 0 and <= 1"),
    ("screw.eta_f=1.01", "screw.eta_f = 1.01 is not valid: it must be > 0 and <= 1"),
    ("screw.eta_b=-10.1", "screw.eta_b = -10.1 is not valid: it must be >= -10 and <= 1"),
    ("screw.eta_b=1.1", "screw.eta_b = 1.1 is not valid"),
    ("wedge.mu_B=-0.1", "wedge.mu_B = -0.1 is not valid: it must be >= 0"),
    ("wedge_friction.stopped_disc=stuck", "did you mean 'stick'?"),
    ("options.M_high=-200Nm", "M_high = -200 Nm is not valid: it must be > 0 Nm"),
]


@pytest.mark.parametrize(("change", "text"), BAD)
def test_bad_value_gets_one_clear_line(change, text, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["bywire", "run", "moment-pulses", "--set", change])
    with pytest.raises(SystemExit) as ended:
        main()
    out, err = capsys.readouterr()
    assert ended.value.code == 2
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    assert text in err


@pytest.mark.parametrize(
    ("mu_B", "fields"),
    [
        ("0.2, 0.2", {"name": "mu_B"}),
        ("0.2, 0", {"name": "mu_B.1", "value": "0", "valid": "> 0 and <= 2"}),
        ((), {"name": "mu_B"}),
    ],
)
def test_bad_table_of_coefficients(mu_B, fields):
    with raises(bywire.BywireError, **fields):
        bywire.Bench("friction-sweep", "roberts2003", options={"mu_B": mu_B})


def test_override_that_a_sweep_replaces_is_refused():
    with pytest.raises(bywire.BywireError, match=r"wedge\.mu_B = 0\.33"):
        bywire.Bench("friction-sweep", "roberts2003", overrides={"wedge.mu_B": 0.33})


def test_steep_angle_in_degrees_is_taken(monkeypatch, capsys):
    arguments = ["--set", "wedge.alpha=24.5 deg", "--set", "screw.eta_f=1"]
    monkeypatch.setattr(sys, "argv", ["bywire", "run", "moment-pulses", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code in (0, None)
    assert "hold_moment" in capsys.readouterr().out


# What a run shows


def warnings(name, options=None, **overrides):
    """Return the warnings of a run, but the one that a slope of the controller is left behind.

    It is derived from the disc's friction and the screw's lead, among others, and told of just
    where one of these is changed.
    """
    changes = {key.replace("__", "."): value for key, value in overrides.items()}
    run = run_once(bywire.Bench(name, "roberts2003", changes, options or {}))
    left_behind = [text for text in run.warnings if ": its formula (" in text]
    assert len(left_behind) == ("wedge.mu_B" in changes)
    assert all(text.startswith("control.moment.slope_hat = 304.12 N*m/rad") for text in left_behind)
    return [text for text in run.warnings if text not in left_behind]


def test_moment_out_of_reach_is_said_with_numbers():
    """The number is what both motors can push, crept up to: their momentum would add to it.

    Between what the bearings' friction leaves at rest, with the Stribeck peak, and in motion.
    """
    slow = {"control__moment__rate_max": 5.0, "flywheel__runout": 0.0}
    (text,) = warnings(
        "moment-pulse-950",
        {"t_pulse": 1.0, "omega_gap": 10.0},
        wedge__mu_B=0.2,
        control__position__i_max=2.5,
        **slow,
    )
    found = re.search(r"950 N\*m.* 2\.5 A.* t = ([\d.]+) s to ([\d.]+) s,.* ([\d.]+) N\*m$", text)
    assert found is not None, text
    begin, end, most = map(float, found.groups())
    assert 0.1 < begin < 0.3
    assert end == pytest.approx(1.0, abs=0.002)
    par = brake(mu_B=0.2)
    per_torque = 2.0 * np.pi / par.screw.lead * par.screw.eta_f
    per_torque *= 2.0 * 0.2 * par.caliper.r_B / (np.tan(par.wedge.alpha) - 0.2)
    at_rest, moving = (
        2.0 * (2.5 * par.motor_1.K_ref - peak * par.bearing.C_0) * per_torque
        for peak in (1.0 + par.bearing.G_S, 1.0)
    )
    assert at_rest < most < 1.05 * moving


def test_limit_of_the_drive_counts_too():
    (text,) = warnings("moment-pulse-950", {"t_pulse": 0.4}, wedge__mu_B=0.2, drive__i_max=2.5)
    assert re.search(r"950 N\*m.* 2\.5 A", text)


def test_current_limit_in_passing_is_said():
    (text,) = warnings("moment-release", control__position__i_max=10.0)
    assert re.fullmatch(r"the current limit of 10 A was reached at t = [\d.]+ s", text)
    # Under position control the demands are the test's own, and its figures have the share.
    assert warnings("position-step", control__position__i_max=5.0) == []


def test_end_stop_is_said():
    end, limit = warnings("moment-pulse-950", {"M_high": 3000.0, "t_pulse": 0.4})
    assert re.match(r"the wedge reached its end stop at t = 0\.1\d+ s, x = 2\.5\d* mm", end)
    assert "3000 N*m" in limit


@pytest.mark.parametrize("eta_b", [0.0, 2.0 - 1.0 / 0.65])
def test_screw_that_holds_is_allowed_and_said(eta_b):
    """At mu_B 0.2 the wedge pushes outward. Only a self-locking screw stays."""
    texts = warnings("power-off-hold", wedge__mu_B=0.2, screw__eta_b=eta_b)
    assert len(texts) == (eta_b == 0.0)
    assert all("screw.eta_b = 0" in text for text in texts)
    run = drive(
        brake({"screw.eta_b": eta_b, "flywheel.runout": 0.0}, mu_B=0.2),
        1.6,
        M_set=lambda t: 700.0 + 0.0 * t,
        power_off=lambda t: np.where(t > 0.8 - 1e-9, 1.0, 0.0),
    )
    kept = run["M_B"][-1] / run["M_B"][run.time < 0.8][-1]
    assert (kept > 0.98) == (eta_b == 0.0)


def test_screw_that_the_motors_cannot_release_is_reported():
    """The release takes -eta_b F L / 2 pi, and the motors have 0.1 N*m/A."""
    held, stuck = (warnings("power-off-hold", screw__eta_b=eta)[-1] for eta in (-1.0, -10.0))
    locked = "no load can drive these screws back"
    assert held == f"screw.eta_b = -1: {locked}, so the brake keeps its moment after power-off"
    found = re.fullmatch(
        rf"screw.eta_b = -10: {locked}, and the motors cannot release them from ([\d.]+) kN. This "
        r"takes ([\d.]+) N[*]m, but the current limit of 20 A allows 2 N[*]m. Use screw.eta_b >= "
        r"(-[\d.]+)",
        stuck,
    )
    assert found is not None, stuck
    force, torque, least = map(float, found.groups())
    assert torque == pytest.approx(10e3 * force * 2e-3 / (2.0 * np.pi), rel=5e-3)
    assert least == pytest.approx(-20.0 / torque, rel=0.06)  # of two digits
