"""A braked wheel on a drum at constant speed, for the design of slip control."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple, Self

from annotated_types import Ge
from pydantic import Field

from bywire.brakes.two_wheeler.parameters import BrakeParameters
from bywire.control import slip_pi, vehicle_speed
from bywire.core.assembly import Assembly
from bywire.core.model import Task
from bywire.core.parameters import ParameterSet
from bywire.core.parts import Integral, Part, Shown, Wire
from bywire.core.quantities import Duration, Unit
from bywire.core.signals import Limited, Role, Signal, zeros
from bywire.plant import adhesion, brake_disc, pressure_loop, road_wheel, tyre

DrumSpeed = Annotated[float, Unit("m/s", 20.0), Field(gt=0, allow_inf_nan=False)]
Load = Annotated[float, Unit("N", 2e3), Field(gt=0, allow_inf_nan=False)]


class DrumParameters(ParameterSet):
    """The drum, whose surface has a constant speed."""

    v: DrumSpeed
    """surface speed"""
    N: Load
    """force of the wheel on the drum"""
    surface: adhesion.SurfaceParameters


class WheelOnDrumParameters(ParameterSet):
    """Wheel, tire, brake, drum and slip control."""

    wheel: road_wheel.Parameters
    tyre: tyre.Parameters
    brake: BrakeParameters
    drum: DrumParameters
    slip: slip_pi.Parameters
    T_s: Duration
    """sample time of slip control"""


Par = WheelOnDrumParameters


class Stimulus(NamedTuple):
    """Slip demand, and the pressure that slip control may reduce."""

    slip_set: Annotated[float, Signal("1", "slip demand", 0.1)]
    p_set: Annotated[float, Signal("Pa", "pressure that slip control may reduce", 4e6), Ge(0)]


class Memory(NamedTuple):
    """Memory of slip control between its ticks."""

    p_ref: Annotated[
        float, Signal("Pa", "pressure set point", 2e6, set_point_of="p"), Limited("p_set")
    ]
    slip_hat: Annotated[float, Signal("1", "measured slip", 0.1)]
    slip_ref: Annotated[float, Signal("1", "slip set point", 0.1, set_point_of="slip")]
    integral: Annotated[float, Signal("Pa", "integral term", 2e6)]
    acts: Annotated[float, Signal("1", "slip control is active")]


class WheelOnDrum(Assembly[WheelOnDrumParameters, Memory]):
    """A turning wheel. In linear models its brake and rolling resistance are a torque.

    The rig is invalid if the wheel locks. bywire then warns.
    """

    name: ClassVar[str] = "wheel-on-drum"
    Memory: ClassVar = Memory
    Stimulus: ClassVar = Stimulus

    wheel = Part(road_wheel)
    tyre = Part(tyre, loss={"E_tyre": "work"})
    circuit = Part(pressure_loop, par="brake.circuit")
    disc = Part(brake_disc, par="brake.disc")
    W_drum = Integral("J", "work of the drum", role=Role("source", "drum"))
    E_brake = Integral("J", "brake and rolling resistance", role=Role("sink", "brake"))

    F = Wire("N", "braking force of the tire", 1e3)
    T = Wire("N*m", "torque that the brake and the rolling resistance can hold", 300.0)
    slip = Shown("1", "braking slip", 0.1)

    def wire(self, w: Self) -> None:
        """Connect wheel, tire and brake."""
        drum, surface = w.par.drum, adhesion.surface_of(w.par.drum.surface)
        limits = tyre.limits(
            tyre.Contact(drum.v, road_wheel.tread_speed(w.wheel.xe, w.wheel.par), *surface),
            w.tyre.par,
        )
        tread = road_wheel.tread_speed(w.wheel.x, w.wheel.par)
        w.tyre.u = tyre.Input(drum.v, tread, drum.N, *surface, limits.mu, limits.u)
        w.F = tyre.output(w.tyre.x, w.tyre.u, w.tyre.par).F
        w.circuit.u = pressure_loop.Input(w.m.p_ref)
        w.disc.u = brake_disc.Input(w.circuit.x.p)
        w.T = brake_disc.output(w.disc.u, w.disc.par).torque + road_wheel.rolling_resistance(
            drum.N, w.wheel.par
        )
        w.wheel.u = road_wheel.Input(w.F, -w.T)

    def power(self, w: Self) -> dict[str, float]:
        """Return the power of the drum and of the brake."""
        return {"W_drum": w.F * w.par.drum.v, "E_brake": w.T * w.wheel.x.omega}

    def record(self, w: Self) -> dict[str, float]:
        """Return the slip."""
        return {"slip": braking_slip(w.wheel.x.omega, w.par)}

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the task of slip control."""
        return (Task("slip", par.T_s, tick),)

    def watch(self, recording: Any, par: Any) -> list[str]:
        """Return the warnings about a recording."""
        warnings = super().watch(recording, par)
        if "omega" in recording and bool((recording["omega"] <= 0).any()):
            warnings.append(
                "the wheel locked, so the results are invalid. This rig would let the wheel turn "
                "backward"
            )
        return warnings

    def rest(self, par: Par) -> tuple[Any, Any]:
        """Return the wheel rolling freely on the drum."""
        state = self.state(wheel=road_wheel.State(par.drum.v / par.wheel.r))
        return state, zeros(Memory)


def braking_slip(omega: float, par: Par) -> float:
    """Return the slip relative to the drum."""
    return vehicle_speed.slip(par.drum.v, omega * par.wheel.r, par.slip.v_off)


def tick(x: Any, m: Memory, u: Stimulus, par: Par) -> Memory:
    """Run slip control once."""
    slip = braking_slip(x.omega, par)
    state, out = slip_pi.output(
        slip_pi.State(m.integral),
        slip_pi.Input(par.drum.v, u.slip_set, slip, u.p_set, u.p_set, u.p_set),
        par.T_s,
        par.slip,
    )
    return m._replace(
        p_ref=out.p, slip_hat=slip, slip_ref=u.slip_set, integral=state.integral, acts=out.lowered
    )
