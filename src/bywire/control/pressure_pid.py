"""Pressure PID with set-point weights, filtered derivative and tracking anti-windup."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Gt

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import (
    Current,
    CurrentPerPressure,
    CurrentPerPressureTime,
    CurrentTimePerPressure,
    Duration,
    TimeConstant,
    Weight,
)
from bywire.core.signals import Signal

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]


class Parameters(ParameterSet):
    """Gains of the continuous PID, which is discretized with backward differences."""

    k_p: CurrentPerPressure
    """proportional gain"""
    k_i: CurrentPerPressureTime
    """integral gain"""
    k_d: CurrentTimePerPressure
    """derivative gain"""
    tau_d: TimeConstant
    """time constant of the derivative filter"""
    b: Weight
    """set-point weight of the proportional term"""
    c: Weight
    """set-point weight of the derivative term, which acts only on the measurement if it is 0"""
    T_t: Duration
    """tracking time of the anti-windup"""
    i_max: Current
    """limit of the current demand's magnitude"""


class State(NamedTuple):
    """Integral, filtered derivative, and the differentiated signal."""

    integral: Annotated[float, Signal("A", "integral term", 3.0)]
    slope: Annotated[float, Signal("A", "derivative term", 1.0)]
    last: Annotated[float, Signal("Pa", "previous differentiated signal", 2e6)]


class Input(NamedTuple):
    """Set point and measurement."""

    p_ref: Annotated[float, Signal("Pa", "set point", 2e6)]
    p_meas: Annotated[float, Signal("Pa", "measured pressure", 2e6)]


class Output(NamedTuple):
    """Current demand within its limits."""

    i: Annotated[float, Signal("A", "current demand", 3.0)]


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    r"""Advance the controller by one sample.

    .. math:: i = k_p (b r - p) + I + D, \quad
        D_k = \frac{\tau_d D_{k-1} + k_d (d_k - d_{k-1})}{\tau_d + T}, \quad d = c r - p

    The integral follows the difference between the limited and the unlimited demand with the time
    constant T_t, so it cannot wind up.
    """
    signal = par.c * u.p_ref - u.p_meas
    slope = (par.tau_d * x.slope + par.k_d * (signal - x.last)) / (par.tau_d + T)
    unlimited = par.k_p * (par.b * u.p_ref - u.p_meas) + x.integral + slope
    i = ops.clip(unlimited, -par.i_max, par.i_max)
    growth = par.k_i * (u.p_ref - u.p_meas) + (i - unlimited) / par.T_t
    return State(integral=x.integral + T * growth, slope=slope, last=signal), Output(i=i)


def at_rest(
    u: Input, i: Annotated[float, Signal("A", "current demand", 3.0)], par: Parameters
) -> State:
    """Return the state that holds a current demand ``i`` at a constant input."""
    integral = i - par.k_p * (par.b * u.p_ref - u.p_meas)
    return State(integral=integral, slope=0.0, last=par.c * u.p_ref - u.p_meas)


def transferred(
    x: State,
    u: Input,
    k_p: Annotated[float, Signal("A/Pa", "previous proportional gain", 1e-5)],
    par: Parameters,
) -> State:
    r"""Return the state for a bumpless transfer to the gains of ``par``.

    .. math:: I \leftarrow I + (k_p^{old} - k_p) (b r - p)

    The demand at this input then equals the demand with the old gains. Integral and derivative
    terms are currents, so new k_i and k_d do not change them.

    Notes
    -----
    With a pressure-dependent k_p, the demand contains the integral of k_p with respect to the
    error. At an equilibrium, the loop has the same linear model as with the fixed gains for the
    equilibrium pressure.

    References
    ----------
    I. Kaminer, A. M. Pascoal, P. P. Khargonekar, E. E. Coleman, A velocity algorithm for the
    implementation of gain-scheduled controllers, Automatica 31 (1995).
    """
    return x._replace(integral=x.integral + (k_p - par.k_p) * (par.b * u.p_ref - u.p_meas))
