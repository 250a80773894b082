"""Searches from several starts on all cores; finished ones survive an interrupt."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bywire.cases.runner import complete
from bywire.cases.store import PieceLines
from bywire.core.errors import ParameterError, SolverError
from bywire.core.interrupts import raise_if_stopped
from bywire.core.typing import Array, Progress, silent
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import NO_TRIAL, Loss, Problem, Solution, estimate, solve
from bywire.identification.unknown import moved, scattered

_SAME = 0.01  # of the lowest cost: minima that are treated as equal
_ROUGH = 1e-4  # of the cost: enough for a first approach
_ENDED = 1e-5  # of the cost: enough to distinguish minima; the best one is refined later


@dataclass(frozen=True)
class Search:
    """Results of several starts.

    Parameters
    ----------
    solutions
        One per successful start, in the order of the starts.
    failed
        Starts that could not be computed.
    """

    solutions: tuple[Solution, ...]
    failed: int

    @property
    def best(self) -> Solution:
        """The lowest minimum."""
        return min(self.solutions, key=lambda s: s.cost)

    @property
    def reached(self) -> int:
        """Number of starts within 1 % of the lowest minimum."""
        lowest = self.best.cost
        return sum(s.cost <= (1.0 + _SAME) * lowest + 1e-12 for s in self.solutions)


def multistart(
    problem: Problem,
    count: int = 8,
    *,
    spread: float = 0.3,
    seed: int = 1,
    loss: Loss = "linear",
    progress: Progress | None = None,
    store: Path | None = None,
) -> Estimate:
    """Return the estimate at the lowest minimum from several starts.

    Parameters
    ----------
    problem
        Problem of your own model: ``output_error(trials, unknowns)``, or written by hand.
    count
        Number of starts: the unknowns' own start, then others around it.
    spread
        Maximum distance of the others, as a fraction of the start.
    seed
        Seed of their random numbers.
    loss
        Loss of the residuals.
    progress
        Callback with a label and the finished share.
    store
        File that saves every finished start.

    Returns
    -------
    Estimate
        With a note on how many starts reached the lowest minimum.

    Raises
    ------
    SolverError
        When no start could be computed.
    ParameterError
        When the data determine none of the unknowns.
    """
    starts = scattered(problem.unknowns, count, spread, seed)
    led = search(problem, starts, loss, progress, store)
    note = f"{led.reached} of {count} starts reached the lowest minimum"
    if led.reached == 1 < count:
        note += ". A lower minimum may exist. Use more starts, narrower bounds or fewer unknowns"
    return estimate(problem, loss, led.best.values).noted((note,))


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

    Kernels release Python's lock while they run, so that threads use all cores.

    Parameters
    ----------
    starts
        Each of shape (p,).
    progress
        Callback with a label and the finished share.
    store
        File that saves every finished start; a search with the same residuals and starts
        continues from there.
    threads
        Number of threads; all cores by default.
    before
        Function that first brings each start closer to a minimum.

    Raises
    ------
    SolverError
        When no start could be computed.
    ParameterError
        When the parameters' rules reject the starts.
    KeyboardInterrupt
        When interrupted; finished starts are in the store.
    """
    lines, told = PieceLines(store), progress or silent
    known: dict[str, Solution | Exception] = dict(lines.pieces(_solution))
    keys = _keys(problem, starts, loss) if store is not None else [""] * len(starts)

    def evaluate(values: Array) -> tuple[Array, Array]:
        raise_if_stopped()
        return problem.evaluate(values)

    guarded = replace(problem, evaluate=evaluate)

    def solved(k: int) -> Solution | Exception:
        start = starts[k]
        try:
            return solve(guarded, start if before is None else before(start), loss, share=_ENDED)
        except NO_TRIAL as error:
            return error

    def keep(k: int, led: Solution | Exception) -> None:
        if isinstance(led, Solution):
            lines.keep(keys[k], {"values": led.values.tolist(), "cost": led.cost})

    ends = complete(
        range(len(starts)),
        {k: known[key] for k, key in enumerate(keys) if key in known},
        solved,
        keep=keep,
        progress=lambda _, share: told("starts", share),
        workers=threads,
    )
    solutions = {k: end for k, end in ends.items() if isinstance(end, Solution)}
    refused = [end for end in ends.values() if isinstance(end, ParameterError)]
    if not solutions and refused:
        raise refused[-1]
    if not solutions:
        raise SolverError(
            "the model failed from every start. Start closer to the true values, or measure at "
            "other points",
            name="starts",
        )
    return Search(tuple(solutions[k] for k in sorted(solutions)), len(starts) - len(solutions))


def nearer(problem: Problem, held: Collection[str], start: Array) -> Array:
    """Return the end of a search that holds some unknowns, listed by name, at their starts."""
    fixed = [k for k, u in enumerate(problem.unknowns) if u.name in held]
    rest = replace(problem, unknowns=moved(problem.unknowns, start))
    for k in reversed(fixed):
        rest = rest.held(k)
    free = np.delete(np.arange(start.size), fixed)
    nearer_start = start.copy()
    nearer_start[free] = solve(rest, start[free], share=_ROUGH).values
    return nearer_start


def _keys(problem: Problem, starts: Sequence[Array], loss: Loss) -> list[str]:
    """Return a text that identifies a search: unknowns, their residuals, and the start."""
    digest = hashlib.sha256(f"{loss} {problem.unknowns}".encode())
    for start in starts:
        try:
            digest.update(np.round(problem.evaluate(start)[0], 9).tobytes())
            break
        except SolverError:
            continue
    keys = []
    for start in starts:
        of_start = digest.copy()
        of_start.update(start.tobytes())
        keys.append(of_start.hexdigest())
    return keys


def _solution(row: Mapping[str, Any]) -> Solution:
    """Return the solution from an entry in a file of finished starts."""
    return Solution(np.array(row["values"], dtype=float), float(row["cost"]))
