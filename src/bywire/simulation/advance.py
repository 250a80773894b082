"""Advance of a run in chunks, and through changes of its parameters."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from bywire.core.errors import ParameterError, SolverError, WorkLimitError
from bywire.core.interrupts import interrupt_handled
from bywire.core.parameters import ParameterSet
from bywire.core.signals import Role, Signal, signals_of
from bywire.core.typing import Array
from bywire.simulation.engine import Engine
from bywire.simulation.native import CHUNK, Request
from bywire.simulation.schedule import Layout, Schedule

Progress = Callable[[float], None]

_CHUNK_SECONDS = 0.1
_PART = 8.0  # cost of one part of a cut substep, in ordinary substeps


def advance_all(
    engine: Engine,
    request: Request,
    vector: Array,
    values: Array,
    progress: Progress | None,
    begin: int = 0,
    last: int | None = None,
    most: float = math.inf,
) -> int:
    """Advance in chunks with progress and interrupts between them; return the finished frames.

    Parameters
    ----------
    engine, request
        Engine and its request.
    vector
        The engine's state vector, updated in place. After an interrupt it contains the state after
        the finished frames.
    values
        Recorded rows, starting at the first frame, filled in place, shape (rows, signals).
    progress
        Called with the finished fraction, 0 to 1, after every chunk.
    begin, last
        First frame and end frame. Default: the whole run.
    most
        The run's work limit; see `work_of`.

    Raises
    ------
    SolverError
        When a value of the trajectory is infinite or NaN.
    WorkLimitError
        When the run exceeds its work limit.
    """
    schedule = request.schedule
    first = -(-begin // schedule.record_frames)
    last = schedule.frames if last is None else last
    size = min(16 * schedule.record_frames, max(CHUNK // schedule.substeps, 1))
    while begin < last:
        end = min(begin + size, last)
        started, saved = time.perf_counter(), vector.copy()
        row = -(-begin // schedule.record_frames) - first
        try:
            engine.advance(request, vector, begin, end, values[row:])
        except KeyboardInterrupt:
            interrupt_handled()
            vector[:] = saved
            return begin
        require_finite(
            engine.layout, vector, f"the run diverged before t = {end * schedule.frame:g} s"
        )
        begin = end
        require_work(work_of(schedule, engine.layout, begin, vector), most)
        try:
            if progress is not None:
                progress(end / schedule.frames)
        except KeyboardInterrupt:
            interrupt_handled()
            return begin
        elapsed = max(time.perf_counter() - started, 1e-9)
        factor = min(max(_CHUNK_SECONDS / elapsed, 0.5), 8.0)
        size = max(int(size * factor), 1)
    return begin


def work_of(schedule: Schedule, layout: Layout, frames: int, vector: Array) -> Any:
    """Return the work of each run up to a frame, in ordinary substeps.

    Parts of cut substeps cost more, because they share no operations with ordinary substeps.
    """
    tries = vector[layout.start["counters"] + 2]
    return frames * schedule.substeps + _PART * tries


def require_work(work: Any, most: Any) -> None:
    """Raise ``WorkLimitError`` if a run exceeds its work limit."""
    if np.any(work > most):
        raise WorkLimitError(
            f"the run exceeds its limit of {np.min(most):.3g} substeps, because contact or "
            "friction states keep changing. Look for a parameter with an extreme value",
            name="work",
            value=f"{np.min(most):.3g} substeps",
        )


def require_finite(layout: Layout, vector: Array, what: str) -> None:
    """Raise ``SolverError`` if a value in one or several state vectors is infinite or NaN.

    Checking only the states is not enough, because a friction with a NaN force would seem to stick.
    """
    if not np.all(np.isfinite(vector[: layout.start["counters"]])):
        raise SolverError(
            f"{what}: a signal is not finite. Look for a parameter far from its usual magnitude, "
            "or use a smaller step",
            name="signal",
            value="not finite",
        )


# --- Changes of parameters between two frames; states and memories stay the same
# If such a parameter belongs to an energy store, the change does work. This work is recorded, so it
# is part of the energy balance and not of its closing error. A contact's loss is its work minus its
# stored energy, and therefore includes the work of a change in that contact.

_PUT_IN = "E_change"
_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Change:
    """New parameters that apply from a certain time.

    Parameters
    ----------
    time
        Time since the start of the run [s], rounded up to a frame. Every tick and every recorded
        row begins a frame.
    par
        All parameters from that time. Choices may differ if the model's states, its memory and the
        sample times stay the same.
    """

    time: float
    par: ParameterSet


def frame_of(change: Change, schedule: Schedule) -> int:
    """Return the first frame with the changed parameters."""
    return max(math.ceil(change.time / schedule.frame - _TOLERANCE), 0)


def pieces(
    par: ParameterSet, changes: Sequence[Change], schedule: Schedule
) -> Iterator[tuple[int, int, ParameterSet]]:
    """Yield the parts of a run with constant parameters: first frame, end frame, parameters.

    ``par``: parameters at the start.
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
    """Reject changes of parameters for results that would ignore them.

    Raises
    ------
    ParameterError
        When the run has changes; ``what``: the results that cannot be computed.
    """
    if changes:
        raise ParameterError(
            f"{what} are not available for a run whose parameters change, for example due to a "
            "fault. Remove the change, or set the parameters from the start",
            name="changes",
            value=what,
        )


@cache
def put_in_signals(output: type) -> Mapping[str, Signal]:
    """Return the signals for the work of changes, one for each energy balance of an Output.

    The first balance's signal has the plain name. This is the actuator's balance if it exists.
    """
    books = dict.fromkeys(_books(output).values())
    first = "" if "" in books else next(iter(books), "")
    return {
        _PUT_IN if book == first else f"{_PUT_IN}_{book.replace(' ', '_')}": Signal(
            "J",
            "energy added by parameter changes",
            role=Role("source", "changed parameters", book=book),
        )
        for book in sorted(books, key=lambda book: book != first)
    }


def energies(output: type, names: Sequence[str]) -> Array:
    """Return which outputs are stored energies of each energy balance.

    Stored energies jump at changes, but integrals do not. The shape is (balances, outputs), in the
    order of `put_in_signals`. An entry is 1 if the output belongs to the balance.
    """
    books = _books(output)
    signals = put_in_signals(output).values()
    rows = [[float(books.get(n) == s.role.book) for n in names] for s in signals if s.role]
    return np.array(rows).reshape(len(rows), len(names))


def _books(output: type) -> dict[str, str]:
    known = signals_of(output).items()
    return {name: s.role.book if s.role else "" for name, s in known if name.startswith("E_")}


def energy_of(engine: Engine, request: Request, vector: Array, books: Array) -> Array:
    """Return the total energy of each balance for a state vector and a request's parameters [J].

    ``books``: `energies` of all outputs.
    """
    end = request.schedule.frames  # an interval without frames has only the row at its end
    row = np.empty((1, books.shape[1]))
    asked = replace(request, selection=np.arange(books.shape[1], dtype=np.int32))
    engine.advance(asked, vector.copy(), end, end, row)
    # Other outputs need not be finite.
    return np.array([row[0, book > 0].sum() for book in books])
