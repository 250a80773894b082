"""Faults of the brake in addition to the faults of its elements."""

from __future__ import annotations

from typing import Any

from bywire.authoring import Channel, Channels, ParameterError


def _pressure(value: float, par: Any) -> float:
    """Return a gauge pressure [Pa], which must be above vacuum."""
    if not value + par.gas.p_atm > 0.0:
        raise ParameterError(
            f"pressure = {value / 1e5:g} bar is not valid: it must be > "
            f"{-par.gas.p_atm / 1e5:.4g} bar, which is vacuum (gas.p_atm)"
        )
    return value


def _reading(value: float, par: Any) -> float:
    return _pressure(value, par) / float(par.ecu.p_range)


_CHANNELS = (
    Channel("pressure", "pressure sensor", "Pa", "y_p", seen=_reading, stuck=0.0, offset=0.5e5),
    Channel(
        "pilot", "pilot valve", "Pa", "p_control", "drive", seen=_pressure, stuck=0.0, task="ecu"
    ),
)
_MODULATOR = (
    Channel("hold_valve", "hold valve", "1", "close", "drive", stuck=1.0, task="slip"),
    Channel("vent_valve", "vent valve", "1", "vents", "drive", stuck=1.0, task="slip"),
)
CHANNELS = Channels("truck-ebs", _CHANNELS)
ABS_CHANNELS = Channels("truck-abs", (*_CHANNELS, *_MODULATOR))
PARK_CHANNELS = Channels("truck-park", _CHANNELS)
RIG_CHANNELS = Channels("truck-brake-rig", _CHANNELS)
