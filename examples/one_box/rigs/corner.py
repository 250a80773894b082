"""The brake at a front wheel of a car on the road, with anti-lock control."""

from __future__ import annotations

from typing import Any, ClassVar, Self

from bywire.authoring import Bounds, Integral, Part, Shown, Task, zeros
from bywire.plant import brake_disc, road, road_wheel, wheel_encoder
from bywire.vehicle import (
    Corner,
    CornerParameters,
    WheelSpeed,
    rolling_states,
    slip_control,
    vehicle_sink,
)
from one_box import antilock
from one_box.hydraulics import released_memory
from one_box.laws import valve_pressure
from one_box.modulator import Modulator, ModulatorParameters, modulator_parts


class OneBoxCornerParameters(ModulatorParameters):
    """The brake, its wheel, and a quarter of the car."""

    disc: brake_disc.Parameters
    wheel: road_wheel.Parameters
    corner: CornerParameters
    antilock: slip_control.Parameters
    valves: valve_pressure.Parameters


_DISC = 2  # place of the disc among the dry frictions


class OneBoxCorner(Corner[OneBoxCornerParameters, Any], Modulator[OneBoxCornerParameters, Any]):
    """The brake at a wheel. A third dry friction acts on the disc."""

    name: ClassVar[str] = "one-box-corner"
    Memory: ClassVar = antilock.Memory
    Stimulus: ClassVar = antilock.Stimulus
    frictions: ClassVar[tuple[str, ...]] = ("omega", "omega_p", "omega_w")

    disc = Part(brake_disc)
    turning = Part(
        road_wheel,
        par="wheel",
        outside=True,
        state={"omega": "omega_w"},
        labels={"omega": "wheel speed"},
    )
    encoder = Part(
        wheel_encoder,
        par="antilock.encoder",
        state={"theta": "phi_w"},
        labels={"theta": "wheel angle"},
    )
    E_brake = Integral("J", "disc brake and rolling resistance", role=vehicle_sink("brake"))
    E_wheel = Shown("J", "energy of the wheel", role=vehicle_sink("wheel", "any"))
    T_brake = Shown("N*m", "brake torque", 500.0)

    def wheel(self, w: Self) -> WheelSpeed:
        """Return the speed of the wheel."""
        return WheelSpeed(w.turning.x.omega, w.turning.xe.omega)

    def wire(self, w: Self) -> None:
        """Connect the brake, and the road to the wheel."""
        super().wire(w)
        w.disc.u = brake_disc.Input(w.caliper.x.p)
        w.turning.u = road_wheel.Input(self.tyre_torque(w) / w.turning.par.r, 0.0)
        w.encoder.u = wheel_encoder.Input(w.turning.x.omega)

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return the bounds of the frictions of shaft, pump and disc."""
        rolling = road_wheel.rolling_resistance(w.N_x, w.turning.par)
        most = brake_disc.output(w.disc.u, w.disc.par).torque + rolling
        return (*super().friction(w), (-most, most))

    def power(self, w: Self) -> dict[str, float]:
        """Return the powers that do not follow from the parts."""
        return {**super().power(w), "E_brake": -w.reaction[_DISC] * w.turning.x.omega}

    def record(self, w: Self) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        return {
            **super().record(w),
            "T_brake": -w.reaction[_DISC],
            "E_wheel": road_wheel.energy(w.turning.x, w.turning.par),
        }

    def antilock(self, par: Any) -> tuple[Task, ...]:
        """Return the tasks of anti-lock control or of commanded valves, and the valves' delays."""
        T = par.antilock.T_s
        coils = Task("coils", T, _coils)
        if par.antilock.abs == "off":
            return (Task("valves", T, _sampled), coils)
        return (Task("slip", T, _slip), Task("valves", T, _valves), coils)

    def rest(self, par: Any) -> tuple[Any, Any]:
        """Return the vehicle at rest with released brakes."""
        return rolling(par, 0.0)


def _slip(x: Any, m: Any, u: Any, par: OneBoxCornerParameters) -> Any:
    """Read the wheel, and run slip control once."""
    edge = wheel_encoder.reading(
        wheel_encoder.State(x.phi_w), wheel_encoder.Input(x.omega_w), par.antilock.encoder
    )
    weight = par.corner.body.g * road.slope(x.s, par.corner.road).sine
    tread = x.omega_w * par.corner.r
    seen = slip_control.Readings(x.v_x, tread, edge.angle, edge.age, weight, 1.0)
    return slip_control.tick(seen, m, par.antilock.slip.k_hat * m.p_ref, par.antilock)


def _valves(x: Any, m: Any, u: Any, par: OneBoxCornerParameters) -> Any:
    return antilock.tick(m, x.p_mc, par)


def _sampled(x: Any, m: Any, u: Any, par: OneBoxCornerParameters) -> Any:
    return antilock.sample(m, u)


def _coils(x: Any, m: Any, u: Any, par: OneBoxCornerParameters) -> Any:
    return antilock.coils(m, par)


def rolling(par: OneBoxCornerParameters, v: float) -> tuple[Any, Any]:
    """Return state and memory of a car that rolls at a speed [m/s] with released brakes."""
    state = OneBoxCorner.state(
        **modulator_parts(par), **rolling_states(v), turning=road_wheel.State(v / par.wheel.r)
    )
    awake = slip_control.awake(v, par.antilock)
    held = released_memory(par) | awake | {"building": 1.0}
    return state, zeros(antilock.Memory)._replace(**held)
