"""Carrier-averaged three-phase inverter with dead time, voltage drops, held voltages and diodes."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Frequency, Unit, Weight
from bywire.core.signals import Role, Signal

DeadTime = Annotated[float, Unit("s", 1e-6), Field(ge=0, allow_inf_nan=False)]
ForwardVoltage = Annotated[float, Unit("V", 0.5), Field(ge=0, allow_inf_nan=False)]
BusVoltage = Annotated[float, Signal("V", "bus voltage", 24.0, low=1.0)]
Volts = Annotated[float, Signal("V", "voltage", 5.0)]
Amperes = Annotated[float, Signal("A", "current", 5.0)]
Angle = Annotated[float, Signal("rad", "electrical angle", 3.0)]
Share = Annotated[float, Signal("1", "voltage relative to the bus voltage", 0.3)]
Loss = Annotated[float, Signal("W", "inverter loss", role=Role("sink", "inverter"))]


class Parameters(ParameterSet):
    r"""Inverter that holds its voltages between two ticks, while the rotor continues to turn.

    ``law``: with ``"dead time"``, dead time and forward voltage reduce the voltage of each phase.
    The reduction reverses with the phase current. Without gate signals (``gates`` = 0), only the
    diodes conduct: the inverter becomes a rectifier, which brakes a motor whose back EMF exceeds
    :math:`V_{dc}/\sqrt 3` and charges the bus (uncontrolled generation).
    """

    law: Literal["ideal", "dead time"]
    """whether the inverter distorts its voltages"""
    f_s: Frequency
    """switching frequency"""
    t_d: DeadTime
    """dead time between two switches of a phase (law "dead time")"""
    V_f: ForwardVoltage
    """forward voltage of switch and diode (law "dead time", and without gate signals)"""
    i_th: Current
    """current of full distortion, 2 C_oss V_dc / t_d of the switches (law "dead time")"""
    gates: Weight
    """1 with gate signals; 0 without, so that only the diodes conduct"""
    i_off: Current
    """current at which a diode has its full voltage (without gate signals)"""


FAULTS = (
    ParameterFault(
        "slow-driver",
        "longer dead time (value: dead time)",
        replaced="t_d",
        value=3e-6,
        with_it={"law": "dead time"},
    ),
    ParameterFault(
        "gates-off", "no gate signals: only the diodes conduct", replaced="gates", value=0.0
    ),
)


class Input(NamedTuple):
    """Voltage demands in stator coordinates, currents in rotor coordinates, angle, bus voltage."""

    v_alpha: Volts
    v_beta: Volts
    i_d: Amperes
    i_q: Amperes
    theta_e: Angle
    V_dc: BusVoltage


class Output(NamedTuple):
    """Voltages in rotor coordinates, and the current that the bus supplies."""

    v_d: Volts
    v_q: Volts
    i_dc: Annotated[float, Signal("A", "bus current", 5.0)]


def largest_voltage(V_dc: BusVoltage) -> Volts:
    r"""Return the maximum amplitude of space-vector modulation, :math:`V_{dc} / \sqrt 3`."""
    return V_dc / math.sqrt(3.0)


def rotated(first: Volts, second: Volts, theta: Angle) -> tuple[Volts, Volts]:
    """Return a vector in coordinates that are rotated forward by an angle."""
    c, s = ops.cos(theta), ops.sin(theta)
    return c * first + s * second, c * second - s * first


def distortion(u: Input, par: Parameters) -> tuple[Volts, Volts, Loss]:
    r"""Return the voltage distortion in stator coordinates, and its loss.

    .. math:: \Delta v = -(V_{dc} t_d f_s + V_f)\, \mathrm{sat}(i / i_{th})

    in each phase.

    Notes
    -----
    The switch capacitances give the characteristic a finite slope around zero. The distortion is
    therefore a function of the current, with kinks at :math:`\pm i_{th}`, and not set-valued.
    """
    if par.law == "ideal":
        nothing = 0.0 * u.v_alpha
        return nothing, nothing, nothing * u.i_d
    return _opposing(u, u.V_dc * par.t_d * par.f_s + par.V_f, par.i_th)


def diodes(u: Input, par: Parameters) -> tuple[Volts, Volts, Loss]:
    r"""Return the voltages in stator coordinates without gate signals, and the diodes' loss.

    .. math:: v = -(V_{dc}/2 + V_f)\, \mathrm{sat}(i / i_{off})

    in each phase, from the midpoint of the bus. The part :math:`V_{dc}/2` charges the bus.

    Notes
    -----
    Ideal diodes are set-valued: without current, the voltage between two phases can have any value
    between :math:`\pm V_{dc}`. Here a current below :math:`i_{off}` flows instead, with kinks at
    :math:`\pm i_{off}`. If :math:`i_{off} < \tfrac{1}{4} V_{dc} h / L`, with the step h, the
    currents oscillate around zero.
    """
    v_alpha, v_beta, power = _opposing(u, 0.5 * u.V_dc + par.V_f, par.i_off)
    return v_alpha, v_beta, power * (par.V_f / (0.5 * u.V_dc + par.V_f))


def _opposing(u: Input, size: Volts, i_full: Amperes) -> tuple[Volts, Volts, Loss]:
    """Return the vector of voltages that oppose the phase currents, and the power they take."""
    currents = _phases(u.i_d, u.i_q, u.theta_e)
    a, b, d = (-size * ops.clip(i / i_full, -1.0, 1.0) for i in currents)
    power = -(a * currents[0] + b * currents[1] + d * currents[2])
    return (2.0 * a - b - d) / 3.0, (b - d) / math.sqrt(3.0), power


def _phases(i_d: Amperes, i_q: Amperes, theta_e: Angle) -> tuple[float, float, float]:
    i_alpha, i_beta = rotated(i_d, i_q, -theta_e)
    half, side = -0.5 * i_alpha, 0.5 * math.sqrt(3.0) * i_beta
    return i_alpha, half + side, half - side


def bus_current(
    share_alpha: Share,
    share_beta: Share,
    i_d: Amperes,
    i_q: Amperes,
    theta_e: Angle,
    par: Parameters,
) -> Amperes:
    r"""Return the current that the bus supplies, for voltages relative to the bus voltage.

    .. math:: i_{dc} = \tfrac{3}{2} (v_\alpha i_\alpha + v_\beta i_\beta) / V_{dc}

    with the demanded voltages. Therefore the bus supplies the distortion loss. The current does not
    depend on the bus voltage, so a supply with resistance needs no iteration. Without gate signals,
    the diodes charge the bus with :math:`\tfrac{1}{2} \sum |i|`.
    """
    share_d, share_q = rotated(share_alpha, share_beta, theta_e)
    driven = 1.5 * (share_d * i_d + share_q * i_q)
    a, b, d = (i * ops.clip(i / par.i_off, -1.0, 1.0) for i in _phases(i_d, i_q, theta_e))
    back = -0.5 * (a + b + d)
    return par.gates * driven + (1.0 - par.gates) * back


def output(u: Input, par: Parameters) -> Output:
    r"""Return the voltages in rotor coordinates, and the bus current.

    Notes
    -----
    Held voltages rotate backward in rotor coordinates while the rotor turns. A model that holds
    ``v_d`` and ``v_q`` instead would omit this angle, which increases with speed and sample time.
    """
    more_alpha, more_beta, _ = distortion(u, par)
    off_alpha, off_beta, _ = diodes(u, par)
    on, off = par.gates, 1.0 - par.gates
    v_d, v_q = rotated(
        on * (u.v_alpha + more_alpha) + off * off_alpha,
        on * (u.v_beta + more_beta) + off * off_beta,
        u.theta_e,
    )
    shares = u.v_alpha / u.V_dc, u.v_beta / u.V_dc
    return Output(v_d=v_d, v_q=v_q, i_dc=bus_current(*shares, u.i_d, u.i_q, u.theta_e, par))


def power_loss(u: Input, par: Parameters) -> Loss:
    """Return the power loss due to dead time and voltage drops, >= 0."""
    return par.gates * distortion(u, par)[2] + (1.0 - par.gates) * diodes(u, par)[2]
