"""Equilibria: state and memory of a brake that holds a pressure, with a slightly open valve."""

from __future__ import annotations

from typing import Any

from bywire.authoring import ParameterError, zeros
from bywire.plant import (
    air_orifice,
    anti_alias_filter,
    brake_chamber,
    floating_caliper,
    lever,
    relay_valve,
)
from truck_ebs import ecu
from truck_ebs.elements import push_rod
from truck_ebs.mechanics import filled, released
from truck_ebs.parameters import TruckParameters as Par
from truck_ebs.rigs.brake_rig import BrakeRig

OPENING = 0.02
"""open fraction of the feed seat at an operating point"""


def rod_travel(p: float, par: Par) -> float:
    """Return the travel [m] at which the rod rests at a gauge pressure [Pa], without friction.

    Raises
    ------
    ParameterError
        If the rod would reach the end of the chamber.
    """

    def missing(x: float) -> float:
        out = brake_chamber.output(brake_chamber.Input(x, 0.0, p), par.chamber)
        n = max(lever.travel(x, par.lever) - par.caliper.clearance, 0.0)
        pads = lever.slope(x, par.lever) * floating_caliper.elastic(n, par.caliper)
        return float(out.F - pads - par.stop.k_stop * min(x, 0.0))

    from scipy.optimize import brentq  # imported here, because runs do not need it

    end = par.chamber.x_table[-1]
    if missing(end) > 0.0:
        raise ParameterError(
            f"pressure = {p / 1e5:g} bar is not a valid operating point, because the rod would "
            f"reach the end of the chamber, chamber.x_table = {1e3 * end:g} mm. Use a lower one"
        )
    return float(brentq(missing, -1e-3, end, xtol=1e-15, rtol=1e-14))


def leaking(p: float, par: Par) -> Par:
    """Return parameters with the leak that keeps the feed seat open by `OPENING` at a pressure.

    With closed seats, the control pressure would not affect the pressure at all. The chamber of
    this operating point leaks, so its valve is as sensitive as while it fills.
    """
    gas = par.gas
    ends = air_orifice.Input(par.p_s + gas.p_atm, p + gas.p_atm, gas.T_0, gas.T_0, OPENING)
    flow = air_orifice.output(ends, par.feed, gas).mdot
    return par.replace({"chamber.G_leak": float(flow / (gas.rho_0 * p))})


def held(p: float, par: Par) -> tuple[Any, ecu.Memory, ecu.Stimulus]:
    """Return state, memory and stimulus that hold a gauge pressure [Pa] at standstill."""
    x = rod_travel(p, par)
    spool = par.relay.overlap + (1.0 - par.relay.overlap) * OPENING
    V = brake_chamber.output(brake_chamber.Input(x, 0.0, 0.0), par.chamber).V
    states = released(par) | {
        "relay": relay_valve.State(spool),
        "sensor": anti_alias_filter.State(p / par.ecu.p_range),
        "volume": filled(p, V, par.gas),
        "rod": push_rod.State(x, 0.0),
    }
    control = p + par.relay.p_full * spool
    closed = par.ecu.control == "closed-loop"
    memory = zeros(ecu.Memory)._replace(
        p_ref=p if closed else control,
        p_meas=p,
        p_control=control,
        integral=control - p if closed else 0.0,
    )
    return BrakeRig.state(**states), memory, ecu.Stimulus(p_set=memory.p_ref)
