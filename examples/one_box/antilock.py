"""Anti-lock control of the wheel: slip control lowers the demand, and the valves follow it."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from bywire.authoring import Signal, signals
from bywire.core import ops
from bywire.plant import solenoid_valve
from bywire.vehicle import slip_control
from one_box import ecu
from one_box.laws import valve_pressure


class Commands(NamedTuple):
    """Demands for valves and pump, which act if anti-lock control is off."""

    close_set: Annotated[float, Signal("1", "inlet valve demand", 0.5, low=0.0, high=1.0)]
    release_set: Annotated[float, Signal("1", "outlet valve demand", 0.5, low=0.0, high=1.0)]
    pump_set: Annotated[float, Signal("1", "return pump demand", 0.5, low=0.0, high=1.0)]


class ValveMemory(NamedTuple):
    """Memory of the control of the valves between its ticks."""

    close: Annotated[float, Signal("1", "inlet valve command")]
    release: Annotated[float, Signal("1", "outlet valve command")]
    pump: Annotated[float, Signal("1", "return pump command")]
    close_on: Annotated[float, Signal("1", "inlet valve energized")]
    close_waiting: Annotated[float, Signal("s", "time since the inlet command changed", 1e-3)]
    release_on: Annotated[float, Signal("1", "outlet valve energized")]
    release_waiting: Annotated[float, Signal("s", "time since the outlet command changed", 1e-3)]
    p_wheel_ref: Annotated[float, Signal("Pa", "wheel pressure set point", 5e6, set_point_of="p")]
    p_hat: Annotated[float, Signal("Pa", "wheel pressure expected by the ECU", 5e6)]
    building: Annotated[float, Signal("1", "inlet valve commanded open")]
    dumping: Annotated[float, Signal("1", "outlet valve commanded open")]
    switched: Annotated[float, Signal("s", "time since the valves switched", 0.1)]
    V_hat: Annotated[float, Signal("m**3", "accumulator volume expected by the ECU", 1e-6)]


Stimulus: Any = signals.joined(__name__, "Stimulus", ecu.Stimulus, Commands)
"""external inputs of plunger and valves"""
Memory: Any = signals.joined(__name__, "Memory", ecu.Memory, ValveMemory, slip_control.Memory)
"""memory of the plunger's ECU and of anti-lock control"""


def tick(m: Any, p: float, par: Any) -> Any:
    """Run the control of the valves once after slip control; ``p``: plunger pressure [Pa]."""
    p_ref = m.M_left / par.antilock.slip.k_hat
    p = ops.where(m.refill > 0.5, ops.fmax(p, m.p_kept), p)  # behind the separation valve
    state, out = valve_pressure.output(
        valve_pressure.State(m.p_hat, m.building, m.dumping, m.switched, m.V_hat),
        valve_pressure.Input(p_ref, p, m.abs),
        par.antilock.T_s,
        par.valves,
    )
    return m._replace(
        p_wheel_ref=p_ref,
        p_hat=state.p_hat,
        building=state.building,
        dumping=state.dumping,
        switched=state.since,
        V_hat=state.V_hat,
        close=out.close,
        release=out.release,
        pump=out.pump,
    )


def sample(m: Any, u: Any) -> Any:
    """Sample the demands for valves and pump."""
    return m._replace(
        p_wheel_ref=m.p_ref, close=u.close_set, release=u.release_set, pump=u.pump_set
    )


def coils(m: Any, par: Any) -> Any:
    """Pass the valve commands on to the armatures after their delays."""
    T = par.antilock.T_s
    inlet = solenoid_valve.Coil(m.close_on, m.close_waiting)
    inlet = solenoid_valve.delayed(inlet, m.close, T, par.inlet)
    outlet = solenoid_valve.Coil(m.release_on, m.release_waiting)
    outlet = solenoid_valve.delayed(outlet, m.release, T, par.outlet)
    return m._replace(
        close_on=inlet.on,
        close_waiting=inlet.waiting,
        release_on=outlet.on,
        release_waiting=outlet.waiting,
    )
