"""Sampled field-oriented current control of a synchronous motor."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt
from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import (
    Current,
    FluxLinkage,
    Fraction,
    Inductance,
    PolePairs,
    Resistance,
    Unit,
)
from bywire.core.signals import Signal

Bandwidth = Annotated[float, Unit("rad/s", 3e3), Field(gt=0, allow_inf_nan=False)]
WeakeningGain = Annotated[float, Unit("A/(V*s)", 1e3), Field(ge=0, allow_inf_nan=False)]
LeadTicks = Annotated[float, Unit("1", 1.5), Field(ge=0, le=5, allow_inf_nan=False)]
SampleTime = Annotated[float, Signal("s", "sample time", 1e-4), Gt(0)]
Amperes = Annotated[float, Signal("A", "current", 5.0)]
Volts = Annotated[float, Signal("V", "voltage", 5.0)]


class Parameters(ParameterSet):
    r"""The controller's model of the motor, its bandwidth, and its limits.

    The gains follow from the model: :math:`k_p = L \omega_c` and :math:`k_i = R \omega_c`. With a
    total delay of 1.5 sample times, :math:`\omega_c = 1/(3 T)` has a phase margin of 61.4 degrees.
    """

    omega_c: Bandwidth
    """bandwidth of the current loops"""
    p: PolePairs
    """number of pole pairs"""
    R_hat: Resistance
    """resistance of a phase"""
    L_d_hat: Inductance
    """inductance along the magnets"""
    L_q_hat: Inductance
    """inductance across the magnets"""
    psi_hat: FluxLinkage
    """flux linkage of the magnets"""
    lead: LeadTicks
    """lead angle of the voltage, in sample times of rotation; 1.5 for a delay of one sample time"""
    i_max: Current
    """maximum current amplitude"""
    k_fw: WeakeningGain
    """field-weakening gain; 0 disables field weakening"""
    reserve: Fraction
    """fraction of the maximum voltage above which field weakening starts"""


class State(NamedTuple):
    """Integral terms, and the field-weakening current."""

    z_d: Annotated[float, Signal("V", "integral term, along the magnets", 1.0)]
    z_q: Annotated[float, Signal("V", "integral term, across the magnets", 1.0)]
    i_fw: Annotated[float, Signal("A", "field-weakening current", 1.0)]


class Input(NamedTuple):
    """Current demand, measured currents in stator coordinates, angle, speed and bus voltage."""

    i_ref: Annotated[float, Signal("A", "amplitude of the current, with the torque's sign", 5.0)]
    i_alpha: Amperes
    i_beta: Amperes
    theta_e: Annotated[float, Signal("rad", "electrical angle", 3.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 100.0)]
    V_dc: Annotated[float, Signal("V", "bus voltage", 24.0), Gt(0)]
    i_lim: Annotated[float, Signal("A", "limit of the amplitude, for example derated", 10.0), Ge(0)]


class Output(NamedTuple):
    """Voltages in stator coordinates, and set points in rotor coordinates."""

    v_alpha: Volts
    v_beta: Volts
    i_d_ref: Annotated[float, Signal("A", "set point along the magnets", 5.0)]
    i_q_ref: Annotated[float, Signal("A", "set point across the magnets", 5.0)]
    limited: Annotated[float, Signal("1", "voltage limited", 1.0)]


def least_current(amplitude: Amperes, par: Parameters) -> Amperes:
    r"""Return the current along the magnets that gives the maximum torque per ampere.

    .. math:: i_d = \frac{-\psi + \sqrt{\psi^2 + 8 (L_d - L_q)^2 I^2}}{4 (L_d - L_q)}
        = \frac{2 (L_d - L_q) I^2}{\psi + \sqrt{\psi^2 + 8 (L_d - L_q)^2 I^2}}

    The second form is also valid for equal inductances.
    """
    a, psi = par.L_d_hat - par.L_q_hat, par.psi_hat
    square = amplitude * amplitude
    return 2.0 * a * square / (psi + ops.sqrt(psi * psi + 8.0 * a * a * square))


def set_points(
    i_ref: Amperes, i_fw: Amperes, i_lim: Amperes, par: Parameters
) -> tuple[Amperes, Amperes]:
    r"""Return the set points in rotor coordinates, limited to the maximum amplitude.

    The field-weakening current never cancels more than the magnet flux, :math:`i_d \ge -\psi/L_d`.
    """
    top = ops.fmin(par.i_max, i_lim)
    amplitude = ops.clip(i_ref, -top, top)
    least = ops.fmax(-top, -par.psi_hat / par.L_d_hat)
    i_d = ops.clip(least_current(amplitude, par) + i_fw, least, 0.0)
    room = _root(top * top - i_d * i_d, par)
    # Without field weakening, the amplitude equals the demanded amplitude.
    across = _root(amplitude * amplitude - i_d * i_d, par)
    weakened = ops.fmin(ops.fabs(amplitude), room)
    i_q = ops.where(i_fw < 0.0, weakened, across)
    return i_d, ops.where(amplitude < 0.0, -i_q, i_q)


def _root(square: float, par: Parameters) -> float:
    """Return the square root, or 0 below a millionth of the maximum current (infinite slope)."""
    least = 1e-12 * par.i_max * par.i_max
    return ops.where(square > least, ops.sqrt(ops.fmax(square, least)), 0.0 * par.i_max)


def _relief(v_d: Volts, v_q: Volts, omega_e: float, size: Volts, par: Parameters) -> float:
    """Return how much a current against the magnets reduces the voltage, from -1 to 1."""
    X = omega_e * par.L_d_hat
    slope = par.R_hat * v_d + X * v_q
    return slope / (ops.sqrt(par.R_hat * par.R_hat + X * X) * size)


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    r"""Advance the controller by one sample.

    .. math::
        v_d = k_p e_d + z_d - \omega_e L_q i_q, \quad
        v_q = k_p e_q + z_q + \omega_e (L_d i_d + \psi)

    A voltage above :math:`V_{dc}/\sqrt 3` is limited in magnitude and keeps its direction. The
    integral terms follow the limited voltage. The voltage then gets a lead angle: the rotation of
    the rotor until the middle of the sample in which the inverter applies the voltage.

    Field weakening integrates the voltage above the reserve, weighted by how much a current against
    the magnets reduces it,

    .. math::
        \frac{R v_d + \omega_e L_d v_q}{\sqrt{R^2 + \omega_e^2 L_d^2}\, |v|}

    Notes
    -----
    Without this weight, a slow motor whose resistance needs the whole voltage would weaken its
    field completely. No current would then remain for the torque.
    """
    omega_e = par.p * u.omega
    c, s = ops.cos(u.theta_e), ops.sin(u.theta_e)
    i_d, i_q = c * u.i_alpha + s * u.i_beta, c * u.i_beta - s * u.i_alpha
    i_d_ref, i_q_ref = set_points(u.i_ref, x.i_fw, u.i_lim, par)
    e_d, e_q = i_d_ref - i_d, i_q_ref - i_q
    v_d = par.L_d_hat * par.omega_c * e_d + x.z_d - omega_e * par.L_q_hat * i_q
    v_q = par.L_q_hat * par.omega_c * e_q + x.z_q + omega_e * (par.L_d_hat * i_d + par.psi_hat)
    v_max = u.V_dc / math.sqrt(3.0)
    size = ops.sqrt(v_d * v_d + v_q * v_q)
    is_limited = size > v_max
    divisor = ops.fmax(size, v_max)  # a voltage of zero has no direction
    share = v_max / divisor
    k_i = par.R_hat * par.omega_c
    excess = size - par.reserve * v_max
    relief = _relief(v_d, v_q, omega_e, divisor, par)
    weakened = ops.where(excess > 0.0, excess * relief, excess)
    state = State(
        z_d=x.z_d + T * (k_i * e_d + (share - 1.0) * v_d * par.omega_c),
        z_q=x.z_q + T * (k_i * e_q + (share - 1.0) * v_q * par.omega_c),
        i_fw=ops.clip(x.i_fw - T * par.k_fw * weakened, -par.i_max, 0.0),
    )
    ahead = u.theta_e + par.lead * omega_e * T
    c, s = ops.cos(ahead), ops.sin(ahead)
    return state, Output(
        v_alpha=share * (c * v_d - s * v_q),
        v_beta=share * (s * v_d + c * v_q),
        i_d_ref=i_d_ref,
        i_q_ref=i_q_ref,
        limited=ops.where(is_limited, 1.0, 0.0),
    )
