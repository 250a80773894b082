"""The brake with an anti-lock system: a modulator between the relay valve and the chamber."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple

from bywire.authoring import Part, Signal, Task, signals, zeros
from bywire.core import ops
from bywire.plant import abs_modulator, air_orifice, air_volume, road, wheel_encoder
from bywire.vehicle import slip_control
from truck_ebs import ecu
from truck_ebs.laws import modulator_switch
from truck_ebs.mechanics import Air, BrakedWheel, Flow, air_in, filled, rolling_brake
from truck_ebs.parameters import AbsTruckParameters as Par


class Commands(NamedTuple):
    """Memory of the modulator's control between its ticks."""

    close: Annotated[float, Signal("1", "hold valve closed")]
    vents: Annotated[float, Signal("1", "vent valve open")]
    p_left: Annotated[float, Signal("Pa", "pressure after slip control", 4e5, set_point_of="p")]
    p_last: Annotated[float, Signal("Pa", "previous measured pressure", 4e5)]


Memory: Any = signals.joined(__name__, "Memory", ecu.Memory, slip_control.Memory, Commands)
"""memory of pressure control, slip control and modulator"""


class TruckAbs(BrakedWheel[Par, Any]):
    """The relay valve feeds a hose, from which the modulator fills the chamber or vents it."""

    name: ClassVar[str] = "truck-abs"
    Memory: ClassVar = Memory
    Stimulus: ClassVar = ecu.Stimulus

    hose = Part(air_volume, par="volume", suffix="_hose", which="hose")
    modulator = Part(abs_modulator)
    passage = Part(air_orifice)
    bleed = Part(air_orifice)
    encoder = Part(wheel_encoder, par="slip.encoder", outside=True)

    def valves(self, w: Any, chamber: Air) -> Flow:
        """Connect the relay valve to the hose, and the modulator between hose and chamber."""
        gas, V = w.par.gas, w.par.V_hose
        hose = air_in(w.hose, V, gas)
        into = self.relayed(w, hose)
        w.modulator.u = abs_modulator.Input(w.m.close, w.m.vents)
        opening = w.modulator.x
        w.passage.u = air_orifice.Input(hose.p, chamber.p, hose.T, chamber.T, opening.hold)
        w.bleed.u = air_orifice.Input(chamber.p, gas.p_atm, chamber.T, gas.T_0, opening.vent)
        through = Flow(*air_orifice.output(w.passage.u, w.passage.par, gas))
        kept = into.minus(through)
        w.hose.u = air_volume.Input(kept.mdot, kept.H, V, 0.0 * V / gas.T_0)
        return through.minus(air_orifice.output(w.bleed.u, w.bleed.par, gas))

    def orifices(self, w: Any) -> tuple[tuple[Any, ...], tuple[Any, ...], tuple[Any, ...]]:
        """Return the orifices that take air from the source, exhaust it, and those between."""
        return (w.feed,), (w.outlet, w.bleed), (w.passage,)

    def volumes(self, w: Any) -> tuple[Any, ...]:
        """Return the volumes of air."""
        return (w.volume, w.hose)

    def wire(self, w: Any) -> None:
        """Connect the brake, and the encoder to the wheel."""
        super().wire(w)
        w.encoder.u = wheel_encoder.Input(w.turning.x.omega)

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return pressure control, and slip control with the modulator's switch."""
        return (*super().tasks(par), Task("slip", par.slip.T_s, slip_tick))

    def remarks(self, recording: Any, par: Any) -> list[str]:
        """Return remarks on a slip far below the slip at maximum adhesion."""
        if par.slip.abs != "pi":
            return []
        return slip_control.far_from_peak(
            recording["s"].values,
            recording["abs"].values,
            par.slip.slip.slip_set,
            "slip.slip.slip_set",
            par.corner.tyre,
            par.corner.road,
        )

    def rest(self, par: Par) -> tuple[Any, Any]:
        """Return the vehicle at rest with released brakes."""
        return rolling(par, 0.0)


def slip_tick(x: Any, m: Any, u: ecu.Stimulus, par: Par) -> Any:
    """Run slip control once, then switch the modulator."""
    slip = par.slip
    edge = wheel_encoder.reading(
        wheel_encoder.State(x.theta), wheel_encoder.Input(x.omega), slip.encoder
    )
    p_meas = x.y_p * par.ecu.p_range
    seen = slip_control.Readings(
        x.v_x,
        x.omega * par.corner.r,
        edge.angle,
        edge.age,
        par.corner.body.g * road.slope(x.s, par.corner.road).sine,
        ops.where(p_meas > par.ecu.pressure.p_touch, 1.0, 0.0),
    )
    k = slip.slip.k_hat
    m = slip_control.tick(seen, m, k * m.p_ref, slip)
    acts = 0.0 if slip.abs == "off" else m.abs
    p_left = m.M_left / k
    switched = modulator_switch.output(
        modulator_switch.Input(p_left, p_meas, m.p_last, acts), slip.T_s, par.switch
    )
    return m._replace(close=switched.close, vents=switched.vents, p_left=p_left, p_last=p_meas)


def rolling(par: Par, v: float) -> tuple[Any, Any]:
    """Return state and memory of a vehicle that rolls at a speed [m/s] with released brakes."""
    state = TruckAbs.state(
        **rolling_brake(par, v),
        hose=filled(0.0, par.V_hose, par.gas),
        modulator=abs_modulator.State(1.0, 0.0),
        encoder=wheel_encoder.State(0.0),
    )
    return state, zeros(Memory)._replace(**slip_control.awake(v, par.slip))
