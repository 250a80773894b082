"""Symbolic functions of a model, for the generation of kernels and for the virtual machine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from bywire.core.assembly import Assembly
from bywire.core.errors import ModelError, counted
from bywire.core.model import Model, require_states
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import Signal, signals_of
from bywire.core.wiring import check_wiring
from bywire.simulation.contacts import contact_forces, contact_jacobians
from bywire.simulation.scheme import Pass, Symbols, build_pass, project_exact
from bywire.simulation.symbols import SX, column, scalars, symbol_tuple


def check_model(model: Model, par: ParameterSet) -> None:
    """Evaluate a model's parts on symbols, one by one, and check their shapes.

    Raises
    ------
    ModelError
        When a part is invalid. The message contains the model, the part, and the valid shape.
    """
    for part in ("State", "Memory", "Stimulus", "Flow", "Output"):
        _annotated(model, part)
    require_states(model)
    if not model.tasks(par):
        raise ModelError(
            f"{model.name}: tasks returns no task, but at least one task must sample the stimulus. "
            "Add Task('source', period, lambda x, m, u, par: Memory(...))",
            name="tasks",
            valid="at least one task",
        )
    if isinstance(model, Assembly):
        check_wiring(model, par)
    _check_equations(model, par)


def _annotated(model: Model, part: str) -> None:
    try:
        signals_of(getattr(model, part))
    except ModelError as error:
        raise error.at(model.name, ModelError) from None


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
            f"{model.name}: gap returns groups of {[len(g) for g in gaps]} overlaps, but "
            f"compliance returns groups of {sizes}. The sizes must match",
            name="gap",
            value=str([len(g) for g in gaps]),
            valid=str(sizes),
        )
    bounds = _evaluated(model, "bounds", x, x, m, symbolic, contact)
    _sized(model, "bounds", bounds, len(model.frictions), "one (low, high) per friction")
    widths = _evaluated(model, "widths", x, x, m, symbolic, contact)
    _sized(model, "widths", widths, len(model.stops), "one width per stop operator")
    for pair in bounds:
        _sized(model, "bounds", pair, 2, "pairs (low, high); check the comma in ((low, high),)")


def _evaluated(model: Model, part: str, *arguments: Any) -> Any:
    try:
        value = getattr(model, part)(*arguments)
        if _holds_nan(value):  # caused by math.exp and similar functions of a symbol
            raise TypeError("a symbol was converted to a number")
        return value
    except (AttributeError, NotImplementedError, RuntimeError, TypeError) as error:
        reason = str(error).splitlines()[-1] if str(error) else type(error).__name__
        raise ModelError(
            f"{model.name}: {part} cannot be evaluated on symbols ({reason}). Use core.ops for "
            "functions and core.ops.where instead of if, math and numpy",
            name=part,
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


def _sized(model: Model, part: str, value: Any, count: int, meaning: str) -> None:
    length = value.shape[0] if isinstance(value, ca.SX) else len(value) if value is not None else -1
    if length != count:
        raise ModelError(
            f"{model.name}: {part} returns {counted(max(length, 0), 'value')}, but must return "
            f"{count} ({meaning})",
            name=part,
            value=str(max(length, 0)),
            valid=str(count),
        )


# --- The program


@dataclass(frozen=True)
class Sizes:
    """Lengths of a kernel's vectors."""

    x: int
    memory: int
    stimulus: int
    parameters: int
    reaction: int
    flow: int
    output: int


@dataclass(frozen=True, eq=False)
class Program:
    """A model's symbolic functions for a fixed structure.

    Parameters
    ----------
    parameter_ranges
        Names in the order of the parameter vector, with their valid ranges.
    contact_jacobians
        ``(x, m, p)`` -> Jacobians of dx/dt; see ``contacts.contact_jacobians``.
    fast, exact
        ``(x, d, m, p, h) -> (x, d, reaction, flow, jump, flag, doubt)``; see ``scheme.Pass``. The
        flag is raised if the pass is in doubt or a velocity reverses.
    before, after
        The exact pass in two parts: ``(x, d, m, p, h) -> (S, c, low, high)``, row by row, and
        ``(x, d, m, p, h, w, force, failed)`` -> results, where the last three arguments are the
        solution of the problem.
    ticks
        One ``(x, m, u, p) -> m`` per task.
    output
        ``(x, m, p, reaction, flow, h) -> o``; ``flow`` is the sum of the rates.
    """

    model: Model
    parameter_ranges: dict[str, tuple[float, float]]
    sizes: Sizes
    fast: Any
    exact: Any
    before: Any
    after: Any
    ticks: tuple[Any, ...]
    output: Any
    contact_jacobians: Any

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names in the order of the parameter vector."""
        return tuple(self.parameter_ranges)

    @property
    def velocities(self) -> tuple[int, ...]:
        """Indices of the states with dry friction."""
        states = self.model.State._fields
        return tuple(states.index(name) for name in self.model.frictions)

    @property
    def rows(self) -> int:
        """Number of set-valued forces in an exact pass: frictions, then one-sided limits."""
        return len(self.model.frictions) + len(self.model.limits)

    @property
    def outputs(self) -> dict[str, Signal]:
        """Recorded signals, in order."""
        return signals_of(self.model.Output)


def build_program(model: Model, par: ParameterSet) -> Program:
    """Evaluate a model on symbols.

    Parameters
    ----------
    model
        The system.
    par
        Any parameter set with the required structure. Its numbers become arguments.
    """
    check_model(model, par)
    names = tuple(par.leaves())
    p = SX.sym("p", len(names))
    symbolic = par.with_leaves(dict(zip(names, scalars(p), strict=True)))
    x = SX.sym("x", len(model.State._fields))
    s = Symbols(
        x=x,
        d=SX.sym("d", x.shape[0]),
        m=SX.sym("m", len(model.Memory._fields)),
        p=p,
        h=SX.sym("h"),
    )
    fast = build_pass(model, symbolic, s, exact=False)
    exact = build_pass(model, symbolic, s, exact=True)
    before, after = _halves(s, exact)
    output = _output(model, symbolic, s, fast)
    tasks = model.tasks(par)
    u = SX.sym("u", len(model.Stimulus._fields))
    return Program(
        model=model,
        parameter_ranges=_ranges(par, names),
        sizes=Sizes(
            x=x.shape[0],
            memory=s.m.shape[0],
            stimulus=u.shape[0],
            parameters=p.shape[0],
            reaction=fast.reaction.shape[0],
            flow=fast.flow.shape[0],
            output=len(model.Output._fields),
        ),
        fast=_pass_function("fast", s, fast),
        exact=_joined(s, before, after),
        before=before,
        after=after,
        ticks=tuple(
            ca.Function(
                f"tick_{k}",
                [s.x, s.m, u, p],
                [
                    column(
                        task.tick(
                            symbol_tuple(model.State, s.x),
                            symbol_tuple(model.Memory, s.m),
                            symbol_tuple(model.Stimulus, u),
                            symbolic,
                        )
                    )
                ],
            )
            for k, task in enumerate(tasks)
        ),
        output=output,
        contact_jacobians=contact_jacobians(model, symbolic, s.x, s.m, p),
    )


def _ranges(par: ParameterSet, names: tuple[str, ...]) -> dict[str, tuple[float, float]]:
    fields = leaf_fields(type(par))
    found = {}
    for name in names:
        leaf = fields.get(name) or fields[name.rpartition(".")[0]]  # a node of a table
        found[name] = (leaf.low, leaf.high)
    return found


def _pass_function(name: str, s: Symbols, result: Pass, further: Sequence[Any] = ()) -> Any:
    flag = ca.fmax(result.doubt, result.turn)
    results = (result.x, result.d, result.reaction, result.flow, result.jump, flag, result.doubt)
    given = [s.x, s.d, s.m, s.p, s.h, *further]
    return ca.Function(name, given, [ca.densify(SX(r)) for r in results])


def _halves(s: Symbols, exact: Pass) -> tuple[Any, Any]:
    """Return the functions before and after the solution for the set-valued forces."""
    problem = exact.problem
    assert problem is not None
    found = problem.solution
    posed = (ca.vec(problem.matrix.T), problem.start, problem.low, problem.high)
    before = ca.Function("before", [s.x, s.d, s.m, s.p, s.h], [ca.densify(SX(r)) for r in posed])
    return before, _pass_function("after", s, exact, (found.w, found.force, found.failed))


def _joined(s: Symbols, before: Any, after: Any) -> Any:
    """Return the exact pass as one function."""
    given = [s.x, s.d, s.m, s.p, s.h]
    rows, c, low, high = before(*given)
    m = c.shape[0]
    found = project_exact(ca.reshape(rows, m, m).T, c, low, high)
    return ca.Function("exact", given, list(after(*given, found.w, found.force, found.failed)))


def _output(model: Model, par: ParameterSet, s: Symbols, shape: Pass) -> Any:
    reaction = SX.sym("r", shape.reaction.shape[0])
    flow = SX.sym("q", shape.flow.shape[0])
    out = model.output(
        symbol_tuple(model.State, s.x),
        symbol_tuple(model.Memory, s.m),
        par,
        scalars(contact_forces(model, par, s.x)),
        scalars(reaction),
        symbol_tuple(model.Flow, s.h * flow),
    )
    return ca.Function("output", [s.x, s.m, s.p, reaction, flow, s.h], [column(out)])
