"""The ECU of the two-wheeler: wheel speeds, reference speed, slip and lift control.

The controllers only reduce the rider's demand. They never increase it.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Ge

from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters as Par
from bywire.control import (
    abs_rules,
    lift_pi,
    mixed_slip,
    slip_pi,
    vehicle_speed,
    wheel_speed,
)
from bywire.core import ops
from bywire.core.signals import Limited, Signal


class Stimulus(NamedTuple):
    """Rider demands."""

    p_f_set: Annotated[float, Signal("Pa", "rider's front pressure demand", 2e6), Ge(0)]
    p_r_set: Annotated[float, Signal("Pa", "rider's rear pressure demand", 2e6), Ge(0)]


class Memory(NamedTuple):
    """Memory of the ECU between its ticks."""

    p_f_ref: Annotated[
        float,
        Signal("Pa", "front pressure set point", 2e6, set_point_of="p_f"),
        Limited("p_f_set"),
    ]
    p_r_ref: Annotated[
        float,
        Signal("Pa", "rear pressure set point", 2e6, set_point_of="p_r"),
        Limited("p_r_set"),
    ]
    p_f_most: Annotated[float, Signal("Pa", "front demand with limited build-up rate", 2e6)]
    p_r_most: Annotated[float, Signal("Pa", "rear demand with limited build-up rate", 2e6)]
    v_hat: Annotated[float, Signal("m/s", "reference speed", 20.0, set_point_of="v")]
    slip_f_hat: Annotated[float, Signal("1", "front slip estimated by the ECU", 0.1)]
    slip_r_hat: Annotated[float, Signal("1", "rear slip estimated by the ECU", 0.1)]
    a_hat: Annotated[float, Signal("m/s**2", "measured deceleration", 10.0)]
    abs_f: Annotated[float, Signal("1", "slip control of the front wheel is active")]
    abs_r: Annotated[float, Signal("1", "slip control of the rear wheel is active")]
    lift: Annotated[float, Signal("1", "lift control is active")]
    tread_f: Annotated[float, Signal("m/s", "measured speed of the front tread", 20.0)]
    tread_r: Annotated[float, Signal("m/s", "measured speed of the rear tread", 20.0)]
    eta_f: Annotated[float, Signal("1", "front wheel deceleration in units of g", 1.0)]
    eta_r: Annotated[float, Signal("1", "rear wheel deceleration in units of g", 1.0)]
    omega_f_hat: Annotated[float, Signal("rad/s", "measured front wheel speed", 60.0)]
    omega_r_hat: Annotated[float, Signal("rad/s", "measured rear wheel speed", 60.0)]
    edge_f: Annotated[float, Signal("rad", "angle of the last front encoder edge", 100.0)]
    edge_r: Annotated[float, Signal("rad", "angle of the last rear encoder edge", 100.0)]
    age_f: Annotated[float, Signal("s", "time since the last front encoder edge", 1e-3)]
    age_r: Annotated[float, Signal("s", "time since the last rear encoder edge", 1e-3)]
    v_last: Annotated[float, Signal("m/s", "speed at the sensor's last sample", 20.0)]
    slip_f_integral: Annotated[float, Signal("Pa", "integral term of the front slip PI", 2e6)]
    slip_r_integral: Annotated[float, Signal("Pa", "integral term of the rear slip PI", 2e6)]
    lift_integral: Annotated[float, Signal("Pa", "integral term of the lift PI", 2e6)]
    phase_f: Annotated[float, Signal("1", "phase of the front rule-based ABS", 3.0)]
    phase_r: Annotated[float, Signal("1", "phase of the rear rule-based ABS", 3.0)]
    since_f: Annotated[
        float, Signal("s", "time since the front rule-based ABS began its phase or step", 0.1)
    ]
    since_r: Annotated[
        float, Signal("s", "time since the rear rule-based ABS began its phase or step", 0.1)
    ]
    p_left_f: Annotated[float, Signal("Pa", "front demand after the rule-based ABS", 2e6)]
    p_left_r: Annotated[float, Signal("Pa", "rear demand after the rule-based ABS", 2e6)]
    p_hat_f: Annotated[float, Signal("Pa", "front pressure estimated by the rule-based ABS", 2e6)]
    p_hat_r: Annotated[float, Signal("Pa", "rear pressure estimated by the rule-based ABS", 2e6)]
    p_held_f: Annotated[
        float, Signal("Pa", "last pressure that the road could hold at the front wheel", 2e6)
    ]
    p_held_r: Annotated[
        float, Signal("Pa", "last pressure that the road could hold at the rear wheel", 2e6)
    ]
    rise_f: Annotated[float, Signal("Pa", "next front pressure step", 1e5)]
    rise_r: Annotated[float, Signal("Pa", "next rear pressure step", 1e5)]
    slowing_f: Annotated[float, Signal("m/s**2", "front wheel deceleration, filtered", 10.0)]
    slowing_r: Annotated[float, Signal("m/s**2", "rear wheel deceleration, filtered", 10.0)]


class Readings(NamedTuple):
    """Sensor readings at one tick."""

    v: Annotated[float, Signal("m/s", "vehicle speed", 20.0)]
    sine: Annotated[float, Signal("1", "sine of the slope", 0.05)]
    tread_f: Annotated[float, Signal("m/s", "speed of the front tread", 20.0)]
    tread_r: Annotated[float, Signal("m/s", "speed of the rear tread", 20.0)]
    angle_f: Annotated[float, Signal("rad", "angle of the last front encoder edge", 100.0)]
    angle_r: Annotated[float, Signal("rad", "angle of the last rear encoder edge", 100.0)]
    age_f: Annotated[float, Signal("s", "time since the last front encoder edge", 1e-3)]
    age_r: Annotated[float, Signal("s", "time since the last rear encoder edge", 1e-3)]


def tick(r: Readings, m: Memory, u: Stimulus, par: Par) -> Memory:
    """Run the ECU once: measure, limit the build-up rate, then let the controllers reduce it."""
    before, m = m, _measured(r, m, par)
    rise = par.ecu.p_rate * par.ecu.T_s
    m = m._replace(
        p_f_most=ops.fmin(u.p_f_set, m.p_f_most + rise),
        p_r_most=ops.fmin(u.p_r_set, m.p_r_most + rise),
    )
    p_f, p_r = m.p_f_most, m.p_r_most
    if par.ecu.abs == "rules":
        p_f, m = _by_rules("f", p_f, m, before, par.ecu.front_slip, par)
        p_r, m = _by_rules("r", p_r, m, before, par.ecu.rear_slip, par)
    if par.ecu.abs == "pi":
        front = _Wheel(m.slip_f_hat, m.tread_f, before.tread_f, m.eta_f, m.slip_f_integral)
        rear = _Wheel(m.slip_r_hat, m.tread_r, before.tread_r, m.eta_r, m.slip_r_integral)
        on_front = _lowered(
            front, m.v_hat, (u.p_f_set, p_f, before.p_f_most), par.ecu.front_slip, par
        )
        on_rear = _lowered(rear, m.v_hat, (u.p_r_set, p_r, before.p_r_most), par.ecu.rear_slip, par)
        p_f, p_r = on_front.p, on_rear.p
        m = m._replace(
            slip_f_integral=on_front.integral,
            slip_r_integral=on_rear.integral,
            eta_f=on_front.eta,
            eta_r=on_rear.eta,
            abs_f=on_front.acts,
            abs_r=on_rear.acts,
        )
    if par.ecu.lift == "pi":
        # Lift control is last, because it must know the demand after slip control.
        seen = lift_pi.Input(m.a_hat, u.p_f_set, p_f, before.p_f_most)
        lift, out = lift_pi.output(
            lift_pi.State(m.lift_integral), seen, par.ecu.T_s, par.ecu.front_lift
        )
        p_f, m = out.p, m._replace(lift_integral=lift.integral, lift=out.lowered)
    return m._replace(p_f_ref=p_f, p_r_ref=p_r)


_Demands = tuple[float, float, float]


class _Wheel(NamedTuple):
    """Signals of a wheel for slip control."""

    slip: float
    tread: float
    tread_before: float
    eta: float
    integral: float


class _Lowered(NamedTuple):
    """Output of slip control."""

    p: float
    acts: float
    integral: float
    eta: float


def _lowered(
    wheel: _Wheel, v: float, demands: _Demands, gains: slip_pi.Parameters, par: Par
) -> _Lowered:
    """Return the rider's demand after slip control.

    ``demands``: whole demand, the part that slip control may reduce, and that part one tick before.
    """
    mix, seen = mixed_slip.output(
        mixed_slip.State(wheel.tread_before, wheel.eta),
        mixed_slip.Input(slip_pi.set_point(v, gains), wheel.slip, wheel.tread),
        par.ecu.T_s,
        par.ecu.mix,
    )
    state, out = slip_pi.output(
        slip_pi.State(wheel.integral),
        slip_pi.Input(v, seen.set_point, seen.mixed, *demands),
        par.ecu.T_s,
        gains,
    )
    return _Lowered(out.p, out.lowered, state.integral, mix.eta)


def _by_rules(
    side: str, p_most: float, m: Memory, before: Memory, wheel: slip_pi.Parameters, par: Par
) -> tuple[float, Memory]:
    """Return the demand on a wheel, "f" or "r", after the rules, and the new memory."""
    seen = abs_rules.Input(
        v=m.v_hat,
        a=m.a_hat,
        v_wheel=getattr(m, f"tread_{side}"),
        v_last=getattr(before, f"tread_{side}"),
        slip=getattr(m, f"slip_{side}_hat"),
        inertia=wheel.J_hat / (wheel.r_hat * wheel.k_hat),
        p_most=p_most,
        p_before=getattr(before, f"p_{side}_most"),
        p_ref=getattr(before, f"p_{side}_ref"),
    )
    state = abs_rules.State(*(getattr(m, f"{name}_{side}") for name in abs_rules.State._fields))
    state, out = abs_rules.output(state, seen, par.ecu.T_s, par.ecu.rules)
    kept = {f"{name}_{side}": value for name, value in state._asdict().items()}
    return out.p, m._replace(**kept, **{f"abs_{side}": out.lowered})


def _measured(r: Readings, m: Memory, par: Par) -> Memory:
    """Return the memory with the ECU's estimates of speeds, slips and deceleration."""
    T, ecu, vehicle = par.ecu.T_s, par.ecu, par.vehicle
    front = wheel_speed.output(
        wheel_speed.State(m.edge_f, m.age_f, m.omega_f_hat),
        wheel_speed.Input(r.angle_f, r.age_f),
        T,
        ecu.wheel_speed,
    )
    rear = wheel_speed.output(
        wheel_speed.State(m.edge_r, m.age_r, m.omega_r_hat),
        wheel_speed.Input(r.angle_r, r.age_r),
        T,
        ecu.wheel_speed,
    )
    shown = (m.v_last - r.v) / T - vehicle.body.g * r.sine + par.sensors.a_offset
    a_hat = m.a_hat + T / (par.sensors.tau_a + T) * (shown - m.a_hat)
    if ecu.sees == "known":
        v, tread_f, tread_r = r.v, r.tread_f, r.tread_r
    else:
        tread_f = front.omega * ecu.front_slip.r_hat
        tread_r = rear.omega * ecu.rear_slip.r_hat
        seen = vehicle_speed.Input(tread_f, tread_r, shown)
        v = vehicle_speed.output(vehicle_speed.State(m.v_hat), seen, T, ecu.vehicle_speed).v
    return m._replace(
        v_hat=v,
        slip_f_hat=vehicle_speed.slip(v, tread_f, ecu.front_slip.v_off),
        slip_r_hat=vehicle_speed.slip(v, tread_r, ecu.rear_slip.v_off),
        a_hat=a_hat,
        tread_f=tread_f,
        tread_r=tread_r,
        omega_f_hat=front.omega,
        omega_r_hat=rear.omega,
        edge_f=front.angle,
        edge_r=rear.angle,
        age_f=front.age,
        age_r=rear.age,
        v_last=r.v,
    )
