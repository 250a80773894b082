"""Exact linear models of sampled loops: frame by frame, closed, and cut open."""

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
    linearize,
    plant_model,
    require_outputs,
    smooth_point,
)
from bywire.analysis.linear.smooth_functions import SmoothPoint, smooth_functions
from bywire.core.arguments import checked
from bywire.core.errors import ParameterError, StepError, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of
from bywire.core.units import shown

Jacobians = list[Any]
"""Jacobians of the new memory with respect to states, memory and inputs"""
_WHOLE = 1e-9  # of a step: maximum deviation of a sample time from a multiple


@dataclass(frozen=True, eq=False)
class SampledSystem:
    """System between two times at which any of its tasks runs.

    Parameters
    ----------
    plant
        Exact model of the plant over a frame, driven by all fields of the Memory.
    names, ticks
        Tasks and their Jacobians, in the order in which they run.
    reads
        States that each task may read, for any gains.
    takes
        Fields of the Memory that the plant may read, likewise.
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
        """Return the Jacobians of tasks that run one after the other at the same time."""
        (n_m, n_x), n_u = self.ticks[0][0].shape, self.ticks[0][2].shape[1]
        X, M, U = np.zeros((n_m, n_x)), np.eye(n_m), np.zeros((n_m, n_u))
        # All tasks read the same plant. Each also reads the values that earlier tasks have written.
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
    """Return linear models of plant and controllers at an operating point, without friction.

    Parameters
    ----------
    point
        State, Memory and Stimulus; None for a stimulus of zeros.
    build
        Function that builds the models of a system.
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
        raise ParameterError(f"{model.name} has no controller. Use linearize()", name=model.name)
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
    """Return the longest time that divides all periods, and its multiple in each period."""
    # As floats, 1 ms is not a multiple of 0.2 ms. The nearest ratios of whole numbers are.
    exact = [Fraction(period).limit_denominator(10**9) for period in periods]
    whole = math.lcm(*(period.denominator for period in exact))
    ticks = [int(period * whole) for period in exact]
    frame = math.gcd(*ticks)
    return frame / whole, [tick // frame for tick in ticks]


def _ticks(point: SmoothPoint, inputs: Sequence[str], kept: Sequence[str]) -> tuple[Jacobians, ...]:
    """Return every task's Jacobians with respect to the kept states, memory and inputs."""
    rows = [point.model.State._fields.index(name) for name in kept]
    columns = [point.model.Stimulus._fields.index(name) for name in inputs]
    return tuple([M_x[:, rows], M_m, M_u[:, columns]] for M_x, M_m, M_u, _ in point.ticks())


def stepped(model: LinearModel, period: float, step: float) -> LinearModel:
    r"""Return the midpoint rule's model of a continuous model with held inputs.

    .. math:: \begin{pmatrix} x_{k+1} \\ u \end{pmatrix} =
        \left[(I - \tfrac{h}{2} W)^{-1} (I + \tfrac{h}{2} W)\right]^{T/h}
        \begin{pmatrix} x_k \\ u \end{pmatrix}, \quad
        W = \begin{pmatrix} A & B \\ 0 & 0 \end{pmatrix}

    Without friction, limits and changes of contacts, a run of a linear plant follows this model to
    rounding error. Its difference from the exact model is the step's numerical error.

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
        When the substep does not divide the sample time.
    """
    count = round(period / step)
    if count < 1 or abs(count * step - period) > _WHOLE * step:
        valid = shown(period / max(count, 1), "s", digits=12)
        raise StepError(
            f"step = {shown(step, 's')} does not divide the sample time of {shown(period, 's')}. "
            f"For example, use {valid}",
            name="step",
            value=shown(step, "s"),
            valid=valid,
        )
    n, m = model.B.shape
    W = np.zeros((n + m, n + m))
    W[:n, :n], W[:n, n:] = model.A, model.B
    half = 0.5 * step * W
    once = np.linalg.solve(np.eye(n + m) - half, np.eye(n + m) + half)
    whole = np.linalg.matrix_power(once, count)
    return replace(model, A=whole[:n, :n], B=whole[:n, n:], period=period)


# --- Closed: controllers' ticks and continuous plant in one model


@checked
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
    step: float = 0.0,
) -> LinearModel:
    r"""Return a model with its controllers, from one time at which all of them run to the next.

    Between two times at which any task runs,

    .. math:: m' = M_x x + M_m m + M_u u, \quad x' = A_d x + B_d m'

    with the Jacobians M of the ticks that are due, one after the other, and the exact A_d, B_d of
    the plant; dry friction is removed. Tasks with different periods are lifted to their common
    period, over which the input is held. Outputs are those at the sample time, with new memory.

    Parameters
    ----------
    model, par
        The system and its parameters. Switch off discontinuous functions (a quantizer, a dither's
        waveform), which have no slope.
    state, memory
        Operating point.
    inputs
        Fields of Stimulus.
    outputs
        Fields of Output or State.
    locked
        States held at the operating point, for example angle and speed of a locked rotor.
    stimulus
        Stimulus at the operating point, required if a limit of the controller depends on it; zero
        by default.
    step
        Substep [s] of the simulation's midpoint rule, which then replaces the exact A_d, B_d; 0
        for the exact model.

    Raises
    ------
    ParameterError
        When the model has no task, or a contact just touches.
    CornerError
        As `bywire.analysis.linear.linearize.linearize`.
    UnknownNameError
        When a name is unknown.
    """
    return sampled_models(
        model,
        par,
        (state, memory, stimulus),
        lambda system: (closed_again(model, system, inputs),),
        inputs=inputs,
        outputs=outputs,
        locked=locked,
        step=step,
    )[0]


def closed_again(model: Model, system: SampledSystem, inputs: Sequence[str]) -> LinearModel:
    """Return `closed_loop` of a system with the same inputs."""
    plant, fields = system.plant, model.Memory._fields
    size = len(plant.states) + len(fields)
    A, B = np.eye(size), np.zeros((size, len(inputs)))
    for f in range(system.common):
        F, G = system.step(system.in_a_row(system.due(f)))
        A, B = F @ A, F @ B + G
    M_x, M_m, M_u = system.in_a_row(system.due(0))
    C = np.hstack([plant.C + plant.D @ M_x, plant.D @ M_m])
    stimuli, held = signals_of(model.Stimulus), signals_of(model.Memory)
    return LinearModel(
        model.name,
        A,
        B,
        C,
        plant.D @ M_u,
        (*plant.states, *(f"{name}[k]" for name in fields)),
        tuple(inputs),
        plant.outputs,
        (*plant.state_units, *(held[name].unit for name in fields)),
        tuple(stimuli[name].unit for name in inputs),
        plant.output_units,
        np.zeros(size),
        system.common * system.frame,
    )


# --- Cut open: at a controller, or within the plant


def open_loop(
    model: Model,
    par: ParameterSet,
    state: NamedTuple,
    memory: NamedTuple,
    *,
    cut: str,
    stimulus: NamedTuple | None = None,
    locked: tuple[str, ...] = (),
) -> LinearModel:
    """Return the loop gain L of a sampled loop with its delays, filters and other loops.

    The loop is cut where one controller reads a state or writes a value; everything else stays
    closed. Margins of L (negative feedback: the closed loop has 1 + L) are the real loop's margins
    at this cut.

    Parameters
    ----------
    model, par, state, memory, stimulus, locked
        As in ``closed_loop``.
    cut
        Field of State that a controller reads, or field of Memory that it writes for the plant or
        another controller.

    Returns
    -------
    LinearModel
        Model with one input and one output, both ``cut``; sampled with its controller's period.

    Raises
    ------
    UnknownNameError
        When the field is unknown.
    ParameterError
        When no controller or several controllers read or write the field, another controller runs
        more slowly, or nothing reads the written value.
    CornerError
        As `bywire.analysis.linear.linearize.linearize`.
    """
    return sampled_models(
        model,
        par,
        (state, memory, stimulus),
        lambda system: (cut_open(model, system, cut),),
        locked=locked,
    )[0]


def cut_open(model: Model, system: SampledSystem, cut: str) -> LinearModel:
    """Return `open_loop` of a system with any inputs and outputs."""
    fields, states = model.Memory._fields, system.plant.states
    if _is_without_gain(system, cut):
        return _nothing(model, cut, system.common * system.frame)
    if cut not in (*states, *fields):
        raise unknown_name("field of state and memory", cut, (*states, *fields))
    if cut in states:
        first, C = _cut_reading(system, states.index(cut), cut)
    else:
        first, C = _cut_writing(system, fields.index(cut), cut)
    size = len(states) + len(fields)
    A, B = np.eye(size), np.zeros((size, 1))
    for f in range(system.common):
        tick = first  # the input acts only here, since its controller runs once per common period
        if f > 0:
            X, M, _ = system.in_a_row(system.due(f))
            tick = [X, M, np.zeros((len(fields), 1))]
        F, G = system.step(tick)
        A, B = F @ A, F @ B + G
    # The minus sign: margins assume negative feedback, but the closed loop adds the feedback.
    held = signals_of(model.Memory)
    unit = (signals_of(model.State) | held)[cut].unit
    return LinearModel(
        f"{model.name}, cut at {cut}",
        A,
        B,
        -C,
        np.zeros((1, 1)),
        (*system.plant.states, *(f"{name}[k]" for name in fields)),
        (cut,),
        (cut,),
        (*system.plant.state_units, *(held[name].unit for name in fields)),
        (unit,),
        (unit,),
        np.zeros(size),
        system.common * system.frame,
    )


def _is_without_gain(system: SampledSystem, cut: str) -> bool:
    """Return whether a field is read only if gains or openings are not 0."""
    if cut not in system.plant.inputs:
        is_read = cut in system.plant.states and any(
            X[:, system.plant.states.index(cut)].any() for X, _, _ in system.ticks
        )
        return not is_read and any(cut in names for names in system.reads)
    row = system.plant.inputs.index(cut)
    is_taken = system.plant.B[:, row].any() or any(
        np.delete(M[:, row], row).any() for _, M, _ in system.ticks
    )
    return not is_taken and cut in system.takes


def _nothing(model: Model, cut: str, period: float) -> LinearModel:
    """Return the zero gain of a loop without feedback."""
    unit = (signals_of(model.State) | signals_of(model.Memory))[cut].unit
    return LinearModel(
        f"{model.name}, cut at {cut}",
        np.zeros((0, 0)),
        np.zeros((0, 1)),
        np.zeros((1, 0)),
        np.zeros((1, 1)),
        (),
        (cut,),
        (cut,),
        (),
        (unit,),
        (unit,),
        np.zeros(0),
        period,
    )


def _cut_reading(system: SampledSystem, column: int, cut: str) -> tuple[Jacobians, Any]:
    """Return the first tick with the input in place of a state, and the row of the state."""
    readers = [k for k, (X, _, _) in enumerate(system.ticks) if X[:, column].any()]
    owner = _alone(system, readers, f"{cut} cannot be cut, because it needs exactly one reader")
    n_m, n_x = system.ticks[0][0].shape
    X, M, U = np.zeros((n_m, n_x)), np.eye(n_m), np.zeros((n_m, 1))
    for k in system.due(0):
        M_x, M_m, _ = system.ticks[k]
        read = np.zeros((n_m, 1))
        if k == owner:
            read, M_x = M_x[:, column : column + 1], M_x.copy()
            M_x[:, column] = 0.0  # this task reads the input in place of the state
        X, M, U = M_x + M_m @ X, M_m @ M, M_m @ U + read
    row = np.zeros((1, n_x + n_m))
    row[0, column] = 1.0
    return [X, M, U], row


def _cut_writing(system: SampledSystem, row: int, cut: str) -> tuple[Jacobians, Any]:
    """Return the first tick with the input in place of a field, and the row of its value."""
    kept = np.zeros(system.ticks[0][1].shape[1])
    kept[row] = 1.0
    writers = [
        k
        for k, (X, M, _) in enumerate(system.ticks)
        if X[row].any() or not np.array_equal(M[row], kept)
    ]
    owner = _alone(system, writers, f"{cut} cannot be cut, because it needs exactly one writer")
    later = system.due(0)[owner + 1 :]
    taken = system.plant.B[:, row].any() or any(
        np.delete(system.ticks[k][1][:, row], row).any() for k in later
    )
    if not taken:
        raise ParameterError(
            f"{cut} cannot be cut, because neither the plant nor another controller reads it from "
            f"{system.names[owner]}. Cut a state that this controller reads",
            name="cut",
            value=cut,
        )
    X, M, _ = system.in_a_row(system.due(0)[: owner + 1])
    written = np.concatenate([X[row], M[row]])[None]
    U = np.zeros((M.shape[0], 1))
    # Later tasks at the same time already read the input.
    X[row], M[row], U[row] = 0.0, 0.0, 1.0
    for k in later:
        M_x, M_m, _ = system.ticks[k]
        X, M, U = M_x + M_m @ X, M_m @ M, M_m @ U
    return [X, M, U], written


def _alone(system: SampledSystem, tasks: list[int], refusal: str) -> int:
    """Return the only task of a list, which must run exactly once in the common period."""
    if len(tasks) != 1:
        names = ", ".join(system.names[k] for k in tasks) or "none"
        raise ParameterError(f"{refusal} (found {names})", name="cut")
    (owner,) = tasks
    if system.every[owner] != system.common:
        often = system.common // system.every[owner]
        raise ParameterError(
            f"{refusal}, which must be the slowest controller. {system.names[owner]} runs "
            f"{often} times for each run of the slowest controller",
            name="cut",
        )
    return owner


def analog_gain(
    model: Model,
    par: ParameterSet,
    state: NamedTuple,
    memory: NamedTuple,
    *,
    cut: str,
    locked: Sequence[str] = (),
) -> LinearModel:
    r"""Return the exact gain of a loop cut open at a state, with sampled controllers held.

    Let :math:`x_c` be the state and :math:`x_o` all others. All readers of the state receive an
    input u in its place:

    .. math:: \dot x_o = A_{oo} x_o + A_{oc} u, \quad \dot x_c = A_{co} x_o + A_{cc} x_c, \quad
        L = -x_c / u

    Parameters
    ----------
    model, par, state, memory, locked
        As in ``closed_loop``; dry friction is removed.
    cut
        Field of State, for example the reading of an analog controller's sensor.

    Returns
    -------
    LinearModel
        Continuous model with one input and one output, both ``cut``. The closed loop has 1 + L.

    Raises
    ------
    UnknownNameError
        When the field is unknown.
    ParameterError
        When nothing reads the state.
    """
    if cut not in model.State._fields:
        raise unknown_name("state", cut, model.State._fields)
    whole = linearize(model, par, state, memory, inputs=(), outputs=(cut,))
    kept = [name for name in whole.live if name not in locked]
    plant = whole.reduced(kept, held=bool(locked))
    if cut in locked:
        raise ParameterError(f"{cut} cannot be cut, because it is locked", name="cut", value=cut)
    if cut not in plant.states:
        return _nothing(model, cut, 0.0)
    k = plant.states.index(cut)
    A, B = plant.A.copy(), plant.A[:, k : k + 1].copy()
    B[k] = 0.0  # the state's own decay stays, since it is not feedback through the controller
    A[:, k] -= B[:, 0]
    if not B.any():
        by = smooth_functions(model, par).driven[0][:, model.State._fields.index(cut)]
        readers = {name for name, reads in zip(model.State._fields, by, strict=True) if reads}
        if readers - {cut, *locked}:  # something reads it, but gains are 0
            return _nothing(model, cut, 0.0)
        raise ParameterError(
            f"{cut} cannot be cut, because nothing in {model.name} reads it", name="cut", value=cut
        )
    return replace(
        plant,
        name=f"{model.name}, cut at {cut}",
        A=A,
        B=B,
        C=-plant.C,
        D=np.zeros((1, 1)),
        inputs=(cut,),
        input_units=plant.output_units,
    )
