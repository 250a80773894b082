"""Equilibria of the motorcycle brake: states and ECU memory that hold a pressure at rest."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from typing import Any

from bywire.brakes.motorcycle.ecu import Memory
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.control import low_pass_2, pressure_pid
from bywire.core import ops
from bywire.core.errors import not_valid
from bywire.core.signals import zeros
from bywire.plant import (
    anti_alias_filter,
    ball_screw_gear,
    brake_fluid,
    caliper,
    current_sensor,
    dc_motor,
    master_cylinder,
    motor_heat,
    pressure_sensor,
    reservoir_port,
)

Par = MotorcycleParameters
_INNER, _OUTER = (math.sqrt(5.0 + sign * 2.0 * math.sqrt(10.0 / 7.0)) / 3.0 for sign in (-1, 1))
_LARGE, _SMALL = ((322.0 + sign * 13.0 * math.sqrt(70.0)) / 900.0 for sign in (1, -1))
_GAUSS = (
    (-_OUTER, _SMALL),
    (-_INNER, _LARGE),
    (0.0, 128.0 / 225.0),
    (_INNER, _LARGE),
    (_OUTER, _SMALL),
)
_HALVINGS = 60
_NOTHING = zeros(Memory)


def travel_at(p: float, par: Par) -> float:
    r"""Return the piston travel [m] at a pressure [Pa], after slow filling from the retracted end.

    With port law "dead-stroke" the filling begins where the port is covered.

    Notes
    -----
    The displaced volume compresses the chamber and fills the caliper. The chamber's fluid,
    F = A_mc (s_mc - x) - V_g(p) with the gas V_g, then follows

    .. math:: \frac{dF}{dp} = -\frac{F}{\beta} - C_{pd}(p), \quad
        F(p) = F(0) e^{-p/\beta} - \int_0^p C_{pd}(s) e^{(s - p)/\beta} ds

    Gauss quadrature integrates from node to node of the caliper's table. Its points never coincide
    with the nodes, where the slope jumps.
    """
    cylinder, fluid, port, pads = par.master_cylinder, par.fluid, par.port, par.caliper
    start = cylinder.x_rest + reservoir_port.closed_at(port)
    empty = cylinder.A_mc * (cylinder.s_mc - start) - brake_fluid.gas_volume(0.0, fluid)
    is_plain = all(type(number) is float for number in (p, fluid.beta, *pads.p_table))
    looked_at, decay = (_kept_nodes if is_plain else _nodes)(p, fluid.beta, pads.p_table)
    taken = 0.0
    for at, width, left_of_it in looked_at:
        taken += width * caliper.mass(at, pads, fluid) * left_of_it
    left = empty * decay - taken
    return cylinder.s_mc - (left + brake_fluid.gas_volume(p, fluid)) / cylinder.A_mc


def _nodes(
    p: float, beta: float, table: tuple[float, ...]
) -> tuple[tuple[tuple[caliper.State, float, float], ...], float]:
    """Return the Gauss points of the integral of `travel_at`, each with width and exponential.

    The second value is the exponential over the whole interval.
    """
    looked_at = []
    for low, high in pairwise((0.0, *(ops.clip(node, 0.0, p) for node in table), p)):
        for share, weight in _GAUSS:
            at = 0.5 * (low + high) + 0.5 * (high - low) * share
            exponential = ops.exp((at - p) / beta)
            looked_at.append((caliper.State(at), 0.5 * (high - low) * weight, exponential))
    return tuple(looked_at), ops.exp(-p / beta)


_kept_nodes = lru_cache(maxsize=64)(_nodes)  # a study rarely varies their parameters


def highest_pressure(par: Par) -> float:
    """Return the pressure [Pa] at which a slow piston reaches its far end stop."""
    x_end, low, high = par.master_cylinder.x_end, 0.0, 1e6
    while travel_at(high, par) < x_end:
        high *= 2.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if travel_at(middle, par) < x_end else (low, middle)
    return low


def holding_current(p: float, par: Par) -> float:
    """Return the current [A] that balances a pressure [Pa] without friction."""
    torque = par.gear.k_g * p * par.master_cylinder.A_mc
    efficiency = par.gear.eta_g if par.gear.law == "paper" else 1.0
    return torque / (efficiency * par.motor.K_e)


def state_at(p: float, par: Par, current: float | None = None) -> Any:
    """Return the state at rest at a pressure [Pa] (see `resting_at`), without checking symbols.

    Parameters
    ----------
    current
        Motor current [A]. Default: the current that balances the pressure without friction.

    Raises
    ------
    ParameterError
        When the piston would be beyond its end stop, or the pressure is negative.
    """
    x = par.master_cylinder.x_rest if p == 0 else travel_at(p, par)
    if not ops.is_symbol(x) and not (p >= 0 and x <= par.master_cylinder.x_end):
        limit = math.floor(highest_pressure(par) / 1e3) / 100.0
        raise not_valid(
            "initial pressure at rest",
            f"{p / 1e5:g} bar",
            f">= 0 bar and <= {limit:g} bar",
            "where the piston reaches its end stop. Start lower, or move the stop "
            "(master_cylinder.x_end)",
        )
    return _resting_at(p, x, par, current)


def resting_at(p: float, par: Par, current: float | None = None) -> Any:
    """Return the state at rest at a pressure [Pa]; friction balances the remaining torque.

    Without pressure the piston rests at its retracted end. Parameters may be symbols.

    Parameters
    ----------
    current
        Motor current [A]. Default: the current that balances the pressure without friction.
    """
    x = par.master_cylinder.x_rest if p == 0 else travel_at(p, par)
    return _resting_at(p, x, par, current)


def _resting_at(p: float, x: float, par: Par, current: float | None) -> Any:
    held = holding_current(p, par) if current is None else current
    p_seen = pressure_sensor.reading(p + par.fluid.p_atm, par.pressure_sensor)
    i_seen = current_sensor.reading(held, par.current_sensor)
    return MotorcycleBrake.state(
        motor=dc_motor.State(i=0.0 if par.drive.mode == "current-source" else held),
        gear=ball_screw_gear.State(theta=x / par.gear.k_g, omega=0.0),
        chamber=master_cylinder.State(p),
        pads=caliper.State(p),
        filter_p=anti_alias_filter.State(p_seen),
        filter_i=anti_alias_filter.State(i_seen),
        heat=motor_heat.cold(par.motor_heat),
    )


def memory_at(p: float, par: Par, current: float | None = None) -> Memory:
    """Return the memory with which the controllers or the ideal source hold that state."""
    i = holding_current(p, par) if current is None else current
    measured = _NOTHING._replace(p_meas=p, i_meas=i)
    if par.drive.mode == "voltage-source":
        return measured._replace(v_source=par.motor.R_m * i)
    if par.drive.mode == "current-source":
        return measured._replace(i_source=i, i_ref=i)
    scheduled = par.ecu.pressure_at(p)
    pid = pressure_pid.at_rest(pressure_pid.Input(p_ref=p, p_meas=p), i, scheduled)
    low = low_pass_2.at_rest(i)
    duty = _duty_for(i, par)
    return measured._replace(
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
    return 2.0 * v / (V + ops.sqrt(ops.fmax(V * V - 4.0 * drop * v, 0.0)))
