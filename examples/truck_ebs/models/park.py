"""The brake with compressor, tank and spring brake, which parks the vehicle when air is lost."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple

from bywire.authoring import Bounds, Integral, Part, Role, Shown, Signal, Task, signals, zeros
from bywire.plant import (
    air,
    air_orifice,
    air_volume,
    anti_alias_filter,
    brake_chamber,
    compressor,
    end_stop,
    governor,
    spring_brake,
)
from truck_ebs import ecu
from truck_ebs.elements import push_rod
from truck_ebs.mechanics import Air, BrakedWheel, air_in, filled, rolling_brake
from truck_ebs.parameters import ParkTruckParameters as Par
from truck_ebs.trim import rod_travel


class Stimulus(NamedTuple):
    """External inputs."""

    p_set: Annotated[float, Signal("Pa", "pressure demand", 4e5)]
    parks: Annotated[float, Signal("1", "hand valve in the parking position", low=0.0, high=1.0)]
    burst: Annotated[float, Signal("1", "open fraction of the tank", low=0.0, high=1.0)]


class Switches(NamedTuple):
    """Memory of governor, hand valve and tank between ticks."""

    on: Annotated[float, Signal("1", "compressor loaded")]
    parked: Annotated[float, Signal("1", "park chamber exhausted by the hand valve")]
    opened: Annotated[float, Signal("1", "open fraction of the tank")]


Memory: Any = signals.joined(__name__, "Memory", ecu.Memory, Switches)
"""memory of pressure control and switches"""


class TruckPark(BrakedWheel[Par, Any]):
    """The tank feeds relay valve and park chamber. The piston of the spring pushes the rod."""

    name: ClassVar[str] = "truck-park"
    Memory: ClassVar = Memory
    Stimulus: ClassVar = Stimulus
    frictions: ClassVar[tuple[str, ...]] = (*BrakedWheel.frictions, "v_spring")

    E_source = Integral("J", "energy of the compressed air", role=Role("source", "compressor"))
    tank = Part(air_volume, par="volume", suffix="_tank", which="tank")
    compressor = Part(compressor)
    burst = Part(air_orifice)
    park = Part(air_volume, par="volume", suffix="_park", which="park chamber")
    park_feed = Part(air_orifice, par="hand_valve")
    park_exhaust = Part(air_orifice, par="hand_valve")
    spring = Part(spring_brake, suffix="_spring", loss="E_piston")
    push = Part(end_stop, par="push", work="W_push", loss="E_push", which="piston on rod")
    ends = Part(end_stop, par="ends", work="W_ends", loss="E_ends", which="piston at its ends")

    p_tank = Shown("Pa", "pressure of the tank", 8e5)
    p_park = Shown("Pa", "park pressure", 8e5)
    F_push = Shown("N", "force of the spring brake on the rod", 5e3)

    def reservoir(self, w: Any) -> Air:
        """Return the air in the tank."""
        return air_in(w.tank, w.par.V_tank, w.par.gas)

    def pushed(self, w: Any) -> float:
        """Return the force of the spring piston on the rod [N]."""
        force: float = w.push.f.near
        return force

    def orifices(self, w: Any) -> tuple[tuple[Any, ...], tuple[Any, ...], tuple[Any, ...]]:
        """Return the orifices that exhaust air, and those between volumes."""
        return (), (w.outlet, w.park_exhaust, w.burst), (w.feed, w.park_feed)

    def volumes(self, w: Any) -> tuple[Any, ...]:
        """Return the volumes of air."""
        return (w.volume, w.tank, w.park)

    def wire(self, w: Any) -> None:
        """Connect brake and vehicle, then tank, park chamber and spring."""
        super().wire(w)
        par, gas = w.par, w.par.gas
        tank, room = self.reservoir(w), spring_brake.output(w.spring.x, w.spring.par)
        park = air_in(w.park, room.V, gas)
        w.compressor.u = compressor.Input(tank.p, w.m.on)
        w.burst.u = air_orifice.Input(tank.p, gas.p_atm, tank.T, gas.T_0, w.m.opened)
        w.park_feed.u = air_orifice.Input(tank.p, park.p, tank.T, park.T, 1.0 - w.m.parked)
        w.park_exhaust.u = air_orifice.Input(park.p, gas.p_atm, park.T, gas.T_0, w.m.parked)
        compressed = compressor.output(w.compressor.u, w.compressor.par, gas)
        lost, fed, parking, vented = (
            air_orifice.output(each.u, each.par, gas)
            for each in (w.burst, w.feed, w.park_feed, w.park_exhaust)
        )
        V = par.V_tank
        w.tank.u = air_volume.Input(
            compressed.mdot - lost.mdot - fed.mdot - parking.mdot,
            compressed.H - lost.H - fed.H - parking.H,
            V,
            0.0 * room.V_rate,
        )
        w.park.u = air_volume.Input(
            parking.mdot - vented.mdot, parking.H - vented.H, room.V, room.V_rate
        )
        piston, rod = w.spring.x, w.rod.x
        beyond = 10.0 * w.spring.par.x_max  # the piston only pushes the rod
        w.push.u = end_stop.Input(rod.x - piston.x, rod.v - piston.v, 0.0, beyond)
        w.ends.u = end_stop.Input(piston.x, piston.v, 0.0, w.spring.par.x_max)
        load = w.push.f.near + end_stop.load(w.ends.f)
        w.spring.u = spring_brake.Input(park.p - gas.p_atm, load, 0.0)

    def friction(self, w: Any) -> tuple[Bounds, ...]:
        """Return the bounds of the other frictions, then those of the seals of the piston."""
        seals = w.spring.par.F_fr
        return (*super().friction(w), (-seals, seals))

    def power(self, w: Any) -> dict[str, float]:
        """Return the powers that do not follow from the parts."""
        powers = super().power(w)
        dry = powers["E_friction"] - w.reaction[2] * w.spring.x.v
        return {**powers, "E_friction": dry}

    def air_powers(self, w: Any) -> dict[str, float]:
        """Return the powers of the air, whose source is the compressor."""
        gas = w.par.gas
        q = compressor.output(w.compressor.u, w.compressor.par, gas)
        isothermal = w.volume.par.law == "isothermal"
        power = q.mdot * air.exergy(w.compressor.u.p, gas) if isothermal else q.H
        return {**super().air_powers(w), "E_source": power, "m_fed": q.mdot}

    def record(self, w: Any) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        return {
            **super().record(w),
            "p_tank": w.compressor.u.p - w.par.gas.p_atm,
            "p_park": w.spring.u.p,
            "F_push": w.push.f.near,
        }

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return pressure control, and the switches of the air supply."""
        return (*super().tasks(par), Task("supply", par.governor.T_s, supply_tick))

    def rest(self, par: Par) -> tuple[Any, Any]:
        """Return the vehicle at rest with released brakes."""
        return rolling(par, 0.0)


def supply_tick(x: Any, m: Any, u: Stimulus, par: Par) -> Any:
    """Sample governor, hand valve and tank."""
    gas = par.gas
    T = air_volume.temperature(air_volume.State(x.m_tank, x.T_tank), par.volume, gas)
    p = x.m_tank * air.gas_constant(gas) * T / par.V_tank - gas.p_atm
    switch = governor.output(governor.State(m.on), governor.Input(p), par.governor)
    return m._replace(on=switch.on, parked=u.parks, opened=u.burst)


def rolling(par: Par, v: float) -> tuple[Any, Any]:
    """Return state and memory of a vehicle that rolls at a speed [m/s] with released brakes."""
    return TruckPark.state(**_filled(par, v)), zeros(Memory)


def standing(par: Par, p: float) -> tuple[Any, Any]:
    """Return state and memory of a vehicle at standstill that a service pressure [Pa] holds."""
    x = rod_travel(p, par)
    V = brake_chamber.output(brake_chamber.Input(x, 0.0, 0.0), par.chamber).V
    held = {
        "volume": filled(p, V, par.gas),
        "rod": push_rod.State(x, 0.0),
        "sensor": anti_alias_filter.State(p / par.ecu.p_range),
    }
    memory = zeros(Memory)._replace(p_ref=p, p_meas=p, p_control=p)
    return TruckPark.state(**(_filled(par, 0.0) | held)), memory


def _filled(par: Par, v: float) -> dict[str, Any]:
    """Return the states with full tank and park chamber, and released brakes."""
    force = par.spring.A * par.p_s - par.spring.F_s0  # of the piston on its retracted stop
    piston = spring_brake.State(-force / (par.ends.k_stop + par.spring.k_s), 0.0)
    room = spring_brake.output(piston, par.spring)
    return {
        **rolling_brake(par, v),
        "tank": filled(par.p_s, par.V_tank, par.gas),
        "park": filled(par.p_s, room.V, par.gas),
        "spring": piston,
    }
