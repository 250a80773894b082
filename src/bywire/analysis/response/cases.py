"""The cases of a sweep: every variant with every amplitude, each at its own operating point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bywire.analysis.response.dataset import Sweep
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.simulation.engine import structure_of
from bywire.simulation.ensemble import case_matrix
from bywire.simulation.run import Run


@dataclass(frozen=True, eq=False)
class Cases:
    """Cases that run side by side, amplitudes within variants.

    Parameters
    ----------
    matrix
        Parameter vectors, shape (parameters, cases).
    starts
        State and memory that each case starts from.
    rest
        Stimulus that the excitation is added to, shape (cases, nu).
    sizes
        Amplitudes, SI, shape (cases,).
    shape
        Numbers of variants and amplitudes.
    """

    matrix: Array
    starts: list[tuple[Any, Any]]
    rest: Array
    sizes: Array
    shape: tuple[int, int]


def cases_of(run: Run, sweep: Sweep, points: Sequence[Run] | None) -> Cases:
    """Return the cases of a sweep.

    Parameters
    ----------
    run
        The loop at its operating point.
    sweep
        Amplitudes, and variations of the run's parameters, which keep its operating point.
    points
        Variants with operating points of their own, in place of variations.

    Raises
    ------
    ParameterError
        When a variant has other sample times or choices than the run, or both kinds are given.
    """
    sizes = np.asarray(sweep.amplitudes, dtype=float)
    if points is None:
        variations = dict(sweep.variations or {})
        matrix = case_matrix(run, variations) if variations else _column(run)[:, None]
        runs = [run] * matrix.shape[1]
    else:
        _require_alike(run, sweep, points)
        matrix, runs = np.stack([_column(variant) for variant in points], axis=1), list(points)
    n = sizes.size
    return Cases(
        matrix=np.repeat(matrix, n, axis=1),
        starts=[(variant.state, variant.memory) for variant in runs for _ in range(n)],
        rest=np.repeat(np.concatenate([run.stimulus(np.zeros(1)) for run in runs]), n, axis=0),
        sizes=np.tile(sizes, len(runs)),
        shape=(len(runs), n),
    )


def _column(run: Run) -> Array:
    return np.array(list(run.par.leaves().values()))


def _require_alike(run: Run, sweep: Sweep, points: Sequence[Run]) -> None:
    if sweep.variations:
        raise ParameterError("variants: give variations of one point or points, not both")
    if not points:
        raise ParameterError("variants: give at least one operating point")
    structure, tasks = structure_of(run.model, run.par), run.model.tasks(run.par)
    for k, variant in enumerate(points):
        if structure_of(variant.model, variant.par) != structure:
            raise ParameterError(f"variant {k} is another model or makes another choice")
        if [t.period for t in variant.model.tasks(variant.par)] != [t.period for t in tasks]:
            raise ParameterError(f"variant {k} has other sample times: they cannot vary in a sweep")
