"""How probably gains meet their requirements: over models that are drawn, and not designed for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bywire.bench.requirements import Limit
from bywire.core.typing import Progress, silent
from bywire.synthesis.linear_case import LinearCase, room, values_of
from bywire.synthesis.outcome import MISSED


@dataclass(frozen=True)
class Judged:
    """Requirements over drawn models.

    Parameters
    ----------
    models
        How many were judged; one that does not exist, or is unstable, meets nothing.
    unstable
        How many are unstable with the gains, or do not exist.
    met
        How many meet each requirement, in their order.
    all_met
        How many meet all of them.
    worst
        Worst value of each requirement's figure over the stable ones, NaN without any.
    """

    models: int
    unstable: int
    met: tuple[int, ...]
    all_met: int
    worst: tuple[float, ...]


def judged_over(
    cases: Sequence[LinearCase | None],
    requirements: Sequence[Limit],
    gains: Mapping[str, float],
    progress: Progress = silent,
) -> Judged:
    """Return how many models meet requirements with some gains.

    Parameters
    ----------
    cases
        Models; None for one that does not exist.
    requirements
        See `requirement.read`.
    gains
        By dotted name [SI].
    progress
        Called with a label and the finished share.
    """
    rooms = np.full((len(cases), len(requirements)), -np.inf)
    values = np.full(rooms.shape, np.nan)
    for k, case in enumerate(cases):
        figures = None if case is None else case.figures(gains)
        if figures is not None and figures.is_stable:
            rooms[k] = [room(figures, each) for each in requirements]
            known = values_of(figures)
            values[k] = [known[each.figure] for each in requirements]
        progress("drawn models", (k + 1) / len(cases))
    met = rooms >= MISSED
    lowest = np.where(np.isneginf(rooms), np.inf, rooms).argmin(axis=0)
    worst = tuple(float(values[row, r]) for r, row in enumerate(lowest))
    return Judged(
        len(cases),
        int(np.isneginf(rooms).all(axis=1).sum()),
        tuple(met.sum(axis=0).tolist()),
        int(met.all(axis=1).sum()),
        worst,
    )
