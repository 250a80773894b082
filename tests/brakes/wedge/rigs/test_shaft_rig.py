"""The single motor's rig against closed forms: position loop, current loop, friction at rest."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rig_runs import FRICTIONLESS, SLOPE, drive, emf_inertia, rig
from scipy import signal

from bywire.brakes.wedge.rigs.shaft_rig import ShaftRig

DUMMY = {"rig.load": "dummy", "rig.clamp": "open", "rig.mode_1": "position"}
CURRENT = {"rig.mode_1": "current", "encoder.law": "ideal"}
CLAMPED = CURRENT | {"rig.load": "dummy", "rig.clamp": "closed"}


def free_shaft(f_n: float, J_dummy: float) -> float:
    """Return the largest difference to the second-order step response, in steps."""
    changes = FRICTIONLESS | DUMMY | {"control.position.f_n": f_n, "rig.J_dummy": J_dummy}
    par = rig(changes)
    own = par.control.position
    run = drive(ShaftRig(), par, 2.0 / f_n, record=1e-3, theta_1_set=lambda t: 0.1 + 0.0 * t)
    J = par.motor_1.J_M + J_dummy + emf_inertia(par)
    w = 2.0 * math.pi * f_n
    plant = ([w * w * own.J_hat], [J, 2.0 * own.zeta * w * own.J_hat, w * w * own.J_hat])
    _, closed = signal.step(plant, T=run.time)
    return float(np.abs(run["theta_1"] / 0.1 - closed).max())


@pytest.mark.parametrize("J_dummy", [1e-9, 2e-5, 1.2e-4])
def test_slow_position_loop_is_of_second_order(J_dummy):
    """The lags of filter, sampling and current loop vanish beside a slow loop, in proportion."""
    off = [free_shaft(f_n, J_dummy) for f_n in (4.0, 2.0, 1.0)]
    assert off[2] < 0.01
    assert off[0] / off[1] == pytest.approx(2.0, rel=0.1)
    assert off[1] / off[2] == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize(("winding", "gain"), [(1.0, 1.0), (4.0, 0.5), (1.0, 3.0)])
def test_current_loop_against_its_transfer_function(winding, gain):
    """The loop has demand filter, PI, winding and sense filter, without canceling the pole."""
    par = rig(CLAMPED)
    par = par.replace(
        {
            "motor_1.R_ref": winding * par.motor_1.R_ref,
            "motor_1.L_M": par.motor_1.L_M,
            "drive.k_p": gain * par.drive.k_p,
        }
    )
    own, R, L = par.drive, par.motor_1.R_ref, par.motor_1.L_M
    w_d, w_s = 2.0 * math.pi * own.f_demand, 2.0 * math.pi * own.f_sense
    # (s + w_s) V (k_p s + k_i) over s (L s + R)(s + w_s) + w_s V (k_p s + k_i), and the filter.
    pi = own.V_dc * np.array([own.k_p, own.k_i])
    below = np.polyadd(np.polymul([L, R, 0.0], [1.0, w_s]), w_s * pi)
    whole = (w_d * np.polymul(pi, [1.0, w_s]), np.polymul(below, [1.0, w_d]))
    off = []
    for step in (20e-6, 10e-6):
        run = drive(ShaftRig(), par, 0.01, step, 2e-5, i_1_set=lambda t: 3.0 + 0.0 * t)
        _, closed = signal.step(whole, T=run.time)
        off.append(float(np.abs(run["i_1"] / 3.0 - closed).max()))
        assert not run["omega_1"].any()
    assert off[0] < 0.01
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.15)


def test_clamp_slips_at_its_torque():
    i = 5.0
    for T_clamp, moves in ((0.39, True), (0.41, False)):
        par = rig(FRICTIONLESS | CLAMPED | {"rig.T_clamp": T_clamp, "motor_1.K_ref": 0.08})
        run = drive(ShaftRig(), par, 0.1, i_1_set=lambda t: i + 0.0 * t)
        assert bool(run["omega_1"].any()) == moves


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("load", "halves"), [("dummy", 0.0), ("screw", 1.0)])
def test_breakaway(sign, load, halves):
    """The bearing has its Stribeck peak. Both halves of the preloaded nut add no net torque."""
    par = rig(CURRENT | {"rig.load": load, "motor_1.T_cog": 0.0, "screw.eta_b": 0.3})
    bearing = par.bearing.C_0 * (1.0 + par.bearing.G_S)
    screw = halves * SLOPE * par.rig.F_0 * ((1.0 / 0.65 - 1.0) + (1.0 - 0.3))
    i = (bearing + screw) / par.motor_1.K_ref
    for share, moves in ((0.999, False), (1.001, True)):
        run = drive(ShaftRig(), par, 0.2, i_1_set=lambda t, y=share * sign * i: y + 0.0 * t)
        assert bool(run["omega_1"].any()) == moves


def test_loss_by_motor_torque_does_not_see_the_preload():
    changes = CURRENT | {"screw.law": "drive", "motor_1.T_cog": 0.0, "rig.load": "screw"}
    runs = [
        drive(ShaftRig(), rig(changes | {"rig.F_0": F_0}), 0.1, i_1_set=lambda t: 5.0 + 0.0 * t)
        for F_0 in (0.0, 500.0)
    ]
    np.testing.assert_array_equal(runs[0]["theta_1"], runs[1]["theta_1"])
    par = rig()
    moving = runs[0]["T_fr_1"][-1] - 0.35 * par.motor_1.K_ref * runs[0]["i_1"][-1]
    assert 0.08 < moving < 0.5
