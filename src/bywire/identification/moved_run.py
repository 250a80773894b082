"""A run with unknowns changed: parameters, where it begins, offsets of what drives it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bywire.core.arguments import checked
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.identification.unknown import Unknown
from bywire.simulation.run import Run

Start = Callable[[Mapping[str, float]], tuple[Any, Any]]
"""``start(values) -> (state, memory)``: where a run begins with parameters, and with what is
called ``start.NAME``, changed"""

_SHIFT = 1e-6  # of an unknown's scale: for differences of the start
_AFTERWARDS = ("initial.", "stimulus.")  # what no start depends on


@checked
def moved_run(run: Run, values: Mapping[str, float], start: Start | None = None) -> Run:
    """Return a run with unknowns changed.

    Parameters
    ----------
    run
        The run.
    values
        By name: parameters; ``initial.STATE`` replaces, ``stimulus.NAME`` adds, ``start.NAME``
        goes to the start.
    start
        Where the run begins with other values; by default where it does.

    Raises
    ------
    ParameterError
        When the values are not admissible together.
    """
    fixed = {n[8:]: v for n, v in values.items() if n.startswith("initial.")}
    shift = {n[9:]: v for n, v in values.items() if n.startswith("stimulus.")}
    rest = {n: v for n, v in values.items() if not n.startswith(_AFTERWARDS)}
    par = {n: v for n, v in rest.items() if not n.startswith("start.")}
    state, memory = (run.state, run.memory) if start is None else start(rest)
    if shift:
        fields, inner = run.model.Stimulus._fields, run.stimulus
        add = np.array([shift.get(name, 0.0) for name in fields])
        run = replace(run, stimulus=lambda t: inner(t) + add)
    return replace(run, par=run.par.replace(par), state=state._replace(**fixed), memory=memory)


def start_slopes(
    start: Start, run: Run, unknowns: Sequence[Unknown], values: Mapping[str, float]
) -> tuple[Array, Array]:
    """Return derivatives of the initial state and memory, shapes (states, p) and (memories, p).

    By central differences, one-sided at the end of a range: equilibria are smooth, and computed
    to rounding. What ``initial.STATE`` replaces does not move.

    Parameters
    ----------
    start
        Where the run begins.
    run
        Begins there.
    unknowns
        Of the run; p of them.
    values
        By name.
    """
    rest = {n: v for n, v in values.items() if not n.startswith(_AFTERWARDS)}
    fields = run.model.State._fields
    slopes = np.zeros((len(fields) + len(run.memory), len(unknowns)))

    def at(name: str, shift: float) -> tuple[float, Array]:
        try:
            state, memory = start({**rest, name: rest[name] + shift})
        except ParameterError:
            shift, (state, memory) = 0.0, start(rest)
        return shift, np.array([*state, *memory], dtype=float)

    for k, u in enumerate(unknowns):
        if u.name in rest:
            (a, low), (b, high) = (at(u.name, way * _SHIFT * u.scale) for way in (-1.0, 1.0))
            slopes[:, k] = (high - low) / (b - a) if b > a else 0.0
    fixed = [fields.index(u.name[8:]) for u in unknowns if u.name.startswith("initial.")]
    slopes[fixed] = 0.0
    return slopes[: len(fields)], slopes[len(fields) :]
