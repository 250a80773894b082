"""One model with one parameter set on trial, and the runs that its contracts share."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from bywire.contracts.evidence import NotCheckedError, Place, place_of
from bywire.contracts.probe import Drive, Probe, drive_of
from bywire.contracts.start import Start
from bywire.core.errors import BywireError, ParameterError, RunError
from bywire.core.model import Model
from bywire.core.typing import Array
from bywire.simulation.engine import prepare
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.run import Run

LARGE = 0.5
"""amplitude of the stimulus in large runs, of the signals' usual magnitudes"""


class Trial:
    """A model where it starts, with what runs from there have in common.

    Parameters
    ----------
    kind
        Class of the model.
    find_start
        Returns the model with its parameters, and where its runs start.
    """

    def __init__(self, kind: type[Any], find_start: Callable[[], Start]) -> None:
        self.kind, self._find_start = kind, find_start

    @cached_property
    def start(self) -> Start:
        """The model with its parameters, where its runs start.

        Raises
        ------
        NotCheckedError
            When nobody can say where.
        """
        try:
            return self._find_start()
        except BywireError as error:
            raise NotCheckedError(str(error)) from error

    @property
    def model(self) -> Model:
        """The model on trial."""
        return self.start.model

    @cached_property
    def drive(self) -> Drive:
        """What the controllers do in a large run.

        Raises
        ------
        NotCheckedError
            When that run fails.
        """
        try:
            return drive_of(self.start, LARGE)
        except RunError as error:
            raise NotCheckedError(f"the run from {self.start.known} fails: {error}") from error

    @cached_property
    def rounds(self) -> bool:
        """Whether a controller rounds, as a converter or an encoder does."""
        ticks = prepare(self.model, self.start.par).program.ticks
        return any(
            tick.instruction_id(k) == ca.OP_FLOOR
            for tick in ticks
            for k in range(tick.n_instructions())
        )

    def large_run(self, frictions: bool) -> Run:
        """Return a large run from the start, with states and memory recorded.

        Where a controller rounds it is that of the plant alone: a last digit can change a code, and
        nothing has derivatives.
        """
        if self.rounds:
            return self.drive.run(frictions=frictions)
        probe = Probe(self.model, held=False, frictions=frictions)
        return replace(self.start.run(LARGE), model=probe)

    def place(self, *members: str) -> Place:
        """Return where the first of some members of the model is written, else its class."""
        for member in members:
            function = vars(self.kind).get(member)
            if inspect.isfunction(function):
                return place_of(function)
        return place_of(self.kind)


def constants(run: Run) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a run that may vary within an ensemble: no table, no sample time."""
    periods = [task.period for task in run.model.tasks(run.par)]
    for name, value in run.par.flat().items():
        if name in run.par.leaves():
            try:
                moved = run.par.replace({name: float(np.nextafter(value, np.inf))})
            except ParameterError:  # at the end of its range
                continue
            if [task.period for task in run.model.tasks(moved)] == periods:
                yield name, float(value)


def lanes(run: Run, variations: Mapping[str, Sequence[float]]) -> Array:
    """Return all signals of a run for other parameters, shape (cases, rows, signals)."""
    return simulate_ensemble(run, variations, run.model.Output._fields).values
