"""The brake with a synchronous motor, an inverter, and field-oriented control."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any, ClassVar, Self

from bywire.authoring import Bounds, Integral, Part, Role, Shown, Wire
from bywire.core import ops
from bywire.plant import angle_sensor, battery_supply, inverter, pmsm
from emb_caliper import ecu, ecu_pmsm
from emb_caliper.mechanics import LOADS, LOSSES, MOTION, CaliperBrake
from emb_caliper.parameters import SynchronousBrakeParameters as Par


class EmbCaliperPmsm(CaliperBrake[Par, Any]):
    """The brake with a synchronous motor."""

    name: ClassVar[str] = "emb-caliper-pmsm"
    Memory: ClassVar = ecu_pmsm.Memory
    Stimulus: ClassVar = ecu.Stimulus
    laws: ClassVar[ModuleType] = ecu_pmsm

    inverter = Part(inverter, loss="E_inverter")
    motor = Part(pmsm, loss="E_copper")
    E_iron = Integral("J", "eddy-current loss", role=Role("sink", "iron"))
    v_d = Wire("V", "d-axis voltage", 10.0)
    v_q = Wire("V", "q-axis voltage", 10.0)
    i = Shown("A", "motor current, an amplitude with the torque's sign", 10.0)
    records: ClassVar[tuple[str, ...]] = (
        *MOTION,
        "i_d",
        "i_d_ref",
        "i_q",
        "i_q_ref",
        "v_d",
        "v_q",
        *LOADS,
        "E_inverter",
        "E_copper",
        "E_iron",
        *LOSSES,
    )

    def electrics(self, w: Self) -> None:
        """Connect battery, inverter and motor.

        The duties are constant between two ticks. The voltages, in rotor coordinates, are not,
        because the rotor turns.
        """
        i = w.motor.x
        theta_e = w.motor.par.p * w.rotor.xe.theta
        if w.par.drive == "voltage":
            w.i_dc = 0.0 * i.i_q
            w.v_d, w.v_q = 0.0 * i.i_d, w.m.v_source
            w.inverter.u = inverter.Input(
                0.0 * w.v_d, 0.0 * w.v_q, 0.0 * i.i_d, 0.0 * i.i_q, theta_e, w.par.supply.V_bat
            )
        else:
            w.i_dc = inverter.bus_current(
                w.m.duty_alpha, w.m.duty_beta, i.i_d, i.i_q, theta_e, w.inverter.par
            )
            bus = battery_supply.output(battery_supply.Input(w.i_dc), w.supply.par).v_bus
            w.inverter.u = inverter.Input(
                bus * w.m.duty_alpha, bus * w.m.duty_beta, i.i_d, i.i_q, theta_e, bus
            )
            out = inverter.output(w.inverter.u, w.inverter.par)
            w.v_d, w.v_q = out.v_d, out.v_q
        w.supply.u = battery_supply.Input(w.i_dc)
        w.motor.u = pmsm.Input(w.v_d, w.v_q, w.rotor.x.omega)
        w.torque = pmsm.output(i, w.rotor.x.omega, w.motor.par).torque

    def source_power(self, w: Self) -> float:
        """Return the power of battery or source [W]."""
        if w.par.drive == "voltage":
            return pmsm.electrical_power(w.motor.x, w.motor.u)
        return battery_supply.power_source(w.supply.u, w.supply.par)

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return the limits of the dry friction on the shaft, with the iron's hysteresis."""
        ((low, high),) = super().friction(w)
        T_h = pmsm.output(w.motor.x, w.rotor.x.omega, w.motor.par).T_h
        return ((low - T_h, high + T_h),)

    def power(self, w: Self) -> dict[str, float]:
        """Return the power of source, iron and dry friction, and 1 while the shaft is stuck."""
        iron = pmsm.iron_loss(w.motor.x, w.rotor.x.omega, w.motor.par)
        return {**super().power(w), "E_iron": iron}

    def record(self, w: Self) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        i, tiny = w.motor.x, 1e-9 * w.par.ecu.current.i_max
        square = ops.fmax(i.i_d * i.i_d + i.i_q * i.i_q, tiny * tiny)  # a root of 0 has no slope
        amplitude = ops.sqrt(square)
        return {**super().record(w), "i": ops.where(i.i_q < 0.0, -amplitude, amplitude)}

    def sensed(self, law: Callable[..., Any]) -> Callable[[Any, Any, Any, Any], Any]:
        """Return a controller's tick with the sensor readings."""
        return _reading(law)


def _reading(law: Callable[..., Any]) -> Callable[[Any, Any, Any, Any], Any]:
    """Return a controller's tick with the sensor readings."""

    def tick(x: Any, m: Any, u: ecu.Stimulus, par: Par) -> Any:
        theta_e = par.motor.p * x.theta
        i_alpha, i_beta = inverter.rotated(x.i_d, x.i_q, -theta_e)
        i_dc = inverter.bus_current(m.duty_alpha, m.duty_beta, x.i_d, x.i_q, theta_e, par.inverter)
        readings = ecu_pmsm.Readings(
            x.F_cell,
            angle_sensor.reading(x.theta, par.encoder),
            x.omega,
            i_alpha,
            i_beta,
            battery_supply.output(battery_supply.Input(i_dc), par.supply).v_bus,
        )
        return law(readings, m, u, par)

    return tick
