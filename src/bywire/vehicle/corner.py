"""A quarter car with any disc brake: body, tire, road, and the disc's heat.

A corner inherits from `Corner` and from its brake's assembly, whose disc turns with the wheel. Its
method ``wheel`` returns the disc's speed. `tyre_torque` is the road's torque on the disc.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Self

from bywire.core import ops
from bywire.core.assembly import Assembly, MemoryT, ParT
from bywire.core.parameters import ParameterSet
from bywire.core.parts import Integral, Part, Shown, Wire
from bywire.core.quantities import Length
from bywire.core.signals import Role
from bywire.plant import corner_body, disc_heat, road, tyre
from bywire.vehicle.two_wheeler import BOOK, HEAT_BOOK, heat_sink, shown_slip, vehicle_sink


class CornerParameters(ParameterSet):
    """Body, wheel, tire and road; the wheel's inertia belongs to the brake's disc."""

    body: corner_body.Parameters
    r: Length
    """rolling radius of the wheel"""
    tyre: tyre.Parameters
    road: road.Parameters


class WheelSpeed(NamedTuple):
    """Wheel speed [rad/s]: in the implicit solve, and as a value only."""

    x: float
    xe: float


class Corner(Assembly[ParT, MemoryT]):
    """Body and tire of a corner; their parameters are in ``corner``."""

    corner = Part(corner_body, par="corner.body", outside=True, state={"v": "v_x"})
    tyre = Part(tyre, par="corner.tyre")
    road = Part(road, par="corner.road")
    E_tyre = Integral("J", "tire: slip and deflection", role=vehicle_sink("tire", "taken"))
    W_slope = Integral("J", "work of gravity", role=Role("source", "slope", book=BOOK))
    t_locked = Integral("s", "time during which the wheel is locked")

    F_x = Wire("N", "braking force of the tire", 1e3)
    N_x = Wire("N", "load on the wheel", 4e3)
    v_tread = Shown("m/s", "tread speed", 20.0)
    slip = Shown("1", "braking slip", 0.1)
    sliding = Shown("1", "tire slides")
    a = Shown("m/s**2", "deceleration", 10.0)
    E_body = Shown("J", "energy of the body", role=vehicle_sink("body", "any"))

    def wheel(self, w: Self) -> WheelSpeed:
        """Return the speed of the wheel."""
        raise NotImplementedError

    def motor_torque(self, w: Self) -> float:
        """Return the braking torque of a motor at the wheel [N m]; 0 by default."""
        return 0.0

    def tyre_torque(self, w: Self) -> float:
        """Wire body and tire, and return the torque of road and motor on the wheel [N m]."""
        par: CornerParameters = w.par.corner  # type: ignore[attr-defined]
        omega = self.wheel(w)
        ground = road.surface(w.corner.xe.s, par.road)
        slope = road.slope(w.corner.xe.s, par.road)
        seen = tyre.Contact(w.corner.xe.v, omega.xe * par.r, *ground)
        limits = tyre.limits(seen, par.tyre)
        w.N_x = corner_body.load(slope.cosine, par.body)
        w.tyre.u = tyre.Input(w.corner.x.v, omega.x * par.r, w.N_x, *ground, limits.mu, limits.u)
        w.F_x = tyre.output(w.tyre.x, w.tyre.u, par.tyre).F
        w.corner.u = corner_body.Input(w.F_x, slope.sine)
        return par.r * w.F_x - self.motor_torque(w)

    def power(self, w: Self) -> dict[str, float]:
        """Return the powers of the vehicle's energy balance."""
        body = w.corner.par
        return {
            **super().power(w),
            "E_tyre": tyre.work(w.tyre.x, w.tyre.u, w.tyre.par),
            "W_slope": -body.m * body.g * w.corner.u.sine * w.corner.x.v,
            "t_locked": ops.where(self.wheel(w).x == 0, 1.0, 0.0),
        }

    def record(self, w: Self) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        return {
            **super().record(w),
            "v_tread": w.tyre.u.v_wheel,
            "slip": shown_slip(w.tyre.u, w.tyre.par),
            "sliding": tyre.sliding(w.tyre.x, w.tyre.u),
            "a": -corner_body.balance(w.corner.x, w.corner.u, w.corner.par).v / w.corner.par.m,
            "E_body": corner_body.energy(w.corner.x, w.corner.par),
        }


def rolling_states(v: float) -> dict[str, Any]:
    """Return the states of the corner's parts at a speed [m/s]."""
    return {"corner": corner_body.State(s=0.0, v=v), "tyre": tyre.State(0.0)}


# --- A corner whose brake warms up and fades


class HotCornerParameters(CornerParameters):
    """Parameters of a corner whose brake may warm up."""

    heat: disc_heat.Parameters


class HotCorner(Corner[ParT, MemoryT]):
    """A corner whose friction heats the disc, so its pads may fade.

    A corner inherits from it instead of `Corner`, has parameters ``corner.heat``, and multiplies
    its pads' friction by `pads_friction`. Its method ``brake_torque`` returns the torque that its
    brake can hold.
    """

    disc_heat = Part(
        disc_heat, par="corner.heat", fixed=disc_heat.State._fields, outside=True, loss="E_air"
    )

    E_friction = Shown(
        "J", "friction work of the warm brake", role=Role("source", "brake", book=HEAT_BOOK)
    )
    E_discs = Shown("J", "heat in the disc", role=heat_sink("disc"))
    E_pads = Shown("J", "heat in the pads", role=heat_sink("pads"))
    E_fluid = Shown("J", "heat in the caliper", role=heat_sink("caliper"))
    E_brake = Shown(
        "J",
        "energy that the brake removes from the wheel",
        role=vehicle_sink("brake", "any"),
    )

    def braked(self, w: Self) -> float:
        """Return the energy that the brake has removed from the wheel [J]."""
        raise NotImplementedError

    def brake_torque(self, w: Self) -> float:
        """Return the torque that the brake can hold at the wheel [N m], >= 0."""
        raise NotImplementedError

    def pads_friction(self, w: Self) -> float:
        """Return the pads' friction relative to cold pads."""
        return disc_heat.friction(w.disc_heat.xe.T_disc, w.disc_heat.par)

    def wire(self, w: Self) -> None:
        """Connect the brake's heat: friction limit times speed, 0 if the wheel does not turn."""
        super().wire(w)
        torque = self.brake_torque(w)
        w.disc_heat.u = disc_heat.Input(
            P=torque * ops.fabs(self.wheel(w).x),
            v=w.corner.xe.v,
            pressed=ops.where(torque > 0, 1.0, 0.0),
        )

    def record(self, w: Self) -> dict[str, float]:
        """Return the heat in the bodies, and its source."""
        heat = disc_heat.stored(w.disc_heat.x, w.disc_heat.par)
        return {
            **super().record(w),
            "E_friction": 0.0 if w.disc_heat.par.law == "off" else self.braked(w),
            "E_brake": self.braked(w),
            "E_discs": heat.discs,
            "E_pads": heat.pads,
            "E_fluid": heat.fluid,
        }


def warm_disc(T: float, par: disc_heat.Parameters) -> disc_heat.State:
    """Return the brake's state with its disc at a temperature [K], the rest at air temperature."""
    return disc_heat.State(T, par.T_a, par.T_a)
