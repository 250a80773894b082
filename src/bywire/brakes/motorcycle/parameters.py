"""Parameters of the motorcycle brake: one group per element, and one for the ECU."""

from __future__ import annotations

from typing import Literal

from pydantic import model_validator

from bywire.control import (
    current_pi,
    derating,
    dither,
    gain_schedule,
    low_pass_2,
    pedal_map,
    pressure_pid,
)
from bywire.control.dither import Believed
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Duration, Pressure
from bywire.core.units import shown
from bywire.plant import (
    adc,
    anti_alias_filter,
    ball_screw_gear,
    battery_supply,
    brake_fluid,
    caliper,
    current_sensor,
    dc_motor,
    end_stop,
    fluid_vapor,
    h_bridge,
    master_cylinder,
    motor_heat,
    pedal,
    pipeline,
    piston_friction,
    pressure_sensor,
    reservoir_port,
    seal_friction,
)

DriveMode = Literal[
    "pressure", "pedal", "current", "current-direct", "voltage-source", "current-source"
]


class DriveParameters(ParameterSet):
    """Source of the motor's command.

    ``pressure`` and ``pedal`` close the pressure loop. ``current`` is a demand to the current loop
    through dither and low-pass filter; ``current-direct`` bypasses both. ``voltage-source`` and
    ``current-source`` are ideal sources at the motor, in open loop.
    """

    mode: DriveMode
    """quantity that the stimulus commands"""
    T_source: Duration
    """interval over which an ideal source holds its value"""


class EcuParameters(ParameterSet):
    """The ECU: its sample time, its controllers, and its model of the plant."""

    T_s: Duration
    """sample time of both control loops"""
    pressure: pressure_pid.Parameters
    schedule: gain_schedule.Parameters
    current: current_pi.Parameters
    derating: derating.Parameters
    filter: low_pass_2.Parameters
    dither: dither.Parameters
    est_par: Believed
    p_atm: Pressure
    """ambient pressure that the ECU subtracts from the absolute reading"""
    pedal_map: pedal_map.Parameters

    @model_validator(mode="after")
    def _fits_sampling(self) -> EcuParameters:
        if self.filter.f_c * self.T_s >= 0.5:
            valid = f"< half the sample rate, {0.5 / self.T_s:g} Hz"
            raise RuleError("filter.f_c", f"{self.filter.f_c:g} Hz", valid)
        if self.dither.waveform != "off" and self.dither.f_dit * self.T_s >= 0.5:
            raise RuleError(
                "dither.f_dit",
                f"{self.dither.f_dit:g} Hz",
                f"< half the sample rate, {0.5 / self.T_s:g} Hz",
                "lower it, sample faster (ecu.T_s), or set ecu.dither.waveform = 'off'",
            )
        return self

    def pressure_at(self, p: float) -> pressure_pid.Parameters:
        """Return the pressure PID with its scheduled gains at a pressure [Pa]."""
        if self.schedule.law == "off":
            return self.pressure
        gains = gain_schedule.output(p, self.pressure, self.schedule)
        # Not validated: the gains may be symbols, and they lie between valid gains.
        return pressure_pid.Parameters.model_construct(**{**dict(self.pressure), **gains._asdict()})


class MotorcycleParameters(ParameterSet):
    """The whole motorcycle brake: plant (``par``), sensors, pedal, and ECU."""

    supply: battery_supply.Parameters
    bridge: h_bridge.Parameters
    motor: dc_motor.Parameters
    motor_heat: motor_heat.Parameters
    gear: ball_screw_gear.Parameters
    seal: seal_friction.Parameters
    master_cylinder: master_cylinder.Parameters
    stop: end_stop.Parameters
    port: reservoir_port.Parameters
    fluid: brake_fluid.Parameters
    vapor: fluid_vapor.Parameters
    pipeline: pipeline.Parameters
    caliper: caliper.Parameters
    piston: piston_friction.Parameters
    pressure_sensor: pressure_sensor.Parameters
    current_sensor: current_sensor.Parameters
    anti_alias: anti_alias_filter.Parameters
    adc: adc.Parameters
    pedal: pedal.Parameters
    ecu: EcuParameters
    drive: DriveParameters

    @model_validator(mode="after")
    def _chamber_has_room(self) -> MotorcycleParameters:
        cylinder = self.master_cylinder
        stroke, closed = cylinder.x_end - cylinder.x_rest, reservoir_port.closed_at(self.port)
        if not closed < stroke:
            raise RuleError(
                "port.x_port",
                shown(self.port.x_port, "m"),
                f"< the piston's stroke x_end - x_rest = {shown(stroke, 'm')}",
                "otherwise the port never closes",
            )
        room = cylinder.A_mc * (cylinder.s_mc - cylinder.x_rest - closed)
        if self.fluid.air == "entrained" and not self.fluid.V_air < room:
            valid = f"< the chamber volume where pressure begins to build up, {room:g} m**3"
            raise RuleError("fluid.V_air", f"{self.fluid.V_air:g} m**3", valid)
        return self

    @model_validator(mode="after")
    def _sticks_on_fluid_alone(self) -> MotorcycleParameters:
        """Reject a sticking piston combined with laws of the caliper's fluid.

        These laws need the fluid pressure, but the state is the pads' pressure.
        """
        fluid_laws = {
            "caliper.leak": self.caliper.leak == "leaking",
            "caliper.fluid_heat": self.caliper.fluid_heat == "warming",
            "fluid.air": self.fluid.air == "caliper",
        }
        clashing = [name for name, is_on in fluid_laws.items() if is_on]
        if self.piston.law == "sticking" and clashing:
            value = self.value(clashing[0])
            raise RuleError(
                "piston.law",
                "'sticking'",
                f"another law with {clashing[0]} = {value!r}",
                "otherwise the fluid pressure differs from the pad pressure and is not a state. "
                "Change one of them",
            )
        return self
