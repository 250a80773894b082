"""Several starts on all cores; what is finished survives an interrupt."""

from __future__ import annotations

import hashlib
import json
import os
import threading
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError, SolverError
from bywire.identification.least_squares import Loss, Problem, Solution, solve
from bywire.identification.unknown import moved

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

_SAME = 0.01  # of the lowest cost: minima that count as one
_ROUGH = 1e-4  # of the cost: enough to come nearer
_ENDED = 1e-5  # of the cost: enough to tell minima apart; the best one is polished later


class _StoppedError(Exception):
    """Ends the search in a thread after an interrupt."""


@dataclass(frozen=True)
class Search:
    """Where several starts led.

    Parameters
    ----------
    solutions
        One per start that led anywhere, in the order of the starts.
    failed
        Starts from which nothing could be computed.
    """

    solutions: tuple[Solution, ...]
    failed: int

    @property
    def best(self) -> Solution:
        """The lowest minimum."""
        return min(self.solutions, key=lambda s: s.cost)

    @property
    def reached(self) -> int:
        """How many starts came within 1 % of the lowest minimum."""
        lowest = self.best.cost
        return sum(s.cost <= (1.0 + _SAME) * lowest + 1e-12 for s in self.solutions)


def search(
    problem: Problem,
    starts: Sequence[Array],
    loss: Loss = "linear",
    progress: Progress | None = None,
    store: Path | None = None,
    threads: int | None = None,
    before: Callable[[Array], Array] | None = None,
) -> Search:
    """Solve from every start.

    Kernels let go of Python's lock while they run, so that threads use all cores.

    Parameters
    ----------
    starts
        Each of shape (p,).
    progress
        Called with a label and the finished share.
    store
        File that keeps every finished start; a search of the same residuals and starts goes on
        from there.
    threads
        All cores by default.
    before
        Brings each start nearer first.

    Raises
    ------
    SolverError
        When no start led anywhere.
    KeyboardInterrupt
        When interrupted; finished starts are in the store.
    """
    known = _read(store)
    keys = _keys(problem, starts, loss) if store is not None else [""] * len(starts)
    found = {k: known[key] for k, key in enumerate(keys) if key in known}
    stop = threading.Event()

    def evaluate(values: Array) -> tuple[Array, Array]:
        if stop.is_set():
            raise _StoppedError
        return problem.evaluate(values)

    guarded = replace(problem, evaluate=evaluate)

    def one(start: Array) -> Solution:
        return solve(guarded, start if before is None else before(start), loss, share=_ENDED)

    failed = 0
    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        jobs = {
            pool.submit(one, start): k for k, start in enumerate(starts) if k not in found
        }
        try:
            for job in as_completed(jobs):
                k = jobs[job]
                try:
                    found[k] = job.result()
                    _append(store, keys[k], found[k])
                except SolverError:
                    failed += 1
                if progress is not None:
                    progress("starts", (len(found) + failed) / len(starts))
        except KeyboardInterrupt:
            stop.set()
            pool.shutdown(cancel_futures=True)
            raise
    if not found:
        raise SolverError(
            "no start could be computed: begin nearer to the truth, or measure at other points"
        )
    return Search(tuple(found[k] for k in sorted(found)), failed)


def nearer(problem: Problem, held: Collection[str], start: Array) -> Array:
    """Return where a start leads with some unknowns, by name, held at it."""
    fixed = [k for k, u in enumerate(problem.unknowns) if u.name in held]
    rest = replace(problem, unknowns=moved(problem.unknowns, start))
    for k in reversed(fixed):
        rest = rest.held(k)
    found = start.copy()
    free = np.delete(np.arange(start.size), fixed)
    found[free] = solve(rest, start[free], share=_ROUGH).values
    return found


def _keys(problem: Problem, starts: Sequence[Array], loss: Loss) -> list[str]:
    """Return what tells one search from another: unknowns, their residuals, and the start."""
    digest = hashlib.sha256(f"{loss} {problem.unknowns}".encode())
    for start in starts:
        try:
            digest.update(np.round(problem.evaluate(start)[0], 9).tobytes())
            break
        except SolverError:
            continue
    keys = []
    for start in starts:
        own = digest.copy()
        own.update(start.tobytes())
        keys.append(own.hexdigest())
    return keys


def _read(store: Path | None) -> dict[str, Solution]:
    """Return the finished starts; a last line that was cut off by a killed run is left out."""
    if store is None or not store.exists():
        return {}
    found = {}
    try:
        lines = store.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{store} cannot be read: {error}; delete it to start anew") from None
    for line in lines:
        try:
            row = json.loads(line)
            values = np.array(row["values"], dtype=float)
            found[str(row["key"])] = Solution(values, float(row["cost"]))
        except (ValueError, KeyError, TypeError):
            continue
    return found


def _append(store: Path | None, key: str, solution: Solution) -> None:
    if store is None:
        return
    row = {"key": key, "values": solution.values.tolist(), "cost": solution.cost}
    with store.open("a", encoding="utf-8") as file:
        file.write(json.dumps(row) + "\n")
