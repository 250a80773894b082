"""A model's smooth part and its controllers as functions of the parameters, built once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

from bywire.core.model import Model, require_states
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros
from bywire.simulation.engine import structure_of

_BUILT: dict[tuple[object, ...], SmoothFunctions] = {}


@dataclass(frozen=True, eq=False)
class SmoothFunctions:
    """Functions of CasADi, for any numbers of one structure.

    Parameters
    ----------
    contacts
        ``(x, p) -> (C of each group..., all overlaps)``.
    plant
        ``(x, m, p, K, s, g) -> (A, B, C, D, rate)`` with the stiffness K of closed contacts, the
        direction s of each friction (0: removed) and g, 0 for each velocity that is stuck and 1
        else; B and D by all of the Memory, C and D for all of the Output.
    ticks
        ``(x, m, u, p) -> (by x, by m, by u)`` of each task's new memory.
    """

    contacts: Any
    plant: Any
    ticks: tuple[Any, ...]


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
    ticks = []
    for k, task in enumerate(model.tasks(par)):
        stimulus = cast(Any, model.Stimulus)(*_split(u))
        renewed = ca.vertcat(*task.tick(at, held, stimulus, symbolic))
        parts = [ca.jacobian(renewed, by) for by in (x, m, u)]
        ticks.append(ca.Function(f"tick_{k}", [x, m, u, p], parts))
    groups = [C for C in model.compliance(symbolic) if C]
    gap = _column([d for group in model.gap(at, at, symbolic) for d in group])
    matrices = [ca.SX(ca.vertcat(*(ca.horzcat(*row) for row in C))) for C in groups]
    return SmoothFunctions(
        contacts=ca.Function("contacts", [x, p], [*matrices, gap]),
        plant=_plant(model, symbolic, (x, m, p), at, held, gap),
        ticks=tuple(ticks),
    )


def _plant(
    model: Model, par: ParameterSet, symbols: tuple[Any, Any, Any], x: Any, held: Any, gap: Any
) -> Any:
    """Return the function of rates and outputs and their Jacobians."""
    import casadi as ca

    require_states(model)
    K = ca.SX.sym("K", gap.shape[0], gap.shape[0])
    s = ca.SX.sym("s", len(model.frictions))
    g = ca.SX.sym("g", len(model.frictions))
    contact = tuple(_split(K @ gap))
    force = dict(zip(x._fields, model.balance(x, x, held, par, contact), strict=True))
    reaction: list[Any] = [0.0] * (len(model.frictions) + len(model.limits))
    bounds = model.bounds(x, x, held, par, contact)
    for k, (name, (low, high)) in enumerate(zip(model.frictions, bounds, strict=True)):
        reaction[k] = ca.if_else(s[k] > 0, low, ca.if_else(s[k] < 0, high, 0.0))
        force[name] = g[k] * (force[name] + reaction[k])
    mass = model.mass(x, par)
    rate = _column([force[name] / getattr(mass, name) for name in x._fields])
    out = model.output(x, held, par, contact, tuple(reaction), zeros(cast(Any, model.Flow)))
    y = _column(list(out))
    parts = [ca.densify(ca.jacobian(a, b)) for a in (rate, y) for b in symbols[:2]]
    return ca.Function("plant", [*symbols, K, s, g], [*parts, ca.densify(rate)])


def _split(symbols: Any) -> list[Any]:
    import casadi as ca

    return ca.vertsplit(symbols) if symbols.shape[0] else []


def _column(values: list[Any]) -> Any:
    import casadi as ca

    return ca.vertcat(*(ca.SX(value) for value in values)) if values else ca.SX(0, 1)
