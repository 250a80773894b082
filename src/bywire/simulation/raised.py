"""Whether a number that cannot be negative is above zero, told without computing it.

The flag of a pass is the largest of what must not be passed: gaps, distances from the ends of
tables, products of speeds before and behind. A kernel only asks whether it is up: comparisons,
which wait for nothing, in place of differences and maxima.
"""

from __future__ import annotations

from functools import reduce

from bywire.simulation.graph import Graph
from bywire.simulation.operation import Node


def raised(graph: Graph, node: Node) -> Node:
    """Return the truth value of ``node > 0``; of ``node != 0`` where it may be negative.

    A difference is above zero exactly where its terms differ so: numbers near zero are not cut off.
    """
    if not graph.intervals[node].positive:
        return graph.apply("ne", node, graph.constant(0.0))
    truths = dict.fromkeys(_above_zero(graph, term) for term in _terms(graph, node))
    return reduce(lambda a, b: graph.apply("or", a, b), truths) if truths else node


def _terms(graph: Graph, node: Node) -> list[Node]:
    """Return what a maximum is the largest of, less constants that are not above zero."""
    operation = graph.nodes[node]
    if operation.op == "fmax":
        return [term for a in operation.args for term in _terms(graph, a)]
    is_idle = operation.op == "const" and graph.intervals[node].negative
    return [] if is_idle else [node]


def _above_zero(graph: Graph, node: Node) -> Node:
    if graph.is_boolean(node):
        return node
    operation, zero = graph.nodes[node], graph.constant(0.0)
    if operation.op == "sub":
        first, second = operation.args
        return graph.apply("lt", second, first)
    if operation.op == "neg":
        return graph.apply("lt", operation.args[0], zero)
    return graph.apply("lt", zero, node)
