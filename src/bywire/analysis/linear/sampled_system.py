"""Plant and controllers of a sampled system as Jacobians, frame by frame, exact or as stepped."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.linear.corners import Linearization, linear_models
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import (
    free_signals,
    jacobians,
    plant_model,
    require_outputs,
    smooth_point,
)
from bywire.analysis.linear.smooth_functions import SmoothPoint, smooth_functions
from bywire.core.errors import ParameterError, StepError, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet

Jacobians = list[Any]
"""of the new memory by states, memory and inputs"""
_WHOLE = 1e-9  # of a step: what a sample time may differ from a multiple


@dataclass(frozen=True, eq=False)
class SampledSystem:
    """A system between two instants at which any of its tasks runs.

    Parameters
    ----------
    plant
        Exact model of the plant over a frame, driven by all fields of the Memory.
    names, ticks
        Tasks and their Jacobians, in the order in which they run.
    reads
        States that each task may read, whatever its gains.
    takes
        Fields of the Memory that the plant may take, likewise.
    every
        Frames per tick of each task.
    frame
        Length of a frame [s].
    """

    plant: LinearModel
    names: tuple[str, ...]
    ticks: tuple[Jacobians, ...]
    reads: tuple[frozenset[str], ...]
    takes: frozenset[str]
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
        # All read the same plant; each reads what those before it at this instant have written.
        for M_x, M_m, M_u in (self.ticks[k] for k in tasks):
            X, M, U = M_x + M_m @ X, M_m @ M, M_u + M_m @ U
        return [X, M, U]

    def step(self, tick: Jacobians) -> tuple[Any, Any]:
        """Return the map of states and memory over a frame that begins with a tick."""
        M_x, M_m, M_u = tick
        A, B = self.plant.A, self.plant.B
        return np.block([[A + B @ M_x, B @ M_m], [M_x, M_m]]), np.vstack([B @ M_u, M_u])


def sampled_models(
    model: Model,
    par: ParameterSet,
    point: tuple[NamedTuple, NamedTuple, NamedTuple | None],
    build: Callable[[SampledSystem], tuple[LinearModel, ...]],
    *,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    locked: Sequence[str] = (),
    step: float = 0.0,
) -> tuple[LinearModel, ...]:
    """Return linear models of plant and controllers at an operating point; friction is removed.

    Parameters
    ----------
    point
        State, Memory and Stimulus; None for a stimulus of zeros.
    build
        Makes the models of a system.
    inputs, outputs, locked, step
        As in ``closed_loop``.

    Raises
    ------
    ParameterError
        When the model has no task, or a contact just touches.
    CornerError
        As `linearize`.
    UnknownNameError
        When a name is unknown.
    """
    tasks = model.tasks(par)
    if not tasks:
        raise ParameterError(f"{model.name} has no controller: linearize() is what it takes")
    for name in inputs:
        if name not in model.Stimulus._fields:
            raise unknown_name("signal of the stimulus", name, model.Stimulus._fields)
    require_outputs(model, outputs)
    at = smooth_point(model, par, point)
    states = [name for name in model.State._fields if name not in locked]
    free = free_signals(at, states, model.Memory._fields, inputs)
    functions = smooth_functions(model, par)
    reads = tuple(_named(model.State._fields, row) for row in functions.reads)
    takes = _named(model.Memory._fields, np.asarray(functions.driven[1].any(axis=0)))
    periods = {task.name: task.period for task in tasks}
    frame, every = frames_of([*periods.values()])

    def system(at: SmoothPoint) -> SampledSystem:
        plant = plant_model(at, model.Memory._fields, outputs)
        kept = [name for name in plant.live if name not in locked]
        moving = plant.reduced(kept, held=bool(locked))
        return SampledSystem(
            plant=stepped(moving, frame, step) if step else moving.sampled(frame),
            names=tuple(periods),
            ticks=_ticks(at, inputs, kept),
            reads=reads,
            takes=takes,
            every=tuple(every),
            frame=frame,
        )

    return linear_models(
        Linearization(
            at,
            free,
            lambda at: jacobians(at, at.plant(), outputs, free, at.ticks()),
            lambda at: build(system(at)),
            outputs=bool(outputs),
            ticks=True,
        )
    )


def _named(names: Sequence[str], chosen: NDArray[np.bool_]) -> frozenset[str]:
    return frozenset(name for name, is_chosen in zip(names, chosen, strict=True) if is_chosen)


def frames_of(periods: Sequence[float]) -> tuple[float, list[int]]:
    """Return the longest time that divides all periods, and how often each holds it."""
    # 0.2 ms and 1 ms are no multiples as floats: the nearest ratios of whole numbers are.
    exact = [Fraction(period).limit_denominator(10**9) for period in periods]
    whole = math.lcm(*(period.denominator for period in exact))
    ticks = [int(period * whole) for period in exact]
    frame = math.gcd(*ticks)
    return frame / whole, [tick // frame for tick in ticks]


def _ticks(point: SmoothPoint, inputs: Sequence[str], kept: Sequence[str]) -> tuple[Jacobians, ...]:
    """Return the Jacobians of every task's new memory by kept states, memory and inputs."""
    rows = [point.model.State._fields.index(name) for name in kept]
    columns = [point.model.Stimulus._fields.index(name) for name in inputs]
    return tuple([M_x[:, rows], M_m, M_u[:, columns]] for M_x, M_m, M_u, _ in point.ticks())


def stepped(model: LinearModel, period: float, step: float) -> LinearModel:
    r"""Return what the midpoint rule makes of a continuous model with held inputs.

    .. math:: \begin{pmatrix} x_{k+1} \\ u \end{pmatrix} =
        \left[(I - \tfrac{h}{2} W)^{-1} (I + \tfrac{h}{2} W)\right]^{T/h}
        \begin{pmatrix} x_k \\ u \end{pmatrix}, \quad
        W = \begin{pmatrix} A & B \\ 0 & 0 \end{pmatrix}

    Where friction, limits and changes of contacts stay out, a run of a linear plant follows it to
    rounding: what then still differs from the exact model is the error of the step.

    Parameters
    ----------
    model
        Continuous model.
    period
        Sample time T [s].
    step
        Substep h [s], which divides T.

    Raises
    ------
    StepError
        When it does not.
    """
    count = round(period / step)
    if count < 1 or abs(count * step - period) > _WHOLE * step:
        raise StepError(
            f"step = {step * 1e6:g} us does not divide the sample time of {period * 1e6:g} us: "
            f"take for instance {period * 1e6 / max(count, 1):.12g} us"
        )
    n, m = model.B.shape
    W = np.zeros((n + m, n + m))
    W[:n, :n], W[:n, n:] = model.A, model.B
    half = 0.5 * step * W
    once = np.linalg.solve(np.eye(n + m) - half, np.eye(n + m) + half)
    whole = np.linalg.matrix_power(once, count)
    return replace(model, A=whole[:n, :n], B=whole[:n, n:], period=period)
