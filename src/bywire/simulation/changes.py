"""Parameters that change during a run: between two frames, all states and memories kept.

Where such a parameter belongs to a store of energy, the change does work. It is recorded, so that
it stands in the books and not in their closing error. A contact's loss is what its work exceeds its
store by: what a change does there stands in that loss.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.signals import Role, Signal
from bywire.core.typing import Array
from bywire.simulation.engine import Engine
from bywire.simulation.native import Request
from bywire.simulation.schedule import Schedule

PUT_IN = "E_change"
"""sum of what changes made the recorded energies jump by"""
PUT_IN_SIGNAL = Signal(
    "J", "energy put in by changed parameters", role=Role("source", "changed parameters")
)
_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Change:
    """Parameters that hold from a time on.

    Parameters
    ----------
    time
        Since the start of the run [s]; rounded up to a frame, which every tick and every recorded
        row begins.
    par
        All parameters from then on. Choices may differ where the model's states, its memory and
        the sample times stay what they are.
    """

    time: float
    par: ParameterSet


def frame_of(change: Change, schedule: Schedule) -> int:
    """Return the first frame in which a change holds."""
    return max(math.ceil(change.time / schedule.frame - _TOLERANCE), 0)


def pieces(
    par: ParameterSet, changes: Sequence[Change], schedule: Schedule
) -> Iterator[tuple[int, int, ParameterSet]]:
    """Yield the stretches of a run with equal parameters: first frame, end, and these.

    ``par``: what holds at the start.
    """
    begin = 0
    for change in changes:
        end = min(frame_of(change, schedule), schedule.frames)
        if end > begin:
            yield begin, end, par
            begin = end
        par = change.par
    if begin < schedule.frames:
        yield begin, schedule.frames, par


def require_unchanged(changes: Sequence[Change], what: str) -> None:
    """Refuse changes of a run where they would be passed over in silence.

    Raises
    ------
    ParameterError
        When there are any; ``what`` says what cannot be computed.
    """
    if changes:
        raise ParameterError(
            f"{what} of a run whose parameters change, as by a fault, are not available: leave "
            "the change out, or give the parameters from the start"
        )


def energies(names: Sequence[str]) -> list[int]:
    """Return the places of the energies among some outputs: integrals do not jump, stores do."""
    return [k for k, name in enumerate(names) if name.startswith("E_")]


def energy_of(engine: Engine, request: Request, vector: Array, places: Sequence[int]) -> float:
    """Return the sum of some energies at an instant with the parameters of a request [J].

    ``places``: their indices among the outputs.
    """
    end = request.schedule.frames  # a stretch without frames: the row at its end alone
    row = np.empty((1, len(places)))
    asked = replace(request, selection=np.array(places, dtype=np.int32))
    engine.advance(asked, vector.copy(), end, end, row)
    return float(row.sum())
