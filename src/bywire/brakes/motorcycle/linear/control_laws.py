"""The ECU's control laws, and its current loop, as linear models: from the laws themselves.

Where the gains are scheduled, a law is that of the gains frozen at a pressure: small motion about
an equilibrium knows no other, because the schedule is bumpless.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.sampled_loops import closed_loop
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import EcuParameters, MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.control import current_pi, low_pass_2, pressure_pid
from bywire.core.signals import signals_of, zeros

Rotor = Literal["locked", "free"]
Law = Callable[[Any, Any], tuple[Any, Any]]


def pressure_feedback(ecu: EcuParameters, p: float) -> LinearModel:
    """Return the PID at a pressure p from a fall of the measured one [Pa] to the demand [A]."""
    gains = ecu.pressure_at(p)

    def law(x: pressure_pid.State, u: Any) -> tuple[Any, Any]:
        signals = pressure_pid.Input(p_ref=0.0 * u, p_meas=-u)
        state, out = pressure_pid.output(x, signals, ecu.T_s, gains)
        return state, out.i

    return _linear("pressure-feedback", law, pressure_pid.State, ecu.T_s, ("Pa", "A"))


def pressure_demand(ecu: EcuParameters, p: float) -> LinearModel:
    """Return the PID at a pressure p [Pa] from the set point [Pa] to the current demand [A]."""
    gains = ecu.pressure_at(p)

    def law(x: pressure_pid.State, u: Any) -> tuple[Any, Any]:
        signals = pressure_pid.Input(p_ref=u, p_meas=0.0 * u)
        state, out = pressure_pid.output(x, signals, ecu.T_s, gains)
        return state, out.i

    return _linear("pressure-demand", law, pressure_pid.State, ecu.T_s, ("Pa", "A"))


def pressure_control(ecu: EcuParameters, p: float) -> LinearModel:
    """Return the PID at a pressure p from set point and measured one [Pa] to the demand [A]."""
    gains = ecu.pressure_at(p)

    def law(x: pressure_pid.State, u: Any) -> tuple[Any, Any]:
        signals = pressure_pid.Input(p_ref=u[0], p_meas=u[1])
        state, out = pressure_pid.output(x, signals, ecu.T_s, gains)
        return state, out.i

    units, inputs = ("Pa", "A"), ("p_ref", "p_meas")
    return _linear("pressure-control", law, pressure_pid.State, ecu.T_s, units, inputs)


def current_control(ecu: EcuParameters) -> LinearModel:
    """Return the current PI from the current error [A] to the duty cycle."""

    def law(x: current_pi.State, u: Any) -> tuple[Any, Any]:
        signals = current_pi.Input(i_ref=u, i_meas=0.0 * u)
        state, out = current_pi.output(x, signals, ecu.T_s, ecu.current)
        return state, out.duty

    return _linear("current-control", law, current_pi.State, ecu.T_s, ("A", "1"))


def demand_filter(ecu: EcuParameters) -> LinearModel:
    """Return the low-pass between pressure and current controller."""

    def law(x: low_pass_2.State, u: Any) -> tuple[Any, Any]:
        state, out = low_pass_2.output(x, u, ecu.T_s, ecu.filter)
        return state, out.y

    return _linear("demand-filter", law, low_pass_2.State, ecu.T_s, ("A", "A"))


def current_loop(par: MotorcycleParameters, p: float, rotor: Rotor) -> LinearModel:
    """Return the loop from the set point ``i_set`` to the currents ``i`` and ``i_meas``.

    PI at the ECU's sample time, battery and bridge, winding, anti-alias filter; the converter's
    resolution is left out.

    Parameters
    ----------
    par
        Parameters; the drive mode does not matter.
    p
        Pressure of the operating point [Pa].
    rotor
        ``"locked"``: no back-EMF, as where friction holds the shaft. ``"free"``: the shaft moves
        against the brake, without dry friction.
    """
    driven = par.replace({"drive.mode": "current-direct", "adc.law": "ideal"})
    return closed_loop(
        MotorcycleBrake(),
        driven,
        state_at(p, driven),
        memory_at(p, driven),
        inputs=("i_set",),
        outputs=("i", "i_meas"),
        locked=("theta", "omega", "p_mc", "p_pd", "y_p") if rotor == "locked" else (),
    )


def _linear(
    name: str,
    law: Law,
    state_type: Any,
    period: float,
    units: tuple[str, str],
    inputs: tuple[str, ...] = ("in",),
) -> LinearModel:
    """Return a law's Jacobians at zero, inside all limits."""
    import casadi as ca

    signals = signals_of(state_type)
    x, u = ca.SX.sym("x", len(signals)), ca.SX.sym("u", len(inputs))
    renewed, out = law(state_type(*ca.vertsplit(x)), u)
    after = ca.vertcat(*renewed)
    parts = [ca.jacobian(a, b) for a in (after, out) for b in (x, u)]
    values = ca.Function("law", [x, u], parts)(list(zeros(state_type)), 0.0)
    A, B, C, D = (np.array(value, dtype=float) for value in values)
    return LinearModel(
        name,
        A,
        B,
        C,
        D,
        tuple(signals),
        inputs,
        ("out",),
        tuple(s.unit for s in signals.values()),
        units[:1] * len(inputs),
        units[1:],
        np.zeros(len(signals)),
        period,
    )
