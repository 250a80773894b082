"""Stroboscopic map: a system from one instant to the next a period later, with exact derivatives.

The system must take the same inputs in every period: a dither whose period is a whole number of
sample times, a disc that turns around. What the map acts on is everything that the engine carries
from one substep to the next: states, their last increments, and the memory of the controllers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import CompilerError, ParameterError
from bywire.core.typing import Array
from bywire.simulation.advance import require_finite, require_unchanged
from bywire.simulation.compiler import Compiler, find_compiler
from bywire.simulation.engine import built_once, prepare
from bywire.simulation.native import Request
from bywire.simulation.program import Program
from bywire.simulation.repetition import window_schedule
from bywire.simulation.run import Run, initial_vector, selected
from bywire.simulation.schedule import Schedule
from bywire.simulation.sensitivity import DIRECTIONS, TangentKernel


@dataclass(frozen=True)
class Period:
    """One period of a system.

    Parameters
    ----------
    end
        Carried vector at the end, before its controllers run, shape (n,).
    rows
        Recorded signals, the end left out, shape (rows, signals).
    """

    end: Array
    rows: Array


@dataclass(frozen=True)
class Derivatives:
    """Derivatives of a period.

    Parameters
    ----------
    A
        Of the carried vector at the end by that at the beginning, shape (n, n).
    B
        Of the carried vector at the end by the input of every tick, shape (n, ticks).
    C, D
        Of the recorded signals by both, shapes (rows, signals, n) and (rows, signals, ticks).
    """

    A: Array
    B: Array
    C: Array
    D: Array


class Stroboscope:
    """The map of one system over its period.

    Parameters
    ----------
    run
        Its duration is the period: whole sample times and recording intervals. Its stimulus at
        time zero is held throughout.
    inputs
        Signals of the stimulus that move together, held from one tick of the fastest controller
        to the next.
    signals
        Outputs to record.

    Raises
    ------
    CompilerError
        When there is no compiler.
    StepError
        When the period is not a multiple of the sample times.
    UnknownNameError
        When a signal is unknown.
    ParameterError
        When a controller rounds what it samples: derivatives through it are zero.
    """

    def __init__(self, run: Run, inputs: Sequence[str], signals: Sequence[str]) -> None:
        compiler = find_compiler()
        if compiler is None:
            raise CompilerError("derivatives need a C compiler: install the extra bywire[compiler]")
        require_unchanged(run.changes, "derivatives of a stroboscope")
        self._schedule = _by_substeps(window_schedule(run))
        self._open = replace(self._schedule, frames=self._schedule.frames + 1)
        program = prepare(run.model, run.par).program
        self._selection = selected(tuple(program.outputs), signals)
        self._inputs = selected(run.model.Stimulus._fields, inputs)
        self._kernel = _kernel(program, compiler)
        if self._kernel.rounds:
            raise ParameterError(
                "a sampled value is rounded to whole codes, through which derivatives are zero: "
                "choose the law without rounding (adc.law = 'ideal')",
                name="adc.law",
                valid="'ideal'",
            )
        self._p = np.array(list(run.par.leaves().values()))
        self._layout = self._kernel.layout
        self._u = np.repeat(run.stimulus(np.zeros(1)), self._schedule.stimulus_rows, axis=0)
        first = self._layout.start["x"]
        self._frictions = np.array([first + k for k in program.velocities], int)
        start = initial_vector(self._layout, run.state, run.memory)
        self.start: Array = start[self._carried]
        self.names: tuple[str, ...] = (
            *run.model.State._fields,
            *(f"last increment of {name}" for name in run.model.State._fields),
            *run.model.Memory._fields,
        )

    @cached_property
    def _carried(self) -> NDArray[np.int64]:
        """Places of states, increments and memory in the engine's vector."""
        layout = self._layout
        spans = [(layout.start[kind], layout.length[kind]) for kind in ("x", "d", "m")]
        return np.concatenate([np.arange(first, first + count) for first, count in spans])

    @property
    def ticks(self) -> int:
        """Ticks of the fastest controller in a period."""
        return self._schedule.frames // self._schedule.stimulus_frames

    def advance(self, start: Array) -> Period:
        """Return one period from a carried vector, shape (n,)."""
        vector, tangents = self._loaded(start)
        values, _ = self._segment(vector, tangents, self._seeds(()), 0, self._schedule.frames)
        require_finite(self._layout, vector, "the period left the numbers")
        return Period(vector[self._carried], values)

    def derivatives(self, start: Array) -> Derivatives:
        """Return the derivatives of one period by start and inputs."""
        n, ticks = start.size, self.ticks
        count = n + ticks
        end = np.empty((n, count))
        rows = self._schedule.frames // self._schedule.record_frames
        shown = np.empty((rows, self._selection.size, count))
        for first in range(0, count, DIRECTIONS):
            lanes = range(first, min(first + DIRECTIONS, count))
            vector, tangents = self._loaded(start)
            for lane, k in enumerate(lanes):
                if k < n:
                    tangents[self._carried[k], lane] = 1.0
            for tick in range(ticks):
                begin, stop = (k * self._schedule.stimulus_frames for k in (tick, tick + 1))
                moved = [lane for lane, k in enumerate(lanes) if k - n == tick]
                _, rec_t = self._segment(vector, tangents, self._seeds(moved), begin, stop)
                at = -(-begin // self._schedule.record_frames)
                shown[at : at + len(rec_t), :, first : lanes.stop] = rec_t[:, :, : len(lanes)]
            end[:, first : lanes.stop] = tangents[self._carried, : len(lanes)]
        return Derivatives(end[:, :n], end[:, n:], shown[:, :, :n], shown[:, :, n:])

    def velocities(self, start: Array) -> Array:
        """Return the velocities with dry friction, shape (substeps, frictions)."""
        vector, tangents = self._loaded(start)
        found = np.empty((self._schedule.frames, self._frictions.size))
        if not self._frictions.size:
            return found
        nothing, seeds = np.empty(0), self._seeds(())
        request = Request(self._open, self._p, self._u, self._selection[:0])
        for k in range(self._schedule.frames):
            self._kernel.advance(request, vector, k, k + 1, nothing, seeds, tangents, nothing)
            found[k] = vector[self._frictions]
        return found

    def _seeds(self, lanes: Sequence[int]) -> Array:
        """Return seeds of the kernel's one parameter, which stays, and of all stimuli."""
        seeds = np.zeros((1 + self._u.shape[1], DIRECTIONS))
        for lane in lanes:
            seeds[1 + self._inputs, lane] = 1.0
        return seeds

    def _loaded(self, start: Array) -> tuple[Array, Array]:
        vector = np.zeros(self._layout.total)
        vector[self._carried] = start
        return vector, np.zeros((vector.size, DIRECTIONS))

    def _segment(
        self, vector: Array, tangents: Array, seeds: Array, begin: int, end: int
    ) -> tuple[Array, Array]:
        """Run frames begin..end, vector and tangents renewed in place; return what it recorded."""
        schedule = self._schedule
        every, signals = schedule.record_frames, self._selection.size
        rows = -(-end // every) - -(-begin // every)
        values, rec_t = np.empty((rows, signals)), np.empty((rows, signals, DIRECTIONS))
        # The end of a period is the beginning of the next, and ticks only there.
        request = Request(self._open, self._p, self._u, self._selection)
        self._kernel.advance(request, vector, begin, end, values, seeds, tangents, rec_t)
        return values, rec_t


def _by_substeps(schedule: Schedule) -> Schedule:
    """Return the same plan in frames of one substep, at each of which a run can be cut."""
    n = schedule.substeps
    return Schedule(
        schedule.step,
        1,
        schedule.frames * n,
        tuple(n * every for every in schedule.task_frames),
        schedule.record_frames * n,
    )


@built_once
def _kernel(program: Program, compiler: Compiler) -> TangentKernel:
    # Directions are set one by one; the kernel has at least one parameter among them.
    return TangentKernel(program, (0,), compiler)
