"""What follows from ramps alone, in a single run's kernel: kept for as long as these stand still.

A ramp is a linear function of states between two limits, such as the share of a road's second
surface over the place. All but a short while it stands at a limit, and what follows from it and
from parameters, a peak of adhesion with its logarithm for one, need not be computed again. The
values are the same.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from bywire.simulation.branches import worth
from bywire.simulation.expressions import Namer, as_number
from bywire.simulation.graph import Graph
from bywire.simulation.operation import Node
from bywire.simulation.quadrature import Levels

_LINEAR = ("add", "sub", "neg", "mul")
_OPPOSITE = {"fmin": "fmax", "fmax": "fmin"}


@dataclass(frozen=True)
class Remembered:
    """Values that follow from the same ramps.

    Parameters
    ----------
    ramps
        What they follow from.
    values
        Nodes to renew where one of these moves, in order.
    read
        Those of them that are read elsewhere.
    """

    ramps: tuple[Node, ...]
    values: tuple[Node, ...]
    read: tuple[Node, ...]


def remembered(
    graph: Graph,
    order: Sequence[Node],
    kept: Collection[Node],
    states: Collection[Node],
    level: Levels,
) -> tuple[list[Node], tuple[Remembered, ...], list[Node]]:
    """Return what is worth remembering of a substep, what that follows from, and all else.

    Parameters
    ----------
    graph
        The expressions.
    order
        Operations of a substep, arguments first.
    kept
        Those that are read from outside as well.
    states
        Nodes that are there already, and linear in states.
    level
        Tells how often a node changes, see ``stages.LEVEL``.

    Returns
    -------
    tuple
        Operations to compute first, in order; groups to be renewed then, in order; and the others.
    """
    follows: dict[Node, frozenset[Node]] = {}
    linear = set(states)
    for node in order:
        arguments = graph.arguments(node)
        changing = [a for a in arguments if level[a] == 2]
        if _is_linear(graph, node, changing, linear):
            linear.add(node)
        if _is_ramp(graph, node, linear, level):
            follows[node] = frozenset({node})
        elif changing and all(a in follows for a in changing):
            follows[node] = frozenset().union(*(follows[a] for a in changing))
    groups: dict[frozenset[Node], list[Node]] = {}
    for node, ramps in follows.items():
        if node not in ramps:
            groups.setdefault(ramps, []).append(node)
    # Those of fewer ramps first: the others may follow from them.
    chosen = [(r, groups[r]) for r in sorted(groups, key=len) if worth(graph, groups[r])]
    inside = {node for _, nodes in chosen for node in nodes}
    leading = {r for ramps, _ in chosen for r in ramps}
    leading |= {a for node in inside for a in graph.arguments(node) if a not in inside}
    for node in reversed(order):
        if node in leading:
            leading.update(graph.arguments(node))
    left = [node for node in order if node not in inside]
    groups_found = tuple(
        Remembered(tuple(sorted(ramps)), tuple(nodes), _read(graph, nodes, order, kept))
        for ramps, nodes in chosen
    )
    return [n for n in left if n in leading], groups_found, [n for n in left if n not in leading]


def _is_linear(
    graph: Graph, node: Node, changing: Sequence[Node], linear: Collection[Node]
) -> bool:
    op = graph.nodes[node].op
    if op not in _LINEAR or (op == "mul" and len(changing) != 1):
        return False
    return all(graph.nodes[a].op == "leaf" or a in linear for a in changing)


def _is_ramp(graph: Graph, node: Node, linear: Collection[Node], level: Levels) -> bool:
    """Return whether a node is a linear one between two limits."""
    opposite = _OPPOSITE.get(graph.nodes[node].op)
    if opposite is None:
        return False
    for inner in graph.arguments(node):
        others = [a for a in graph.arguments(node) if a != inner]
        if graph.nodes[inner].op == opposite and all(level[a] < 2 for a in others):
            return any(
                a in linear and all(level[b] < 2 for b in graph.arguments(inner) if b != a)
                for a in graph.arguments(inner)
            )
    return False


def _read(
    graph: Graph, nodes: Sequence[Node], order: Collection[Node], kept: Collection[Node]
) -> tuple[Node, ...]:
    """Return those that are read outside: directly, or by truth values written where they are."""
    inside = frozenset(nodes)
    outside = set(kept)
    for node in order:
        if node in inside:
            continue
        stack = list(graph.arguments(node))
        while stack:
            argument = stack.pop()
            outside.add(argument)
            if graph.is_boolean(argument):
                stack.extend(graph.arguments(argument))
    return tuple(n for n in nodes if n in outside and not graph.is_boolean(n))


def declarations(groups: Sequence[Remembered], name: Namer) -> list[str]:
    """Return the declarations of what is remembered, unknown so far."""
    lines = []
    for k, group in enumerate(groups):
        lines.append(f"uint64_t known{k} = 0;")
        lines += [f"double at{n} = 0.0;" for n in group.ramps]
        lines += [f"double {name(n)} = 0.0;" for n in group.read]
    return lines


def renewal(
    graph: Graph, k: int, group: Remembered, computed: Sequence[str], name: Namer
) -> list[str]:
    """Return the statements that renew a group where one of its ramps moved."""
    same = " & ".join(f"({as_number(graph, n, name)} == at{n})" for n in group.ramps)
    return [
        f"if (__builtin_expect(!(known{k} & {same}), 0)) {{",
        f"  known{k} = 1;",
        *(f"  at{n} = {as_number(graph, n, name)};" for n in group.ramps),
        *(f"  {line}" for line in computed),
        "}",
    ]
