"""Permanent-magnet servo motor with winding, rotor, cogging and temperature effects."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import (
    Inductance,
    Inertia,
    Resistance,
    RotaryDamping,
    TemperatureCoefficient,
    Torque,
    TorqueConstant,
    Unit,
)
from bywire.core.signals import Energy, Power, Role, Signal

TemperatureRise = Annotated[
    float, Unit("delta_degC", 20.0), Field(ge=-100, le=200, allow_inf_nan=False)
]
PoleCount = Annotated[float, Unit("1", 180.0), Field(gt=0, allow_inf_nan=False)]
Loss = Annotated[float, Signal("W", "copper loss", role=Role("sink", "copper", split=True))]
DampingLoss = Annotated[
    float, Signal("W", "motor damping loss", role=Role("sink", "motor damping"))
]


class Parameters(ParameterSet):
    """Motor averaged over commutation, with one winding, without saturation and iron loss."""

    R_ref: Resistance
    """winding resistance at the reference temperature"""
    L_M: Inductance
    """winding inductance"""
    K_ref: TorqueConstant
    """torque and back-EMF constant at the reference temperature"""
    J_M: Inertia
    """inertia of rotor, encoder, screw and bearings"""
    D_M: RotaryDamping
    """viscous damping"""
    T_cog: Torque
    """amplitude of the cogging torque"""
    N_cog: PoleCount
    """cogging periods per revolution of 2 pi rad"""
    dT: TemperatureRise
    """temperature of winding and magnets above the reference"""
    a_R: TemperatureCoefficient
    """increase in resistance with temperature (copper)"""
    a_K: TemperatureCoefficient
    """decrease in torque constant with temperature (magnets)"""


FAULTS = (
    ParameterFault("hot", "hot winding or a bad contact", ("R_ref",), 2.0),
    ParameterFault("demagnetized", "weaker magnets", ("K_ref",), 0.7),
    ParameterFault("seized", "the rotor drags in its bearings", ("D_M",), 100.0),
)


class State(NamedTuple):
    """Current, shaft angle and speed, positive toward clamping."""

    i: Annotated[float, Signal("A", "current", 5.0)]
    theta: Annotated[float, Signal("rad", "motor angle", 3.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 50.0)]


class Factors(NamedTuple):
    """Factors of the derivatives."""

    i: Annotated[float, Signal("H", "inductance", 2e-4)]
    theta: Annotated[float, Signal("1", "unity")]
    omega: Annotated[float, Signal("kg*m**2", "inertia", 1e-4)]


class Balance(NamedTuple):
    """Right-hand sides of current, angle and speed."""

    i: Annotated[float, Signal("V", "voltage across the inductance", 6.0)]
    theta: Annotated[float, Signal("rad/s", "motor speed", 50.0)]
    omega: Annotated[float, Signal("N*m", "accelerating torque", 0.5)]


class Input(NamedTuple):
    """Terminal voltage, load torque, and dry friction torque on the shaft."""

    v: Annotated[float, Signal("V", "motor voltage", 10.0)]
    load: Annotated[float, Signal("N*m", "torque of the screw on the shaft", 0.5)]
    friction: Annotated[float, Signal("N*m", "friction torque", 0.1)]


def resistance(par: Parameters) -> Annotated[float, Signal("ohm", "winding resistance", 0.5)]:
    r"""Return the resistance, :math:`R_M = R_{ref} (1 + a_R \Delta T)`."""
    return par.R_ref * (1.0 + par.a_R * par.dT)


def torque_constant(
    par: Parameters,
) -> Annotated[float, Signal("N*m/A", "torque constant", 0.1)]:
    r"""Return the torque constant, :math:`K_T = K_{ref} (1 - a_K \Delta T)`."""
    return par.K_ref * (1.0 - par.a_K * par.dT)


def cogging(x: State, par: Parameters) -> Annotated[float, Signal("N*m", "cogging torque", 0.01)]:
    r"""Return the lossless cogging torque, :math:`T_{COG} = -\hat T \sin(N \theta)`."""
    return -par.T_cog * ops.sin(par.N_cog * x.theta)


def mass(par: Parameters) -> Factors:
    """Return the factors of the derivatives: inductance, 1, inertia."""
    return Factors(i=par.L_M, theta=1.0, omega=par.J_M)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return voltage, speed and torque.

    .. math::
        L_M \frac{di}{dt} = V - R_M i - K_T \omega, \quad
        J_M \frac{d\omega}{dt} = K_T i + T_{COG} + T_{SCREW} - D_M \omega - T_{FRICT}

    References
    ----------
    Roberts et al. (2003), section "Motor".
    """
    K_T = torque_constant(par)
    return Balance(
        i=u.v - resistance(par) * x.i - K_T * x.omega,
        theta=x.omega,
        omega=K_T * x.i + cogging(x, par) + u.load - par.D_M * x.omega + u.friction,
    )


def energy(x: State, par: Parameters) -> Energy:
    """Return magnetic, kinetic and cogging energy."""
    magnetic = 0.5 * par.L_M * x.i * x.i
    kinetic = 0.5 * par.J_M * x.omega * x.omega
    return magnetic + kinetic + par.T_cog / par.N_cog * (1.0 - ops.cos(par.N_cog * x.theta))


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the power at the terminals and at the shaft."""
    return u.v * x.i + (u.load + u.friction) * x.omega


def copper_loss(x: State, par: Parameters) -> Loss:
    """Return the heat in the winding, >= 0."""
    return resistance(par) * x.i * x.i


def damping_loss(x: State, par: Parameters) -> DampingLoss:
    """Return the heat from viscous damping, >= 0."""
    return par.D_M * x.omega * x.omega


def power_loss(x: State, par: Parameters) -> Power:
    """Return copper and damping loss, >= 0."""
    return copper_loss(x, par) + damping_loss(x, par)
