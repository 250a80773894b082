"""The state in which a run begins, for parameters that are not the exported ones, also in C."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from bywire.core.errors import BywireError
from bywire.export.exported import Exported
from bywire.simulation.emission import indented, leaf_namer, statements
from bywire.simulation.expressions import as_number, needed
from bywire.simulation.graph import Graph
from bywire.simulation.operation import Node
from bywire.simulation.symbols import SX, column, scalars

_AGREES = 1e-9  # of a value, that the same start may differ where it was computed otherwise
_NOT_SYMBOLIC = (BywireError, TypeError, ValueError, ArithmeticError, RuntimeError)

HEADING = "void bw_start(const double *p, double *state)"


@dataclass(frozen=True)
class Start:
    """The state in which a run begins, over parameters.

    Parameters
    ----------
    graph, targets
        Expressions, and the node of every place in the state vector that they set.
    reads
        Parameters that they read, by index.
    """

    graph: Graph
    targets: dict[int, Node]
    reads: frozenset[int]


def start_nodes(made: Exported) -> Start | None:
    """Return the equations of the start; None where it is not known for other parameters."""
    function = _start(made)
    if function is None:
        return None
    graph = Graph()
    leaves = [graph.leaf("p", k) for k in range(made.program.sizes.parameters)]
    states, memory = graph.add_function(function, [leaves])
    targets = {made.layout.start["x"] + k: node for k, node in enumerate(states)}
    targets |= {made.layout.start["m"] + k: node for k, node in enumerate(memory)}
    read = graph.read_by(targets.values())
    return Start(graph, targets, frozenset(k for k, leaf in enumerate(leaves) if leaf in read))


def start_source(made: Exported) -> tuple[str, frozenset[int]]:
    """Return the C function that sets the state vector, and which parameters it reads.

    Empty text where the start is not known for other parameters: the exported one then stays.
    """
    start = start_nodes(made)
    if start is None:
        return "", frozenset()
    graph, roots = start.graph, list(start.targets.values())
    name = leaf_namer(graph, lambda kind, k: f"{kind}[{k}]", lambda node: f"v{node}")
    lines = statements(graph, needed(graph, roots, lambda _: False), name, "const double ")
    lines += [f"state[{at}] = {as_number(graph, n, name)};" for at, n in start.targets.items()]
    return f"{HEADING} {{\n  (void)p;\n  {indented(lines, 2)}\n}}\n", start.reads


def _start(made: Exported) -> ca.Function | None:
    """Return state and memory over parameters; None where these cannot be symbols."""
    start, par = made.case.start, made.run.par
    if start is None:
        return None
    numbers = par.leaves()
    p = SX.sym("p", len(numbers))
    symbolic = par.with_leaves(dict(zip(numbers, scalars(p), strict=True)))
    try:
        state, memory = start(symbolic)
        results = [ca.densify(column(list(each))) for each in (state, memory)]
        function = ca.Function("start", [p], results)
    except _NOT_SYMBOLIC:
        return None
    computed = [np.asarray(each).ravel() for each in function(list(numbers.values()))]
    wanted = [np.array(each, dtype=np.float64) for each in (made.run.state, made.run.memory)]
    for value, exact in zip(computed, wanted, strict=True):
        if not np.allclose(value, exact, rtol=_AGREES, atol=1e-300):
            return None
    return function
