"""Runs that differ only in numbers, as rows of tables instead of objects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import overload

import numpy as np
from numpy.typing import NDArray

from bywire.core.parameters import ParameterSet, ParameterTable, leaf_table
from bywire.core.typing import Array
from bywire.simulation.run import Run, contact_doubts


@dataclass(frozen=True)
class RunTable(Sequence[Run]):
    """Runs of one model, structure and plan without changes, whose stimuli differ only in noise.

    Parameters
    ----------
    like
        One of the runs.
    parameters
        Numbers of their parameter sets, shape (runs, leaves).
    states, memories
        Initial values, shape (runs, entries) each.
    stimulus
        Stimulus without noise, shape (samples, nu).
    seeds
        Seed of each run's noise, shape (runs, numbers).
    noisy
        Columns of the noisy signals in a stimulus row.
    build
        ``build(k)``: the run in row k.
    """

    like: Run
    parameters: Array
    states: Array
    memories: Array
    stimulus: Array
    seeds: NDArray[np.uint64]
    noisy: tuple[int, ...]
    build: Callable[[int], Run]

    @property
    def pars(self) -> ParameterTable:
        """Parameters of the runs."""
        return ParameterTable(self[0].par, self.parameters, lambda k: self[k].par)

    def __len__(self) -> int:
        return len(self.parameters)

    @overload
    def __getitem__(self, k: int) -> Run: ...

    @overload
    def __getitem__(self, k: slice) -> RunTable: ...

    def __getitem__(self, k: int | slice) -> Run | RunTable:
        places = range(len(self))[k]
        if isinstance(places, int):
            return self.build(places)
        return replace(
            self,
            parameters=self.parameters[k],
            states=self.states[k],
            memories=self.memories[k],
            seeds=self.seeds[k],
            build=lambda j: self.build(places[j]),
        )


def one_of(runs: Sequence[Run]) -> Run:
    """Return one of several runs with the same model, structure and plan."""
    return runs.like if isinstance(runs, RunTable) else runs[0]


def change(runs: Sequence[Run]) -> bool:
    """Return whether a run has changes of its parameters."""
    return not isinstance(runs, RunTable) and any(run.changes for run in runs)


def parameters_of(runs: Sequence[Run]) -> Sequence[ParameterSet]:
    """Return the parameters of each run."""
    return runs.pars if isinstance(runs, RunTable) else [run.par for run in runs]


def doubts_of(runs: Sequence[Run]) -> list[str]:
    """Return why the step may be too long for each run's contacts; see `contact_doubts`."""
    one = one_of(runs)
    if isinstance(runs, RunTable):
        return contact_doubts(one, runs.states, runs.memories, runs.parameters)
    states, memories = [run.state for run in runs], [run.memory for run in runs]
    return contact_doubts(one, states, memories, leaf_table([run.par for run in runs]))
