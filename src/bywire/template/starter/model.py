"""Model of the brake starter: parts, wires, and the inputs of each element.

States, masses, balances, stored energy and simple losses follow from the elements.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple, Self

from bywire.authoring import Assembly, Bounds, Integral, Limited, Part, Role, Signal, Task, Wire
from bywire.plant import dc_motor
from bywire.template.starter.elements import caliper_spring, spindle
from bywire.template.starter.laws import force_control
from bywire.template.starter.parameters import Parameters


class Stimulus(NamedTuple):
    """External inputs."""

    F_set: Annotated[float, Signal("N", "demanded clamp force", 1e4)]


class Memory(NamedTuple):
    """Memory of the controller between its ticks."""

    v: Annotated[float, Signal("V", "motor voltage", 6.0), Limited("control.v_max")]
    v_i: Annotated[float, Signal("V", "integral term", 1.0)]


class StarterActuator(Assembly[Parameters, Memory]):
    """Model of the brake: one dry friction, on the spindle."""

    name: ClassVar[str] = "starter-actuator"
    Memory: ClassVar = Memory
    Stimulus: ClassVar = Stimulus
    frictions: ClassVar[tuple[str, ...]] = ("omega",)

    E_source = Integral("J", "energy from the supply", role=Role("source", "supply"))
    motor = Part(dc_motor, loss="E_copper")
    spindle = Part(spindle, loss="E_damping")
    E_friction = Integral("J", "loss of the dry friction", role=Role("sink", "dry friction"))
    caliper = Part(caliper_spring)

    travel = Wire("m", "travel of the pads", 5e-4)
    F = Wire("N", "clamp force", 1e4)

    def wire(self, w: Self) -> None:
        """Connect the parts, in the physical order."""
        nut = spindle.output(w.spindle.x, w.spindle.par)
        w.travel = nut.x
        w.caliper.u = caliper_spring.Input(w.travel, nut.v)
        w.F = caliper_spring.output(w.caliper.u, w.caliper.par)
        w.motor.u = dc_motor.Input(w.m.v, w.spindle.x.omega)
        torque = dc_motor.output(w.motor.x, w.motor.par).torque
        w.spindle.u = spindle.Input(torque, w.F)

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return the limits of the dry friction, between which it has any value at rest."""
        T = spindle.dry_friction(w.spindle.u, w.spindle.par)
        return ((-T, T),)

    def power(self, w: Self) -> dict[str, float]:
        """Return the powers that do not follow from the parts."""
        return {
            "E_source": w.m.v * w.motor.x.i,
            "E_friction": -w.reaction[0] * w.spindle.x.omega,
        }

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        """Return the controller and its sample time."""
        return (Task("force", par.T_s, _control),)


def _control(x: Any, m: Memory, u: Stimulus, par: Parameters) -> Memory:
    """Run the force control once."""
    F = clamp_force(x.theta, par)
    seen = force_control.Input(u.F_set, F, x.omega)
    state, out = force_control.output(force_control.State(m.v_i), seen, par.T_s, par.control)
    return Memory(v=out.v, v_i=state.v_i)


def clamp_force(theta: float, par: Parameters) -> float:
    """Return the clamp force [N] at an angle [rad]."""
    nut = spindle.output(spindle.State(theta, 0.0), par.spindle)
    return caliper_spring.output(caliper_spring.Input(nut.x, nut.v), par.caliper)
