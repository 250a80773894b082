"""The brake from the relay valve to the pads, and the same brake at a wheel on a road."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple, TypeVar

from bywire.authoring import Assembly, Bounds, Integral, Part, Role, Shown, Task, Wire
from bywire.core import ops
from bywire.plant import (
    air,
    air_orifice,
    air_volume,
    anti_alias_filter,
    brake_chamber,
    end_stop,
    floating_caliper,
    lever,
    relay_valve,
    road_wheel,
)
from bywire.vehicle import Corner, WheelSpeed, rolling_states, vehicle_sink
from truck_ebs import ecu
from truck_ebs.elements import push_rod
from truck_ebs.parameters import TruckParameters

ParT = TypeVar("ParT", bound=TruckParameters)
MemoryT = TypeVar("MemoryT")


class Air(NamedTuple):
    """Air at a port: absolute pressure [Pa] and temperature [K]."""

    p: float
    T: float


class Flow(NamedTuple):
    """Flow of air: mass [kg/s] and enthalpy [W]."""

    mdot: float
    H: float

    def minus(self, other: Flow | air_orifice.Output) -> Flow:
        """Return the difference of two flows."""
        return Flow(self.mdot - other.mdot, self.H - other.H)


class AirBrake(Assembly[ParT, MemoryT]):
    """The brake without its wheel. Rod and lever have dry friction.

    A variant may replace the reservoir (`reservoir`), the valves between reservoir and chamber
    (`valves`), and the list of orifices (`orifices`), and add a force on the rod (`pushed`).
    """

    frictions: ClassVar[tuple[str, ...]] = ("v",)
    shared: ClassVar[tuple[str, ...]] = ("gas",)

    E_source = Integral("J", "energy of the fed air", role=Role("source", "reservoir"))
    E_exhaust = Integral("J", "energy of the exhausted air", role=Role("sink", "exhausted air"))
    E_throttling = Integral("J", "throttling and leaks", role=Role("sink", "throttling"))
    E_walls = Integral(
        "J", "heat to the walls, work on ambient air", role=Role("sink", "walls", returns="any")
    )
    m_fed = Integral("kg", "air from reservoir or compressor")
    m_out = Integral("kg", "exhausted and leaked air")
    relay = Part(relay_valve, state={"s": "spool"}, output=("feed", "exhaust"))
    feed = Part(air_orifice)
    outlet = Part(air_orifice, par="exhaust")
    volume = Part(air_volume, which="chamber")
    sensor = Part(anti_alias_filter, par="ecu.filter", suffix="_p", which="chamber pressure")
    chamber = Part(brake_chamber)
    rod = Part(push_rod, loss="E_rod")
    lever = Part(lever)
    E_friction = Integral("J", "friction of rod and lever", role=Role("sink", "dry friction"))
    caliper = Part(floating_caliper, output=("F_cl",), work="W_caliper", loss="E_caliper")
    stop = Part(end_stop, work="W_stop", loss="E_stop", which="retracted")

    p = Wire("Pa", "chamber pressure", 4e5)

    def reservoir(self, w: Any) -> Air:
        """Return the air in the reservoir, whose pressure is constant."""
        return Air(w.par.p_s + w.par.gas.p_atm, w.par.gas.T_0)

    def valves(self, w: Any, chamber: Air) -> Flow:
        """Connect the relay valve to the chamber, and return the flow into the chamber."""
        return self.relayed(w, chamber)

    def relayed(self, w: Any, outlet: Air) -> Flow:
        """Connect the relay valve to the air at its outlet, and return the flow into it."""
        gas, supply = w.par.gas, self.reservoir(w)
        # The pilot valve takes its air from the same reservoir.
        control = ops.fmin(w.m.p_control, supply.p - gas.p_atm)
        w.relay.u = relay_valve.Input(control, outlet.p - gas.p_atm)
        seats = relay_valve.output(w.relay.x, w.relay.par)
        w.feed.u = air_orifice.Input(supply.p, outlet.p, supply.T, outlet.T, seats.feed)
        w.outlet.u = air_orifice.Input(outlet.p, gas.p_atm, outlet.T, gas.T_0, seats.exhaust)
        into = air_orifice.output(w.feed.u, w.feed.par, gas)
        return Flow(*into).minus(air_orifice.output(w.outlet.u, w.outlet.par, gas))

    def orifices(self, w: Any) -> tuple[tuple[Any, ...], tuple[Any, ...], tuple[Any, ...]]:
        """Return the orifices that take air from the source, exhaust it, and those between."""
        return (w.feed,), (w.outlet,), ()

    def pushed(self, w: Any) -> float:
        """Return the force of other parts on the rod [N], positive toward clamping."""
        return 0.0

    def wire(self, w: Any) -> None:
        """Connect valve, chamber, rod and pads."""
        par, gas = w.par, w.par.gas
        unloaded = brake_chamber.Input(w.rod.x.x, w.rod.x.v, 0.0)
        room = brake_chamber.output(unloaded, w.chamber.par)
        inside = air_in(w.volume, room.V, gas)
        w.p = inside.p - gas.p_atm
        flow = self.valves(w, inside).minus(leaked(w.p, inside.T, w.chamber.par, gas))
        w.volume.u = air_volume.Input(flow.mdot, flow.H, room.V, room.V_rate)
        w.sensor.u = anti_alias_filter.Input(w.p / par.ecu.p_range)
        w.chamber.u = brake_chamber.Input(w.rod.x.x, w.rod.x.v, w.p)
        force = brake_chamber.output(w.chamber.u, w.chamber.par).F + self.pushed(w)
        beyond = 10.0 * w.chamber.par.x_table[-1]  # only the retracted stop is within the travel
        w.stop.u = end_stop.Input(w.rod.x.x, w.rod.x.v, 0.0, beyond)
        # The travel of the pads is affine in the rod's travel, with a slope at the predicted one.
        slope = lever.slope(w.rod.xe.x, w.lever.par)
        y = lever.travel(w.rod.xe.x, w.lever.par) + slope * (w.rod.x.x - w.rod.xe.x)
        w.caliper.u = floating_caliper.Input(y, slope * w.rod.x.v)
        w.lever.u = lever.Input(w.rod.xe.x, w.rod.x.v, w.caliper.f.F_cl)
        load = lever.load(w.lever.u, w.lever.par) + end_stop.load(w.stop.f)
        w.rod.u = push_rod.Input(force, load, 0.0)

    def friction(self, w: Any) -> tuple[Bounds, ...]:
        """Return the bounds of the friction of rod and lever."""
        rod = lever.friction(w.lever.u, w.lever.par)
        return ((-rod, rod),)

    def power(self, w: Any) -> dict[str, float]:
        """Return the powers that do not follow from the parts."""
        return {
            **super().power(w),
            **self.air_powers(w),
            "E_friction": -w.reaction[0] * w.rod.x.v,
        }

    def air_powers(self, w: Any) -> dict[str, float]:
        """Return the powers of the air: exergies of isothermal air, else enthalpies and heat."""
        gas, volume = w.par.gas, w.volume
        fed, exhausted, between = self.orifices(w)
        into = [air_orifice.output(each.u, each.par, gas) for each in fed]
        out = [air_orifice.output(each.u, each.par, gas) for each in exhausted]
        T = air_volume.temperature(volume.x, volume.par, gas)
        leak = leaked(w.p, T, w.chamber.par, gas)
        mass = {
            "m_fed": sum(each.mdot for each in into),
            "m_out": sum(each.mdot for each in out) + leak.mdot,
        }
        if volume.par.law == "isothermal":
            lost = leak.mdot * air.exergy(w.p + gas.p_atm, gas)
            for each in (*fed, *exhausted, *between):
                lost = lost + air_orifice.power_loss(each.u, each.par, gas)
            drawn = [
                q.mdot * air.exergy(each.u.p_a, gas) for q, each in zip(into, fed, strict=True)
            ]
            return {
                **mass,
                "E_source": sum(drawn),
                "E_exhaust": 0.0 * lost,
                "E_throttling": lost,
                "E_walls": 0.0 * lost,
            }
        heat = sum(each.par.G_w * (each.x.T - gas.T_0) for each in self.volumes(w))
        work = sum(gas.p_atm * each.u.V_rate for each in self.volumes(w))
        return {
            **mass,
            "E_source": sum(each.H for each in into),
            "E_exhaust": sum(each.H for each in out) + leak.H,
            "E_throttling": 0.0 * heat,
            "E_walls": heat + work,
        }

    def volumes(self, w: Any) -> tuple[Any, ...]:
        """Return the volumes of air."""
        return (w.volume,)

    def tasks(self, par: Any) -> tuple[Task, ...]:
        """Return the ECU's task."""
        return (Task("ecu", par.ecu.T_s, ecu.tick),)


class BrakedWheel(Corner[ParT, MemoryT], AirBrake[ParT, MemoryT]):
    """The brake at a wheel, whose disc has dry friction."""

    frictions: ClassVar[tuple[str, ...]] = (*AirBrake.frictions, "omega")

    turning = Part(road_wheel, par="wheel", outside=True)
    E_brake = Integral("J", "disc brake and rolling resistance", role=vehicle_sink("brake"))
    E_wheel = Shown("J", "energy of the wheel", role=vehicle_sink("wheel", "any"))
    torque = Shown("N*m", "brake torque", 5e3)

    def wheel(self, w: Any) -> WheelSpeed:
        """Return the speed of the wheel."""
        return WheelSpeed(w.turning.x.omega, w.turning.xe.omega)

    def wire(self, w: Any) -> None:
        """Connect the brake, and the road to the wheel."""
        super().wire(w)
        w.turning.u = road_wheel.Input(self.tyre_torque(w) / w.turning.par.r, 0.0)

    def friction(self, w: Any) -> tuple[Bounds, ...]:
        """Return the bounds of the brake's frictions, then those of the disc."""
        most = self.brake_torque(w) + road_wheel.rolling_resistance(w.N_x, w.turning.par)
        return (*super().friction(w), (-most, most))

    def brake_torque(self, w: Any) -> float:
        """Return the largest torque of the disc brake [N m]."""
        disc = w.par.disc
        torque: float = 2.0 * disc.mu * disc.r_eff * w.caliper.f.F_cl
        return torque

    def power(self, w: Any) -> dict[str, float]:
        """Return the powers that do not follow from the parts."""
        return {**super().power(w), "E_brake": -w.reaction[1] * w.turning.x.omega}

    def record(self, w: Any) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        return {
            **super().record(w),
            "torque": -w.reaction[1],
            "E_wheel": road_wheel.energy(w.turning.x, w.turning.par),
        }


def air_in(volume: Any, V: float, gas: air.Parameters) -> Air:
    """Return the air in a part with mass and temperature that fills a volume [m^3]."""
    still = air_volume.Input(0.0, 0.0, V, 0.0)
    p = air_volume.pressure(volume.x, still, volume.par, gas)
    return Air(p, air_volume.temperature(volume.x, volume.par, gas))


def leaked(p: float, T: float, par: brake_chamber.Parameters, gas: air.Parameters) -> Flow:
    """Return the flow through the diaphragm at a gauge pressure [Pa] and a temperature [K]."""
    mdot = brake_chamber.leak(p, par, gas)
    return Flow(mdot, mdot * gas.gamma * air.heat_capacity(gas) * T)


def filled(p: float, V: float, gas: air.Parameters) -> air_volume.State:
    """Return the state of a volume [m^3] at ambient temperature and a gauge pressure [Pa]."""
    m = (p + gas.p_atm) * V / (air.gas_constant(gas) * gas.T_0)
    return air_volume.State(m, gas.T_0)


def released(par: TruckParameters) -> dict[str, Any]:
    """Return the states of a brake that the return spring holds open."""
    x = -par.chamber.F_s0 / (par.stop.k_stop + par.chamber.k_s)  # the spring presses on its stop
    V = brake_chamber.output(brake_chamber.Input(x, 0.0, 0.0), par.chamber).V
    return {
        "volume": filled(0.0, V, par.gas),
        "rod": push_rod.State(x, 0.0),
    }


def rolling_brake(par: TruckParameters, v: float) -> dict[str, Any]:
    """Return the states of a released brake at a wheel that rolls at a speed [m/s]."""
    turning = road_wheel.State(v / par.wheel.r)
    return {**rolling_states(v), **released(par), "turning": turning}
