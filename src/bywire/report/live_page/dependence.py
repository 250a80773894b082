"""Which parameters a page may move: its run is driven as the bench drives it, whatever they are."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case
from bywire.core.errors import BywireError
from bywire.core.typing import Array

_SHARE = 1e-3  # of a value, by which it is moved to see what follows it
_TIMES = 101  # at which stimuli are compared


@dataclass(frozen=True)
class Dependence:
    """What follows which parameter.

    Parameters
    ----------
    driving
        Parameters that change what drives the run, how long it takes, or when rows are recorded.
    judging
        Parameters that change options by which key figures look at it.
    """

    driving: frozenset[str]
    judging: frozenset[str]


def dependence(bench: Bench, number: int, names: Collection[str]) -> Dependence:
    """Return what follows the parameters of a bench in one of its runs.

    Each is moved by a thousandth, up or else down; one that admits neither counts as driving.
    """
    case = bench.cases()[number]
    rows, values = _rows(case), bench.par.leaves()
    driving, judging = set(), set()
    for name in names:
        moved = _moved(bench, name, values[name])
        if moved is None:
            driving.add(name)
            continue
        other = moved.cases()[number]
        plans = [(c.duration, c.settle, c.keep, c.record) for c in (case, other)]
        if plans[0] != plans[1] or not np.array_equal(rows, _rows(other)):
            driving.add(name)
        if moved.chosen_options != bench.chosen_options:
            judging.add(name)
    return Dependence(frozenset(driving), frozenset(judging))


def _moved(bench: Bench, name: str, value: float) -> Bench | None:
    step = _SHARE * (abs(value) or 1.0)
    for other in (value + step, value - step):
        with suppress(BywireError):
            return bench.varied({name: other}, {})
    return None


def _rows(case: Case) -> Array:
    """Return the stimulus over the run, what is left out as zero."""
    times = np.linspace(-case.settle, case.duration, _TIMES)
    given = case.stimulus(times)
    names: Sequence[str] = case.model.Stimulus._fields
    return np.array([given.get(name, np.zeros(_TIMES)) for name in names], dtype=float)
