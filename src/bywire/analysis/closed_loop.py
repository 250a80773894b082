"""Exact linear models of sampled loops: controllers' ticks and continuous plant in one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple, cast

import numpy as np

from bywire.analysis.linear_model import LinearModel
from bywire.analysis.linearize import linearize
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.model import Model, Task
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of, zeros


def closed_loop(
    model: Model,
    par: ParameterSet,
    state: NamedTuple,
    memory: NamedTuple,
    *,
    inputs: Sequence[str],
    outputs: Sequence[str],
    locked: Sequence[str] = (),
    stimulus: NamedTuple | None = None,
) -> LinearModel:
    r"""Return a model with its controllers, from one instant at which all of them run to the next.

    Between two instants at which any task runs,

    .. math:: m' = M_x x + M_m m + M_u u, \quad x' = A_d x + B_d m'

    with the Jacobians M of the ticks that are due, one after the other, and the exact A_d, B_d of
    the plant; dry friction is removed. Tasks of different periods are lifted to their common
    period, over which the input is held. Outputs are those of the instant, memory renewed.

    Parameters
    ----------
    model, par
        The system and its parameters. What jumps (a quantizer, a dither's
        waveform) has no slope: switch it off.
    state, memory
        Operating point.
    inputs
        Fields of Stimulus.
    outputs
        Fields of Output or State.
    locked
        States held at the operating point, for instance angle and speed of a locked rotor.
    stimulus
        Stimulus at the operating point, where a limit of the controller depends on it; zero by
        default.

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
    fields = model.Memory._fields
    plant = linearize(model, par, state, memory, inputs=fields, outputs=outputs)
    kept = [name for name in plant.states if name not in locked]
    frame, every = _frames([task.period for task in tasks])
    plant = plant.reduced(kept, held=bool(locked)).sampled(frame)
    at = zeros(cast(Any, model.Stimulus)) if stimulus is None else stimulus
    ticks = [_tick(task, model, par, (state, memory, at), inputs, kept) for task in tasks]
    common = math.lcm(*every)
    A, B = np.eye(len(kept) + len(fields)), np.zeros((len(kept) + len(fields), len(inputs)))
    for f in range(common):
        due = [tick for tick, n in zip(ticks, every, strict=True) if f % n == 0]
        F, G = _frame(plant, _in_a_row(due, len(kept), len(fields), len(inputs)))
        A, B = F @ A, F @ B + G
    M_x, M_m, M_u = _in_a_row(ticks, len(kept), len(fields), len(inputs))
    C = np.hstack([plant.C + plant.D @ M_x, plant.D @ M_m])
    stimuli, held = signals_of(model.Stimulus), signals_of(model.Memory)
    return LinearModel(
        model.name, A, B, C, plant.D @ M_u,
        (*plant.states, *(f"{name}[k]" for name in fields)), tuple(inputs), plant.outputs,
        (*plant.state_units, *(held[name].unit for name in fields)),
        tuple(stimuli[name].unit for name in inputs), plant.output_units,
        np.zeros(A.shape[0]), common * frame,
    )  # fmt: skip


def _frames(periods: Sequence[float]) -> tuple[float, list[int]]:
    """Return the longest time that divides all periods, and how often each holds it."""
    exact = [Fraction(period).limit_denominator(10**9) for period in periods]
    whole = math.lcm(*(one.denominator for one in exact))
    ticks = [int(one * whole) for one in exact]
    frame = math.gcd(*ticks)
    return frame / whole, [tick // frame for tick in ticks]


def _in_a_row(ticks: Sequence[list[Any]], n_x: int, n_m: int, n_u: int) -> list[Any]:
    """Return the Jacobians of ticks that run one after the other at the same instant."""
    X, M, U = np.zeros((n_m, n_x)), np.eye(n_m), np.zeros((n_m, n_u))
    for M_x, M_m, M_u in ticks:
        X, M, U = M_x + M_m @ X, M_m @ M, M_u + M_m @ U
    return [X, M, U]


def _frame(plant: LinearModel, tick: list[Any]) -> tuple[Any, Any]:
    """Return the map of states and memory over one frame, and that of the input."""
    M_x, M_m, M_u = tick
    F = np.block([[plant.A + plant.B @ M_x, plant.B @ M_m], [M_x, M_m]])
    return F, np.vstack([plant.B @ M_u, M_u])


def _tick(
    task: Task,
    model: Model,
    par: ParameterSet,
    point: tuple[Any, Any, Any],
    inputs: Sequence[str],
    kept: Sequence[str],
) -> list[Any]:
    """Return the Jacobians of the new memory by kept states, memory and inputs."""
    import casadi as ca

    state, memory, stimulus = point
    sizes = {"x": len(kept), "m": len(memory), "u": len(inputs)}
    x, m, u = (ca.SX.sym(name, size) for name, size in sizes.items())
    at = state._replace(**dict(zip(kept, ca.vertsplit(x), strict=True)))
    driven = stimulus._replace(**dict(zip(inputs, ca.vertsplit(u), strict=True)))
    held = cast(Any, model.Memory)(*ca.vertsplit(m))
    renewed = ca.vertcat(*task.tick(at, held, driven, par))
    jacobians = ca.Function("tick", [x, m, u], [ca.jacobian(renewed, v) for v in (x, m, u)])
    at_x, at_u = [getattr(state, n) for n in kept], [getattr(stimulus, n) for n in inputs]
    values = jacobians(at_x, list(memory), at_u)
    return [np.array(value, dtype=float) for value in values]
