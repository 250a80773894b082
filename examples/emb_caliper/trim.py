"""Equilibria, with state and memory that hold a clamp force at rest without friction."""

from __future__ import annotations

from typing import Any

from bywire.authoring import ParameterError, zeros
from bywire.core import ops
from bywire.plant import dc_motor, floating_caliper, pmsm
from emb_caliper import ecu, ecu_pmsm
from emb_caliper.ecu import travel_per_angle
from emb_caliper.elements import load_cell, rotor
from emb_caliper.model import EmbCaliper
from emb_caliper.models.pmsm import EmbCaliperPmsm
from emb_caliper.parameters import BrakeParameters, torque_constant


def overlap_at(F: float, par: BrakeParameters) -> float:
    """Return the overlap [m] at rest at a clamp force [N].

    Raises
    ------
    ParameterError
        If the force is negative, or beyond the measured curve.
    """
    most = floating_caliper.elastic(par.caliper.n_max, par.caliper)
    if not 0.0 <= F <= most:
        raise ParameterError(
            f"a clamp force of {F / 1e3:g} kN is not valid. It must be >= 0 kN and <= "
            f"{most / 1e3:.4g} kN, the end of the caliper's measured curve (caliper.n_max)"
        )

    from scipy.optimize import brentq  # imported here, because a run from rest does not need it

    def missing(n: float) -> float:
        return float(floating_caliper.elastic(n, par.caliper)) - F

    return float(brentq(missing, 0.0, par.caliper.n_max, xtol=1e-15, rtol=1e-14))


def brake_with(par: BrakeParameters) -> EmbCaliper | EmbCaliperPmsm:
    """Return the brake that has these parameters."""
    return EmbCaliper() if isinstance(par.motor, dc_motor.Parameters) else EmbCaliperPmsm()


def holding_current(F: float, par: BrakeParameters) -> float:
    """Return the current [A] that balances a clamp force [N] without friction."""
    return travel_per_angle(par) * F / torque_constant(par)


def holding_voltage(F: float, par: BrakeParameters) -> float:
    """Return the voltage [V] that drives this current at rest, along the q axis of a PMSM."""
    R = par.motor.R_m if isinstance(par.motor, dc_motor.Parameters) else par.motor.R
    return R * holding_current(F, par)


def state_at(F: float, par: BrakeParameters) -> Any:
    """Return the state at rest at a clamp force [N]. At zero force the piston is parked at 0."""
    x = par.caliper.clearance + overlap_at(F, par) if F > 0.0 else 0.0
    i = holding_current(F, par)
    turned, cell = rotor.State(x / travel_per_angle(par), 0.0), load_cell.State(par.force.gain * F)
    if isinstance(par.motor, dc_motor.Parameters):
        return EmbCaliper.state(motor=dc_motor.State(i), rotor=turned, force=cell)
    return EmbCaliperPmsm.state(motor=pmsm.State(0.0, i), rotor=turned, force=cell)


def memory_at(F: float, par: BrakeParameters) -> Any:
    """Return the memory with which each controller, or the ideal source, holds this state."""
    i, theta, v = holding_current(F, par), state_at(F, par).theta, holding_voltage(F, par)
    cascade = {
        "F_meas": F,
        "F_used": F,
        "theta_meas": theta,
        "F_ref": F,
        "i_ref": i,
        "v_source": v,
        "parked": float(par.ecu.F_on > F),
        "speed_integral": i - (i if par.ecu.load == "fed-forward" else 0.0),
    }
    if isinstance(par.motor, dc_motor.Parameters):
        duty = _duty(v, i, par)
        return zeros(ecu.Memory)._replace(**cascade, duty=duty, current_integral=duty)
    duty = _duty(v, 1.5 * i, par)
    theta_e = par.motor.p * theta
    alpha, beta = -duty * ops.sin(theta_e), duty * ops.cos(theta_e)
    return zeros(ecu_pmsm.Memory)._replace(
        **cascade,
        i_q_ref=i,
        duty_alpha=alpha,
        duty_beta=beta,
        next_alpha=alpha,
        next_beta=beta,
        z_q=v + par.ecu.current.R_a * i,
    )


def _duty(v: float, i: float, par: BrakeParameters) -> float:
    """Return the duty D of a voltage if the battery supplies the current D i."""
    # Solve D (V_bat - R_bat D i) = v by fixed-point iteration (contraction R_bat i / V_bat).
    duty = v / par.supply.V_bat
    for _ in range(50):
        duty = v / (par.supply.V_bat - par.supply.R_bat * duty * i)
    return duty
