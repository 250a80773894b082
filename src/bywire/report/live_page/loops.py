"""Loops that a page shows beside its run: those that the bench's experiment is the proof of."""

from __future__ import annotations

from typing import Any

from bywire.analysis.loop import LOOPS
from bywire.analysis.margins import MARGINS
from bywire.export.exported import Exported
from bywire.export.loop_source import LoopSource, loop_source
from bywire.report.wording import amount

_SHOWN = {"1": ("", 1.0), "s": ("ms", 1e3)}  # unit and factor of margins, where not as they are


def loops_of(made: Exported) -> list[LoopSource]:
    """Return the loops of a bench in C; those whose point cannot follow parameters are left out."""
    par = made.run.par
    shown = [
        loop
        for loop in LOOPS.all().values()
        if loop.proof == made.bench.experiment and made.bench.definition.assembly == loop.assembly
    ]
    sources = [loop_source(loop, par) for loop in shown]
    return [source for source in sources if source is not None]


def told(source: LoopSource) -> dict[str, Any]:
    """Return what the page must know of a loop."""
    loop = source.loop
    is_state = loop.cut in source.states
    names = source.states if is_state else source.memory
    point = f"{loop.at.name} {amount(loop.at.default, loop.at.unit)}"
    return {
        "name": loop.name,
        "summary": loop.summary,
        "point": point,
        "cutName": loop.cut,
        "entry": source.entry,
        "size": source.size,
        "contacts": source.contacts,
        "states": len(source.states),
        "held": len(source.memory),
        "every": list(source.every),
        "frame": source.frame,
        "from": loop.band[0],
        "isAnalog": loop.analog,
        "margins": [
            [name, figure.heading, *_SHOWN.get(figure.unit, (figure.unit, 1.0))]
            for name, figure in MARGINS.items()
            if name != "bandwidth"  # which takes the closed loop
        ],
        "cut": {"isState": is_state, "at": names.index(loop.cut)},
    }
