"""All symbolic functions of a model: what kernels are emitted from and the machine evaluates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from bywire.core.model import Model
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import Signal, signals_of
from bywire.simulation.contact_set import contact_forces
from bywire.simulation.model_check import check_model
from bywire.simulation.scheme import Pass, Symbols, build_pass
from bywire.simulation.set_valued import project_exact
from bywire.simulation.stiff_contacts import contact_jacobians
from bywire.simulation.symbols import SX, column, scalars, symbol_tuple


@dataclass(frozen=True)
class Sizes:
    """Lengths of the vectors that a kernel works on."""

    x: int
    memory: int
    stimulus: int
    parameters: int
    reaction: int
    flow: int
    output: int


@dataclass(frozen=True, eq=False)
class Program:
    """Symbolic functions of a model with a fixed structure.

    Parameters
    ----------
    parameter_ranges
        Names in the order of the parameter vector, each with its admissible range.
    contact_jacobians
        ``(x, m, p)`` -> Jacobians of dx/dt, see ``stiff_contacts.contact_jacobians``.
    fast, exact
        ``(x, d, m, p, h) -> (x, d, reaction, flow, jump, flag, doubt)``, see ``scheme.Pass``; the
        flag is up where the pass is in doubt or a velocity turns round.
    before, after
        The exact pass in two: ``(x, d, m, p, h) -> (S, c, low, high)``, row by row, and
        ``(x, d, m, p, h, w, force, failed)`` -> results, with the solution of that problem.
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
        """Indices of the states that carry dry friction."""
        states = self.model.State._fields
        return tuple(states.index(name) for name in self.model.frictions)

    @property
    def rows(self) -> int:
        """How many set-valued forces an exact pass has: frictions, then one-sided limits."""
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
        Any parameter set of the wanted structure: its numbers are not used, they become
        arguments.
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
    """Return what comes before the set-valued forces are found, and what after."""
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
