"""Permanent-magnet DC motor: winding and torque."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Inductance, Resistance, TorqueConstant
from bywire.core.signals import Energy, Power, Role, Signal

Loss = Annotated[float, Signal("W", "copper loss", role=Role("sink", "copper", split=True))]


class Parameters(ParameterSet):
    """Constant coefficients, without saturation, temperature effects or brush voltage."""

    R_m: Resistance
    """winding resistance"""
    L_m: Inductance
    """winding inductance"""
    K_e: TorqueConstant
    """torque and back-EMF constant"""


FAULTS = (
    ParameterFault("hot", "hot winding or a bad contact", ("R_m",), 2.0),
    ParameterFault("demagnetized", "weaker magnets", ("K_e",), 0.7),
)


class State(NamedTuple):
    """Winding current."""

    i: Annotated[float, Signal("A", "motor current", 5.0)]


class Factors(NamedTuple):
    """Factor of the current's derivative."""

    i: Annotated[float, Signal("H", "inductance", 1e-4)]


class Balance(NamedTuple):
    """Right-hand side of the current."""

    i: Annotated[float, Signal("V", "voltage across the inductance", 6.0)]


class Input(NamedTuple):
    """Terminal voltage and rotor speed."""

    v: Annotated[float, Signal("V", "motor voltage", 6.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 50.0)]


class Output(NamedTuple):
    """Electromagnetic torque."""

    torque: Annotated[float, Signal("N*m", "motor torque", 0.1)]


def mass(x: State, par: Parameters) -> Factors:
    """Return the factor of di/dt, the inductance."""
    return Factors(i=par.L_m)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return the voltage across the inductance.

    .. math:: L_m \frac{di}{dt} = v - R_m i - K_e \Omega

    Notes
    -----
    The printed equation has the opposite sign on its right-hand side, but the current must rise
    with the voltage.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (1), first line.
    """
    return Balance(i=u.v - par.R_m * x.i - par.K_e * u.omega)


def output(x: State, par: Parameters) -> Output:
    """Return the torque T = K_e i of eq. (1)."""
    return Output(torque=par.K_e * x.i)


def energy(x: State, par: Parameters) -> Energy:
    """Return the magnetic energy."""
    return 0.5 * par.L_m * x.i * x.i


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the electrical power minus the mechanical power."""
    return u.v * x.i - par.K_e * x.i * u.omega


def power_loss(x: State, par: Parameters) -> Loss:
    """Return the copper loss, >= 0."""
    return par.R_m * x.i * x.i
