"""Slip control around any brake: of a quarter car, and remarks on a fixed set point.

The laws use pressures. For a brake that follows a moment, the demand is converted to a pressure
with ``slip.k_hat``, and the lowered pressure is converted back.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, NamedTuple, cast

from pydantic import Field

from bywire.control import abs_rules, slip_pi, vehicle_speed, wheel_speed
from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant, Unit
from bywire.core.signals import Signal, zeros
from bywire.core.typing import Array
from bywire.plant import adhesion, road, wheel_encoder
from bywire.vehicle.surfaces import surface_name

SomeMoment = Annotated[float, Unit("N*m", 10.0), Field(ge=0, allow_inf_nan=False)]
MomentRate = Annotated[float, Unit("N*m/s", 1e4), Field(gt=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Sensors and laws of one wheel.

    ``abs``: ``"pi"`` controls the slip; ``"rules"`` build, dump and hold the pressure by
    thresholds; ``"off"`` does not change the demand. ``sees``: speed and slip are ``"estimated"``
    from pulses and an accelerometer, or ``"known"``, for comparison.
    """

    T_s: Duration
    """sample time"""
    abs: Literal["off", "pi", "rules"]
    """control of the wheel's slip"""
    sees: Literal["estimated", "known"]
    """whether speed and slip are estimated"""
    M_rate: MomentRate
    """maximum build-up rate of the demand"""
    M_least: SomeMoment
    """minimum moment under slip control, which keeps the pads on the disc"""
    encoder: wheel_encoder.Parameters
    tau_a: TimeConstant
    """time constant of the accelerometer's filter"""
    wheel_speed: wheel_speed.Parameters
    vehicle_speed: vehicle_speed.Parameters
    slip: slip_pi.Parameters
    rules: abs_rules.Parameters


class Memory(NamedTuple):
    """Memory of slip control between its ticks."""

    M_left: Annotated[float, Signal("N*m", "moment demand after slip control", 300.0)]
    M_most: Annotated[float, Signal("N*m", "moment demand after the build-up limit", 300.0)]
    v_hat: Annotated[float, Signal("m/s", "reference speed", 20.0, set_point_of="v_x")]
    slip_hat: Annotated[float, Signal("1", "slip estimated by the ECU", 0.1)]
    a_hat: Annotated[float, Signal("m/s**2", "measured deceleration", 10.0)]
    abs: Annotated[float, Signal("1", "slip control is active")]
    tread_hat: Annotated[float, Signal("m/s", "measured speed of the tread", 20.0)]
    omega_hat: Annotated[float, Signal("rad/s", "measured wheel speed", 60.0)]
    edge: Annotated[float, Signal("rad", "angle of the last encoder edge", 100.0)]
    age: Annotated[float, Signal("s", "time since the last encoder edge", 1e-3)]
    v_last: Annotated[float, Signal("m/s", "speed at the sensor's last sample", 20.0)]
    slip_integral: Annotated[float, Signal("Pa", "integral term of the slip PI", 1e6)]
    phase_x: Annotated[float, Signal("1", "phase of the rule-based ABS", 3.0)]
    since_x: Annotated[
        float, Signal("s", "time since the rule-based ABS began its phase or step", 0.1)
    ]
    p_left_x: Annotated[float, Signal("Pa", "demand after the rule-based ABS", 1e6)]
    p_hat_x: Annotated[float, Signal("Pa", "pressure estimated by the rule-based ABS", 1e6)]
    p_held_x: Annotated[float, Signal("Pa", "last pressure that the road could hold", 1e6)]
    rise_x: Annotated[float, Signal("Pa", "next pressure step", 1e5)]
    slowing_x: Annotated[float, Signal("m/s**2", "wheel's deceleration, filtered", 10.0)]


class Readings(NamedTuple):
    """Readings of vehicle, wheel, slope and brake at a tick."""

    v: Annotated[float, Signal("m/s", "vehicle speed", 20.0)]
    v_wheel: Annotated[float, Signal("m/s", "speed of the tread", 20.0)]
    angle: Annotated[float, Signal("rad", "angle of the last encoder edge", 100.0)]
    age: Annotated[float, Signal("s", "time since the last encoder edge", 1e-3)]
    weight: Annotated[float, Signal("m/s**2", "gravity along the road", 0.5)]
    touches: Annotated[float, Signal("1", "pads touch the disc")]


def awake(v: float, par: Parameters) -> dict[str, float]:
    """Return the memory of slip control on a corner that rolls at a speed [m/s]."""
    omega = v / par.slip.r_hat
    seen = zeros(Memory)._replace(
        v_hat=v, v_last=v, tread_hat=v, omega_hat=omega, edge=-omega * par.T_s
    )
    return seen._asdict()


def tick(r: Readings, m: Any, M_set: float, par: Parameters) -> Any:
    """Run slip control once: measure, limit the build-up, then lower the demand.

    ``m``: a memory with the fields of `Memory`. ``M_set``: the demanded moment [N m].
    """
    before, m = m, _measured(r, m, par)
    k = par.slip.k_hat
    # While the pads cross a gap, the demand does not build up and the law's integral is frozen.
    risen = ops.where(r.touches > 0.5, m.M_most + par.M_rate * par.T_s, par.M_least)
    m = m._replace(M_most=ops.fmin(M_set, risen))
    p_most, p_before = m.M_most / k, ops.where(r.touches > 0.5, before.M_most, 0.0) / k
    if par.abs == "pi":
        seen = slip_pi.Input(
            m.v_hat, slip_pi.set_point(m.v_hat, par.slip), m.slip_hat, M_set / k, p_most, p_before
        )
        state, out = slip_pi.output(slip_pi.State(m.slip_integral), seen, par.T_s, par.slip)
        m = m._replace(slip_integral=state.integral)
    else:
        view = abs_rules.Input(
            m.v_hat,
            m.a_hat,
            m.tread_hat,
            before.tread_hat,
            m.slip_hat,
            par.slip.J_hat / (par.slip.r_hat * k),
            p_most,
            p_before,
            before.M_left / k,
        )
        rules = abs_rules.State(*(getattr(m, f"{name}_x") for name in abs_rules.State._fields))
        rules, out = abs_rules.output(rules, view, par.T_s, par.rules)  # type: ignore[assignment]
        m = m._replace(**{f"{name}_x": value for name, value in rules._asdict().items()})
    left = ops.fmax(k * out.p, ops.fmin(par.M_least, m.M_most))
    # Near standstill, the car rocks on its tire, and the motors would follow this slip although the
    # disc is at rest. The lowered moment is therefore kept, unless the demand is lower.
    holds = ops.where(m.v_hat < par.vehicle_speed.v_still, before.abs, 0.0)
    kept = ops.fmin(before.M_left, m.M_most)
    left = ops.where(holds > 0.5, kept, left)
    return m._replace(M_left=left, abs=ops.where(left < m.M_most, 1.0, 0.0))


def _measured(r: Readings, m: Any, par: Parameters) -> Any:
    """Return the memory with speeds, slip and deceleration estimated by the ECU."""
    T = par.T_s
    wheel = wheel_speed.output(
        wheel_speed.State(m.edge, m.age, m.omega_hat),
        wheel_speed.Input(r.angle, r.age),
        T,
        par.wheel_speed,
    )
    shown = (m.v_last - r.v) / T - r.weight
    v, tread = r.v, r.v_wheel
    if par.sees == "estimated":
        tread = wheel.omega * par.slip.r_hat
        seen = vehicle_speed.Input(tread, tread, shown)
        v = vehicle_speed.output(vehicle_speed.State(m.v_hat), seen, T, par.vehicle_speed).v
    return m._replace(
        v_hat=v,
        slip_hat=vehicle_speed.slip(v, tread, par.slip.v_off),
        a_hat=m.a_hat + T / (par.tau_a + T) * (shown - m.a_hat),
        tread_hat=tread,
        omega_hat=wheel.omega,
        edge=wheel.angle,
        age=wheel.age,
        v_last=r.v,
    )


# --- Remarks on the road's surfaces

FAR = 2.0
"""minimum ratio of the slip at maximum adhesion to the slip set point that causes a remark"""


def far_from_peak(
    place: Array,
    acts: Array,
    slip_set: float,
    parameter: str,
    curve: adhesion.Parameters,
    ways: road.Parameters,
) -> list[str]:
    """Return remarks on surfaces whose maximum adhesion needs far more slip than the set point.

    Parameters
    ----------
    place
        Position of the wheel along the road [m], row by row.
    acts
        Whether slip control acts, above 0.5.
    slip_set
        Slip set point.
    parameter
        Name of its parameter, for example ``"ecu.slip.slip_set"``.
    curve, ways
        Parameters of tire and road.

    Returns
    -------
    list of str
        A remark for each surface on which slip control acted and whose peak is beyond `FAR` times
        the slip set point.
    """
    places = place[acts > 0.5]
    is_further = cast("Array", road.share(cast("Any", places), ways)) > 0.5
    texts: dict[str, None] = {}
    for x in (*places[~is_further][:1], *places[is_further][:1]):
        ground = road.surface(float(x), ways)
        peak = float(adhesion.peak_slip(ground, curve))
        if not peak > FAR * slip_set:
            continue
        most, held = (float(adhesion.adhesion(slip, ground, curve)) for slip in (peak, slip_set))
        name = surface_name(float(x), ways)
        surface = "the road" if name == "own" else name
        texts[
            f"slip control uses a slip set point of {slip_set:.3g} ({parameter}), but {surface} "
            f"has its maximum adhesion at {peak:.3g}. The wheel uses {100.0 * held / most:.0f} % "
            "of it. A larger set point, or the rule-based ABS (abs=rules), would brake harder there"
        ] = None
    return list(texts)
