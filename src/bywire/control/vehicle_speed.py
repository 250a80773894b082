"""Vehicle speed, estimated from wheel speeds during slip."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge, Gt
from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Unit, Weight
from bywire.core.signals import Signal

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
Speed = Annotated[float, Signal("m/s", "speed", 20.0), Ge(0)]


class Parameters(ParameterSet):
    """Estimator of the reference speed.

    ``law``: ``"wheels"`` follows the faster wheel, but decreases no faster than the strongest
    braking permits. ``"accelerometer"`` integrates the measured deceleration, and returns to the
    faster wheel while its slip is low. The first law fails if both wheels slip at the same time.
    """

    law: Literal["wheels", "accelerometer"]
    """source of the speed while the wheels slip"""
    a_max: Annotated[float, Unit("m/s**2", 12.0), Field(gt=0, allow_inf_nan=False)]
    """maximum deceleration in any stop (law "wheels")"""
    slip_small: Weight
    """slip up to which a wheel is considered reliable (law "accelerometer")"""
    tau: Duration
    """time constant with which the speed estimate returns to the speed of a reliable wheel"""
    v_still: Annotated[float, Unit("m/s", 1.0), Field(gt=0, allow_inf_nan=False)]
    """speed below which every wheel is considered reliable, which removes errors at standstill"""


class State(NamedTuple):
    """Reference speed."""

    v: Speed


class Input(NamedTuple):
    """Tread speeds and deceleration."""

    v_f: Annotated[float, Signal("m/s", "measured front tread speed", 20.0)]
    v_r: Annotated[float, Signal("m/s", "measured rear tread speed", 20.0)]
    a: Annotated[float, Signal("m/s**2", "measured deceleration", 10.0)]


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> State:
    """Advance the reference by one sample; it is never below the faster wheel."""
    fastest = ops.fmax(u.v_f, u.v_r)
    if par.law == "wheels":
        return State(ops.fmax(ops.fmax(fastest, x.v - par.a_max * T), 0.0))
    carried = x.v - u.a * T
    drawn = carried + T / (par.tau + T) * (fastest - carried)
    rolls = ops.where(carried - fastest < par.slip_small * carried, drawn, carried)
    return State(ops.fmax(ops.where(carried < par.v_still, drawn, rolls), 0.0))


def slip(
    v: Speed,
    v_wheel: Annotated[float, Signal("m/s", "measured tread speed", 20.0)],
    v_off: Annotated[float, Signal("m/s", "speed below which slip is uncertain", 2.0), Gt(0)],
) -> Annotated[float, Signal("1", "braking slip computed by the ECU", 0.1)]:
    """Return the braking slip computed by the ECU, relative to at least ``v_off``."""
    return (v - v_wheel) / ops.fmax(v, v_off)
