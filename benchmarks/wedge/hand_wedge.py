"""The hand-written C of the wedge brake, ``hand_written_wedge.c``."""

from __future__ import annotations

from pathlib import Path

from benchmarks.peers.hand_code import HandCode
from benchmarks.peers.hand_source import Subject
from bywire.brakes.wedge.model import WedgeBrake
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.parameters import ParameterSet
from bywire.simulation.compiler import SINGLE


class _Wedge(Subject):
    """The wedge brake, whose C covers two types of encoder."""

    def text(self, par: ParameterSet, scheme: str | None = None) -> str:
        """Return the complete C source (see ``Subject.text``)."""
        quantized = int(par.flat()["encoder.law"] == "quantized")
        return f"enum {{ QUANTIZED = {quantized} }};\n" + super().text(par, scheme)


SUBJECT = _Wedge(
    folder=Path(__file__).parent,
    source="hand_written_wedge.c",
    indices="hand_written_wedge_indices.h",
    shared=("hand_written_wedge_model.h",),
    model=WedgeBrake,
    flow=WedgeBrake.Flow,
    choices={
        "motor_heat.law": ("off",),
        "control.derating.law": ("off",),
        "screw.law": ("load",),
        "wedge_friction.stopped_disc": ("drop",),
        "caliper.law": ("linear",),
        "adjuster.law": ("none",),
        "control.adjuster.ways": ("both",),
        "control.adjuster.fault": ("none",),
        "flywheel.law": ("coasting",),
        "encoder.law": ("ideal", "quantized"),
        "control.offset.law": ("preload",),
        "command.mode": ("moment",),
    },
)


class HandWrittenWedge(HandCode):
    """The compiled library of the wedge brake (see ``HandCode``).

    The second counter is the number of passes.
    """

    def __init__(self, par: WedgeParameters, flags: tuple[str, ...] = SINGLE) -> None:
        super().__init__(SUBJECT, par, flags)
