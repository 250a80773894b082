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
_SAME = 1e-12  # by which states may differ, of each


@dataclass(frozen=True)
class Dependence:
    """What follows which parameter.

    Parameters
    ----------
    driving
        Parameters that change what drives the run, how long it takes, when rows are recorded, or
        in a way that the page does not know the state in which it begins; those that the
        experiment sets itself; and nodes of tables, which only together make a table.
    judging
        Parameters that change options by which key figures look at it.
    """

    driving: frozenset[str]
    judging: frozenset[str]


def dependence(bench: Bench, number: int, names: Collection[str]) -> Dependence:
    """Return what follows the parameters of a bench in one of its runs.

    Each is moved by a thousandth, up or else down; one that admits neither counts as driving.
    """
    case, values = _case(bench, number), bench.par.leaves()
    driving, judging = set(), set()
    for name in names:
        if name not in values:  # a node, as exports call it: p_table[1]
            driving.add(name)
            continue
        moved, other = _moved(bench, number, name, values[name])
        is_taken = other is not None and other.par.value(name) == moved.par.value(name)
        if other is None or not (is_taken and _is_driven_alike(bench, case, other)):
            driving.add(name)
        if moved.chosen_options != bench.chosen_options:
            judging.add(name)
    return Dependence(frozenset(driving), frozenset(judging))


def _is_driven_alike(bench: Bench, case: Case, other: Case) -> bool:
    """Return whether a page's run with other parameters is driven, and begins, as the bench's."""
    plans = [(c.duration, c.settle, c.keep, c.record) for c in (case, other)]
    is_driven = plans[0] == plans[1] and np.array_equal(_rows(case), _rows(other))
    return is_driven and _begins_alike(bench, case, other)


def _case(bench: Bench, number: int) -> Case:
    """Return a run as it is driven; where that takes other runs before, as its preview says."""
    made = bench.cases_with(bench.par, bench.chosen_options, bench.definition.preview)[number]
    return made.aligned(bench.step, bench.record)


def _begins_alike(bench: Bench, case: Case, other: Case) -> bool:
    """Return whether a run with other parameters begins where the page's does with them."""
    if bench.definition.preview is not None:
        return True  # where it really begins, other runs say; the page says that it keeps to ours
    begun = (case.state, case.memory) if case.start is None else case.start(other.par)
    pairs = zip(begun, (other.state, other.memory), strict=True)
    return all(np.allclose(a, b, rtol=_SAME, atol=0.0, equal_nan=True) for a, b in pairs)


def _moved(bench: Bench, number: int, name: str, value: float) -> tuple[Bench, Case | None]:
    """Return the bench with a parameter moved, and its run; None where neither way is admitted."""
    step = _SHARE * (abs(value) or 1.0)
    for other in (value + step, value - step):
        with suppress(BywireError):
            moved = bench.with_overrides({name: other})
            return moved, _case(moved, number)
    return bench, None


def _rows(case: Case) -> Array:
    """Return the stimulus over the run, what is left out as zero."""
    times = np.linspace(-case.settle, case.duration, _TIMES)
    given = case.stimulus(times)
    names: Sequence[str] = case.model.Stimulus._fields
    return np.array([given.get(name, np.zeros(_TIMES)) for name in names], dtype=float)
