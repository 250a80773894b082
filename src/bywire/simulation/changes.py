"""Parameters that change during a run: between two frames, all states and memories kept.

Where such a parameter belongs to a store of energy, the change does work. It is recorded, so that
it stands in the books and not in their closing error. A contact's loss is what its work exceeds its
store by: what a change does there stands in that loss.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.signals import Role, Signal, signals_of
from bywire.core.typing import Array
from bywire.simulation.engine import Engine
from bywire.simulation.native import Request
from bywire.simulation.schedule import Schedule

_PUT_IN = "E_change"
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


@cache
def put_in_signals(output: type) -> Mapping[str, Signal]:
    """Return the signals of what changes put into the energies of an Output: one for each book.

    That of the first book has the plain name: of the actuator's own, which has none, if there is.
    """
    books = dict.fromkeys(_books(output).values())
    first = "" if "" in books else next(iter(books), "")
    return {
        _PUT_IN if book == first else f"{_PUT_IN}_{book.replace(' ', '_')}": Signal(
            "J",
            "energy put in by changed parameters",
            role=Role("source", "changed parameters", book=book),
        )
        for book in sorted(books, key=lambda book: book != first)
    }


def energies(output: type, names: Sequence[str]) -> Array:
    """Return which of some outputs are energies, and of which book's.

    Integrals do not jump, stores do. Shape (books, outputs), 1 where an output is one of the
    book's, in the order of `put_in_signals`.
    """
    books = _books(output)
    signals = put_in_signals(output).values()
    rows = [[float(books.get(n) == s.role.book) for n in names] for s in signals if s.role]
    return np.array(rows).reshape(len(rows), len(names))


def _books(output: type) -> dict[str, str]:
    known = signals_of(output).items()
    return {name: s.role.book if s.role else "" for name, s in known if name.startswith("E_")}


def energy_of(engine: Engine, request: Request, vector: Array, books: Array) -> Array:
    """Return the sum of each book's energies at an instant with a request's parameters [J].

    ``books``: `energies` of all outputs.
    """
    end = request.schedule.frames  # a stretch without frames: the row at its end alone
    row = np.empty((1, books.shape[1]))
    asked = replace(request, selection=np.arange(books.shape[1], dtype=np.int32))
    engine.advance(asked, vector.copy(), end, end, row)
    # Outputs that are no energies need not be finite.
    return np.array([row[0, book > 0].sum() for book in books])
