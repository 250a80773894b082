"""The brake with a synchronous motor, an inverter, and field-oriented control."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any, ClassVar, Self

from bywire.authoring import Bounds, Integral, Part, Role, Shown, Wire
from bywire.core import ops
from bywire.plant import (
    angle_sensor,
    battery_supply,
    end_stop,
    floating_caliper,
    inverter,
    pad_hysteresis,
    pmsm,
)
from emb_caliper import ecu, ecu_pmsm
from emb_caliper.elements import (
    ball_screw,
    load_cell,
    load_friction,
    planetary_gear,
    rotor,
)
from emb_caliper.mechanics import CaliperBrake
from emb_caliper.parameters import SynchronousBrakeParameters as Par


class EmbCaliperPmsm(CaliperBrake[Par, Any]):
    """The brake with a synchronous motor."""

    name: ClassVar[str] = "emb-caliper-pmsm"
    Memory: ClassVar = ecu_pmsm.Memory
    Stimulus: ClassVar = ecu.Stimulus
    frictions: ClassVar[tuple[str, ...]] = ("omega",)
    laws: ClassVar[ModuleType] = ecu_pmsm

    E_source = Integral("J", "energy from battery or source", role=Role("source", "source"))
    supply = Part(battery_supply, loss="E_supply")
    inverter = Part(inverter, loss="E_inverter")
    motor = Part(pmsm, loss="E_copper")
    E_iron = Integral("J", "eddy-current loss", role=Role("sink", "iron"))
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
    v_d = Wire("V", "d-axis voltage", 10.0)
    v_q = Wire("V", "q-axis voltage", 10.0)
    torque = Wire("N*m", "motor torque", 1.0)
    F_pads = Wire("N", "clamp force", 1e4)
    i = Shown("A", "motor current, an amplitude with the torque's sign", 10.0)
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
        "i_d",
        "i_d_ref",
        "i_q",
        "i_q_ref",
        "v_d",
        "v_q",
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
        "E_inverter",
        "E_copper",
        "E_iron",
        "E_viscous",
        "E_friction",
        "E_caliper",
        "E_hysteresis",
        "E_stop",
        "E_stored",
        "t_stuck",
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
