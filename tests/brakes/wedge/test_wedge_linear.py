"""Linear models of the wedge brake: closed contacts, poles, loops of two sample times."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import linearize
from bywire.analysis.linear.sampled_loops import closed_loop
from bywire.bench.experiment import Case, as_run
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.laws import moment_control
from bywire.brakes.wedge.model import WedgeBrake, force_for, memory_at, state_at, travel_for
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.catalog import parameters
from bywire.plant import roller_screw
from bywire.simulation.run import simulate

FRICTIONLESS = {
    "bearing.C_0": 0.0,
    "bearing.C_2": 0.0,
    "bearing.T_nu": 0.0,
    "screw.eta_f": 1.0,
    "screw.eta_b": 1.0,
    "wedge_friction.mu_int": 0.0,
    "wedge_friction.mu_R": 0.0,
    "flywheel.runout": 0.0,
    "flywheel.law": "driven",
    "encoder.law": "ideal",
    "motor_1.T_cog": 0.0,
    "motor_2.T_cog": 0.0,
    "motor_1.D_M": 0.0,
    "motor_2.D_M": 0.0,
}
MECHANICAL = ("theta_1", "omega_1", "theta_2", "omega_2", "x", "v")


def brake(mu_B: float, **changes: float | str) -> WedgeParameters:
    found = parameters("roberts2003").replace({**FRICTIONLESS, "wedge.mu_B": mu_B, **changes})
    assert isinstance(found, WedgeParameters)
    return found


def mechanical(par: WedgeParameters, F_N: float = 3e3) -> LinearModel:
    """Return rotors and wedge, currents held."""
    x = travel_for(F_N, par)
    model = linearize(
        WedgeBrake(),
        par,
        state_at(x, par),
        memory_at(x, par),
        inputs=("i_1_ref", "i_2_ref"),
        outputs=("F_N",),
    )
    return model.reduced(MECHANICAL, held=True)


def rigid(par: WedgeParameters) -> float:
    """Return the squared slow rate [1/s^2] of rotors and wedge in one."""
    tan = wedge.slope(par.wedge)
    M = par.wedge.M_W + 2.0 * par.motor_1.J_M / roller_screw.slope(par.screw) ** 2
    return par.caliper.K_cal * tan * (par.wedge.mu_B - tan) / M


@pytest.mark.parametrize(("mu_B", "published"), [(0.2, -27.0), (0.5, 25.4)])
def test_slow_poles(mu_B: float, published: float) -> None:
    slow = mechanical(brake(mu_B)).poles()[:2]
    square = float(np.real(np.prod(slow)) * -1.0)
    assert math.copysign(math.sqrt(abs(square)), square) == pytest.approx(published, rel=2e-3)


@pytest.mark.parametrize("mu_B", [0.2, 0.6])
def test_slow_poles_approach_the_rigid_ones_as_the_heart_stiffens(mu_B: float) -> None:
    left = []
    for factor in (1.0, 10.0, 100.0):
        par = brake(mu_B, **{"heart.K_S": 60e6 * factor, "heart.K_W": 40e6 * factor})
        square = float(np.real(np.prod(mechanical(par).poles()[:2])) * -1.0)
        left.append(abs(square / rigid(par) - 1.0))
    assert left[0] < 0.06  # 3 % of the rate itself
    assert left[0] / left[1] == pytest.approx(10.0, rel=0.1)
    assert left[1] / left[2] == pytest.approx(10.0, rel=0.1)


def test_moment_loop_of_two_sample_times_is_that_of_the_simulation() -> None:
    """A small step of the demand: 1 kHz over 5 kHz around the continuous plant."""
    par, M = brake(0.35), 200.0
    x = travel_for(force_for(M, par), par)
    memory = memory_at(x, par)._replace(
        mode=moment_control.MOMENT, M_set=M, M_meas=M, theta_c=memory_at(x, par).theta_c
    )
    case = Case(
        "step",
        WedgeBrake(),
        par,
        state_at(x, par)._replace(y_M=M),
        memory,
        lambda t: {"M_set": np.full(t.shape, M)},
        0.6,
    )
    # The brake settles by itself to the operating point.
    settled = simulate(as_run(case, 20e-6))
    height = 0.5

    def stepped(t: np.ndarray) -> dict[str, np.ndarray]:
        return {"M_set": M + height * (t >= 0.3 - 1e-9)}

    run = simulate(as_run(replace(case, stimulus=stepped), 20e-6), signals=("y_M",))
    loop = closed_loop(
        WedgeBrake(),
        par,
        state_at(x, par)._replace(y_M=M),
        memory,
        inputs=("M_set",),
        outputs=("y_M",),
    )
    assert loop.period == pytest.approx(1e-3)
    assert np.abs(loop.poles()).max() < 1.0 + 1e-9
    z, expected = np.zeros(len(loop.states)), []
    for t in run.time:
        u = np.array([height if t >= 0.3 - 1e-9 else 0.0])
        expected.append(float((loop.C @ z + loop.D @ u)[0]))
        z = loop.A @ z + loop.B @ u
    got = run["y_M"] - settled["y_M"]
    assert np.max(np.abs(got - expected)) < 4e-3 * height
    assert max(expected) > 0.9 * height
