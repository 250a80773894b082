"""Rule-based anti-lock control of one wheel: build, dump, hold, stepped build."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt
from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Factor, Fraction, TimeConstant, Unit
from bywire.core.signals import Pressure, Signal

BUILD, DUMP, HOLD, STEPPED = 0.0, 1.0, 2.0, 3.0
PHASES = ("build", "dump", "hold", "stepped")
"""names of the phases 0 to 3"""
_FAR = 0.5  # fraction of the pressure that remains if a wheel slips far despite a dump
_LEAST = 0.05  # minimum fraction of the pressure, because steps from less would be too slow

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
Flag = Annotated[float, Signal("1", "flag")]
Slowing = Annotated[float, Signal("m/s**2", "filtered deceleration of the wheel", 10.0)]
Speed = Annotated[float, Unit("m/s", 5.0), Field(gt=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Thresholds, times, and pressures relative to the last pressure that the road could hold.

    Thresholds apply to the predicted slip, which extrapolates the slip by ``t_lead`` with the
    wheel's deceleration. A threshold is therefore a line in the plane of slip and deceleration. A
    wheel that slows down quickly crosses it while its slip is still small. No parameter depends on
    the road.
    """

    slip_keep: Fraction
    """predicted slip above which the first build-up stops"""
    slip_dump: Fraction
    """predicted slip above which pressure is reduced"""
    slip_back: Fraction
    """slip below which a wheel has recovered"""
    t_lead: TimeConstant
    """prediction horizon for the slip"""
    a_hold: Annotated[float, Unit("m/s**2", 10.0), Field(ge=0, allow_inf_nan=False)]
    """wheel recovery rate, relative to constant slip, below which pressure is reduced further"""
    t_hold: Duration
    """minimum time for which pressure is held"""
    t_most: Duration
    """time after which pressure is built up again in any case"""
    dump: Annotated[float, Unit("1/s", 100.0), Field(gt=0, allow_inf_nan=False)]
    """rate at which pressure is reduced, relative to the pressure"""
    depth: Fraction
    """pressure at the end of a dump, relative to the last pressure that the road could hold"""
    back: Factor
    """pressure at which the stepped build-up begins, relative to the same reference"""
    t_step: Duration
    """time between two steps"""
    step: Fraction
    """first step, relative to the same reference"""
    growth: Factor
    """ratio of a step to the previous step; build-up accelerates while the wheel does not lock"""
    tau_a: TimeConstant
    """time constant of the deceleration filter"""
    tau_p: TimeConstant
    """time constant from demand to brake pressure, as assumed by the controller"""
    v_off: Speed
    """speed below which the wheel may lock"""
    v_fall: Speed
    """speed below which thresholds decrease with speed, because sensors lag"""


class State(NamedTuple):
    """Phase and its start, demand, pressures, next step, and filtered deceleration."""

    phase: Annotated[float, Signal("1", "phase of anti-lock control", 3.0)]
    since: Annotated[float, Signal("s", "time since the current phase or step began", 0.1)]
    p_left: Annotated[float, Signal("Pa", "remaining demand", 2e6)]
    p_hat: Annotated[float, Signal("Pa", "pressure assumed by the controller", 2e6)]
    p_held: Annotated[float, Signal("Pa", "last pressure that the road could hold", 2e6)]
    rise: Annotated[float, Signal("Pa", "next pressure step", 1e5)]
    slowing: Slowing


class Input(NamedTuple):
    """State of wheel and vehicle, demand of this and the previous sample, and previous output."""

    v: Annotated[float, Signal("m/s", "vehicle speed", 20.0), Ge(0)]
    a: Annotated[float, Signal("m/s**2", "measured deceleration of the vehicle", 10.0)]
    v_wheel: Annotated[float, Signal("m/s", "measured tread speed", 20.0)]
    v_last: Annotated[float, Signal("m/s", "tread speed at the previous sample", 20.0)]
    slip: Annotated[float, Signal("1", "braking slip", 0.1)]
    inertia: Annotated[float, Signal("Pa*s**2/m", "pressure that slows a free wheel", 1e4)]
    p_most: Pressure
    p_before: Pressure
    p_ref: Pressure


class Output(NamedTuple):
    """Demand, and whether it was lowered."""

    p: Pressure
    lowered: Annotated[float, Signal("1", "slip control is active")]


class Seen(NamedTuple):
    """Conditions of the rules, 0 or 1."""

    biting: Annotated[float, Signal("1", "the first bite is enough")]
    locking: Annotated[float, Signal("1", "the wheel tends to lock")]
    falling: Annotated[float, Signal("1", "the wheel did not recover in time after a dump")]
    recovered: Annotated[float, Signal("1", "the wheel can be braked again")]
    dumped: Annotated[float, Signal("1", "pressure is reduced enough")]
    whole: Annotated[float, Signal("1", "the demand is no longer reduced")]


def seen(x: State, u: Input, slowing: Slowing, par: Parameters) -> Seen:
    r"""Return the conditions of the rules.

    .. math:: \lambda_{ahead} = \lambda + T_{lead} \dot\lambda, \quad
       v \dot\lambda = a_{wheel} - (1 - \lambda) a
    """
    fast = ops.where(u.v > par.v_off, 1.0, 0.0)
    near = ops.fmin(u.v / par.v_fall, 1.0)
    faster = slowing - (1.0 - u.slip) * u.a
    ahead = u.slip + par.t_lead * faster / ops.fmax(u.v, par.v_fall)
    locking = fast * ops.where(ahead > near * par.slip_dump, 1.0, 0.0)
    kept = ops.where(x.since > par.t_hold, 1.0, 0.0)
    rolls = ops.where(u.slip < near * par.slip_back, 1.0, 0.0)
    long = ops.where(x.since > par.t_most, 1.0, 0.0)
    return Seen(
        biting=fast * ops.where(ahead > near * par.slip_keep, 1.0, 0.0),
        locking=locking,
        falling=kept * locking * ops.where(faster < -par.a_hold, 0.0, 1.0),
        recovered=ops.fmax(kept * ops.fmax(rolls, long), 1.0 - fast),
        dumped=ops.where(x.p_left > par.depth * x.p_held, 1.0 - locking, 1.0),
        whole=ops.where(x.p_left < u.p_most, 0.0, 1.0),
    )


def next_phase(phase: Flag, s: Seen) -> Flag:
    """Return the next phase."""
    from_build = ops.where(s.locking > 0.5, DUMP, ops.where(s.biting > 0.5, HOLD, BUILD))
    from_dump = ops.where(s.dumped > 0.5, HOLD, DUMP)
    from_hold = ops.where(s.falling > 0.5, DUMP, ops.where(s.recovered > 0.5, STEPPED, HOLD))
    from_stepped = ops.where(s.locking > 0.5, DUMP, ops.where(s.whole > 0.5, BUILD, STEPPED))
    lower = ops.where(phase < 0.5, from_build, from_dump)
    upper = ops.where(phase < 2.5, from_hold, from_stepped)
    return ops.where(phase < 1.5, lower, upper)


def balanced(p: Pressure, slowing: Slowing, u: Input) -> Pressure:
    r"""Return the pressure that the road can hold, :math:`p - (a_{wheel} - a) J/(r k)`.

    A wheel that decelerates more than the vehicle has more brake torque than the road can hold.
    """
    return ops.fmax(p - (slowing - u.a) * u.inertia, _LEAST * p)


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    """Advance the controller by one sample.

    References
    ----------
    R. Bosch GmbH, Automotive Handbook, for the phases of anti-lock brakes. The predictive
    thresholds, the remembered pressure and the growing steps are our own.
    """
    slowing = x.slowing + T / (par.tau_a + T) * ((u.v_last - u.v_wheel) / T - x.slowing)
    p_hat = x.p_hat + T / (par.tau_p + T) * (u.p_ref - x.p_hat)
    phase = ops.where(u.p_before <= 0, BUILD, next_phase(x.phase, seen(x, u, slowing, par)))
    begun = ops.where(ops.fabs(phase - x.phase) > 0.5, 1.0, 0.0)
    # The law updates its estimate of the road's limit when a dump begins or the first bite ends. If
    # a dump was not sufficient, the estimate was wrong or the road has changed. The road can then
    # hold at most the remaining pressure.
    held = balanced(p_hat, slowing, u)
    far = ops.where(u.slip > par.slip_dump, _FAR, par.depth)
    again = ops.where(ops.fabs(x.phase - HOLD) < 0.5, ops.fmin(held, far * x.p_held), held)
    bites = ops.where(x.phase < 0.5, begun, 0.0)
    anew = ops.where(phase < 0.5, 0.0, ops.where(phase < 1.5, begun, bites))
    p_held = ops.where(anew > 0.5, again, x.p_held)
    due = ops.where(phase > 2.5, ops.where(x.since + 0.5 * T > par.t_step, 1.0, 0.0), 0.0)
    later = ops.where(due > 0.5, par.growth * x.rise, x.rise)
    rise = ops.where(begun > 0.5, par.step * p_held, later)
    first = ops.fmax(x.p_left, par.back * p_held)
    stepped = ops.where(begun > 0.5, first, x.p_left + due * x.rise)
    target = ops.fmin(x.p_left, par.depth * p_held)
    dumped = ops.fmax(x.p_left / (1.0 + par.dump * T), target)
    lower = ops.where(phase < 0.5, u.p_most, dumped)
    upper = ops.where(phase < 2.5, x.p_left, stepped)
    p = ops.clip(ops.where(phase < 1.5, lower, upper), 0.0, ops.fmax(u.p_most, 0.0))
    since = ops.where(begun + due > 0.5, 0.0, x.since + T)
    return (
        State(phase, since, p, p_hat, p_held, rise, slowing),
        Output(p, ops.where(p < u.p_most, 1.0, 0.0)),
    )
