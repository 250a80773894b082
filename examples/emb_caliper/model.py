"""The brake with DC motor, planetary gear, ball screw, floating caliper, and ECU."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any, ClassVar, Self

from bywire.authoring import Integral, Part, Role, Shown, Wire
from bywire.plant import (
    angle_sensor,
    battery_supply,
    dc_motor,
    end_stop,
    floating_caliper,
    h_bridge,
    pad_hysteresis,
)
from emb_caliper import ecu
from emb_caliper.elements import (
    ball_screw,
    load_cell,
    load_friction,
    planetary_gear,
    rotor,
)
from emb_caliper.mechanics import CaliperBrake
from emb_caliper.parameters import CaliperBrakeParameters as Par


class EmbCaliper(CaliperBrake[Par, Any]):
    """The brake with a DC motor."""

    name: ClassVar[str] = "emb-caliper"
    laws: ClassVar[ModuleType] = ecu
    Memory: ClassVar = ecu.Memory
    Stimulus: ClassVar = ecu.Stimulus
    frictions: ClassVar[tuple[str, ...]] = ("omega",)

    E_source = Integral("J", "energy from battery or source", role=Role("source", "source"))
    supply = Part(battery_supply, loss="E_supply")
    motor = Part(dc_motor, loss="E_copper")
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

    voltage = Wire("V", "motor voltage", 10.0)
    i_dc = Wire("A", "battery current", 10.0)
    torque = Wire("N*m", "motor torque", 1.0)
    F_pads = Wire("N", "clamp force", 1e4)
    T_fr = Shown("N*m", "friction torque", 0.1)
    F_stop = Shown("N", "end stop load on the piston", 1e3)
    stuck = Shown("1", "shaft stuck")
    P_el = Shown("W", "electrical power from battery or source", 100.0)

    records: ClassVar[tuple[str, ...]] = (
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
        "duty",
        "voltage",
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
        "E_copper",
        "E_viscous",
        "E_friction",
        "E_caliper",
        "E_hysteresis",
        "E_stop",
        "E_stored",
        "t_stuck",
    )

    def electrics(self, w: Self) -> None:
        """Connect battery, bridge and motor."""
        w.voltage, w.i_dc = _electrics(w)
        w.supply.u = battery_supply.Input(w.i_dc)
        w.motor.u = dc_motor.Input(w.voltage, w.rotor.x.omega)
        w.torque = dc_motor.output(w.motor.x, w.motor.par).torque

    def source_power(self, w: Self) -> float:
        """Return the power of battery or source [W]."""
        if w.par.drive == "voltage":
            return w.voltage * w.motor.x.i
        return battery_supply.power_source(w.supply.u, w.supply.par)

    def sensed(self, law: Callable[..., Any]) -> Callable[[Any, Any, Any, Any], Any]:
        """Return a controller's tick with the sensor readings."""
        return _reading(law)


def _electrics(w: EmbCaliper) -> tuple[float, float]:
    """Return motor voltage and battery current of the drive mode."""
    i = w.motor.x.i
    if w.par.drive == "voltage":
        return w.m.v_source, 0.0 * i
    i_dc = w.m.duty * i
    bus = battery_supply.output(battery_supply.Input(i_dc), w.supply.par).v_bus
    bridge = h_bridge.output(h_bridge.Input(duty=w.m.duty, v_bus=bus, i=i))
    return bridge.v, bridge.i_dc


def _reading(law: Callable[..., Any]) -> Callable[[Any, Any, Any, Any], Any]:
    """Return a controller's tick with the sensor readings."""

    def tick(x: Any, m: Any, u: ecu.Stimulus, par: Par) -> Any:
        theta = angle_sensor.reading(x.theta, par.encoder)
        return law(ecu.Readings(x.F_cell, theta, x.omega, x.i), m, u, par)

    return tick
