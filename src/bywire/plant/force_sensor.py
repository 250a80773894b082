"""Force sensor between two screws. Both screws and the sensor act as one spring."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Frequency, Stiffness, TimeConstant
from bywire.core.signals import ContactCompliance, Energy, Power, Role, Signal

AxialForce = Annotated[float, Signal("N", "compression of the sensor", 1000.0)]
Loss = Annotated[
    float,
    Signal(
        "W", "damping of screws and force sensor", role=Role("sink", "damping of screws and sensor")
    ),
]


class Parameters(ParameterSet):
    """Calibrated massless sensor, bolted to both screws for compression and tension."""

    K_F: Stiffness
    """stiffness of the sensor with its adapters"""
    tau_F: TimeConstant
    """ratio of damping to stiffness of sensor and screws"""
    f_F: Frequency
    """cutoff frequency of the amplifier filter"""


class State(NamedTuple):
    """Amplifier reading."""

    y: Annotated[float, Signal("N", "force measured by the sensor", 1000.0)]


class Rate(NamedTuple):
    """Derivative of the state."""

    y: Annotated[float, Signal("N/s", "rate of the measured force", 1e5)]


class Input(NamedTuple):
    """Travels and velocities of both nuts, and the compliance of both screws together."""

    X_1: Annotated[float, Signal("m", "travel of screw 1", 1e-4)]
    X_2: Annotated[float, Signal("m", "travel of screw 2", 1e-4)]
    V_1: Annotated[float, Signal("m/s", "velocity of screw 1", 0.02)]
    V_2: Annotated[float, Signal("m/s", "velocity of screw 2", 0.02)]
    c: ContactCompliance


class InputRate(NamedTuple):
    """Derivatives of the inputs of the stored energy. The compliance is constant."""

    X_1: Annotated[float, Signal("m/s", "velocity of screw 1", 0.02)]
    X_2: Annotated[float, Signal("m/s", "velocity of screw 2", 0.02)]
    c: Annotated[float, Signal("m/(N*s)", "rate of the compliance")]


def stiffness(u: Input, par: Parameters) -> Annotated[float, Signal("N/m", "stiffness", 2e7)]:
    r"""Return the stiffness of the line, :math:`K = 1 / (c + 1/K_F)`."""
    return 1.0 / (u.c + 1.0 / par.K_F)


def compression(u: Input) -> Annotated[float, Signal("m", "compression of the line", 1e-4)]:
    """Return the approach of the nuts relative to zero force, negative in tension."""
    return u.X_1 - u.X_2


def closing(u: Input) -> Annotated[float, Signal("m/s", "rate of the compression", 0.02)]:
    """Return the rate of the compression."""
    return u.V_1 - u.V_2


def force(u: Input, par: Parameters) -> AxialForce:
    r"""Return the force in the line, :math:`F = K (d + \tau \dot d)`, positive in compression.

    References
    ----------
    Roberts et al. (2003), section "Drive train stiffnesses": sensor between the roller screws.
    """
    return stiffness(u, par) * (compression(u) + par.tau_F * closing(u))


def rate(x: State, u: Input, par: Parameters) -> Rate:
    r"""Return the derivative of the measured force, :math:`2 \pi f_F (F - y_F)`."""
    return Rate(y=2.0 * math.pi * par.f_F * (force(u, par) - x.y))


def input_rate(u: Input) -> InputRate:
    """Return the rates of the nuts, which are the ports through which the line stores energy."""
    return InputRate(X_1=u.V_1, X_2=u.V_2, c=0.0)


def energy(u: Input, par: Parameters) -> Energy:
    """Return the elastic energy of the line."""
    d = compression(u)
    return 0.5 * stiffness(u, par) * d * d


def power_in(u: Input, par: Parameters) -> Power:
    """Return the work of both screws on the line."""
    return force(u, par) * closing(u)


def power_loss(u: Input, par: Parameters) -> Loss:
    """Return the damping loss, >= 0."""
    rate_d = closing(u)
    return stiffness(u, par) * par.tau_F * rate_d * rate_d
