"""The ECU: it samples the demand, and sets the control pressure of the relay valve."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from annotated_types import Ge

from bywire.authoring import Limited, Signal
from bywire.core import ops
from truck_ebs.laws import pressure_control


class Stimulus(NamedTuple):
    """External inputs."""

    p_set: Annotated[float, Signal("Pa", "pressure demand", 4e5), Ge(0)]


class Memory(NamedTuple):
    """Memory of the ECU between its ticks."""

    p_ref: Annotated[
        float, Signal("Pa", "pressure set point", 4e5, set_point_of="p"), Limited("ecu.p_max")
    ]
    p_meas: Annotated[float, Signal("Pa", "measured pressure", 4e5)]
    p_control: Annotated[float, Signal("Pa", "control pressure", 4e5), Limited("ecu.p_max")]
    integral: Annotated[float, Signal("Pa", "integral term of the pressure control", 1e4)]


def tick(x: Any, m: Any, u: Stimulus, par: Any) -> Any:
    """Sample demand and pressure, and set the control pressure."""
    return controlled(x, m._replace(p_ref=ops.clip(u.p_set, 0.0, par.ecu.p_max)), par)


def controlled(x: Any, m: Any, par: Any) -> Any:
    """Return the memory after pressure control; the pilot valve has a lag, by backward Euler."""
    ecu = par.ecu
    p_meas = x.y_p * ecu.p_range
    demand, integral = m.p_ref, m.integral
    if ecu.control == "closed-loop":
        state, out = pressure_control.output(
            pressure_control.State(m.integral),
            pressure_control.Input(m.p_ref, p_meas),
            ecu.T_s,
            ecu.pressure,
        )
        demand, integral = ops.fmin(out.p, ecu.p_max), state.integral
    share = ecu.T_s / (ecu.T_s + ecu.T_bus)
    p_control = m.p_control + share * (demand - m.p_control)
    return m._replace(p_meas=p_meas, p_control=p_control, integral=integral)
