"""The ECU of a synchronous motor: the same cascade, with field-oriented current control.

Currents are measured in the stator's coordinates and the angle with its sensor. Current control
computes duties for the next sample. Until then, the inverter holds the duties of the last sample
while the rotor turns.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.authoring import Signal
from bywire.control import field_oriented
from emb_caliper import ecu
from emb_caliper.ecu import Stimulus, force_tick, source_tick
from emb_caliper.parameters import SynchronousBrakeParameters as Par

__all__ = ["Memory", "Readings", "current_tick", "force_tick", "source_tick", "speed_tick"]


class Memory(NamedTuple):
    """Memory of the ECU between its ticks. Duties are voltages per bus voltage."""

    F_meas: Annotated[float, Signal("N", "measured clamp force", 1e4)]
    theta_meas: Annotated[float, Signal("rad", "measured motor angle", 50.0)]
    omega_meas: Annotated[float, Signal("rad/s", "measured motor speed", 100.0)]
    F_ref: Annotated[float, Signal("N", "force set point", 1e4, set_point_of="F_cl")]
    omega_ref: Annotated[float, Signal("rad/s", "speed set point", 100.0, set_point_of="omega")]
    i_ref: Annotated[float, Signal("A", "current set point", 10.0, set_point_of="i")]
    i_d_ref: Annotated[float, Signal("A", "d-axis set point", 10.0, set_point_of="i_d")]
    i_q_ref: Annotated[float, Signal("A", "q-axis set point", 10.0, set_point_of="i_q")]
    duty_alpha: Annotated[float, Signal("1", "duty on the alpha axis", 0.5)]
    duty_beta: Annotated[float, Signal("1", "duty on the beta axis", 0.5)]
    next_alpha: Annotated[float, Signal("1", "next duty on the alpha axis", 0.5)]
    next_beta: Annotated[float, Signal("1", "next duty on the beta axis", 0.5)]
    v_source: Annotated[float, Signal("V", "source voltage", 10.0)]
    parked: Annotated[float, Signal("1", "parked by position control")]
    sat_speed: Annotated[float, Signal("1", "speed demand saturated")]
    sat_current: Annotated[float, Signal("1", "current demand saturated")]
    sat_duty: Annotated[float, Signal("1", "voltage saturated")]
    force_integral: Annotated[float, Signal("rad/s", "integral term of the force PI", 10.0)]
    speed_integral: Annotated[float, Signal("A", "integral term of the speed PI", 5.0)]
    z_d: Annotated[float, Signal("V", "d-axis integral term of the current PI", 1.0)]
    z_q: Annotated[float, Signal("V", "q-axis integral term of the current PI", 1.0)]
    i_fw: Annotated[float, Signal("A", "field-weakening current", 1.0)]


class Readings(NamedTuple):
    """Sensor readings at a tick. Sensors of currents, speed and bus voltage are ideal."""

    F_cl: Annotated[float, Signal("N", "clamp force", 1e4)]
    theta: Annotated[float, Signal("rad", "motor angle", 50.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 100.0)]
    i_alpha: Annotated[float, Signal("A", "current on the alpha axis", 10.0)]
    i_beta: Annotated[float, Signal("A", "current on the beta axis", 10.0)]
    V_dc: Annotated[float, Signal("V", "bus voltage", 40.0)]


def speed_tick(r: Readings, m: Memory, u: Stimulus, par: Par) -> Memory:
    """Run speed control once to update the current set point."""
    law = par.ecu.current
    return ecu.speed_control(r, m, u, par, 1.5 * law.p * law.psi_hat)


def current_tick(r: Readings, m: Memory, u: Stimulus, par: Par) -> Memory:
    """Apply the duties of the last tick, and run field-oriented control once for the next one."""
    if par.drive == "current":
        m = m._replace(i_ref=u.i_set)
    state, out = field_oriented.output(
        field_oriented.State(m.z_d, m.z_q, m.i_fw),
        field_oriented.Input(
            i_ref=m.i_ref,
            i_alpha=r.i_alpha,
            i_beta=r.i_beta,
            theta_e=par.ecu.current.p * r.theta,
            omega=r.omega,
            V_dc=r.V_dc,
            i_lim=par.ecu.current.i_max,
        ),
        par.ecu.T_current,
        par.ecu.current,
    )
    return m._replace(
        i_d_ref=out.i_d_ref,
        i_q_ref=out.i_q_ref,
        duty_alpha=m.next_alpha,
        duty_beta=m.next_beta,
        next_alpha=out.v_alpha / r.V_dc,
        next_beta=out.v_beta / r.V_dc,
        sat_duty=out.limited,
        z_d=state.z_d,
        z_q=state.z_q,
        i_fw=state.i_fw,
    )
