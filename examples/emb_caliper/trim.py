"""Equilibria, with state and memory that hold a clamp force at rest without friction."""

from __future__ import annotations

from typing import Any

from bywire.authoring import ParameterError, zeros
from bywire.plant import dc_motor
from emb_caliper.ecu import Memory, travel_per_angle
from emb_caliper.elements import floating_caliper, rotor
from emb_caliper.model import EmbCaliper
from emb_caliper.parameters import CaliperBrakeParameters as Par


def overlap_at(F: float, par: Par) -> float:
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


def holding_current(F: float, par: Par) -> float:
    """Return the current [A] that balances a clamp force [N] without friction."""
    return travel_per_angle(par) * F / par.motor.K_e


def state_at(F: float, par: Par) -> Any:
    """Return the state at rest at a clamp force [N]. At zero force the piston is parked at 0."""
    x = par.caliper.clearance + overlap_at(F, par) if F > 0.0 else 0.0
    return EmbCaliper.state(
        motor=dc_motor.State(holding_current(F, par)),
        rotor=rotor.State(x / travel_per_angle(par), 0.0),
    )


def memory_at(F: float, par: Par) -> Memory:
    """Return the memory with which each controller, or the ideal source, holds this state."""
    i = holding_current(F, par)
    v = par.motor.R_m * i
    # Solve D (V_bat - R_bat D i) = v by fixed-point iteration (contraction R_bat i / V_bat).
    duty = v / par.supply.V_bat
    for _ in range(50):
        duty = v / (par.supply.V_bat - par.supply.R_bat * duty * i)
    fed = i if par.ecu.load == "fed-forward" else 0.0
    return zeros(Memory)._replace(
        F_meas=F,
        theta_meas=state_at(F, par).theta,
        F_ref=F,
        i_ref=i,
        duty=duty,
        v_source=v,
        parked=float(par.ecu.F_on > F),
        speed_integral=i - fed,
        current_integral=duty,
    )
