"""Whether a model gives what the protocol asks for, said in the model's own terms."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca

from bywire.core.assembly import Assembly
from bywire.core.errors import ModelError
from bywire.core.model import Model, require_states
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of
from bywire.core.wiring_check import check_wiring
from bywire.simulation.symbols import SX, scalars, symbol_tuple


def check_model(model: Model, par: ParameterSet) -> None:
    """Evaluate a model's parts on symbols, one by one, and check their shapes.

    Raises
    ------
    ModelError
        Naming the model, the part, and what is wanted.
    """
    for part in ("State", "Memory", "Stimulus", "Flow", "Output"):
        _annotated(model, part)
    require_states(model)
    if not model.tasks(par):
        raise ModelError(
            f"{model.name}: tasks returns none, but one task must sample the stimulus, if only "
            "to hold it: Task('source', period, lambda x, m, u, par: Memory(...))"
        )
    if isinstance(model, Assembly):
        check_wiring(model, par)
    _check_equations(model, par)


def _annotated(model: Model, part: str) -> None:
    try:
        signals_of(getattr(model, part))
    except ModelError as error:
        raise ModelError(f"{model.name}: {error}") from None


def _check_equations(model: Model, par: ParameterSet) -> None:
    names = tuple(par.leaves())
    symbolic = par.with_leaves(dict(zip(names, scalars(SX.sym("p", len(names))), strict=True)))
    x = symbol_tuple(model.State, SX.sym("x", len(model.State._fields)))
    m = symbol_tuple(model.Memory, SX.sym("m", len(model.Memory._fields)))
    sizes = [len(C) for C in _evaluated(model, "compliance", symbolic)]
    contact = scalars(SX.sym("F", sum(sizes)))
    _sized(model, "mass", _evaluated(model, "mass", x, symbolic), len(x), "one factor per state")
    balance = _evaluated(model, "balance", x, x, m, symbolic, contact)
    _sized(model, "balance", balance, len(x), "one right-hand side per state")
    gaps = _evaluated(model, "gap", x, x, symbolic)
    if [len(g) for g in gaps] != sizes:
        raise ModelError(
            f"{model.name}: gap has groups of {[len(g) for g in gaps]} overlaps, compliance of "
            f"{sizes}: they must match"
        )
    bounds = _evaluated(model, "bounds", x, x, m, symbolic, contact)
    _sized(model, "bounds", bounds, len(model.frictions), "one (low, high) per friction")
    for pair in bounds:
        _sized(model, "bounds", pair, 2, "pairs (low, high); mind the comma in ((low, high),)")


def _evaluated(model: Model, part: str, *arguments: Any) -> Any:
    try:
        value = getattr(model, part)(*arguments)
        if _holds_nan(value):  # what math.exp and the like make of a symbol
            raise TypeError("a symbol was turned into a number")
        return value
    except (AttributeError, NotImplementedError, RuntimeError, TypeError) as error:
        reason = str(error).splitlines()[-1] if str(error) else type(error).__name__
        raise ModelError(
            f"{model.name}: {part} cannot be evaluated on symbols ({reason}): use core.ops for "
            "functions and core.ops.where instead of if, math and numpy"
        ) from error


def _holds_nan(value: Any) -> bool:
    if isinstance(value, (tuple, list)):
        return any(_holds_nan(v) for v in value)
    if not isinstance(value, (float, ca.SX)):
        return False
    function = ca.Function("part", ca.symvar(ca.SX(value)), [ca.SX(value)])
    codes = range(function.n_instructions())
    constants = [k for k in codes if function.instruction_id(k) == ca.OP_CONST]
    return any(math.isnan(function.instruction_constant(k)) for k in constants)


def _sized(model: Model, part: str, value: Any, wanted: int, meaning: str) -> None:
    length = value.shape[0] if isinstance(value, ca.SX) else len(value) if value is not None else -1
    if length != wanted:
        raise ModelError(
            f"{model.name}: {part} returns {max(length, 0)} values, wanted are {wanted} ({meaning})"
        )
