"""Smooth part of a model and its controllers as functions of the parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from threading import Lock
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from bywire.core.model import Model, require_states
from bywire.core.ops import where
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros
from bywire.core.typing import Array
from bywire.simulation.engine import structure_of
from bywire.simulation.native import BufferedCall

_BUILT: dict[tuple[object, ...], SmoothFunctions] = {}


@dataclass(frozen=True, eq=False)
class SmoothFunctions:
    """CasADi functions of a model, for any numbers of one structure.

    Parameters
    ----------
    contacts
        ``(x, p) -> (C of each group..., all overlaps)``.
    plant
        ``(x, m, p, K, s, g) -> (A, B, C, D, rate, y)`` with the stiffness K of closed contacts,
        the direction s of each friction (0: removed) and g, which is 0 for each stuck velocity and
        each slipping stop operator, and 1 otherwise. B and D are for the whole Memory, C, D and y
        for the whole Output.
    ticks
        ``(x, m, u, p) -> (d/dx, d/dm, d/du, new)``: each task's new memory and its Jacobians.
    reads
        For each task, the states on which its new memory may depend for any parameters.
    driven
        For the rates of states, the states and fields of the Memory on which they may depend.
    model
        Model of the functions, kept alive because the addresses of its parts identify structures.
    """

    contacts: Any
    plant: Any
    ticks: tuple[Any, ...]
    reads: tuple[NDArray[np.bool_], ...]
    driven: tuple[NDArray[np.bool_], NDArray[np.bool_]]
    model: Model

    @cached_property
    def plant_at(self) -> _Evaluated:
        """`plant` on arrays."""
        return _Evaluated(self.plant)

    @cached_property
    def ticks_at(self) -> tuple[_Evaluated, ...]:
        """`ticks` on arrays."""
        return tuple(map(_Evaluated, self.ticks))


class _Evaluated:
    """Function with dense results on arrays, without the slow conversion of CasADi's matrices."""

    def __init__(self, function: Any) -> None:
        self._call, self._lock = BufferedCall(function), Lock()
        self._shapes = [function.size_out(k) for k in range(function.n_out())]

    def __call__(self, *arguments: Any) -> list[Array]:
        with self._lock:
            columns = self._call(*arguments)
            pairs = zip(columns, self._shapes, strict=True)
            return [np.array(column.reshape(shape, order="F")) for column, shape in pairs]


def smooth_functions(model: Model, par: ParameterSet) -> SmoothFunctions:
    """Return the functions of a model's structure; the numbers of ``par`` do not matter."""
    key = structure_of(model, par)
    if key not in _BUILT:
        _BUILT[key] = _build(model, par)
    return _BUILT[key]


def vector(par: ParameterSet) -> list[float]:
    """Return the numbers of a parameter set in the order of the functions' p."""
    return list(par.leaves().values())


def _build(model: Model, par: ParameterSet) -> SmoothFunctions:
    import casadi as ca

    names = tuple(par.leaves())
    p = ca.SX.sym("p", len(names))
    symbolic = par.with_leaves(dict(zip(names, ca.vertsplit(p), strict=True)))
    x = ca.SX.sym("x", len(model.State._fields))
    m = ca.SX.sym("m", len(model.Memory._fields))
    u = ca.SX.sym("u", len(model.Stimulus._fields))
    at, held = cast(Any, model.State)(*_split(x)), cast(Any, model.Memory)(*_split(m))
    ticks, reads = [], []
    for k, task in enumerate(model.tasks(par)):
        stimulus = cast(Any, model.Stimulus)(*_split(u))
        renewed = ca.vertcat(*task.tick(at, held, stimulus, symbolic))
        parts = [ca.jacobian(renewed, by) for by in (x, m, u)]
        reads.append(np.asarray(_pattern(parts[0]).any(axis=0)))
        results = [ca.densify(each) for each in (*parts, renewed)]
        ticks.append(ca.Function(f"tick_{k}", [x, m, u, p], results))
    groups = [C for C in model.compliance(symbolic) if C]
    gap = _column([d for group in model.gap(at, at, symbolic) for d in group])
    matrices = [ca.SX(ca.vertcat(*(ca.horzcat(*row) for row in C))) for C in groups]
    plant, driven = _plant(model, symbolic, (x, m, p), at, held, gap)
    return SmoothFunctions(
        contacts=ca.Function("contacts", [x, p], [*matrices, gap]),
        plant=plant,
        ticks=tuple(ticks),
        reads=tuple(reads),
        driven=driven,
        model=model,
    )


def _plant(
    model: Model, par: ParameterSet, symbols: tuple[Any, Any, Any], x: Any, held: Any, gap: Any
) -> tuple[Any, tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
    """Return the function of rates, outputs and Jacobians, and the dependencies of the rates."""
    import casadi as ca

    require_states(model)
    K = ca.SX.sym("K", gap.shape[0], gap.shape[0])
    s = ca.SX.sym("s", len(model.frictions))
    g = ca.SX.sym("g", len(model.frictions) + len(model.stops))
    contact = tuple(_split(K @ gap))
    growth = _growth(model, par, (x, held), contact, symbols[0])
    rates, outputs = equations(model, par, (x, held), contact, _split(s), _split(g), growth=growth)
    rate, y = _column(rates), _column(outputs)
    parts = [ca.jacobian(a, b) for a in (rate, y) for b in symbols[:2]]
    results = [ca.densify(each) for each in (*parts, rate, y)]
    function = ca.Function("plant", [*symbols, K, s, g], results)
    return function, (_pattern(parts[0]), _pattern(parts[1]))


def _growth(
    model: Model, par: ParameterSet, at: tuple[Any, Any], contact: tuple[Any, ...], symbols: Any
) -> Callable[[list[Any]], list[Any]]:
    """Return the function from the states' rates to the rates of slipping stop operators."""
    import casadi as ca

    x, held = at
    widths = _column(list(model.widths(x, x, held, par, contact)))
    signs = [ca.sign(getattr(x, name)) for name in model.stops]

    def growth(rates: list[Any]) -> list[Any]:
        grown = _split(ca.jtimes(widths, symbols, _column(rates))) if model.stops else []
        return [sign * each for sign, each in zip(signs, grown, strict=True)]

    return growth


def _pattern(matrix: Any) -> NDArray[np.bool_]:
    """Return a mask of the nonzero entries of a symbolic matrix."""
    pattern = np.zeros(matrix.shape, dtype=bool)
    pattern[tuple(matrix.sparsity().get_triplet())] = True
    return pattern


def equations(
    model: Model,
    par: ParameterSet,
    at: tuple[Any, Any],
    contact: tuple[Any, ...],
    directions: Sequence[Any],
    moving: Sequence[Any],
    *,
    outputs: bool = True,
    growth: Callable[[list[Any]], list[Any]] | None = None,
) -> tuple[list[Any], list[Any]]:
    """Return rates and outputs of a model's smooth part, on numbers of any kind.

    Parameters
    ----------
    model, par
        The system and its parameters.
    at
        State and Memory.
    contact
        Forces of the contacts.
    directions, moving
        For each friction, its direction (0 if it is removed), and 0 if its velocity is stuck. Then
        0 for each stop operator that slips.
    outputs
        Whether to compute outputs.
    growth
        ``growth(rates)``: rates of slipping stop operators, from the states' rates. Default: zero.
    """
    x, held = at
    force = dict(zip(x._fields, model.balance(x, x, held, par, contact), strict=True))
    reaction: list[Any] = [0.0] * len((*model.frictions, *model.limits, *model.stops))
    bounds = model.bounds(x, x, held, par, contact)
    for k, (name, (low, high)) in enumerate(zip(model.frictions, bounds, strict=True)):
        s = directions[k]
        reaction[k] = where(s > 0, low, where(s < 0, high, 0.0))
        force[name] = moving[k] * (force[name] + reaction[k])
    mass = model.mass(x, par)
    rates = [force[name] / getattr(mass, name) for name in x._fields]
    slipping = [0.0 for _ in model.stops] if growth is None else growth(rates)
    for k, (name, rate) in enumerate(zip(model.stops, slipping, strict=True), len(model.frictions)):
        place = x._fields.index(name)
        lost = (1.0 - moving[k]) * (rates[place] - rate)
        reaction[k + len(model.limits)] = -lost
        rates[place] = rates[place] - lost
    if not outputs:
        return rates, []
    flow = zeros(cast(Any, model.Flow))
    return rates, list(model.output(x, held, par, contact, tuple(reaction), flow))


def _split(symbols: Any) -> list[Any]:
    import casadi as ca

    return ca.vertsplit(symbols) if symbols.shape[0] else []


def _column(values: list[Any]) -> Any:
    import casadi as ca

    return ca.vertcat(*(ca.SX(value) for value in values)) if values else ca.SX(0, 1)


@dataclass(frozen=True, eq=False)
class SmoothPoint:
    """Numbers at which a model's smooth part and its controllers are evaluated.

    Parameters
    ----------
    model, par
        The system and its parameters.
    state, memory, stimulus
        Operating point, as arrays.
    K
        Stiffness of the closed contacts.
    directions, moving
        As in `equations`.
    """

    model: Model
    par: ParameterSet
    state: Array
    memory: Array
    stimulus: Array
    K: Array
    directions: Sequence[float]
    moving: Sequence[float]

    def moved(self, by: Array) -> SmoothPoint:
        """Return the point displaced by one vector of state, memory and stimulus."""
        n, m = self.state.size, self.memory.size
        return replace(
            self,
            state=self.state + by[:n],
            memory=self.memory + by[n : n + m],
            stimulus=self.stimulus + by[n + m :],
        )

    def plant(self) -> list[Array]:
        """Return A, B, C, D, rate and y, for the whole Memory and the whole Output."""
        return smooth_functions(self.model, self.par).plant_at(
            self.state,
            self.memory,
            vector(self.par),
            self.K.ravel(order="F"),
            self.directions,
            self.moving,
        )

    def widths(self) -> dict[str, float]:
        """Return the widths of the stop operators by name."""
        if not self.model.stops:
            return {}
        x = cast(Any, self.model.State)(*self.state.tolist())
        memory = cast(Any, self.model.Memory)(*self.memory.tolist())
        gaps = [d for group in self.model.gap(x, x, self.par) for d in group]
        contact = tuple((self.K @ np.array(gaps)).tolist()) if gaps else ()
        found = self.model.widths(x, x, memory, self.par, contact)
        return dict(zip(self.model.stops, map(float, found), strict=True))

    def ticks(self) -> list[list[Array]]:
        """Return each task's Jacobians for state, memory and stimulus, and the new memory."""
        at = (self.state, self.memory, self.stimulus, vector(self.par))
        return [tick(*at) for tick in smooth_functions(self.model, self.par).ticks_at]
