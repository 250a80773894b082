"""The two motors' rig against closed forms: forces at rest, stiffness, friction that holds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rig_runs import FRICTIONLESS, SLOPE, drive, emf_inertia, rig

from bywire.brakes.wedge.rigs.screw_rig import ScrewRig

BOTH = {"rig.mode_1": "current", "rig.mode_2": "current"}


def line_stiffness(par):
    """Return the stiffness [N/m] of both screws and the sensor in series."""
    return 1.0 / (2.0 / par.heart.K_S + 1.0 / par.rig.sensor.K_F)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_force_at_rest_without_friction(sign):
    """The sensor measures both directions. Its force balances the screws, its travel is linear."""
    par = rig(FRICTIONLESS | BOTH | {"rig.sensor.tau_F": 2e-3})
    i = 6.0 * sign
    run = drive(
        ScrewRig(),
        par,
        4.0,
        record=1e-2,
        i_1_set=lambda t: i * np.minimum(t, 1.0),
        i_2_set=lambda t: -i * np.minimum(t, 1.0),
    )
    F = par.motor_1.K_ref * i / SLOPE
    assert run["F"][-1] == pytest.approx(F, rel=1e-6)
    assert run["y_F"][-1] == pytest.approx(F, rel=1e-6)
    travel = SLOPE * (run["theta_1"][-1] - run["theta_2"][-1])
    assert travel == pytest.approx(F / line_stiffness(par), rel=1e-6)


def test_frequency_of_the_motors_against_each_other():
    """Two rotors on the line's spring swing with sqrt(2 K (L/2 pi)^2 / J)."""
    par = rig(FRICTIONLESS | BOTH | {"rig.sensor.tau_F": 0.0})
    run = drive(ScrewRig(), par, 0.5, record=1e-4, state={"theta_1": 0.01, "theta_2": -0.01})
    J = par.motor_1.J_M + emf_inertia(par)
    w = math.sqrt(2.0 * line_stiffness(par) * SLOPE**2 / J)
    apart = run["theta_1"] - run["theta_2"]
    down = np.flatnonzero((apart[:-1] > 0) & (apart[1:] <= 0))
    t = [run.time[k] + 1e-4 * apart[k] / (apart[k] - apart[k + 1]) for k in down]
    period = (t[-1] - t[0]) / (len(t) - 1)
    assert 2.0 * math.pi / period == pytest.approx(w, rel=2e-3)


def test_equal_motors_do_not_fight():
    run = drive(
        ScrewRig(),
        rig(),
        0.3,
        theta_1_set=lambda t: np.sin(100.0 * t),
        theta_2_set=lambda t: np.sin(100.0 * t),
    )
    assert np.abs(run["F"]).max() < 1e-6


@pytest.mark.parametrize(("share", "moves"), [(0.95, False), (1.05, True)])
def test_back_driving(share, moves):
    """A screw is driven back where eta_b times the torque of the force overcomes the bearing."""
    par = rig(
        BOTH
        | {
            "motor_1.T_cog": 0.0,
            "motor_2.T_cog": 0.0,
            "bearing.T_nu": 0.0,
            "rig.sensor.tau_F": 1e-3,
        }
    )
    T_1 = 15.0 * par.motor_1.K_ref
    T_b = par.bearing.C_0 * (1.0 + par.bearing.G_S)
    F = par.screw.eta_f * (T_1 - T_b) / SLOPE
    own = par.replace({"bearing.C_2": 0.0, "screw.eta_b": share * T_b / (SLOPE * F)})
    run = drive(
        ScrewRig(), own, 3.0, record=1e-2, i_1_set=lambda t: 15.0 * np.minimum(t / 2.0, 1.0)
    )
    assert bool(run["omega_2"].any()) == moves
    if not moves:
        assert run["F"][-1] == pytest.approx(F, rel=0.02)


def test_force_stays_where_friction_holds_it():
    """After the currents are gone, set-valued friction holds the rest of the force for good."""
    par = rig(BOTH)
    ramp = lambda t: 10.0 * np.interp(t, [0.0, 0.5, 0.6, 1.1], [0.0, 1.0, 1.0, 0.0])  # noqa: E731
    run = drive(ScrewRig(), par, 3.0, record=1e-2, i_1_set=ramp, i_2_set=lambda t: -ramp(t))
    late = run.time > 1.5
    assert run["F"][-1] > 300.0
    assert not run["omega_1"][late].any()
    assert not run["omega_2"][late].any()
    assert np.ptp(run["F"][late]) == 0.0
