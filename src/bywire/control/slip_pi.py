"""Slip control of one wheel: PI with a speed-dependent gain, which can only lower a demand."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge, Gt
from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Fraction, Gain, Length, Unit
from bywire.core.signals import Pressure, Signal

_NO_SLIP = 1e-9
SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]


class Parameters(ParameterSet):
    """Gains from the loop's crossover frequency and the wheel parameters that the ECU assumes.

    ``schedule``: ``"speed"`` makes the gain proportional to speed, like the wheel's gain and pole.
    ``"fixed"`` uses the gain for v_fixed.
    """

    schedule: Literal["speed", "fixed"]
    """whether the gain is proportional to speed or fixed"""
    slip_set: Fraction
    """slip set point"""
    omega_c: Annotated[float, Unit("rad/s", 20.0), Field(gt=0, allow_inf_nan=False)]
    """crossover frequency of the loop on the falling branch of the adhesion curve"""
    T_i: Duration
    """integral time"""
    T_t: Duration
    """tracking time of the anti-windup"""
    eager: Gain
    """factor for additional integral gain at zero slip, which decreases to zero at the set point"""
    v_off: Annotated[float, Unit("m/s", 2.0), Field(gt=0, allow_inf_nan=False)]
    """minimum reference speed for slip; below it, control fades out and the wheel may lock"""
    v_fall: Annotated[float, Unit("m/s", 5.0), Field(gt=0, allow_inf_nan=False)]
    """speed below which the slip set point decreases with speed, because sensors lag"""
    v_fixed: Annotated[float, Unit("m/s", 15.0), Field(gt=0, allow_inf_nan=False)]
    """speed that determines the fixed gain (schedule "fixed")"""
    J_hat: Annotated[float, Unit("kg*m**2", 0.5), Field(gt=0, allow_inf_nan=False)]
    """wheel inertia assumed by the ECU"""
    r_hat: Length
    """wheel radius assumed by the ECU"""
    k_hat: Annotated[float, Unit("N*m/Pa", 3e-4), Field(gt=0, allow_inf_nan=False)]
    """brake torque per unit of pressure assumed by the ECU"""


class State(NamedTuple):
    """Integral term."""

    integral: Pressure


class Input(NamedTuple):
    """Speed, slip, set point, rider's demand, the demand to limit, and its previous sample."""

    v: Annotated[float, Signal("m/s", "vehicle speed", 20.0), Ge(0)]
    slip_set: Annotated[float, Signal("1", "slip set point", 0.1)]
    slip: Annotated[float, Signal("1", "braking slip", 0.1)]
    p_rider: Pressure
    p_most: Pressure
    p_before: Pressure


class Output(NamedTuple):
    """Demand, and whether it was lowered."""

    p: Pressure
    lowered: Annotated[float, Signal("1", "slip control is active")]


def gain(
    v: Annotated[float, Signal("m/s", "vehicle speed", 20.0), Ge(0)], par: Parameters
) -> Annotated[float, Signal("Pa", "pressure per unit of slip", 3e6)]:
    r"""Return the proportional gain, :math:`K_p = \omega_c J v/(r k)`."""
    speed = par.v_fixed if par.schedule == "fixed" else ops.fmax(v, par.v_off)
    return par.omega_c * par.J_hat * speed / (par.r_hat * par.k_hat)


def set_point(
    v: Annotated[float, Signal("m/s", "vehicle speed", 20.0), Ge(0)], par: Parameters
) -> Annotated[float, Signal("1", "slip set point", 0.1)]:
    """Return the slip set point at a speed."""
    return par.slip_set * ops.fmin(v / par.v_fall, 1.0)


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    r"""Advance the controller by one sample.

    .. math:: p = \min(p_{most}, K_p (\lambda_{set} - \lambda) + I)

    The integral follows the output with the tracking time constant, and starts at the rider's
    demand.

    Notes
    -----
    On the rising branch, the slip stiffness of the tire is high, and the integral alone would close
    the loop in :math:`T_i\, N r \mu'(\lambda)/(k K_p)`. On dry asphalt at a slip of 0.04, this is
    2 s, which is half a stop. ``eager`` shortens this time far below the set slip and above v_fall.
    It does not change the loop at the set slip.

    References
    ----------
    S. M. Savaresi, M. Tanelli, Active Braking Control Systems Design for Vehicles, 2010, for slip
    control of a single corner. The speed-dependent gain is derived from its linear model.
    """
    K_p = gain(u.v, par)
    error = u.slip_set - u.slip
    unlimited = K_p * error + x.integral
    p = ops.clip(unlimited, 0.0, ops.fmax(u.p_most, 0.0))
    short = ops.fmax(error, 0.0) / ops.fmax(u.slip_set, _NO_SLIP)
    # While a demand builds up, slip control does not cause the missing pressure. Below v_fall, the
    # sensor edges arrive so late that slip seems too small, so the integral must not be faster.
    calm = ops.where(u.p_most < u.p_rider, 1.0, ops.where(u.v < par.v_fall, 1.0, 0.0))
    haste = 1.0 + par.eager * (1.0 - calm) * short
    growth = K_p / par.T_i * haste * error + (p - unlimited) / par.T_t
    # Without a demand, reset the integral, because the first demand must not wait for it.
    idle = u.p_before <= 0
    integral = ops.where(idle, ops.fmax(u.p_rider, 0.0), x.integral + T * growth)
    return State(integral), Output(p, ops.where(p < u.p_most, 1.0, 0.0))
