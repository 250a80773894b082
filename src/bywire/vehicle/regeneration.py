"""A motor at a braked wheel: it recovers energy, and a law blends it with the friction brake.

A quarter car inherits from `RegeneratingCorner` instead of `Corner`, and a two-wheeler from
`RegeneratingTwoWheeler`. Its parameters have a group ``regeneration``, its stimulus has the fields
of `Demand`, and its memory has those of `Memory`. The friction brake follows ``T_brake``, the
demand that arrives over the bus.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, ClassVar, NamedTuple, Self

from annotated_types import Ge
from pydantic import model_validator

from bywire.control import blending, torque_bus
from bywire.core import ops
from bywire.core.assembly import Assembly, MemoryT, ParT
from bywire.core.faults import Channel
from bywire.core.model import Task
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.parts import Part, Shown
from bywire.core.quantities import Duration, TimeConstant
from bywire.core.signals import Limited, Role, Signal, joined, zeros
from bywire.plant import traction_battery, wheel_motor
from bywire.vehicle.corner import Corner
from bywire.vehicle.two_wheeler import TwoWheeler

BOOK = "battery"


class Parameters(ParameterSet):
    """Motor, battery, and the ECU that blends motor and friction brake."""

    motor: wheel_motor.Parameters
    battery: traction_battery.Parameters
    blending: blending.Parameters
    bus: torque_bus.Parameters
    T_s: Duration
    """sample time"""
    t_ahead: TimeConstant
    """look-ahead time of the law "predicted": delay of the bus plus lag of the brake"""
    tau_a: TimeConstant
    """time constant of the deceleration filter (law "predicted")"""

    @model_validator(mode="after")
    def _bus_holds_the_delay(self) -> Parameters:
        longest = torque_bus.SLOTS * self.T_s
        if self.bus.T_d > longest * (1.0 + 1e-9):
            limit = f"<= {torque_bus.SLOTS} T_s = {longest:g} s"
            raise RuleError("bus.T_d", f"{self.bus.T_d:g} s", limit)
        return self


class Demand(NamedTuple):
    """Demands of the driver."""

    T_demand: Annotated[float, Signal("N*m", "demanded braking torque", 300.0), Ge(0)]
    T_coast: Annotated[float, Signal("N*m", "torque of the released accelerator", 50.0), Ge(0)]


class Law(NamedTuple):
    """Memory of the blending law between its ticks."""

    T_m_ref: Annotated[
        float,
        Signal("N*m", "motor torque set point", 300.0, set_point_of="T_m"),
        Limited("regeneration.motor.T_max"),
    ]
    T_limit: Annotated[float, Signal("N*m", "limit of the motor torque", 300.0)]
    T_friction: Annotated[float, Signal("N*m", "demand that is sent to the brake", 300.0)]
    T_brake: Annotated[float, Signal("N*m", "demand that arrives at the brake", 300.0)]
    t_wait: Annotated[float, Signal("s", "time until the motor may brake after slip control", 0.5)]
    a_m_hat: Annotated[float, Signal("m/s**2", "deceleration seen by the blending law", 5.0)]
    v_m_last: Annotated[float, Signal("m/s", "wheel speed at the last tick of blending", 20.0)]


def _on_the_bus(prefix: str, label: str) -> Any:
    """Return the memory of a bus, whose fields begin with a prefix."""
    make: Callable[..., Any] = NamedTuple
    slot = Annotated[float, Signal("N*m", f"{label}, in transit on the bus", 300.0)]
    return make("Bus", [(f"{prefix}_{name}", slot) for name in torque_bus.State._fields])


_SENT, _REPORT = (
    _on_the_bus("sent", "demand on the friction brake"),
    _on_the_bus("report", "motor torque"),
)
Memory: Any = joined(__name__, "Memory", Law, _SENT, _REPORT)
"""memory of the blending law and of the bus"""


CHANNELS = (
    Channel(
        "wheel_motor", "command of the wheel motor", "N*m", "T_m_ref", "drive", task="blending"
    ),
    Channel("motor_report", "torque that the wheel motor reports", "N*m", "T_m", offset=10.0),
    Channel("brake_demand", "demand on the friction brake", "N*m", "T_brake", "drive"),
)
"""signals that faults can corrupt, for the `Channels` of a vehicle with regeneration"""


class Readings(NamedTuple):
    """Demands, and readings of motor, wheel, battery and slip control at a tick."""

    T_demand: float
    T_coast: float
    T_m: float
    omega: float
    r: float
    soc: float
    slip_acts: float


def tick(seen: Readings, m: Any, par: Parameters) -> Any:
    """Run the blending law once, between both directions of the bus.

    ``m``: a memory with the fields of `Memory`.
    """
    T, v = par.T_s, seen.omega * seen.r
    slowing = (m.v_m_last - v) / T
    a_hat = m.a_m_hat + T / (par.tau_a + T) * (slowing - m.a_m_hat)
    ahead = ops.fmax(v - par.t_ahead * a_hat, 0.0)
    P_bat = traction_battery.charging_limit(traction_battery.State(seen.soc), par.battery)
    now, then = (wheel_motor.limit(each / seen.r, each, P_bat, par.motor) for each in (v, ahead))
    m, reported = _transmitted("report", seen.T_m, m, par)
    u = blending.Input(seen.T_demand, seen.T_coast, now, then, reported, seen.slip_acts)
    state, out = blending.output(blending.State(m.T_m_ref, m.t_wait), u, T, par.blending)
    m, received = _transmitted("sent", out.T_friction, m, par)
    return m._replace(
        T_m_ref=state.T_m,
        t_wait=state.wait,
        T_limit=now,
        T_friction=out.T_friction,
        T_brake=received,
        a_m_hat=a_hat,
        v_m_last=v,
    )


def _transmitted(prefix: str, sent: float, m: Any, par: Parameters) -> tuple[Any, float]:
    """Return the memory after a value is sent over the bus, and the value that arrives."""
    names = [f"{prefix}_{name}" for name in torque_bus.State._fields]
    state = torque_bus.State(*(getattr(m, name) for name in names))
    state, out = torque_bus.output(state, torque_bus.Input(sent), par.T_s, par.bus)
    return m._replace(**dict(zip(names, state, strict=True))), out.T_received


def awake(v: float) -> dict[str, float]:
    """Return the memory of the blending law at a speed [m/s], without demand."""
    return zeros(Memory)._replace(v_m_last=v)._asdict()  # type: ignore[no-any-return]


def charged(soc: float) -> dict[str, Any]:
    """Return the states of motor and battery at a state of charge, without torque."""
    return {"motor": wheel_motor.State(0.0), "battery": traction_battery.State(soc)}


# --- Motor and battery at a wheel


class Regenerating(Assembly[ParT, MemoryT]):
    """Motor, battery and blending law; their parameters are in ``regeneration``."""

    motor = Part(
        wheel_motor,
        par="regeneration.motor",
        state={"T": "T_m"},
        outside=True,
        loss={"E_recovered": "recovered_power", "E_drive": "power_loss"},
    )
    battery = Part(
        traction_battery, par="regeneration.battery", outside=True, loss="E_battery_loss"
    )
    E_charged = Shown("J", "recovered energy", role=Role("source", "recovered", book=BOOK))
    E_battery = Shown(
        "J", "energy of the battery", role=Role("sink", "battery", book=BOOK, returns="any")
    )

    def slip_acts(self, m: Any) -> float:
        """Return whether slip control acts, above 0.5; by default, there is no slip control."""
        return 0.0

    def demands(self, m: Any, u: Any, par: ParT) -> tuple[float, float]:
        """Return the torques that pedal and released accelerator demand [N m].

        If there is slip control, the first one is the pedal's demand after slip control.
        """
        return u.T_demand, u.T_coast

    def motor_wheel(self, x: Any, par: ParT) -> tuple[float, float]:
        """Return the speed [rad/s] and the rolling radius [m] of the motor's wheel."""
        raise NotImplementedError

    def braking(self, w: Self, omega: float) -> float:
        """Wire motor and battery at a wheel speed, and return the motor's torque [N m]."""
        w.motor.u = wheel_motor.Input(w.m.T_m_ref, omega)  # type: ignore[attr-defined]
        w.battery.u = traction_battery.Input(
            wheel_motor.recovered_power(w.motor.x, w.motor.u, w.motor.par)
        )
        return w.motor.x.T

    def record(self, w: Self) -> dict[str, float]:
        """Return the energy balance of the battery."""
        return {
            **super().record(w),
            "E_charged": w.flow.E_recovered,
            "E_battery": traction_battery.energy(w.battery.x, w.battery.par),
        }

    def tasks(self, par: ParT) -> tuple[Task, ...]:
        """Return the blending law, then the brake's tasks."""
        ours: Parameters = par.regeneration  # type: ignore[attr-defined]
        return (Task("blending", ours.T_s, self._blended), *super().tasks(par))

    def _blended(self, x: Any, m: Any, u: Any, par: Any) -> Any:
        omega, r = self.motor_wheel(x, par)
        seen = Readings(*self.demands(m, u, par), x.T_m, omega, r, x.soc, self.slip_acts(m))
        return tick(seen, m, par.regeneration)


class RegeneratingCorner(Regenerating[ParT, MemoryT], Corner[ParT, MemoryT]):
    """A quarter car with a motor at its wheel. The state of the wheel's speed is ``turns``."""

    turns: ClassVar[str] = "omega"

    def motor_wheel(self, x: Any, par: Any) -> tuple[float, float]:
        """Return speed and radius of the wheel."""
        return getattr(x, self.turns), par.corner.r

    def motor_torque(self, w: Self) -> float:
        """Return the braking torque of the motor."""
        return self.braking(w, self.wheel(w).x)


class RegeneratingTwoWheeler(Regenerating[ParT, MemoryT], TwoWheeler[ParT, MemoryT]):
    """A two-wheeler with a motor at its rear wheel."""

    def motor_wheel(self, x: Any, par: Any) -> tuple[float, float]:
        """Return speed and radius of the rear wheel."""
        return x.omega_r, par.vehicle.rear_wheel.r

    def motor_torques(self, w: Self) -> tuple[float, float]:
        """Return the braking torque of the motor, at the rear wheel."""
        return 0.0, self.braking(w, w.rear.x.omega)
