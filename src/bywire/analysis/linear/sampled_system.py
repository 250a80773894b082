"""Plant and controllers of a sampled system as Jacobians, frame by frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple, cast

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import linearize
from bywire.analysis.linear.smooth_functions import smooth_functions, vector
from bywire.analysis.linear.stepped import stepped
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros

Jacobians = list[Any]
"""of the new memory by states, memory and inputs"""


@dataclass(frozen=True, eq=False)
class SampledSystem:
    """A system between two instants at which any of its tasks runs.

    Parameters
    ----------
    plant
        Exact model of the plant over a frame, driven by all fields of the Memory.
    names, ticks
        Tasks and their Jacobians, in the order in which they run.
    every
        Frames per tick of each task.
    frame
        Length of a frame [s].
    """

    plant: LinearModel
    names: tuple[str, ...]
    ticks: tuple[Jacobians, ...]
    every: tuple[int, ...]
    frame: float

    @property
    def common(self) -> int:
        """Frames after which all tasks run together again."""
        return math.lcm(*self.every)

    def due(self, f: int) -> list[int]:
        """Return the tasks that run at the beginning of a frame."""
        return [k for k, n in enumerate(self.every) if f % n == 0]

    def in_a_row(self, tasks: Sequence[int]) -> Jacobians:
        """Return the Jacobians of tasks that run one after the other at the same instant."""
        (n_m, n_x), n_u = self.ticks[0][0].shape, self.ticks[0][2].shape[1]
        X, M, U = np.zeros((n_m, n_x)), np.eye(n_m), np.zeros((n_m, n_u))
        for M_x, M_m, M_u in (self.ticks[k] for k in tasks):
            X, M, U = M_x + M_m @ X, M_m @ M, M_u + M_m @ U
        return [X, M, U]

    def step(self, tick: Jacobians) -> tuple[Any, Any]:
        """Return the map of states and memory over a frame that begins with a tick."""
        M_x, M_m, M_u = tick
        A, B = self.plant.A, self.plant.B
        return np.block([[A + B @ M_x, B @ M_m], [M_x, M_m]]), np.vstack([B @ M_u, M_u])


def sampled_system(
    model: Model,
    par: ParameterSet,
    point: tuple[NamedTuple, NamedTuple, NamedTuple | None],
    inputs: Sequence[str],
    outputs: Sequence[str],
    locked: Sequence[str] = (),
    step: float = 0.0,
) -> SampledSystem:
    """Return plant and controllers at an operating point; dry friction is removed.

    Parameters
    ----------
    point
        State, Memory and Stimulus; None for a stimulus of zeros.
    inputs, outputs, locked, step
        As in ``closed_loop``.

    Raises
    ------
    ParameterError
        When the model has no task, or a contact just touches.
    UnknownNameError
        When a name is unknown.
    """
    tasks = model.tasks(par)
    if not tasks:
        raise ParameterError(f"{model.name} has no controller: linearize() is what it takes")
    for name in inputs:
        if name not in model.Stimulus._fields:
            raise unknown_name("signal of the stimulus", name, model.Stimulus._fields)
    state, memory, stimulus = point
    plant = linearize(model, par, state, memory, inputs=model.Memory._fields, outputs=outputs)
    kept = [name for name in plant.states if name not in locked]
    frame, every = _frames([task.period for task in tasks])
    at = zeros(cast(Any, model.Stimulus)) if stimulus is None else stimulus
    moving = plant.reduced(kept, held=bool(locked))
    return SampledSystem(
        plant=stepped(moving, frame, step) if step else moving.sampled(frame),
        names=tuple(task.name for task in tasks),
        ticks=_ticks(model, par, (state, memory, at), inputs, kept),
        every=tuple(every),
        frame=frame,
    )


def _frames(periods: Sequence[float]) -> tuple[float, list[int]]:
    """Return the longest time that divides all periods, and how often each holds it."""
    exact = [Fraction(period).limit_denominator(10**9) for period in periods]
    whole = math.lcm(*(one.denominator for one in exact))
    ticks = [int(one * whole) for one in exact]
    frame = math.gcd(*ticks)
    return frame / whole, [tick // frame for tick in ticks]


def _ticks(
    model: Model,
    par: ParameterSet,
    point: tuple[Any, Any, Any],
    inputs: Sequence[str],
    kept: Sequence[str],
) -> tuple[Jacobians, ...]:
    """Return the Jacobians of every task's new memory by kept states, memory and inputs."""
    rows = [model.State._fields.index(name) for name in kept]
    columns = [model.Stimulus._fields.index(name) for name in inputs]
    state, memory, stimulus = point
    found = []
    for tick in smooth_functions(model, par).ticks:
        values = tick(list(state), list(memory), list(stimulus), vector(par))
        M_x, M_m, M_u = (np.array(value, dtype=float) for value in values)
        found.append([M_x[:, rows], M_m, M_u[:, columns]])
    return tuple(found)
