"""Carrier-averaged three-phase inverter with dead time, voltage drops and zero-order hold."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Frequency, Unit
from bywire.core.signals import Role, Signal

DeadTime = Annotated[float, Unit("s", 1e-6), Field(ge=0, allow_inf_nan=False)]
ForwardVoltage = Annotated[float, Unit("V", 0.5), Field(ge=0, allow_inf_nan=False)]
BusVoltage = Annotated[float, Signal("V", "bus voltage", 24.0, low=1.0)]
Volts = Annotated[float, Signal("V", "voltage", 5.0)]
Amperes = Annotated[float, Signal("A", "current", 5.0)]
Loss = Annotated[float, Signal("W", "inverter loss", role=Role("sink", "inverter"))]


class Parameters(ParameterSet):
    """Inverter that holds its voltages between two ticks, while the rotor continues to turn.

    ``law``: with ``"dead time"``, dead time and forward voltage reduce the voltage of each phase.
    The reduction reverses with the phase current.
    """

    law: Literal["ideal", "dead time"]
    """whether the inverter distorts its voltages"""
    f_s: Frequency
    """switching frequency"""
    t_d: DeadTime
    """dead time between two switches of a phase (law "dead time")"""
    V_f: ForwardVoltage
    """forward voltage of switch and diode (law "dead time")"""
    i_th: Current
    """current of full distortion, 2 C_oss V_dc / t_d of the switches (law "dead time")"""


FAULTS = (
    ParameterFault(
        "slow-driver",
        "longer dead time (value: dead time)",
        replaced="t_d",
        value=3e-6,
        with_it={"law": "dead time"},
    ),
)


class Input(NamedTuple):
    """Voltage demands in stator coordinates, currents in rotor coordinates, angle, bus voltage."""

    v_alpha: Volts
    v_beta: Volts
    i_d: Amperes
    i_q: Amperes
    theta_e: Annotated[float, Signal("rad", "electrical angle", 3.0)]
    V_dc: BusVoltage


class Output(NamedTuple):
    """Voltages in rotor coordinates, and the current that the bus supplies."""

    v_d: Volts
    v_q: Volts
    i_dc: Annotated[float, Signal("A", "bus current", 5.0)]


def largest_voltage(V_dc: BusVoltage) -> Volts:
    r"""Return the maximum amplitude of space-vector modulation, :math:`V_{dc} / \sqrt 3`."""
    return V_dc / math.sqrt(3.0)


def rotated(
    first: Volts, second: Volts, theta: Annotated[float, Signal("rad", "electrical angle", 3.0)]
) -> tuple[Volts, Volts]:
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
    c, s = ops.cos(u.theta_e), ops.sin(u.theta_e)
    i_alpha, i_beta = c * u.i_d - s * u.i_q, s * u.i_d + c * u.i_q
    half, side = -0.5 * i_alpha, 0.5 * math.sqrt(3.0) * i_beta
    size = u.V_dc * par.t_d * par.f_s + par.V_f
    currents = (i_alpha, half + side, half - side)
    a, b, d = (-size * ops.clip(i / par.i_th, -1.0, 1.0) for i in currents)
    loss = -(a * currents[0] + b * currents[1] + d * currents[2])
    return (2.0 * a - b - d) / 3.0, (b - d) / math.sqrt(3.0), loss


def output(u: Input, par: Parameters) -> Output:
    r"""Return the voltages in rotor coordinates, and the bus current.

    .. math:: i_{dc} = \tfrac{3}{2} (v_\alpha i_\alpha + v_\beta i_\beta) / V_{dc}

    with the demanded voltages. Therefore the bus supplies the distortion loss.

    Notes
    -----
    Held voltages rotate backward in rotor coordinates while the rotor turns. A model that holds
    ``v_d`` and ``v_q`` instead would omit this angle, which increases with speed and sample time.
    """
    more_alpha, more_beta, _ = distortion(u, par)
    v_d, v_q = rotated(u.v_alpha + more_alpha, u.v_beta + more_beta, u.theta_e)
    demanded_d, demanded_q = rotated(u.v_alpha, u.v_beta, u.theta_e)
    i_dc = 1.5 * (demanded_d * u.i_d + demanded_q * u.i_q) / u.V_dc
    return Output(v_d=v_d, v_q=v_q, i_dc=i_dc)


def power_loss(u: Input, par: Parameters) -> Loss:
    """Return the power loss due to dead time and voltage drops, >= 0."""
    return distortion(u, par)[2]
