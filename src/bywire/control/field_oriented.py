"""Sampled field-oriented current control of a synchronous motor."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge, Gt
from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import (
    Current,
    FluxLinkage,
    Fraction,
    Inductance,
    InternalResistance,
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
Linkage = Annotated[float, Signal("V*s", "flux linkage", 6e-3)]


class Parameters(ParameterSet):
    r"""The controller's model of the motor, its bandwidth, and its limits.

    ``voltage``: with ``"circle"``, the voltages are at most :math:`V_{dc}/\sqrt 3`, and sinusoidal.
    With ``"hexagon"``, each phase can use the whole bus. The fundamental then reaches
    :math:`2 V_{dc}/\pi` (six steps), with harmonics of the orders 5 and 7.

    The gains follow from the model: :math:`k_p = L \omega_c` and :math:`k_i = (R + R_a) \omega_c`.
    With a total delay of 1.5 sample times, :math:`\omega_c = 1/(3 T)` has a phase margin of 61.4
    degrees.
    """

    omega_c: Bandwidth
    """bandwidth of the current loops"""
    p: PolePairs
    """number of pole pairs"""
    R_a: InternalResistance
    """active damping: resistance that the control adds; 0 for none"""
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
    voltage: Literal["circle", "hexagon"]
    """voltages that the control uses"""
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


def weakest_field(limit: Linkage, par: Parameters) -> Amperes:
    r"""Return the current along the magnets with the maximum torque per voltage (MTPV).

    .. math::
        i_d = \frac{\psi_d - \psi}{L_d}, \quad
        \psi_d = -\frac{2 (L_q - L_d) \lambda^2}
        {L_q \psi + \sqrt{L_q^2 \psi^2 + 8 (L_q - L_d)^2 \lambda^2}}

    with the amplitude :math:`\lambda` of the flux linkage. A more negative current would reduce the
    torque at this voltage.

    References
    ----------
    S. Morimoto, Y. Takeda, T. Hirasa, K. Taniguchi, "Expansion of Operating Limits for Permanent
    Magnet Motor by Current Vector Control Considering Inverter Capacity", IEEE Trans. Industry
    Applications 26(5), 1990.
    """
    a, own = par.L_q_hat - par.L_d_hat, par.L_q_hat * par.psi_hat
    square = limit * limit
    psi_d = -2.0 * a * square / (own + ops.sqrt(own * own + 8.0 * a * a * square))
    return (psi_d - par.psi_hat) / par.L_d_hat


class SetPoints(NamedTuple):
    """Set points, and the field weakening that lowers the current across the magnets."""

    i_d: Amperes
    i_q: Amperes
    beyond: Annotated[float, Signal("A", "field weakening beyond the MTPV current", 5.0)]


def set_points(
    i_ref: Amperes, i_fw: Amperes, i_lim: Amperes, limit: Linkage, par: Parameters
) -> SetPoints:
    """Return the set points in rotor coordinates, limited to the maximum amplitude.

    Field weakening lowers the current along the magnets from that with the maximum torque per
    ampere, and the maximum amplitude limits the current across the magnets. At the current with the
    maximum torque per voltage, the rest of the field weakening lowers the current across the
    magnets.

    Parameters
    ----------
    limit
        Flux linkage that the voltage allows.
    """
    top = ops.fmin(par.i_max, i_lim)
    amplitude = ops.clip(i_ref, -top, top)
    i_0 = least_current(amplitude, par)
    demand = _root(amplitude * amplitude - i_0 * i_0, par)
    least = ops.fmax(-top, weakest_field(limit, par))
    i_d = ops.clip(i_0 + i_fw, least, 0.0)
    beyond = ops.fmin(i_0 + i_fw - least, 0.0)
    size = ops.fmax(ops.fmin(demand, _root(top * top - i_d * i_d, par)) + beyond, 0.0)
    return SetPoints(i_d, ops.where(amplitude < 0.0, -size, size), beyond)


def _allowed_flux(V: Volts, omega_e: float, par: Parameters) -> Linkage:
    """Return the flux linkage that a voltage allows at a speed; at rest, more than any current."""
    strongest = par.psi_hat + (par.L_d_hat + par.L_q_hat) * par.i_max
    left = ops.fmax(V - par.R_hat * par.i_max, 0.0)
    return left / ops.fmax(ops.fabs(omega_e), V / strongest)


def _root(square: float, par: Parameters) -> float:
    """Return the square root, or 0 below a millionth of the maximum current (infinite slope)."""
    least = 1e-12 * par.i_max * par.i_max
    return ops.where(square > least, ops.sqrt(ops.fmax(square, least)), 0.0 * par.i_max)


def _relief(
    v: tuple[Volts, Volts],
    size: Volts,
    omega_e: float,
    i: tuple[Amperes, Amperes],
    beyond: Amperes,
    par: Parameters,
) -> float:
    """Return the cosine of the angle between the voltage and its change by less field weakening.

    The currents change along the curve of constant torque, or beyond the MTPV current across the
    magnets.
    """
    a = par.L_d_hat - par.L_q_hat
    only_q = beyond < 0.0
    torque = ops.where(i[1] < 0.0, -par.psi_hat, par.psi_hat)
    by_d = ops.where(only_q, 0.0 * par.psi_hat, par.psi_hat + a * i[0])
    by_q = ops.where(only_q, torque, -a * i[1])
    to_d = par.R_hat * by_d - omega_e * par.L_q_hat * by_q
    to_q = par.R_hat * by_q + omega_e * par.L_d_hat * by_d
    least = 1e-6 * par.R_hat * par.psi_hat
    length = ops.sqrt(to_d * to_d + to_q * to_q + least * least)
    return (to_d * v[0] + to_q * v[1]) / (length * size)


def hexagon(v_alpha: Volts, v_beta: Volts, V_dc: Volts) -> tuple[Volts, Volts]:
    r"""Return the voltages of a modulator whose duties are limited to 0 to 1.

    The modulator adds the voltage to all phases that centers them, and limits each phase to
    :math:`\pm V_{dc}/2`. Voltages within the hexagon do not change. A large demand results in six
    steps, whose fundamental has the amplitude :math:`2 V_{dc}/\pi`.

    References
    ----------
    D. G. Holmes, T. A. Lipo, Pulse Width Modulation for Power Converters, 2003, chapter 8.
    """
    half, side = -0.5 * v_alpha, 0.5 * math.sqrt(3.0) * v_beta
    phases = v_alpha, half + side, half - side
    highest = ops.fmax(phases[0], ops.fmax(phases[1], phases[2]))
    lowest = ops.fmin(phases[0], ops.fmin(phases[1], phases[2]))
    center, most = 0.5 * (highest + lowest), 0.5 * V_dc
    a, b, d = (ops.clip(v - center, -most, most) for v in phases)
    return (2.0 * a - b - d) / 3.0, (b - d) / math.sqrt(3.0)


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    r"""Advance the controller by one sample.

    .. math::
        v_d = k_p e_d + z_d - R_a i_d - \omega_e L_q i_q, \quad
        v_q = k_p e_q + z_q - R_a i_q + \omega_e (L_d i_d + \psi)

    A voltage above the limit keeps its direction. The integral terms follow the limited voltage.
    The voltage then gets a lead angle: the rotation of the rotor until the middle of the sample in
    which the inverter applies the voltage.

    Field weakening integrates the voltage above the reserve, weighted by the cosine of the angle
    between the voltage and the change of the voltage along a curve of constant torque. For surface
    magnets, the weight is

    .. math::
        \frac{R v_d + \omega_e L_d v_q}{\sqrt{R^2 + \omega_e^2 L_d^2}\, |v|}

    Notes
    -----
    Without active damping, the zero of the control cancels the winding's pole L/R. Set points are
    then followed without this pole, but a disturbance such as an error of the flux linkage decays
    with it. A resistance :math:`R_a` moves the pole of the damped winding to
    :math:`(R + R_a) / L`.

    Without the weight of field weakening, a slow motor whose resistance needs the whole voltage
    would weaken its field completely. No current would then remain for the torque. Where
    :math:`\psi / L_d` is less than the maximum amplitude, the circle of that amplitude is not the
    optimum at high speed.
    """
    omega_e = par.p * u.omega
    c, s = ops.cos(u.theta_e), ops.sin(u.theta_e)
    i_d, i_q = c * u.i_alpha + s * u.i_beta, c * u.i_beta - s * u.i_alpha
    most, usual = _voltages(u.V_dc, par)
    reserved = par.reserve * usual
    ref = set_points(u.i_ref, x.i_fw, u.i_lim, _allowed_flux(reserved, omega_e, par), par)
    e_d, e_q = ref.i_d - i_d, ref.i_q - i_q
    damped_d, damped_q = x.z_d - par.R_a * i_d, x.z_q - par.R_a * i_q
    v_d = par.L_d_hat * par.omega_c * e_d + damped_d - omega_e * par.L_q_hat * i_q
    v_q = par.L_q_hat * par.omega_c * e_q + damped_q + omega_e * (par.L_d_hat * i_d + par.psi_hat)
    size = ops.sqrt(v_d * v_d + v_q * v_q)
    share = most / ops.fmax(size, most)  # a voltage of zero has no direction
    within_d, within_q = share * v_d, share * v_q
    ahead = u.theta_e + par.lead * omega_e * T
    c, s = ops.cos(ahead), ops.sin(ahead)
    v_alpha, v_beta = c * within_d - s * within_q, s * within_d + c * within_q
    if par.voltage == "hexagon":
        v_alpha, v_beta = hexagon(v_alpha, v_beta, u.V_dc)
        within_d, within_q = c * v_alpha + s * v_beta, c * v_beta - s * v_alpha
    k_i = (par.R_hat + par.R_a) * par.omega_c
    excess = size - reserved
    relief = _relief((v_d, v_q), ops.fmax(size, reserved), omega_e, (i_d, i_q), ref.beyond, par)
    weakened = ops.where(excess > 0.0, excess * relief, excess)
    state = State(
        z_d=x.z_d + T * (k_i * e_d + (within_d - v_d) * par.omega_c),
        z_q=x.z_q + T * (k_i * e_q + (within_q - v_q) * par.omega_c),
        i_fw=ops.clip(x.i_fw - T * par.k_fw * weakened, -2.0 * par.i_max, 0.0),
    )
    return state, Output(
        v_alpha=v_alpha,
        v_beta=v_beta,
        i_d_ref=ref.i_d,
        i_q_ref=ref.i_q,
        limited=ops.where(size > usual, 1.0, 0.0),
    )


def _voltages(V_dc: Volts, par: Parameters) -> tuple[Volts, Volts]:
    """Return the maximum demand, and the maximum fundamental."""
    if par.voltage == "hexagon":
        return V_dc, 2.0 / math.pi * V_dc
    return V_dc / math.sqrt(3.0), V_dc / math.sqrt(3.0)
