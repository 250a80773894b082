"""Two-wheeler on a straight road, with any brakes, which may warm up and fade.

A vehicle inherits from `TwoWheeler` and from its brakes' assemblies. Its method ``brake_torques``
returns the torques that the brakes can hold. Standstill needs no special treatment: brake and
rolling resistance form one dry friction on each wheel, the tire is a spring, and the road acts at
every speed.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal, Self

from bywire.core import ops
from bywire.core.assembly import Assembly, MemoryT, ParT
from bywire.core.model import Bounds
from bywire.core.parameters import ParameterSet
from bywire.core.parts import Integral, Part, Shown, Wire
from bywire.core.signals import Role
from bywire.plant import disc_heat, ground_support, road, road_wheel, two_wheeler_body, tyre

BOOK = "vehicle"
_CRAWL = 0.05  # fraction of the tire's low speed below which slip fades to zero


class VehicleParameters(ParameterSet):
    """Body, wheels, tires and the road below them."""

    body: two_wheeler_body.Parameters
    ground: ground_support.Parameters
    front_wheel: road_wheel.Parameters
    rear_wheel: road_wheel.Parameters
    front_tyre: tyre.Parameters
    rear_tyre: tyre.Parameters
    road: road.Parameters


def vehicle_sink(label: str, returns: Literal["", "taken", "any"] = "") -> Role:
    """Return the role of a loss or a store in the vehicle's energy balance; see `Role`."""
    return Role("sink", label, book=BOOK, returns=returns)


class TwoWheeler(Assembly[ParT, MemoryT]):
    """Body, two wheels with tires, and a road; their parameters are in ``vehicle``."""

    frictions: ClassVar[tuple[str, ...]] = ("omega_f", "omega_r")

    body = Part(two_wheeler_body, par="vehicle.body", outside=True, loss="E_drag")
    ground = Part(
        ground_support,
        par="vehicle.ground",
        outside=True,
        output=("support",),
        work="W_ground",
        loss="E_ground",
    )
    front = Part(road_wheel, par="vehicle.front_wheel", outside=True, suffix="_f", which="front")
    rear = Part(road_wheel, par="vehicle.rear_wheel", outside=True, suffix="_r", which="rear")
    front_tyre = Part(tyre, par="vehicle.front_tyre", suffix="_f", which="front")
    rear_tyre = Part(tyre, par="vehicle.rear_tyre", suffix="_r", which="rear")
    road = Part(road, par="vehicle.road")
    E_brake_f = Integral(
        "J", "heat dissipated by the front brake", role=vehicle_sink("front brake")
    )
    E_brake_r = Integral("J", "heat dissipated by the rear brake", role=vehicle_sink("rear brake"))
    E_roll = Integral("J", "rolling resistance", role=vehicle_sink("rolling resistance"))
    E_tyre_f = Integral(
        "J", "front tire: slip and deflection", role=vehicle_sink("front tire", "taken")
    )
    E_tyre_r = Integral(
        "J", "rear tire: slip and deflection", role=vehicle_sink("rear tire", "taken")
    )
    W_slope = Integral("J", "work of gravity", role=Role("source", "slope", book=BOOK))
    W_pitch = Integral(
        "J",
        "work of the braking forces on the pitch motion",
        role=Role("source", "pitching", book=BOOK),
    )
    t_locked_f = Integral("s", "time during which the front wheel is locked")
    t_locked_r = Integral("s", "time during which the rear wheel is locked")

    F_f = Wire("N", "braking force of the front tire", 1e3)
    F_r = Wire("N", "braking force of the rear tire", 1e3)
    N_f = Wire("N", "load on the front wheel", 1e3)
    N_r = Wire("N", "load on the rear wheel", 1e3)
    T_f = Wire("N*m", "torque that the front brake can hold", 300.0)
    T_r = Wire("N*m", "torque that the rear brake can hold", 300.0)
    v_f = Shown("m/s", "front tread speed", 20.0)
    v_r = Shown("m/s", "rear tread speed", 20.0)
    slip_f = Shown("1", "front braking slip")
    slip_r = Shown("1", "rear braking slip")
    sliding_f = Shown("1", "front tire slides")
    sliding_r = Shown("1", "rear tire slides")
    mu_f = Shown("1", "front braking force relative to the wheel load")
    mu_r = Shown("1", "rear braking force relative to the wheel load")
    a = Shown("m/s**2", "deceleration", 10.0)
    E_vehicle = Shown("J", "energy of the vehicle", role=vehicle_sink("vehicle", "any"))

    def brake_torques(self, w: Self) -> tuple[float, float]:
        """Return the torques that the front and the rear brake can hold [N m], >= 0."""
        raise NotImplementedError

    def motor_torques(self, w: Self) -> tuple[float, float]:
        """Return the braking torques of motors at both wheels [N m]; 0 by default."""
        return 0.0, 0.0

    def wire(self, w: Self) -> None:
        """Connect wheels, tires and body."""
        super().wire(w)
        par = w.body.par
        w.T_f, w.T_r = self.brake_torques(w)
        slope = road.slope(w.body.xe.x, w.road.par)
        w.ground.u = ground_support.Input(par.L * w.body.x.phi, par.L * w.body.x.phi_rate)
        front = _felt(w, w.front, w.front_tyre, w.body.xe.x)
        rear = _felt(w, w.rear, w.rear_tyre, w.body.xe.x - par.L)
        w.N_f, w.N_r = _loads(w, slope.cosine, front, rear)
        w.front_tyre.u, w.rear_tyre.u = front._replace(N=w.N_f), rear._replace(N=w.N_r)
        w.F_f = tyre.output(w.front_tyre.x, w.front_tyre.u, w.front_tyre.par).F
        w.F_r = tyre.output(w.rear_tyre.x, w.rear_tyre.u, w.rear_tyre.par).F
        front_motor, rear_motor = self.motor_torques(w)
        w.front.u = road_wheel.Input(w.F_f, 0.0 - front_motor)
        w.rear.u = road_wheel.Input(w.F_r, 0.0 - rear_motor)
        w.body.u = two_wheeler_body.Input(
            w.F_f + w.F_r, slope.sine, slope.cosine, w.ground.f.support
        )

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return the limits of brake and rolling resistance, one dry friction on each wheel."""
        front, rear = (brake + rolling for brake, rolling in _resistances(w))
        return (*super().friction(w), (-front, front), (-rear, rear))

    def power(self, w: Self) -> dict[str, float]:
        """Return the powers of the vehicle's energy balance."""
        rolling, brakes = [], []
        for wheel, name, (_, most) in zip(
            (w.front, w.rear), TwoWheeler.frictions, _resistances(w), strict=True
        ):
            torque = w.reaction[self.frictions.index(name)]
            rolling.append(ops.fmin(most, ops.fabs(torque)) * ops.fabs(wheel.x.omega))
            brakes.append(-torque * wheel.x.omega - rolling[-1])
        body = w.body.par
        return {
            **super().power(w),
            "E_brake_f": brakes[0],
            "E_brake_r": brakes[1],
            "E_roll": rolling[0] + rolling[1],
            "E_tyre_f": tyre.work(w.front_tyre.x, w.front_tyre.u, w.front_tyre.par),
            "E_tyre_r": tyre.work(w.rear_tyre.x, w.rear_tyre.u, w.rear_tyre.par),
            "W_slope": -body.m * body.g * w.body.u.sine * w.body.x.v,
            "W_pitch": two_wheeler_body.pitch_power(w.body.x, w.body.u, body),
            "t_locked_f": ops.where(w.front.x.omega == 0, 1.0, 0.0),
            "t_locked_r": ops.where(w.rear.x.omega == 0, 1.0, 0.0),
        }

    def record(self, w: Self) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        force = two_wheeler_body.balance(w.body.x, w.body.u, w.body.par).v
        kinetic = (
            two_wheeler_body.energy(w.body.x, w.body.par)
            + road_wheel.energy(w.front.x, w.front.par)
            + road_wheel.energy(w.rear.x, w.rear.par)
        )
        return {
            **super().record(w),
            "v_f": w.front_tyre.u.v_wheel,
            "v_r": w.rear_tyre.u.v_wheel,
            "slip_f": shown_slip(w.front_tyre.u, w.front_tyre.par),
            "slip_r": shown_slip(w.rear_tyre.u, w.rear_tyre.par),
            "sliding_f": tyre.sliding(w.front_tyre.x, w.front_tyre.u),
            "sliding_r": tyre.sliding(w.rear_tyre.x, w.rear_tyre.u),
            "mu_f": tyre.force_over_load(w.front_tyre.x, w.front_tyre.u, w.front_tyre.par),
            "mu_r": tyre.force_over_load(w.rear_tyre.x, w.rear_tyre.u, w.rear_tyre.par),
            "a": -force / w.body.par.m,
            "E_vehicle": kinetic + ground_support.energy(w.ground.u, w.ground.par),
        }


def rolling_start(v: float, par: VehicleParameters) -> dict[str, Any]:
    """Return the states of the vehicle's parts at a speed [m/s], rolling freely on a level road."""
    body = par.body
    N_r = two_wheeler_body.static_load(1.0, body)
    sunk = -N_r / (par.ground.k * body.L)
    return {
        "body": two_wheeler_body.State(0.0, v, N_r, sunk, 0.0),
        "front": road_wheel.State(v / par.front_wheel.r),
        "rear": road_wheel.State(v / par.rear_wheel.r),
    }


def _felt(w: Any, wheel: Any, rubber: Any, place: float) -> tyre.Input:
    """Return the input of a tire, without its load."""
    ground, speed, tread = road.surface(place, w.road.par), w.body.x.v, wheel.par
    seen = tyre.Contact(w.body.xe.v, road_wheel.tread_speed(wheel.xe, tread), *ground)
    limits = tyre.limits(seen, rubber.par)
    return tyre.Input(
        speed, road_wheel.tread_speed(wheel.x, tread), 0.0, *ground, limits.mu, limits.u
    )


def shown_slip(u: tyre.Input, par: tyre.Parameters) -> float:
    """Return the slip for recordings, which fades to zero at standstill."""
    least = _CRAWL * par.v_low
    faster = ops.fmax(ops.fmax(ops.fabs(u.v), ops.fabs(u.v_wheel)), least)
    return (u.v - u.v_wheel) / faster


def _loads(w: Any, cosine: float, front: tyre.Input, rear: tyre.Input) -> two_wheeler_body.Loads:
    """Return the loads of both wheels, lagged or immediate."""
    par = w.body.par
    if par.load == "lagged":
        N_r = two_wheeler_body.carried_load(w.body.x.N_lag, cosine, par)
        return two_wheeler_body.loads(N_r, cosine, par)
    N_r = two_wheeler_body.rigid_rear_load(
        tyre.force_over_load(w.front_tyre.x, front, w.front_tyre.par),
        tyre.force_over_load(w.rear_tyre.x, rear, w.rear_tyre.par),
        two_wheeler_body.drag(w.body.x, par),
        cosine,
        par,
    )
    return two_wheeler_body.loads(N_r, cosine, par)


def _resistances(w: Any) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the torques that each wheel's brake and rolling resistance can hold [N m]."""
    return (
        (w.T_f, road_wheel.rolling_resistance(w.N_f, w.front.par)),
        (w.T_r, road_wheel.rolling_resistance(w.N_r, w.rear.par)),
    )


# --- Brakes that warm up and fade

HEAT_BOOK = "heat"
_SLOW = disc_heat.State._fields


def heat_sink(label: str) -> Role:
    """Return the role of a body that stores heat."""
    return Role("sink", label, book=HEAT_BOOK, returns="any")


class HotBrakes(TwoWheeler[ParT, MemoryT]):
    """A two-wheeler whose friction heats the discs of both wheels, so its pads may fade.

    A vehicle inherits from it instead of `TwoWheeler` and has parameters ``front.heat`` and
    ``rear.heat``. Its method ``cold_torques`` returns the torques that cold brakes hold. With
    ``front.heat.law = "off"``, a brake stays cold and its heat is not computed.
    """

    front_heat = Part(
        disc_heat,
        par="front.heat",
        suffix="_f",
        which="front",
        fixed=_SLOW,
        outside=True,
        loss="E_air",
    )
    rear_heat = Part(
        disc_heat,
        par="rear.heat",
        suffix="_r",
        which="rear",
        fixed=_SLOW,
        outside=True,
        loss="E_air",
    )

    E_friction = Shown(
        "J", "friction work of the warm brakes", role=Role("source", "brakes", book=HEAT_BOOK)
    )
    E_discs = Shown("J", "heat in the discs", role=heat_sink("discs"))
    E_pads = Shown("J", "heat in the pads", role=heat_sink("pads"))
    E_fluid = Shown("J", "heat in calipers and fluid", role=heat_sink("calipers and fluid"))

    def cold_torques(self, w: Self) -> tuple[float, float]:
        """Return the torques that the cold front and rear brake can hold [N m], >= 0."""
        raise NotImplementedError

    def brake_torques(self, w: Self) -> tuple[float, float]:
        """Return the torques that the brakes can hold at their discs' temperatures."""
        front, rear = self.cold_torques(w)
        return (
            front * disc_heat.friction(w.front_heat.xe.T_disc, w.front_heat.par),
            rear * disc_heat.friction(w.rear_heat.xe.T_disc, w.rear_heat.par),
        )

    def wire(self, w: Self) -> None:
        """Connect the brakes' heat: friction limit times speed, 0 if a wheel does not turn."""
        super().wire(w)
        for heat, wheel, torque in (
            (w.front_heat, w.front, w.T_f),
            (w.rear_heat, w.rear, w.T_r),
        ):
            heat.u = disc_heat.Input(
                P=torque * ops.fabs(wheel.x.omega),
                v=w.body.xe.v,
                pressed=ops.where(torque > 0, 1.0, 0.0),
            )

    def record(self, w: Self) -> dict[str, float]:
        """Return the heat in the bodies, and its source."""
        every = ((w.front_heat, w.flow.E_brake_f), (w.rear_heat, w.flow.E_brake_r))
        each = [disc_heat.stored(heat.x, heat.par) for heat, _ in every]
        return {
            **super().record(w),
            "E_friction": sum((taken for heat, taken in every if heat.par.law != "off"), start=0.0),
            "E_discs": each[0].discs + each[1].discs,
            "E_pads": each[0].pads + each[1].pads,
            "E_fluid": each[0].fluid + each[1].fluid,
        }


def cold_start(front: disc_heat.Parameters, rear: disc_heat.Parameters) -> dict[str, Any]:
    """Return both brakes' states at air temperature, by part."""
    return {
        part: disc_heat.State(par.T_a, par.T_a, par.T_a)
        for part, par in (("front_heat", front), ("rear_heat", rear))
    }
