"""Observer of second order for the speed of an angle that is sampled and quantized."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Gt
from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import Signal

Bandwidth = Annotated[float, Unit("rad/s", 500.0), Field(gt=0, allow_inf_nan=False)]
Turn = Annotated[float, Unit("rad", 6.283185307179586), Field(gt=0, allow_inf_nan=False)]
SampleTime = Annotated[float, Signal("s", "sample time", 1e-4), Gt(0)]
Angle = Annotated[float, Signal("rad", "angle", 3.0)]
Speed = Annotated[float, Signal("rad/s", "speed", 100.0)]


class Parameters(ParameterSet):
    """Bandwidth, and the range of the sensor."""

    omega_o: Bandwidth
    """bandwidth of the observer; both poles are at -omega_o"""
    turn: Turn
    """angle after which the sensor's reading may start again, usually 2 pi"""


class State(NamedTuple):
    """Estimates at the last sample."""

    theta: Angle
    omega: Speed


class Input(NamedTuple):
    """Reading."""

    theta: Angle


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, State]:
    r"""Advance the observer by one sample, and return its estimates.

    .. math::
        \theta_p = \hat\theta + T \hat\omega, \quad e = \theta_{meas} - \theta_p, \quad
        \hat\theta = \theta_p + (1 - z^2) e, \quad
        \hat\omega \leftarrow \hat\omega + \frac{(1 - z)^2}{T} e, \quad z = e^{-\omega_o T}

    Notes
    -----
    At constant speed, the estimates have no error. At constant acceleration, the speed lags by
    :math:`2/\omega_o`. The difference of two readings, each rounded to whole counts q, has steps of
    q/T. The observer reduces them to about :math:`q \omega_o^2 T`. The reading may jump by whole
    turns: the error is reduced to half a turn, with a corner there.

    References
    ----------
    G. Ellis, Observers in Control Systems, Academic Press, 2002, chapter 8.
    """
    z = ops.exp(-par.omega_o * T)
    ahead = x.theta + T * x.omega
    apart = u.theta - ahead
    error = apart - par.turn * ops.floor(apart / par.turn + 0.5)
    found = State(
        theta=ahead + (1.0 - z * z) * error,
        omega=x.omega + (1.0 - z) * (1.0 - z) / T * error,
    )
    return found, found
