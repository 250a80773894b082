"""The caliper as a parking brake: a small motor, a lead screw or a pawl, and a disc that cools."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple, Self

from pydantic import model_validator

from bywire.authoring import (
    Assembly,
    Bounds,
    Duration,
    Integral,
    ParameterSet,
    Part,
    Role,
    RuleError,
    Shown,
    Signal,
    Task,
    Torque,
    Wire,
    zeros,
)
from bywire.control import parking
from bywire.core import ops
from bywire.plant import (
    battery_supply,
    dc_motor,
    floating_caliper,
    h_bridge,
    lead_screw,
    pawl_lock,
    shaft,
    thermal_growth,
)
from emb_caliper.elements import planetary_gear

RETURNS = Role("sink", "growth of the disc", returns="any")


class Parameters(ParameterSet):
    """The whole parking brake. Pawl and dry friction act on the motor shaft."""

    supply: battery_supply.Parameters
    bridge: h_bridge.Parameters
    motor: dc_motor.Parameters
    shaft: shaft.Parameters
    T_fr: Torque
    """dry friction of motor and gear"""
    gear: planetary_gear.Parameters
    screw: lead_screw.Parameters
    caliper: floating_caliper.Parameters
    disc: thermal_growth.Parameters
    pawl: pawl_lock.Parameters
    parking: parking.Parameters
    T_s: Duration
    """sample time of the park-brake law"""

    @model_validator(mode="after")
    def _holds_and_releases(self) -> Parameters:
        locks = {"off": "screw"}.get(self.pawl.law, self.pawl.law)
        if self.parking.lock != locks:
            raise RuleError("parking.lock", repr(self.parking.lock), f"{locks!r}, as pawl.law")
        ratio = planetary_gear.ratio(self.gear)
        loads = {
            "apply": lead_screw.apply_torque(self.parking.F_park, self.screw),
            "release": lead_screw.release_torque(self.parking.F_park, self.screw),
        }
        most = ratio * (stall_torque(self) - self.T_fr)
        for name, load in loads.items():
            if self.parking.law == "force" and not load < most:
                F = self.parking.F_park / 1e3
                raise RuleError(
                    "screw.mu",
                    f"{self.screw.mu:g}",
                    f"smaller, or parking.F_park <= {F * most / load:.3g} kN",
                    f"the screw needs {load:.3g} N*m to {name} F_park = {F:g} kN, and the motor "
                    f"has {most:.3g} N*m",
                )
        if self.parking.lock == "screw" and loads["release"] < -ratio * self.T_fr:
            raise RuleError(
                "pawl.law",
                "'off'",
                "'mono-stable' or 'bi-stable'",
                "without current, the load turns this screw back",
            )
        return self


def stall_torque(par: Any) -> float:
    """Return the motor torque at rest [N m]."""
    R = par.motor.R_m + par.supply.R_bat * par.bridge.D_max * par.bridge.D_max
    v = par.bridge.D_max * par.supply.V_bat
    return float(par.motor.K_e * v / R)


class Memory(NamedTuple):
    """Duty cycle, state of the law, and the pawl."""

    duty: Annotated[float, Signal("1", "duty cycle", 0.5)]
    mode: Annotated[float, Signal("1", "mode (released, clamps, holds, unlocks, releases)", 2.0)]
    elapsed: Annotated[float, Signal("s", "time in this mode", 1.0)]
    clamped: Annotated[float, Signal("1", "times clamped again", 1.0)]
    powered: Annotated[float, Signal("1", "solenoid with current", 0.5)]
    engaged: Annotated[float, Signal("1", "pawl engaged", 0.5)]
    tooth: Annotated[float, Signal("1", "tooth of the pawl", 100.0)]


class Stimulus(NamedTuple):
    """Demand."""

    park: Annotated[float, Signal("1", "park demand", 0.5, low=0.0, high=1.0)]


class ParkingBrake(Assembly[Parameters, Memory]):
    """One dry friction on the motor shaft, which contains the friction of the screw."""

    name: ClassVar[str] = "emb-parking"
    Memory: ClassVar = Memory
    Stimulus: ClassVar = Stimulus
    frictions: ClassVar[tuple[str, ...]] = ("omega",)

    E_source = Integral("J", "energy from the battery", role=Role("source", "battery"))
    supply = Part(battery_supply, loss="E_supply")
    motor = Part(dc_motor, loss="E_copper")
    shaft = Part(shaft, loss="E_viscous")
    E_friction = Integral("J", "dry friction loss", role=Role("sink", "dry friction"))
    gear = Part(planetary_gear)
    screw = Part(lead_screw)
    pads = Part(
        floating_caliper, par="caliper", output=("F_cl",), work="W_caliper", loss="E_caliper"
    )
    disc = Part(thermal_growth, state={"T": "T_disc"})
    E_growth = Integral("J", "work on the growing disc", role=RETURNS)
    pawl = Part(pawl_lock)
    E_pawl = Integral("J", "loss at the pawl", role=Role("sink", "pawl", returns="any"))

    v_bus = Wire("V", "bus voltage", 12.0)
    travel = Wire("m", "piston travel", 1e-3)
    stuck = Shown("1", "shaft stuck")
    T_fr = Shown("N*m", "friction torque on the motor shaft", 0.1)
    T_pawl = Shown("N*m", "torque of the pawl", 0.3)

    def wire(self, w: Self) -> None:
        """Connect the parts."""
        i, omega = w.motor.x.i, w.shaft.x.omega
        w.supply.u = battery_supply.Input(w.m.duty * i)
        w.v_bus = battery_supply.output(w.supply.u, w.supply.par).v_bus
        v = h_bridge.output(h_bridge.Input(w.m.duty, w.v_bus, i)).v
        w.motor.u = dc_motor.Input(v, omega)
        ratio, slope = planetary_gear.ratio(w.gear.par), lead_screw.slope(w.screw.par)
        w.travel = slope * w.shaft.x.theta / ratio
        disc = thermal_growth.output(w.disc.x, w.disc.par)
        w.pads.u = floating_caliper.Input(w.travel + disc.growth, slope * omega / ratio + disc.rate)
        force = w.pads.f.F_cl
        w.screw.u = lead_screw.Input(-force, omega / ratio)
        load = lead_screw.load_torque(w.screw.u, w.screw.par)
        w.gear.u = planetary_gear.Input(w.shaft.x.theta, omega, load)
        at_motor = planetary_gear.output(w.gear.u, w.gear.par).load
        latch = pawl_lock.Latch(w.m.engaged, w.m.tooth, w.m.powered)
        target = pawl_lock.target(latch, w.pawl.par)
        w.pawl.u = pawl_lock.Input(w.shaft.x.theta, omega, target)
        torque = dc_motor.output(w.motor.x, w.motor.par).torque
        if pawl_lock.exists(w.pawl.par):
            torque = torque + w.pawl.f.T_pawl
        w.shaft.u = shaft.Input(torque + at_motor, 0.0)

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return the bounds of the dry friction on the motor shaft."""
        ratio, T = planetary_gear.ratio(w.gear.par), lead_screw.friction(w.screw.u, w.screw.par)
        return ((-w.par.T_fr - T.T_p / ratio, w.par.T_fr + T.T_n / ratio),)

    def power(self, w: Self) -> dict[str, float]:
        """Return the powers that do not follow from the parts."""
        rate = thermal_growth.output(w.disc.x, w.disc.par).rate
        is_there, pawl = pawl_lock.exists(w.pawl.par), w.pawl
        lost = pawl_lock.power_loss(pawl.x, pawl.u, pawl.f, pawl.par) if is_there else 0.0 * rate
        return {
            "E_source": battery_supply.power_source(w.supply.u, w.supply.par),
            "E_friction": -w.reaction[0] * w.shaft.x.omega,
            "E_growth": -w.pads.f.F_cl * rate,
            "E_pawl": lost,
        }

    def record(self, w: Self) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        return {
            "stuck": ops.where(w.shaft.x.omega == 0, 1.0, 0.0),
            "T_fr": -w.reaction[0],
            "T_pawl": w.pawl.f.T_pawl if pawl_lock.exists(w.pawl.par) else 0.0 * w.reaction[0],
        }

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        """Return the park-brake law."""
        return (Task("parking", par.T_s, tick),)

    def rest(self, par: Parameters) -> tuple[Any, Memory]:
        """Return the released brake with a cold disc."""
        return released(par, par.disc.T_a)


def clamp_force(x: Any, par: Parameters) -> float:
    """Return the clamp force [N] that the ECU measures or estimates without error."""
    slope = lead_screw.slope(par.screw) / planetary_gear.ratio(par.gear)
    disc = thermal_growth.output(thermal_growth.State(x.T_disc), par.disc)
    piston = floating_caliper.Input(slope * x.theta + disc.growth, slope * x.omega + disc.rate)
    return floating_caliper.forces(piston, par.caliper).F_cl


def tick(x: Any, m: Memory, u: Stimulus, par: Parameters) -> Memory:
    """Run the park-brake law once, and move the pawl."""
    state, out = parking.output(
        parking.State(m.mode, m.elapsed, m.clamped, m.powered),
        parking.Input(u.park, clamp_force(x, par), x.i, x.theta, m.engaged),
        par.T_s,
        par.parking,
    )
    before = pawl_lock.Latch(m.engaged, m.tooth, m.powered)
    pawl = pawl_lock.State(x.theta_stop)
    still = pawl_lock.Input(x.theta, x.omega, pawl_lock.target(before, par.pawl))
    torque = pawl_lock.forces(pawl, still, par.pawl).T_pawl
    after = pawl_lock.latch(
        before, pawl_lock.Command(x.theta, x.omega, torque, out.powered), par.pawl
    )
    return Memory(
        duty=par.bridge.D_max * out.drive,
        mode=state.mode,
        elapsed=state.elapsed,
        clamped=state.clamped,
        powered=state.powered,
        engaged=after.engaged,
        tooth=after.tooth,
    )


def released(par: Parameters, T_disc: float) -> tuple[Any, Memory]:
    """Return state and memory of the released brake, with a disc of a temperature [K]."""
    theta = par.parking.theta_open
    is_engaged = 1.0 if par.pawl.law == "mono-stable" else 0.0
    latch = pawl_lock.Latch(is_engaged, ops.floor(theta / par.pawl.delta), 0.0)
    state = ParkingBrake.state(
        shaft=shaft.State(theta, 0.0),
        disc=thermal_growth.State(T_disc),
        pawl=pawl_lock.State(pawl_lock.target(latch, par.pawl)),
    )
    return state, zeros(Memory)._replace(engaged=latch.engaged, tooth=latch.tooth)
