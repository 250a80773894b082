"""Loops cut open: against closed forms, against the closed loop, and what cannot be cut."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bywire.analysis.crossings import margin
from bywire.analysis.linear.sampled_loops import closed_loop, open_loop
from bywire.analysis.loop import LOOPS
from bywire.analysis.margins import margins
from bywire.brakes.motorcycle.linear import PressureLoop
from bywire.brakes.wedge.laws import moment_control
from bywire.brakes.wedge.model import WedgeBrake, force_for, memory_at, state_at, travel_for
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError, UnknownNameError
from bywire.core.model import Task
from systems.sampled_lag import LAG, Memory, SampledLag, State

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
}
MOMENT = 200.0


def braking(**changes: float | str) -> tuple[Any, ...]:
    """Return model, parameters, state and memory of a brake that holds a moment."""
    par = parameters("roberts2003").replace({**FRICTIONLESS, **changes})
    assert isinstance(par, WedgeParameters)
    x = travel_for(force_for(MOMENT, par), par)
    memory = memory_at(x, par)._replace(mode=moment_control.MOMENT, M_set=MOMENT, M_meas=MOMENT)
    return WedgeBrake(), par, state_at(x, par)._replace(y_M=MOMENT), memory


def test_closing_the_loop_gives_the_closed_loop() -> None:
    """Of two sample times: 1 kHz around 5 kHz."""
    point = braking()
    gain = open_loop(*point, cut="rate")
    closed = closed_loop(*point, inputs=("M_set",), outputs=("y_M",))
    assert gain.period == pytest.approx(1e-3)
    joined = np.poly(gain.A - gain.B @ gain.C)
    np.testing.assert_allclose(joined, np.poly(closed.A), atol=1e-6)
    assert np.abs(joined - np.poly(gain.A)).max() > 1e-3


@pytest.mark.parametrize("mu_B", [0.2, 0.35, 0.5])
def test_crossover_of_the_moment_loop_follows_the_friction_coefficient(mu_B: float) -> None:
    """The plant's gain at the crossover is that of the stiff wedge, 2 mu_B r_B K_CAL tan(alpha)."""
    gain = open_loop(*braking(**{"wedge.mu_B": mu_B}), cut="rate")
    found = margin(lambda f: gain.response(f)[:, 0, 0], (0.1, 490.0))
    assert found.crossover == pytest.approx(8.0 * mu_B / 0.35, rel=0.06)
    assert 60.0 < found.phase < 90.0


def test_a_designed_loop_gain_is_recovered() -> None:
    """An integral law around a pure integrator: crossover at f_c, 90 degree less the delays."""
    fast = {"control.moment.f_c": 0.05, "moment_sensor.f_M": 1e4}
    gain = open_loop(*braking(**fast), cut="rate")
    found = margin(lambda f: gain.response(f)[:, 0, 0], (1e-3, 490.0))
    assert found.crossover == pytest.approx(0.05, rel=0.02)
    assert found.phase == pytest.approx(90.0, abs=1.0)


def test_what_cannot_be_cut() -> None:
    point = braking()
    with pytest.raises(ParameterError, match="position runs 5 times"):
        open_loop(*point, cut="i_2_ref")
    with pytest.raises(UnknownNameError, match="i_2_ref"):
        open_loop(*point, cut="i_2_reff")
    with pytest.raises(ParameterError, match="position runs 5 times"):
        open_loop(*point, cut="theta_1")
    with pytest.raises(ParameterError, match="neither the plant nor"):
        open_loop(*point, cut="sat_rate")
    with pytest.raises(ParameterError, match=r"\(found none\)"):
        open_loop(*braking(**{"command.mode": "position"}), cut="rate")


def test_pressure_loop_agrees_with_its_chain() -> None:
    """The motorcycle's loop cut at the measured pressure, against the chain of its parts."""
    from bywire.brakes.motorcycle import trim
    from bywire.brakes.motorcycle.linear import theoretical
    from bywire.brakes.motorcycle.model import MotorcycleBrake

    smooth = {
        "seal.T_pr": 0.0,
        "seal.f_cfr_p": 0.0,
        "seal.f_cfr_n": 0.0,
        "seal.mu_T": 0.0,
        "ecu.dither.waveform": "off",
        "adc.law": "ideal",
        "drive.mode": "pressure",
    }
    par: Any = parameters("dardanelli2010").replace(smooth)
    p = 20e5
    gain = open_loop(
        MotorcycleBrake(), par, trim.state_at(p, par), trim.memory_at(p, par), cut="y_p"
    )
    f = np.array([0.5, 2.0, 5.0, 20.0])
    brake = theoretical(par, p, trim.travel_at(p, par))
    chain = PressureLoop(par, brake, p).open(f)
    ratio = gain.response(f)[:, 0, 0] / chain
    # The chain has a locked rotor in its current loop: they agree while the back-EMF is small.
    apart = np.abs(ratio - 1.0)
    assert apart[0] < 0.01
    assert np.all(np.diff(apart) > 0.0)
    assert apart[-1] < 0.2


class Idle(SampledLag):
    """A controller that looks at the lag by its gain alone, k - 2."""

    def tasks(self, par):
        """Return the controller."""

        def tick(x, m, u, p):
            return Memory(m.seen, (p.k - 2.0) * (u.wanted - x.y))

        return (Task("law", par.T_s, tick),)


def test_a_gain_of_zero_leaves_no_loop_wherever_it_is_cut() -> None:
    at = (State(0.0), Memory(0.0, 0.0))
    for k in (4.0, 2.0):
        for cut in ("y", "drive"):
            gain = open_loop(Idle(), LAG.replace({"k": k}), *at, cut=cut)
            L = gain.response([0.5])[0, 0, 0]
            assert (abs(L) > 0.1) == (k > 2.0)
            assert gain.period == LAG.T_s
    with pytest.raises(UnknownNameError):
        open_loop(Idle(), LAG, *at, cut="x")


def test_an_analog_loop_without_gain_is_none() -> None:
    loop, par = LOOPS.find("drive-current"), parameters("roberts2003")
    usual, idle = par, par.replace({"drive.k_p": 0.0, "drive.k_i": 0.0})
    assert abs(loop.gain(usual, 0.0).response([100.0])[0, 0, 0]) > 0.1
    assert loop.gain(idle, 0.0).response([100.0])[0, 0, 0] == 0.0
    assert margins(loop, idle, 0.0).state == "no loop"
