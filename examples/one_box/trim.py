"""Equilibria, with state and memory that hold a pressure at rest without friction."""

from __future__ import annotations

import math
from typing import Any

from bywire.authoring import zeros
from bywire.plant import ball_screw_gear, dc_motor, master_cylinder, stiffening_caliper
from one_box import ecu
from one_box.hydraulics import released_memory, released_parts
from one_box.model import OneBox
from one_box.parameters import OneBoxParameters


def travel_at(p: float, par: OneBoxParameters, wheel: float | None = None) -> float:
    """Return the plunger travel [m] at a pressure [Pa], after slow filling.

    ``wheel``: pressure at the wheel [Pa]; default: that of the plunger.
    """
    others = stiffening_caliper.volume(stiffening_caliper.State(p), par.others)
    held = stiffening_caliper.State(p if wheel is None else wheel)
    taken = float(others + stiffening_caliper.volume(held, par.caliper))
    cylinder = par.plunger
    start = cylinder.x_rest + par.port.x_port  # the plunger covers the port here
    shrink = math.exp(-p / par.fluid.beta)
    left = cylinder.A_mc * (cylinder.s_mc - start) * shrink - taken
    return cylinder.s_mc - left / cylinder.A_mc


def holding_current(p: float, par: OneBoxParameters) -> float:
    """Return the current [A] that balances a pressure [Pa] without friction."""
    return par.gear.k_g * p * par.plunger.A_mc / par.motor.K_e


def state_at(p: float, par: OneBoxParameters, wheel: float | None = None) -> Any:
    """Return the state at rest at a pressure [Pa]. ``wheel``: as in `travel_at`."""
    parts = released_parts(par) | {
        "motor": dc_motor.State(holding_current(p, par)),
        "gear": ball_screw_gear.State(travel_at(p, par, wheel) / par.gear.k_g, 0.0),
        "chamber": master_cylinder.State(p),
        "others": stiffening_caliper.State(p),
        "caliper": stiffening_caliper.State(p if wheel is None else wheel),
    }
    return OneBox.state(**parts)


def memory_at(p: float, par: OneBoxParameters, wheel: float | None = None) -> ecu.Memory:
    """Return the memory with which each controller holds this state."""
    i, theta = holding_current(p, par), travel_at(p, par, wheel) / par.gear.k_g
    law = par.ecu.position
    stiffness = law.J_hat / law.K_hat * (2.0 * math.pi * law.f_n) ** 2
    duty = _duty(i, par)
    held = {
        "p_ref": p,
        "theta_ref": theta + i / stiffness,
        "theta_last": theta,
        "i_ref": i,
        "duty": duty,
        "pi_integral": duty,
    }
    return zeros(ecu.Memory)._replace(**released_memory(par) | held)


def _duty(i: float, par: OneBoxParameters) -> float:
    """Return the duty D that drives a current at rest, (V_bat - R_bat D i) D = R_m i."""
    duty = par.motor.R_m * i / par.supply.V_bat
    for _ in range(50):
        duty = par.motor.R_m * i / (par.supply.V_bat - par.supply.R_bat * duty * i)
    return duty
