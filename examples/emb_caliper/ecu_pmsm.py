"""The ECU of a synchronous motor: the same cascade, with field-oriented current control.

Currents are measured in the stator's coordinates and the angle with its sensor. Current control
computes duties for the next sample. Until then, the inverter holds the duties of the last sample
while the rotor turns.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from bywire.authoring import Signal, joined
from bywire.control import field_oriented
from bywire.plant import inverter
from emb_caliper import ecu, estimation
from emb_caliper.ecu import Stimulus, force_tick, measured_current, source_tick
from emb_caliper.parameters import SynchronousBrakeParameters as Par

__all__ = [
    "Memory",
    "Readings",
    "current_tick",
    "estimate_tick",
    "force_tick",
    "source_tick",
    "speed_tick",
]


class DriveMemory(NamedTuple):
    """Memory of the cascade between its ticks. Duties are voltages per bus voltage."""

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


Memory: Any = joined(__name__, "Memory", DriveMemory, estimation.Memory)
"""memory of the ECU between its ticks"""


class Readings(NamedTuple):
    """Sensor readings at a tick. Speed and bus voltage are ideal."""

    F_cell: Annotated[float, Signal("N", "reading of the load cell", 1e4)]
    theta: Annotated[float, Signal("rad", "motor angle", 50.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 100.0)]
    i_alpha: Annotated[float, Signal("A", "current on the alpha axis", 10.0)]
    i_beta: Annotated[float, Signal("A", "current on the beta axis", 10.0)]
    V_dc: Annotated[float, Signal("V", "bus voltage", 40.0)]


def estimate_tick(r: Readings, m: Any, u: Stimulus, par: Par) -> Any:
    """Advance the estimate of the clamp force by one sample, from the torque-producing current."""
    return estimation.estimated(r.theta, _torque_current(r, u, par), m, par)


def _torque_current(r: Readings, u: Stimulus, par: Par) -> float:
    """Return the torque-producing current as the ECU measures it."""
    i_alpha, i_beta = _currents(r, u, par)
    _, i_q = inverter.rotated(i_alpha, i_beta, par.ecu.current.p * r.theta)
    return i_q


def _currents(r: Readings, u: Stimulus, par: Par) -> tuple[float, float]:
    """Return the stator's currents as the ECU measures them."""
    return measured_current(r.i_alpha, u.noise_i, par), measured_current(r.i_beta, u.noise_i_2, par)


def speed_tick(r: Readings, m: Any, u: Stimulus, par: Par) -> Any:
    """Run speed control once to update the current set point."""
    law = par.ecu.current
    return ecu.speed_control(r, m, u, par, 1.5 * law.p * law.psi_hat)


def current_tick(r: Readings, m: Any, u: Stimulus, par: Par) -> Any:
    """Apply the duties of the last tick, and run field-oriented control once for the next one."""
    if par.drive == "current":
        m = m._replace(i_ref=u.i_set)
    m = estimation.summed(_torque_current(r, u, par), m, par)
    i_alpha, i_beta = _currents(r, u, par)
    state, out = field_oriented.output(
        field_oriented.State(m.z_d, m.z_q, m.i_fw),
        field_oriented.Input(
            i_ref=m.i_ref,
            i_alpha=i_alpha,
            i_beta=i_beta,
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
