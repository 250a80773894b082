"""The hand-written C of the motorcycle brake, ``hand_written.c``."""

from __future__ import annotations

from pathlib import Path

from benchmarks.peers.hand_code import WITHOUT_SUMS, HandCode
from benchmarks.peers.hand_source import Subject
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters as Par
from bywire.simulation.compiler import SINGLE

__all__ = ["OUTPUTS", "SUBJECT", "WITHOUT_SUMS", "HandWritten", "indices"]

SUBJECT = Subject(
    folder=Path(__file__).parent,
    source="hand_written.c",
    indices="hand_written_indices.h",
    model=MotorcycleBrake,
    flow=MotorcycleBrake.Flow,
    choices={
        "motor_heat.law": ("off",),
        "gear.law": ("paper",),
        "port.law": ("makeup",),
        "fluid.air": ("none",),
        "caliper.law": ("linear",),
        "caliper.fluid_heat": ("off",),
        "piston.law": ("off",),
        "pressure_sensor.place": ("master-cylinder",),
        "adc.law": ("quantized",),
        "ecu.derating.law": ("off",),
        "ecu.schedule.law": ("off",),
        "ecu.filter.place": ("after-dither",),
        "ecu.dither.waveform": ("sine",),
        "drive.mode": ("pressure",),
    },
)
OUTPUTS = SUBJECT.outputs


def indices(par: Par) -> str:
    """Return C enums with the names of the array entries, in the order of the model."""
    return SUBJECT.enums(par)


class HandWritten(HandCode):
    """The compiled library of the motorcycle brake (see ``HandCode``).

    The second counter is the number of substeps near a stop or at the pressure limit.
    """

    def __init__(self, par: Par, flags: tuple[str, ...] = SINGLE) -> None:
        super().__init__(SUBJECT, par, flags)
