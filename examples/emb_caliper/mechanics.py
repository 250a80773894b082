"""Mechanics of the brake, from the rotor to the pads, for any motor."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any, ClassVar, TypeVar

from bywire.authoring import Assembly, Bounds, Integral, Part, Role, Shown, Task, Wire
from bywire.core import ops
from bywire.plant import battery_supply, dc_motor, end_stop, floating_caliper, pad_hysteresis
from emb_caliper.elements import (
    ball_screw,
    load_cell,
    load_friction,
    planetary_gear,
    rotor,
)
from emb_caliper.parameters import BrakeParameters

ParT = TypeVar("ParT", bound=BrakeParameters)
MemoryT = TypeVar("MemoryT")


# Recorded signals of any motor: motion, loads and power, losses beyond the motor.
MOTION = (
    "F_cl",
    "F_ref",
    "F_meas",
    "F_used",
    "F_hat",
    "F_curve",
    "F_balance",
    "T_load",
    "balance_valid",
    "on_estimate",
    "theta_0_hat",
    "s_hat",
    "C_hat",
    "G_hat",
    "strokes",
    "x",
    "theta",
    "omega",
    "omega_ref",
    "i",
    "i_ref",
)
LOADS = (
    "torque",
    "T_fr",
    "F_stop",
    "stuck",
    "parked",
    "sat_speed",
    "sat_current",
    "sat_duty",
    "P_el",
    "E_source",
    "E_supply",
)
LOSSES = (
    "E_viscous",
    "E_friction",
    "E_caliper",
    "E_hysteresis",
    "E_stop",
    "E_stored",
    "t_stuck",
)


class CaliperBrake(Assembly[ParT, MemoryT]):
    """Parts and wires of a brake, for any motor.

    A brake replaces the DC motor if it has another, adds the wires of its electrics, and defines
    ``electrics``, ``source_power`` and the ticks of its ECU. It has one dry friction on the shaft,
    and contacts at the pads and two end stops.
    """

    laws: ClassVar[ModuleType]
    """module of the ECU's ticks"""
    frictions: ClassVar[tuple[str, ...]] = ("omega",)

    E_source = Integral("J", "energy from battery or source", role=Role("source", "source"))
    supply = Part(battery_supply, loss="E_supply")
    motor: Any = Part(dc_motor, loss="E_copper")
    rotor = Part(rotor, loss="E_viscous")
    dry = Part(load_friction, par="friction")
    E_friction = Integral("J", "dry friction loss", role=Role("sink", "dry friction"))
    gear = Part(planetary_gear)
    screw = Part(ball_screw, output=("x",))
    pads = Part(
        floating_caliper, par="caliper", output=("F_cl",), work="W_caliper", loss="E_caliper"
    )
    hysteresis = Part(pad_hysteresis, loss="E_hysteresis")
    force = Part(load_cell)
    stop = Part(end_stop, work="W_stop", loss="E_stop", rarely=True)
    t_stuck = Integral("s", "time stuck", role=Role("standstill"))

    i_dc = Wire("A", "battery current", 10.0)
    torque = Wire("N*m", "motor torque", 1.0)
    F_pads = Wire("N", "clamp force", 1e4)
    T_fr = Shown("N*m", "friction torque", 0.1)
    F_stop = Shown("N", "end stop load on the piston", 1e3)
    stuck = Shown("1", "shaft stuck")
    P_el = Shown("W", "electrical power from battery or source", 100.0)

    def electrics(self, w: Any) -> None:
        """Connect supply, power stage and motor, and set the motor torque."""
        raise NotImplementedError

    def source_power(self, w: Any) -> float:
        """Return the power of battery or source [W]."""
        raise NotImplementedError

    def sensed(self, law: Callable[..., Any]) -> Callable[[Any, Any, Any, Any], Any]:
        """Return a controller's tick with the sensor readings."""
        raise NotImplementedError

    def wire(self, w: Any) -> None:
        """Connect the parts: electrics, motion from rotor to pads, loads from pads to rotor."""
        self.electrics(w)
        piston = travel(w.rotor.x, w.par)
        w.pads.u = floating_caliper.Input(piston.x, piston.v)
        stop = w.par.stop
        w.stop.u = end_stop.Input(piston.x, piston.v, stop.x_rest, stop.x_end)
        w.hysteresis.u = pad_hysteresis.Input(piston.v, w.pads.f.F_cl)
        w.F_pads = (
            w.pads.f.F_cl + pad_hysteresis.output(w.hysteresis.x, w.hysteresis.par).F_hysteresis
        )
        w.force.u = load_cell.Input(w.F_pads)
        force = w.F_pads + end_stop.load(w.stop.f)
        carrier = _carrier(w.rotor.x, w.par)
        w.screw.u = ball_screw.Input(carrier.theta, carrier.omega, force)
        load = ball_screw.output(w.screw.u, w.screw.par).load
        w.gear.u = planetary_gear.Input(w.rotor.x.theta, w.rotor.x.omega, load)
        w.dry.u = load_friction.Input(w.rotor.x.omega, w.F_pads)
        load = planetary_gear.output(w.gear.u, w.gear.par).load
        w.rotor.u = rotor.Input(w.torque, load, 0.0)

    def friction(self, w: Any) -> tuple[Bounds, ...]:
        """Return the limits of the dry friction torque on the shaft."""
        limit = load_friction.output(w.dry.u, w.dry.par).torque
        return ((-limit, limit),)

    def power(self, w: Any) -> dict[str, float]:
        """Return the power of source and dry friction, and 1 while the shaft is stuck."""
        return {
            "E_source": self.source_power(w),
            "E_friction": load_friction.power_loss(w.reaction[0], w.rotor.x.omega),
            "t_stuck": ops.where(w.rotor.x.omega == 0, 1.0, 0.0),
        }

    def record(self, w: Any) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        return {
            "F_cl": w.F_pads,
            "T_fr": -w.reaction[0],
            "F_stop": end_stop.load(w.stop.f),
            "stuck": ops.where(w.rotor.x.omega == 0, 1.0, 0.0),
            "P_el": self.source_power(w),
        }

    def tasks(self, par: Any) -> tuple[Task, ...]:
        """Return the controllers of the drive mode, from the outer loop inward."""
        laws = self.laws
        current = Task("current", par.ecu.T_current, self.sensed(laws.current_tick))
        if par.drive == "voltage":
            return (Task("source", par.ecu.T_current, self.sensed(laws.source_tick)),)
        if par.drive == "current":
            return (current,)
        slow = [("force", laws.force_tick), ("speed", laws.speed_tick)]
        if par.ecu.estimation == "on":
            slow.insert(0, ("estimate", laws.estimate_tick))
        outer = tuple(Task(name, par.ecu.T_force, self.sensed(law)) for name, law in slow)
        return (*outer, current)

    def watch(self, recording: Any, par: Any) -> list[str]:
        """Return the warnings about a recording."""
        warnings = super().watch(recording, par)
        if "F_stop" in recording and bool((recording["F_stop"] != 0).any()):
            warnings.append("the piston reached an end stop")
        return warnings


def travel(x: rotor.State, par: Any) -> ball_screw.Output:
    """Return the motion of the piston."""
    carrier = _carrier(x, par)
    return ball_screw.output(ball_screw.Input(carrier.theta, carrier.omega, 0.0), par.screw)


def _carrier(x: rotor.State, par: Any) -> planetary_gear.Output:
    return planetary_gear.output(planetary_gear.Input(x.theta, x.omega, 0.0), par.gear)
