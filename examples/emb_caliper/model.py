"""The brake with DC motor, planetary gear, ball screw, floating caliper, and ECU."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any, ClassVar, Self

from bywire.authoring import Wire
from bywire.plant import angle_sensor, battery_supply, dc_motor, h_bridge
from emb_caliper import ecu
from emb_caliper.mechanics import LOADS, LOSSES, MOTION, CaliperBrake
from emb_caliper.parameters import CaliperBrakeParameters as Par


class EmbCaliper(CaliperBrake[Par, Any]):
    """The brake with a DC motor."""

    name: ClassVar[str] = "emb-caliper"
    laws: ClassVar[ModuleType] = ecu
    Memory: ClassVar = ecu.Memory
    Stimulus: ClassVar = ecu.Stimulus

    voltage = Wire("V", "motor voltage", 10.0)
    records: ClassVar[tuple[str, ...]] = (
        *MOTION,
        "duty",
        "voltage",
        *LOADS,
        "E_copper",
        *LOSSES,
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
