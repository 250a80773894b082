"""Branches in a single run's kernel: what one arm of a selection alone needs stands inside it.

A selection computes both arms. Where only one of them needs costly functions, such as the curve of
a tyre that slides, the processor skips them while the other arm holds. The values are the same.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from bywire.simulation.expressions import COSTLY, Namer, as_number, condition
from bywire.simulation.graph import Graph
from bywire.simulation.modes import cost
from bywire.simulation.operation import Node

_WORTH = 45.0  # of operations: a costly function and a little of what leads to it
_SELECTIONS = ("if_else_zero", "select")


def branched(
    graph: Graph, order: Sequence[Node], kept: Collection[Node]
) -> tuple[list[Node], dict[Node, tuple[list[Node], list[Node]]]]:
    """Take out of an order what single arms of its selections alone need.

    Parameters
    ----------
    graph
        The expressions.
    order
        Operations, arguments first.
    kept
        Those that are read from outside as well.

    Returns
    -------
    tuple
        The order without them; and by selection, what its two arms need, in order.
    """
    users: dict[Node, list[Node]] = {}
    for node in order:
        for argument in graph.arguments(node):
            users.setdefault(argument, []).append(node)
    inside: set[Node] = set()
    arms: dict[Node, tuple[list[Node], list[Node]]] = {}
    for node in reversed(order):  # the outermost first
        if node in inside or graph.nodes[node].op not in _SELECTIONS:
            continue
        cones = [_cone(graph, node, arm, users, kept) for arm in graph.arguments(node)[1:]]
        worth = [_worth(graph, cone) for cone in cones]
        if any(worth):
            chosen = [cone if pays else set() for cone, pays in zip(cones, worth, strict=True)]
            inside.update(*chosen)
            first, last = chosen if len(chosen) == 2 else (chosen[0], set[Node]())
            arms[node] = [n for n in order if n in first], [n for n in order if n in last]
    return [node for node in order if node not in inside], arms


def _worth(graph: Graph, cone: Collection[Node]) -> bool:
    if not any(graph.nodes[node].op in COSTLY for node in cone):
        return False
    return sum(cost(graph, node) for node in cone) > _WORTH


def _cone(
    graph: Graph, selection: Node, arm: Node, users: Mapping[Node, Sequence[Node]],
    kept: Collection[Node],
) -> set[Node]:  # fmt: skip
    """Return what the arm of a selection needs and nothing else does."""
    if users.get(arm, ()) != [selection] or graph.arguments(selection).count(arm) != 1:
        return set()
    cone: set[Node] = set()
    candidates = {arm}
    while candidates:
        node = max(candidates)  # arguments have lower numbers than who reads them
        candidates.discard(node)
        readers = set(users.get(node, ())) - {selection} if node == arm else set(users[node])
        if node in kept or not graph.arguments(node) or not readers <= cone:
            continue
        cone.add(node)
        candidates.update(a for a in graph.arguments(node) if a in users)
    return cone


def branch(
    graph: Graph, node: Node, arms: tuple[Sequence[str], Sequence[str]], name: Namer
) -> list[str]:
    """Return the statements of a selection whose arms need statements of their own."""
    truth, value, *other = graph.nodes[node].args
    ends = (as_number(graph, value, name), as_number(graph, other[0], name) if other else "0.0")
    first, last = ([*(f"  {line}" for line in lines), f"  {name(node)} = {end};"]
                   for lines, end in zip(arms, ends, strict=True))  # fmt: skip
    test = condition(graph, truth, name)
    return [f"double {name(node)};", f"if ({test}) {{", *first, "} else {", *last, "}"]
