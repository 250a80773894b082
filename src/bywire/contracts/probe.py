"""Models around a model: all that it is, recorded; and its plant alone, under prescribed memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, NamedTuple

import numpy as np

from bywire.contracts.start import Start
from bywire.core.model import Bounds, Model, Task
from bywire.core.signals import Signal, signals_of
from bywire.core.typing import Array
from bywire.core.wrapping import Wrapping
from bywire.simulation.run import Run, Trajectory, simulate


class Clock(NamedTuple):
    """An integral that every model has."""

    t: Annotated[float, Signal("s", "time")]


@cache
def _recorded(model: type[Model], state: type[NamedTuple], memory: type[NamedTuple]) -> Any:
    """Return the signal tuple of all states, then of all of the memory."""
    fields = {f"x_{name}": signal for name, signal in signals_of(state).items()}
    fields |= {f"m_{name}": signal for name, signal in signals_of(memory).items()}
    annotated: list[Any] = [(name, Annotated[float, signal]) for name, signal in fields.items()]
    return NamedTuple("Recorded", annotated)


class Probe(Wrapping):
    """A model whose states and memory are recorded, and no energies.

    Parameters
    ----------
    model
        The model.
    held
        Whether the stimulus is the memory itself: then the plant runs without its controllers.
    frictions
        Whether there is dry friction.
    """

    def __init__(self, model: Model, held: bool, frictions: bool = True) -> None:
        super().__init__(model)
        self.held, self.rubs = held, frictions

    @property
    def Stimulus(self) -> type[NamedTuple]:
        """Stimulus of the model, or its memory."""
        return self.inner.Memory if self.held else self.inner.Stimulus

    @property
    def Flow(self) -> type[NamedTuple]:
        """Nothing but time."""
        return Clock

    @property
    def Output(self) -> type[NamedTuple]:
        """All states and all of the memory."""
        output: type[NamedTuple] = _recorded(type(self.inner), self.State, self.Memory)
        return output

    @property
    def frictions(self) -> tuple[str, ...]:
        """Frictions of the model, or none."""
        return self.inner.frictions if self.rubs else ()

    def tasks(self, par: Any) -> tuple[Task, ...]:
        """Return the controllers, or the task that hands on what is prescribed."""
        tasks = self.inner.tasks(par)
        if not self.held:
            return tasks
        return (Task("prescribed", min(task.period for task in tasks), self._prescribed),)

    def _prescribed(self, x: Any, m: Any, u: Any, par: Any) -> Any:
        return u

    def bounds(
        self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return the bounds of the frictions, if there are any."""
        return super().bounds(x, xe, memory, par, contact) if self.rubs else ()

    def powers(self, *_: Any) -> Any:
        """Return the rate of time."""
        return Clock(1.0)

    def output(self, x: Any, memory: Any, *_: Any) -> Any:
        """Return all states and all of the memory."""
        return self.Output(*x, *memory)


@dataclass(frozen=True, eq=False)
class Drive:
    """Memory over time, as the controllers of a run wrote it, to prescribe in other runs.

    Parameters
    ----------
    start
        Where that run started.
    rows
        By how much it differs from that of the start, at every sample time; shape (samples,
        memories).
    """

    start: Start
    rows: Array

    def run(self, share: float = 1.0, step: float = 0.0, frictions: bool = True) -> Run:
        """Return a run of the plant alone.

        Parameters
        ----------
        share
            How much of the memory's changes is prescribed.
        step
            Substep [s]; that of the start by default.
        frictions
            Whether there is dry friction.
        """
        memory = np.array([float(value) for value in self.start.memory])
        rows = memory + share * self.rows
        period, at = self.start.period, self.start

        def prescribed(t: Array) -> Array:
            row = np.rint(t / period).astype(int)
            return np.asarray(rows[np.minimum(row, len(rows) - 1)])

        return Run(
            Probe(at.model, held=True, frictions=frictions),
            at.par,
            at.state,
            at.memory,
            prescribed,
            (len(rows) - 1) * period,
            step or at.step,
            period,
        )


def drive_of(start: Start, share: float) -> Drive:
    """Return what the controllers do in a run from a start, see `Start.run`."""
    run = start.run(share)
    probe = Run(
        Probe(start.model, held=False),
        run.par,
        run.state,
        run.memory,
        run.stimulus,
        run.duration,
        run.step,
        run.record,
    )
    trajectory = simulate(probe)
    memory = trajectory.values[:, len(start.state) :]
    return Drive(start, np.asarray(memory - memory[0]))


def states(trajectory: Trajectory, names: Sequence[str]) -> Array:
    """Return the recorded states of a probe, shape (rows, states)."""
    return np.asarray(trajectory.values[:, : len(names)])
