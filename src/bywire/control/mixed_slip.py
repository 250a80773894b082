"""Mix of a wheel's slip and deceleration, which is controlled if slip alone is uncertain."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Gt
from pydantic import Field

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import TimeConstant, Unit, Weight
from bywire.core.signals import Signal

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]


class Parameters(ParameterSet):
    """Weights of slip and deceleration, and the deceleration at the slip set point.

    With ``alpha`` = 1, only slip counts. With 0, only deceleration counts. In between, the
    controller demands less slip on a road with more adhesion. Deceleration contains the slip rate
    times speed divided by gravity. It needs separate gains, but fixed gains work at every speed.
    """

    alpha: Weight
    """weight of the slip"""
    eta_set: Annotated[float, Unit("1", 0.5), Field(ge=0, allow_inf_nan=False)]
    """set point of the wheel's deceleration in units of g"""
    tau: TimeConstant
    """time constant of the deceleration filter"""
    g: Annotated[float, Unit("m/s**2", 9.81), Field(gt=0, allow_inf_nan=False)]
    """gravity"""


class State(NamedTuple):
    """Tread speed at the previous sample, and filtered deceleration relative to gravity."""

    v_last: Annotated[float, Signal("m/s", "tread speed at the previous sample", 20.0)]
    eta: Annotated[float, Signal("1", "deceleration of the wheel relative to gravity", 1.0)]


class Input(NamedTuple):
    """Slip and its set point, and the tread speed."""

    slip_set: Annotated[float, Signal("1", "slip set point", 0.1)]
    slip: Annotated[float, Signal("1", "braking slip", 0.1)]
    v_wheel: Annotated[float, Signal("m/s", "measured tread speed", 20.0)]


class Output(NamedTuple):
    """Mixed variables that replace set point and slip."""

    set_point: Annotated[float, Signal("1", "mixed set point", 0.1)]
    mixed: Annotated[float, Signal("1", "mixed slip and deceleration", 0.1)]


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    r"""Advance the measurement by one sample.

    .. math:: \varepsilon = \alpha \lambda + (1 - \alpha) \eta, \quad \eta = -\dot\omega r/g

    References
    ----------
    M. Tanelli, A. Astolfi, S. M. Savaresi, Mixed slip-deceleration control in automotive braking
    systems, Journal of Dynamic Systems, Measurement, and Control 129, 2007.
    """
    seen = (x.v_last - u.v_wheel) / (T * par.g)
    eta = x.eta + T / (par.tau + T) * (seen - x.eta)
    rest = 1.0 - par.alpha
    return State(u.v_wheel, eta), Output(
        set_point=par.alpha * u.slip_set + rest * par.eta_set,
        mixed=par.alpha * u.slip + rest * eta,
    )
