"""The brake at a wheel: reservoir, relay valve, chamber, rod, lever, caliper, tire and road."""

from __future__ import annotations

from typing import Any, ClassVar, Self

from bywire.authoring import Bounds, Integral, Part, Role, Shown, Task, Wire
from bywire.plant import (
    air,
    air_orifice,
    air_volume,
    brake_chamber,
    end_stop,
    floating_caliper,
    lever,
    relay_valve,
    road_wheel,
)
from bywire.vehicle import Corner, WheelSpeed, rolling_states
from truck_ebs import ecu
from truck_ebs.elements import push_rod
from truck_ebs.parameters import TruckParameters as Par


def _vehicle(label: str, returns: Any = "") -> Role:
    return Role("sink", label, returns=returns, book="vehicle")


class TruckEbs(Corner[Par, ecu.Memory]):
    """Two dry frictions: of rod and lever, and of the disc at the wheel."""

    name: ClassVar[str] = "truck-ebs"
    Memory: ClassVar = ecu.Memory
    Stimulus: ClassVar = ecu.Stimulus
    frictions: ClassVar[tuple[str, ...]] = ("v", "omega")
    shared: ClassVar[tuple[str, ...]] = ("gas",)

    E_source = Integral("J", "energy of the fed air", role=Role("source", "reservoir"))
    E_exhaust = Integral("J", "energy of the exhausted air", role=Role("sink", "exhausted air"))
    E_throttling = Integral("J", "throttling in both seats", role=Role("sink", "throttling"))
    E_walls = Integral(
        "J", "heat to the walls, work on ambient air", role=Role("sink", "walls", returns="any")
    )
    relay = Part(relay_valve, state={"s": "spool"}, output=("feed", "exhaust"))
    feed = Part(air_orifice)
    outlet = Part(air_orifice, par="exhaust")
    volume = Part(air_volume)
    chamber = Part(brake_chamber)
    rod = Part(push_rod, loss="E_rod")
    lever = Part(lever)
    E_friction = Integral("J", "friction of rod and lever", role=Role("sink", "dry friction"))
    caliper = Part(floating_caliper, output=("F_cl",), work="W_caliper", loss="E_caliper")
    stop = Part(end_stop, work="W_stop", loss="E_stop", which="retracted")
    turning = Part(road_wheel, par="wheel", outside=True)
    E_brake = Integral("J", "disc brake and rolling resistance", role=_vehicle("brake"))
    E_wheel = Shown("J", "energy of the wheel", role=_vehicle("wheel", "any"))

    p = Wire("Pa", "chamber pressure", 4e5)
    torque = Shown("N*m", "brake torque", 5e3)

    def wheel(self, w: Self) -> WheelSpeed:
        """Return the speed of the wheel."""
        return WheelSpeed(w.turning.x.omega, w.turning.xe.omega)

    def wire(self, w: Self) -> None:
        """Connect valve, chamber, rod and pads, and the road to the wheel."""
        par, gas = w.par, w.par.gas
        unloaded = brake_chamber.Input(w.rod.x.x, w.rod.x.v, 0.0)
        room = brake_chamber.output(unloaded, w.chamber.par)
        still = air_volume.Input(0.0, 0.0, room.V, room.V_rate)
        absolute = air_volume.pressure(w.volume.x, still, w.volume.par, gas)
        w.p = absolute - gas.p_atm
        w.relay.u = relay_valve.Input(w.m.p_control, w.p)
        seats = relay_valve.output(w.relay.x, w.relay.par)
        T = air_volume.temperature(w.volume.x, w.volume.par, gas)
        p_s = par.p_s + gas.p_atm
        w.feed.u = air_orifice.Input(p_s, absolute, gas.T_0, T, seats.feed)
        w.outlet.u = air_orifice.Input(absolute, gas.p_atm, T, gas.T_0, seats.exhaust)
        into = air_orifice.output(w.feed.u, w.feed.par, gas)
        out = air_orifice.output(w.outlet.u, w.outlet.par, gas)
        w.volume.u = air_volume.Input(into.mdot - out.mdot, into.H - out.H, room.V, room.V_rate)
        w.chamber.u = brake_chamber.Input(w.rod.x.x, w.rod.x.v, w.p)
        force = brake_chamber.output(w.chamber.u, w.chamber.par).F
        beyond = 10.0 * w.chamber.par.x_table[-1]  # only the retracted stop is within the travel
        w.stop.u = end_stop.Input(w.rod.x.x, w.rod.x.v, 0.0, beyond)
        # The travel of the pads is affine in the rod's travel, with a slope at the predicted one.
        slope = lever.slope(w.rod.xe.x, w.lever.par)
        y = lever.travel(w.rod.xe.x, w.lever.par) + slope * (w.rod.x.x - w.rod.xe.x)
        w.caliper.u = floating_caliper.Input(y, slope * w.rod.x.v)
        w.lever.u = lever.Input(w.rod.xe.x, w.rod.x.v, w.caliper.f.F_cl)
        load = lever.load(w.lever.u, w.lever.par) + end_stop.load(w.stop.f)
        w.rod.u = push_rod.Input(force, load, 0.0)
        road = self.tyre_torque(w)
        w.turning.u = road_wheel.Input(road / w.turning.par.r, 0.0)

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return the bounds of both frictions; at rest, each is between them."""
        rolling = road_wheel.rolling_resistance(w.N_x, w.turning.par)
        most = self.brake_torque(w) + rolling
        rod = lever.friction(w.lever.u, w.lever.par)
        return ((-rod, rod), (-most, most))

    def brake_torque(self, w: Self) -> float:
        """Return the largest torque of the disc brake [N m]."""
        disc = w.par.disc
        torque: float = 2.0 * disc.mu * disc.r_eff * w.caliper.f.F_cl
        return torque

    def power(self, w: Self) -> dict[str, float]:
        """Return the powers that do not follow from the parts."""
        return {
            **super().power(w),
            **_air_powers(w),
            "E_friction": -w.reaction[0] * w.rod.x.v,
            "E_brake": -w.reaction[1] * w.turning.x.omega,
        }

    def record(self, w: Self) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        return {
            **super().record(w),
            "torque": -w.reaction[1],
            "E_wheel": road_wheel.energy(w.turning.x, w.turning.par),
        }

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the ECU's task."""
        return (Task("ecu", par.ecu.T_s, ecu.tick),)

    def rest(self, par: Par) -> tuple[Any, ecu.Memory]:
        """Return the vehicle at rest with released brakes."""
        return rolling(par, 0.0)


def _air_powers(w: TruckEbs) -> dict[str, float]:
    """Return the powers of the air: exergies of isothermal air, else enthalpies and heat."""
    gas, volume = w.par.gas, w.volume
    into = air_orifice.output(w.feed.u, w.feed.par, gas)
    out = air_orifice.output(w.outlet.u, w.outlet.par, gas)
    if volume.par.law == "isothermal":
        lost = air_orifice.power_loss(w.feed.u, w.feed.par, gas)
        lost = lost + air_orifice.power_loss(w.outlet.u, w.outlet.par, gas)
        return {
            "E_source": into.mdot * air.exergy(w.feed.u.p_a, gas),
            "E_exhaust": out.mdot * air.exergy(w.outlet.u.p_b, gas),
            "E_throttling": lost,
            "E_walls": 0.0 * lost,
        }
    heat = volume.par.G_w * (volume.x.T - gas.T_0)
    return {
        "E_source": into.H,
        "E_exhaust": out.H,
        "E_throttling": 0.0 * heat,
        "E_walls": heat + gas.p_atm * volume.u.V_rate,
    }


def rolling(par: Par, v: float) -> tuple[Any, ecu.Memory]:
    """Return state and memory of a vehicle that rolls at a speed [m/s] with released brakes."""
    gas = par.gas
    x = -par.chamber.F_s0 / (par.stop.k_stop + par.chamber.k_s)  # the spring presses on its stop
    still = brake_chamber.Input(x, 0.0, 0.0)
    V = brake_chamber.output(still, par.chamber).V
    m = gas.p_atm * V / (air.gas_constant(gas) * gas.T_0)
    state = TruckEbs.state(
        **rolling_states(v),
        relay=relay_valve.State(0.0),
        volume=air_volume.State(m, gas.T_0),
        rod=push_rod.State(x, 0.0),
        turning=road_wheel.State(v / par.wheel.r),
    )
    return state, ecu.Memory(0.0, 0.0)
