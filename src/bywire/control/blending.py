"""Sampled blending of a regenerating motor with a friction brake."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge, Gt, Le
from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant, Unit
from bywire.core.signals import Signal

TorqueRate = Annotated[float, Unit("N*m/s", 5e3), Field(gt=0, allow_inf_nan=False)]
LeastTorque = Annotated[float, Unit("N*m", 20.0), Field(ge=0, allow_inf_nan=False)]
SampleTime = Annotated[float, Signal("s", "sample time", 1e-2), Gt(0)]
Torque = Annotated[float, Signal("N*m", "braking torque", 300.0)]
Demand = Annotated[float, Signal("N*m", "demanded braking torque", 300.0), Ge(0)]
Acting = Annotated[float, Signal("1", "whether slip control is active", 0.5), Ge(0), Le(1)]


class Parameters(ParameterSet):
    """Motor first: the friction brake supplies what the motor does not.

    ``category``, as in UN Regulation No. 13-H: with ``"B"``, the motor is part of the service
    brake, and its torque reduces the friction demand. With ``"A"``, it is not: the motor brakes
    only with the torque of the released accelerator, in addition to the pedal's whole friction
    demand.

    ``law``: motor torque from which the friction demand follows. With ``"reported"``, it is the
    torque that the motor reports over the bus. With ``"commanded"``, it is the command. With
    ``"predicted"``, it is the motor's limit when the friction brake will have responded.
    """

    category: Literal["A", "B"]
    """whether the motor is part of the service brake (B) or not (A)"""
    law: Literal["reported", "commanded", "predicted"]
    """motor torque that the friction brake supplements"""
    rate: TorqueRate
    """maximum rate of the motor command"""
    T_least: LeastTorque
    """friction demand that remains while the pedal brakes, to keep the pads on the disc"""
    t_off: Duration
    """time in which the motor command falls to zero once slip control is active"""
    t_back: TimeConstant
    """time after the end of slip control during which the motor does not brake"""


class State(NamedTuple):
    """Command of the motor, and the time until it may brake."""

    T_m: Torque
    wait: Annotated[float, Signal("s", "time until the motor may brake", 0.5)]


class Input(NamedTuple):
    """Demands, limits of the motor now and ahead, reported torque, and slip control."""

    T_demand: Demand
    T_coast: Annotated[float, Signal("N*m", "torque of the released accelerator", 50.0), Ge(0)]
    limit: Annotated[float, Signal("N*m", "limit of the motor", 300.0), Ge(0)]
    limit_ahead: Annotated[float, Signal("N*m", "predicted limit of the motor", 300.0), Ge(0)]
    T_reported: Torque
    slip: Acting


class Output(NamedTuple):
    """Demands on motor and friction brake."""

    T_motor: Torque
    T_friction: Torque


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    r"""Advance the law by one sample.

    .. math::
        T_m = \min(T_{set} - T_{least}, T_{limit}), \quad
        T_f = \max(T_{set} - T_{seen}, T_{least})

    In category B, the set point :math:`T_{set}` is the sum of both demands. In category A, the
    motor follows the demand of the released accelerator, and :math:`T_f` is the pedal's demand.
    Corners: the motor's limit, the maximum rate, the minimum friction demand, and the switch of
    slip control.

    Notes
    -----
    While the motor fades at a rate s, the sum of both torques dips. With a friction brake of delay
    :math:`T_d` and lag :math:`\tau_b`, a motor of lag :math:`\tau_m` and a report that is
    :math:`T_d` old, the dip is :math:`s \Theta` for a slow fade, with
    :math:`\Theta = \tau_b + 2 T_d` (law "reported") or :math:`\tau_b + T_d - \tau_m` (law
    "commanded"). Law "predicted" removes most of it.

    References
    ----------
    D. Kade et al., US patent 5,511,859, 1996: friction demand from the reported motor torque.
    UN Regulation No. 13-H, section 2: electric regenerative braking systems of categories A and B.
    """
    least = ops.fmin(par.T_least, u.T_demand)
    wanted = u.T_coast if par.category == "A" else u.T_demand + u.T_coast - least
    free = ops.clip(ops.fmin(wanted, u.limit), x.T_m - T * par.rate, x.T_m + T * par.rate)
    # Slip control takes the motor out, because it is slower to modulate than the friction brake.
    out = ops.fmax(x.T_m - T / par.t_off * ops.fmax(u.limit, x.T_m), 0.0)
    # Slip control often acts several times in a row, and the motor does not return in between.
    wait = ops.where(u.slip > 0.5, par.t_back, ops.fmax(x.wait - T, 0.0))
    is_out = ops.where(u.slip > 0.5, 1.0, ops.where(wait > 0.0, 1.0, 0.0))
    command = ops.where(is_out > 0.5, out, free)
    if par.law == "reported":
        seen = u.T_reported
    elif par.law == "commanded":
        seen = command
    else:
        seen = ops.where(is_out > 0.5, command, ops.fmin(wanted, u.limit_ahead))
    friction = u.T_demand if par.category == "A" else ops.fmax(wanted + least - seen, least)
    return State(T_m=command, wait=wait), Output(T_motor=command, T_friction=friction)
