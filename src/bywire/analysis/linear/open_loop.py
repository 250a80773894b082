"""Exact linear models of loops that are cut open: at a controller, or within the plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import linearize
from bywire.analysis.linear.sampled_system import Jacobians, SampledSystem, sampled_models
from bywire.analysis.linear.smooth_functions import smooth_functions
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of


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

    The loop is cut where one controller reads a state or hands a value on; everything else stays
    closed. Margins of L (negative feedback: the closed loop has 1 + L) are those of the real loop
    at that place.

    Parameters
    ----------
    model, par, state, memory, stimulus, locked
        As in ``closed_loop``.
    cut
        Field of State that a controller reads, or field of Memory that it hands to the plant or
        to another controller.

    Returns
    -------
    LinearModel
        One input and one output, both ``cut``; sampled with the period of its controller.

    Raises
    ------
    UnknownNameError
        When the field is unknown.
    ParameterError
        When no controller reads or writes the field, several do, another one runs more slowly,
        or nobody takes what is handed on.
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
    """Return `open_loop` of a system that was made for any inputs and outputs."""
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
        tick = first  # the input acts there alone: its controller runs once in the common period
        if f > 0:
            X, M, _ = system.in_a_row(system.due(f))
            tick = [X, M, np.zeros((len(fields), 1))]
        F, G = system.step(tick)
        A, B = F @ A, F @ B + G
    # Minus: what comes back enters the closed loop with a plus, and margins count it negative.
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
    """Return whether a field would be read or taken, but for gains or openings of 0."""
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
    """Return the gain of a loop that feeds nothing back."""
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
    owner = _alone(system, readers, f"{cut} cannot be cut: exactly one controller must read it")
    n_m, n_x = system.ticks[0][0].shape
    X, M, U = np.zeros((n_m, n_x)), np.eye(n_m), np.zeros((n_m, 1))
    for k in system.due(0):
        M_x, M_m, _ = system.ticks[k]
        read = np.zeros((n_m, 1))
        if k == owner:
            read, M_x = M_x[:, column : column + 1], M_x.copy()
            M_x[:, column] = 0.0  # this one reads the input in place of the state, others the state
        X, M, U = M_x + M_m @ X, M_m @ M, M_m @ U + read
    row = np.zeros((1, n_x + n_m))
    row[0, column] = 1.0
    return [X, M, U], row


def _cut_writing(system: SampledSystem, row: int, cut: str) -> tuple[Jacobians, Any]:
    """Return the first tick with the input in place of a field, and the row of what it wrote."""
    kept = np.zeros(system.ticks[0][1].shape[1])
    kept[row] = 1.0
    writers = [
        k
        for k, (X, M, _) in enumerate(system.ticks)
        if X[row].any() or not np.array_equal(M[row], kept)
    ]
    owner = _alone(system, writers, f"{cut} cannot be cut: exactly one controller must write it")
    later = system.due(0)[owner + 1 :]
    taken = system.plant.B[:, row].any() or any(
        np.delete(system.ticks[k][1][:, row], row).any() for k in later
    )
    if not taken:
        raise ParameterError(
            f"{cut} cannot be cut: neither the plant nor another controller takes it from "
            f"{system.names[owner]}; cut a state that this controller reads"
        )
    X, M, _ = system.in_a_row(system.due(0)[: owner + 1])
    written = np.concatenate([X[row], M[row]])[None]
    U = np.zeros((M.shape[0], 1))
    # Whoever comes later at the same instant already takes the input.
    X[row], M[row], U[row] = 0.0, 0.0, 1.0
    for k in later:
        M_x, M_m, _ = system.ticks[k]
        X, M, U = M_x + M_m @ X, M_m @ M, M_m @ U
    return [X, M, U], written


def _alone(system: SampledSystem, tasks: list[int], refusal: str) -> int:
    """Return the one task of a list, which must run only once in the common period."""
    if len(tasks) != 1:
        names = ", ".join(system.names[k] for k in tasks) or "none"
        raise ParameterError(f"{refusal}, found {names}")
    (owner,) = tasks
    if system.every[owner] != system.common:
        often = system.common // system.every[owner]
        raise ParameterError(
            f"{refusal}, and no other may run more slowly: {system.names[owner]} runs {often} "
            "times while the slowest one runs once"
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
    r"""Return the exact gain of a loop that is cut open at a state; sampled controllers hold.

    With the state :math:`x_c` and all others :math:`x_o`, whatever reads the state is handed an
    input u in its place:

    .. math:: \dot x_o = A_{oo} x_o + A_{oc} u, \quad \dot x_c = A_{co} x_o + A_{cc} x_c, \quad
        L = -x_c / u

    Parameters
    ----------
    model, par, state, memory, locked
        As in ``closed_loop``; dry friction is removed.
    cut
        Field of State, for instance what an analog controller's sensor shows.

    Returns
    -------
    LinearModel
        Continuous; one input and one output, both ``cut``. The closed loop has 1 + L.

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
        raise ParameterError(f"{cut} cannot be cut: it is locked")
    if cut not in plant.states:
        return _nothing(model, cut, 0.0)
    k = plant.states.index(cut)
    A, B = plant.A.copy(), plant.A[:, k : k + 1].copy()
    B[k] = 0.0  # the state's own decay is no feedback through the controller: it stays
    A[:, k] -= B[:, 0]
    if not B.any():
        by = smooth_functions(model, par).driven[0][:, model.State._fields.index(cut)]
        readers = {name for name, reads in zip(model.State._fields, by, strict=True) if reads}
        if readers - {cut, *locked}:  # it is read, but for gains of 0
            return _nothing(model, cut, 0.0)
        raise ParameterError(f"{cut} cannot be cut: nothing in {model.name} reads it")
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
