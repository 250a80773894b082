"""Failures of the wedge brake in addition to those of its elements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bywire.brakes.wedge.model import WedgeBrake
from bywire.brakes.wedge.rigs.electric_corner import ElectricCorner
from bywire.brakes.wedge.rigs.wedge_corner import WedgeCorner
from bywire.core.faults import Channel, Channels, Fault
from bywire.vehicle import regeneration

_SIGNALS = (
    Channel("moment", "moment sensor", "N*m", "y_M", offset=50.0),
    Channel("encoder_1", "encoder 1", "rad", "theta_1", offset=0.1),
    Channel("encoder_2", "encoder 2", "rad", "theta_2", offset=0.1),
    Channel("drive_1", "motor 1 demand", "A", "i_1_ref", "drive", task="position"),
    Channel("drive_2", "motor 2 demand", "A", "i_2_ref", "drive", task="position"),
    Channel("power", "power-stage switch", "1", "power_off", "demand", stuck=1.0),
)

_NOTHING = 1e-6  # fraction of a torque constant, which must stay positive

BRAKE_CHANNELS = Channels(WedgeBrake.name, _SIGNALS)
CORNER_CHANNELS = Channels(WedgeCorner.name, _SIGNALS)
ELECTRIC_CHANNELS = Channels(ElectricCorner.name, (*_SIGNALS, *regeneration.CHANNELS))


def _jammed(motor: str) -> Any:
    """Return the overrides that jam a screw, modeled as large motor damping."""

    def changes(par: Any, value: float) -> Mapping[str, Any]:
        return {f"{motor}.D_M": value}

    return changes


def _shorted(motor: str) -> Any:
    """Return the overrides that short a winding, which has no torque, but drag K^2/R."""

    def changes(par: Any, value: float) -> Mapping[str, Any]:
        healthy = getattr(par, motor)
        drag = healthy.K_ref * healthy.K_ref / healthy.R_ref
        return {f"{motor}.D_M": healthy.D_M + drag, f"{motor}.K_ref": _NOTHING * healthy.K_ref}

    return changes


FAULTS = (
    *(
        Fault(
            f"screw_{number}.jammed",
            f"screw {number} jams in place, modeled as damping",
            _jammed(f"motor_{number}"),
            WedgeBrake.name,
            "N*m*s/rad",
            1e3,
        )
        for number in (1, 2)
    ),
    *(
        Fault(
            f"motor_{number}.shorted",
            f"shorted winding in motor {number}, with drag but no torque",
            _shorted(f"motor_{number}"),
            WedgeBrake.name,
        )
        for number in (1, 2)
    ),
)
