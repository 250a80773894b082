"""Common parts of kernel emission: the plan, names of values, statements."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence

from bywire.simulation.expressions import COSTLY, PLAIN_C, Dialect, Namer, text
from bywire.simulation.graph import Graph, Node, Operation
from bywire.simulation.layout import Layout
from bywire.simulation.stages import STATE, Stages

# plan: first frame, end frame, whether the end is recorded, substeps a frame, frames a stimulus
# row, frames a recorded row, first recorded row, recorded signals, frames a tick of each task.
PLAN = """const int64_t begin = plan[0], end = plan[1], last = plan[2], substeps = plan[3];
  const int64_t stim = plan[4], every = plan[5], row0 = plan[6], chosen = plan[7];"""
"""C text that reads a run's plan"""


def unread(stages: Stages) -> frozenset[str]:
    """Return the half increments and reactions that no stage reads.

    They need not be kept. Those of velocities with dry friction are read where a substep is cut.
    """
    roots = [
        node for pass_ in (stages.fast, stages.exact) for nodes in pass_.values() for node in nodes
    ]
    roots += [node for tick in stages.ticks for node in tick] + stages.output + stages.posed
    read = stages.graph.read_by(roots)
    return frozenset(
        f"{kind}{k}"
        for kind in ("d", "r")
        for k in range(len(stages.fast[kind]))
        if stages.graph.leaf(kind, k) not in read and not (kind == "d" and k in stages.velocities)
    )


def midpoints(graph: Graph, order: Iterable[Node]) -> dict[Node, int]:
    """Return the nodes that are a state plus its half increment, and which state it is.

    A kernel carries these from substep to substep: the next one begins with them. Half increments
    alone only cut substeps read.
    """
    chosen = {}
    for node in order:
        parts = {graph.nodes[a] for a in graph.arguments(node)}
        for k in {op.args[1] for op in parts if op.op == "leaf" and op.args[0] == "d"}:
            if graph.nodes[node].op == "add" and Operation("leaf", ("x", k)) in parts:
                chosen[node] = int(k)
    return chosen


def leaf_count(stages: Stages, kind: str) -> int:
    """Return how many inputs of a kind there are, for instance ``"u"`` for the stimulus."""
    return sum(1 for op in stages.graph.nodes if op.op == "leaf" and op.args[0] == kind)


def layout_of(stages: Stages) -> Layout:
    """Return the layout of a model's state vector."""
    length = {kind: len(stages.fast[kind]) for kind in STATE}
    length["m"] = len(stages.ticks[0])
    start, at = {}, 0
    for kind, count in length.items():
        start[kind] = at
        at += count
    start["counters"] = at
    return Layout(start, length)


def literal(graph: Graph, node: Node) -> str:
    """Return a constant as C text."""
    value = str(graph.nodes[node].args[0])
    return f"({value})" if value.startswith("-") else value


def leaf_namer(
    graph: Graph, leaf: Callable[[str, int], str], other: Namer, constant: str = "{}"
) -> Namer:
    """Return the namer that knows constants and leaves and leaves operations to another."""

    def name(node: Node) -> str:
        operation = graph.nodes[node]
        if operation.op == "const":
            return constant.format(literal(graph, node))
        if operation.op == "leaf":
            return leaf(*operation.args)
        return other(node)

    return name


def statements(
    graph: Graph,
    order: Sequence[Node],
    name: Namer,
    declare: str,
    dialect: Dialect = PLAIN_C,
) -> list[str]:
    """Return one declaration per operation; truth values are written where they are used."""
    return [
        f"{declare}{name(node)} = {text(graph, node, name, dialect)};"
        for node in order
        if not graph.is_boolean(node)
    ]


def branching_statements(
    graph: Graph,
    order: Sequence[Node],
    name: Namer,
    declare: str,
    dialect: Dialect = PLAIN_C,
    later: Iterable[Node] = (),
) -> list[str]:
    """Return declarations in which costly functions stand inside the only branch that needs them.

    Where the condition fails, the processor skips the function. ``later``: nodes that read what is
    declared here, too.
    """
    uses = Counter(a for node in (*order, *later) for a in graph.arguments(node))
    inside = {
        graph.nodes[node].args[1]
        for node in order
        if graph.nodes[node].op == "if_else_zero"
        and graph.nodes[graph.nodes[node].args[1]].op in COSTLY
        and uses[graph.nodes[node].args[1]] == 1
    }

    def inlined(node: Node) -> str:
        return f"({text(graph, node, inlined, dialect)})" if node in inside else name(node)

    rest = [node for node in order if node not in inside]
    return statements(graph, rest, inlined, declare, dialect)


def indented(lines: Iterable[str], spaces: int) -> str:
    """Return lines joined with an indentation."""
    return ("\n" + " " * spaces).join(lines)
