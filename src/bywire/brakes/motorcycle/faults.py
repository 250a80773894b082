"""Faults of the motorcycle brake in addition to those of its elements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.core.errors import not_valid
from bywire.core.faults import Channel, Channels, Fault
from bywire.core.units import shown
from bywire.plant import current_sensor, fluid_vapor, pressure_sensor

_GAP_PRESSURE = 2e3  # Pa that closes a gap: small, but > 0, because the curve must increase
NAME = MotorcycleBrake.name


def _pressure(value: float, par: Any) -> float:
    return pressure_sensor.reading(value + par.ecu.p_atm, par.pressure_sensor)


def _current(value: float, par: Any) -> float:
    return current_sensor.reading(value, par.current_sensor)


CHANNELS = Channels(
    NAME,
    (
        Channel("pressure", "pressure sensor", "Pa", "y_p", seen=_pressure, stuck=20e5, offset=2e5),
        Channel("current", "current sensor", "A", "y_i", seen=_current, offset=1.0),
        Channel("bridge", "bridge duty cycle", "1", "duty", "drive", stuck=1.0, task="ecu"),
    ),
)


def _source(mode: str) -> Any:
    """Return the changes that replace the ECU with an ideal source at zero.

    The source is sampled like the ECU, so the run's ticks stay the same.
    """

    def changes(par: Any, value: float) -> Mapping[str, Any]:
        return {"drive.mode": mode, "drive.T_source": par.ecu.T_s}

    return changes


def _knocked_back(par: Any, gap: float) -> Mapping[str, Any]:
    """Return a pressure-volume curve that begins with the volume of a gap at the pads [m]."""
    pads, dead = par.caliper, par.caliper.A_pd * gap
    spring = pads.A_pd * pads.A_pd / pads.K_pd
    return {
        "caliper.law": "table",
        "caliper.p_table": (0.0, _GAP_PRESSURE, _GAP_PRESSURE + 100e5),
        "caliper.V_table": (0.0, dead, dead + spring * 100e5),
    }


def _boiling(par: Any, T: float) -> Mapping[str, Any]:
    """Return the changes that add vapor at a temperature [K] as gas in line and caliper."""
    if not 0.0 < T <= par.vapor.T_most:
        limits = f"> {shown(0.0, 'K')} and <= {shown(par.vapor.T_most, 'K')} (vapor.T_most)"
        raise not_valid(
            "temperature of fluid.vapor", shown(T, "K"), limits, "the range of the vapor law"
        )
    return {"fluid.air": "caliper", "fluid.V_air": fluid_vapor.volume(T, par.vapor)}


FAULTS = (
    Fault(
        "fluid.vapor",
        "the fluid in the caliper boils (value: temperature)",
        _boiling,
        NAME,
        "K",
        433.15,
    ),
    Fault(
        "battery.lost",
        "battery loss with an open bridge: no current",
        _source("current-source"),
        NAME,
    ),
    Fault(
        "battery.shorted",
        "battery loss with a bridge that shorts the motor",
        _source("voltage-source"),
        NAME,
    ),
    Fault(
        "bridge.open-phase",
        "open motor phase: no current",
        _source("current-source"),
        NAME,
    ),
    Fault(
        "gear.jammed",
        "the screw jams in place",
        lambda par, value: {"seal.T_pr": value},
        NAME,
        "N*m",
        100.0,
    ),
    Fault(
        "caliper.knocked-back",
        "the disc has pushed the pads back (value: gap)",
        _knocked_back,
        NAME,
        "m",
        0.3e-3,
    ),
)
