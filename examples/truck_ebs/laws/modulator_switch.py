"""Three-point control of an anti-lock modulator: build, hold or vent, until a pressure is reached.

The valves act late. The law therefore compares the predicted pressure with the demand.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Gt

from bywire.authoring import ParameterSet, Pressure, Signal, TimeConstant
from bywire.core import ops

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
GaugePressure = Annotated[float, Signal("Pa", "pressure", 4e5)]


class Parameters(ParameterSet):
    """Band in which the pressure is held, and the prediction."""

    band: Pressure
    """maximum deviation from the demand at which the pressure is held"""
    t_lead: TimeConstant
    """prediction horizon, about the delay of the valves"""


class Input(NamedTuple):
    """Demand, measured pressure and its previous sample, and whether anti-lock control acts."""

    p_left: GaugePressure
    p_meas: GaugePressure
    p_last: GaugePressure
    acts: Annotated[float, Signal("1", "anti-lock control acts")]


class Output(NamedTuple):
    """Currents of the solenoids, 0 or 1."""

    close: Annotated[float, Signal("1", "hold valve closed")]
    vents: Annotated[float, Signal("1", "vent valve open")]


def output(u: Input, T: SampleTime, par: Parameters) -> Output:
    r"""Return the currents for the pressure expected after the horizon.

    .. math:: \hat p = p_k + \frac{T_{lead}}{T} (p_k - p_{k-1})
    """
    ahead = u.p_meas + par.t_lead / T * (u.p_meas - u.p_last)
    vents = ops.where(ahead > u.p_left + par.band, 1.0, 0.0)
    close = ops.where(ahead > u.p_left - par.band, 1.0, 0.0)
    acts = ops.where(u.acts > 0.5, 1.0, 0.0)
    return Output(close=acts * close, vents=acts * vents)
