"""Equilibria of the motorcycle brake: states and ECU memory that hold a pressure at rest."""

from __future__ import annotations

import math

from bywire.assemblies.motorcycle_ecu import Memory
from bywire.assemblies.motorcycle_parameters import MotorcycleParameters
from bywire.assemblies.motorcycle_plant import State
from bywire.control import low_pass_2, pressure_pid
from bywire.core.signals import zeros
from bywire.plant import (
    brake_fluid,
    caliper,
    current_sensor,
    master_cylinder,
    pressure_sensor,
)

Par = MotorcycleParameters
_STEPS = 200  # Runge-Kutta steps of the filling; its error is far below a nanometer


def travel_at(p: float, par: Par) -> float:
    """Return the piston travel [m] at a pressure [Pa], filled slowly from the retracted end.

    Notes
    -----
    A_mc dx = (C_mc(x, p) + C_pd(p)) dp from x_rest at zero pressure: what the piston displaces
    compresses the chamber and fills the caliper.
    """
    step = p / _STEPS
    x = par.master_cylinder.x_rest
    for k in range(_STEPS):
        at = k * step
        k1 = _travel_slope(x, at, par)
        k2 = _travel_slope(x + 0.5 * step * k1, at + 0.5 * step, par)
        k3 = _travel_slope(x + 0.5 * step * k2, at + 0.5 * step, par)
        k4 = _travel_slope(x + step * k3, at + step, par)
        x += step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return x


def _travel_slope(x: float, p: float, par: Par) -> float:
    volume = master_cylinder.volume(master_cylinder.Input(x=x, v=0.0, q=0.0), par.master_cylinder)
    chamber = brake_fluid.compliance(brake_fluid.Chamber(V=volume, p=p), par.fluid)
    pads = caliper.mass(caliper.State(p), par.caliper, par.fluid)
    return (chamber + pads) / par.master_cylinder.A_mc


def holding_current(p: float, par: Par) -> float:
    """Return the current [A] that balances a pressure [Pa] without friction."""
    torque = par.gear.k_g * p * par.master_cylinder.A_mc
    efficiency = par.gear.eta_g if par.gear.law == "paper" else 1.0
    return torque / (efficiency * par.motor.K_e)


def state_at(p: float, par: Par) -> State:
    """Return the state at rest at a pressure [Pa]; the friction holds what is left over."""
    i = 0.0 if par.drive.mode == "current-source" else holding_current(p, par)
    return State(
        i=i,
        theta=travel_at(p, par) / par.gear.k_g,
        omega=0.0,
        p_mc=p,
        p_pd=p,
        y_p=pressure_sensor.reading(p + par.fluid.p_atm, par.pressure_sensor),
        y_i=current_sensor.reading(holding_current(p, par), par.current_sensor),
    )


def memory_at(p: float, par: Par) -> Memory:
    """Return the ECU's memory in which every controller holds that equilibrium."""
    i = holding_current(p, par)
    pid = pressure_pid.at_rest(pressure_pid.Input(p_ref=p, p_meas=p), i, par.ecu.pressure)
    low = low_pass_2.at_rest(i)
    duty = _duty_for(i, par)
    return zeros(Memory)._replace(
        p_meas=p,
        i_meas=i,
        p_ref=p,
        i_star=i,
        i_ref=i,
        duty=duty,
        v_source=par.motor.R_m * i,
        i_source=i,
        pid_integral=pid.integral,
        pid_slope=pid.slope,
        pid_last=pid.last,
        pi_integral=duty,
        lp_s1=low.s1,
        lp_s2=low.s2,
    )


def _duty_for(i: float, par: Par) -> float:
    """Return the duty cycle at which v = D (V_bat - R_bat D i) drives i at standstill."""
    v, V, drop = par.motor.R_m * i, par.supply.V_bat, par.supply.R_bat * i
    return 2.0 * v / (V + math.sqrt(max(V * V - 4.0 * drop * v, 0.0)))
