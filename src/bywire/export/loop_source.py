"""C code of a loop's linear model: plant rates and control laws as functions of parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from bywire.analysis.linear.corners import beside_point, on_stops
from bywire.analysis.linear.linearize import closed_contacts, free_signals, smooth_point
from bywire.analysis.linear.sampled_loops import frames_of
from bywire.analysis.linear.smooth_functions import SmoothPoint, smooth_functions
from bywire.analysis.loop import Loop, Point
from bywire.core.errors import BywireError
from bywire.core.parameters import ParameterSet
from bywire.simulation.expressions import as_number, needed
from bywire.simulation.graph import Graph
from bywire.simulation.stages import indented, leaf_namer, statements
from bywire.simulation.symbols import SX, column, scalars, symbol_tuple

_NOT_SYMBOLIC = (BywireError, TypeError, ValueError, ArithmeticError, RuntimeError)


@dataclass(frozen=True)
class LoopSource:
    """Linear model of a sampled or analog loop at one operating point, for any parameters.

    Parameters
    ----------
    loop
        The loop.
    entry, text
        Name and C text of ``void entry(const double *p, double t, double *out)``. The function
        writes the nonzero entries of the model at the operating point (t = 0), or close to it on
        either side (t = 1, -1; see `bywire.analysis.linear.corners`). The order is the distance of
        each contact from opening or closing [m], and of each stop operator from slip, then A (n, n)
        and B (n, nm) of the plant row by row, then for each task the memory's Jacobians with
        respect to the states (nm, n) and to the memory (nm, nm). An analog loop has only A, because
        its sampled controllers hold their outputs.
    states, memory
        Names in the order of rows and columns. An analog loop has no memory.
    contacts
        Number of these distances.
    every, frame
        Frames per tick of each task, and the length of a frame [s].
    """

    loop: Loop
    entry: str
    text: str
    states: tuple[str, ...]
    memory: tuple[str, ...]
    contacts: int
    every: tuple[int, ...]
    frame: float

    @property
    def size(self) -> int:
        """Number of values that the function writes."""
        n, m = len(self.states), len(self.memory)
        return self.contacts + (n + m) * (n + m * len(self.every))


def loop_source(loop: Loop, par: ParameterSet) -> LoopSource | None:
    """Return a loop's linear model in C at the loop's usual operating point.

    Return None if symbols cannot express the operating point or the structure.
    """
    names = par.leaves()
    p = SX.sym("p", len(names))
    symbolic = par.with_leaves(dict(zip(names, scalars(p), strict=True)))
    try:
        at = loop.point(loop.smooth(par), loop.at.default)
        moving = loop.point(loop.smooth(symbolic), loop.at.default)
        if at.par.leaves().keys() != names.keys():
            return None
        t = SX.sym("t")
        results = _jacobians(loop, at, moving, t)
        function = ca.Function("loop", [p, t], results)
    except _NOT_SYMBOLIC:
        return None
    frame, every = frames_of([task.period for task in at.model.tasks(at.par)])
    kept = tuple(name for name in at.model.State._fields if name not in loop.locked)
    entry = f"bw_loop_{loop.name.replace('-', '_')}"
    text = _in_c(entry, function)
    contacts, memory = results[0].shape[0], () if loop.analog else at.model.Memory._fields
    return LoopSource(loop, entry, text, kept, memory, contacts, tuple(every), frame)


def _jacobians(loop: Loop, at: Point, moving: Point, t: Any) -> list[Any]:
    """Return the results of the C function for symbolic parameters and the side t."""
    model, functions = at.model, smooth_functions(at.model, at.par)
    p = column([moving.par.value(name) for name in at.par.leaves()])
    x, m, u = (column(list(each)) for each in (moving.state, moving.memory, moving.stimulus))
    point = smooth_point(model, at.par, (at.state, at.memory, at.stimulus))
    states = [name for name in model.State._fields if name not in loop.locked]
    free = free_signals(point, states, model.Memory._fields, ())
    beside = beside_point(point, free)
    point, _ = on_stops(point, free)
    x, m = x + t * beside[: len(at.state)], m + t * beside[len(at.state) :][: len(at.memory)]
    *matrices, gaps = _tuple(functions.contacts(x, p))
    closed = closed_contacts(model, at.par, at.state)
    K, slack, first = SX(gaps.shape[0], gaps.shape[0]), [], 0
    for C in matrices:
        last = first + C.shape[0]
        inside = [k - first for k in closed if first <= k < last]
        block = SX(C.shape[0], C.shape[0])
        if inside:
            block[inside, inside] = ca.inv(C[inside, inside])
        d = gaps[first:last]
        force = ca.mtimes(block, d)
        left = ca.mtimes(C, force) - d
        slack += [C[k, k] * force[k] if k in inside else left[k] for k in range(C.shape[0])]
        K[first:last, first:last] = block
        first = last
    slack += _before_slip(point, moving, x, m, scalars(K @ gaps))
    A, B, *_ = functions.plant(x, m, p, K, column(point.directions), column(point.moving))
    kept = [k for k, name in enumerate(model.State._fields) if name not in loop.locked]
    rows = [column(slack), _by_rows(A[kept, kept])]
    if loop.analog:
        return rows
    rows.append(_by_rows(B[kept, :]))
    for tick in functions.ticks:
        M_x, M_m, *_ = tick(x, m, u, p)
        rows += [_by_rows(M_x[:, kept]), _by_rows(M_m)]
    return rows


def _before_slip(
    point: SmoothPoint, moving: Point, x: Any, m: Any, contact: tuple[Any, ...]
) -> list[Any]:
    """Return the distance of each stop operator that follows its motion from its width."""
    model = point.model
    if not model.stops:
        return []
    state, memory = symbol_tuple(model.State, x), symbol_tuple(model.Memory, m)
    widths = model.widths(state, state, memory, moving.par, contact)
    follows = point.moving[len(model.frictions) :]
    rows = zip(model.stops, widths, follows, strict=True)
    return [width - ca.fabs(getattr(state, name)) for name, width, follow in rows if follow]


def _in_c(entry: str, function: ca.Function) -> str:
    """Return the C text of a function of the parameters, without zero results."""
    graph = Graph()
    results = graph.add_function(
        function,
        [[graph.leaf("p", k) for k in range(function.nnz_in(0))], [graph.leaf("t", 0)]],
    )
    nodes = [node for result in results for node in result]
    zero = graph.constant(0.0)
    targets = {at: node for at, node in enumerate(nodes) if node != zero}
    name = leaf_namer(
        graph, lambda kind, k: kind if kind == "t" else f"{kind}[{k}]", lambda node: f"v{node}"
    )
    order = needed(graph, list(targets.values()), lambda _: False)
    lines = statements(graph, order, name, "const double ")
    lines += [f"out[{at}] = {as_number(graph, node, name)};" for at, node in targets.items()]
    head = f"void {entry}(const double *p, double t, double *out)"
    return f"{head} {{\n  {indented(lines, 2)}\n}}\n"


def _by_rows(matrix: Any) -> Any:
    return ca.densify(ca.vec(ca.densify(matrix).T))


def _tuple(values: Any) -> tuple[Any, ...]:
    return values if isinstance(values, tuple) else (values,)
