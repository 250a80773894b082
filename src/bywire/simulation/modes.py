"""Values that change with a discrete mode alone: which contacts press, what saturates.

A mode is a handful of truth values. What depends on them and on parameters, such as the matrix of a
substep, its pivots and their reciprocals, is computed when one of them changes: a few hundred times
in a run of many thousand substeps.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from bywire.simulation.expressions import needed
from bywire.simulation.graph import Graph, Node
from bywire.simulation.quadrature import Levels

_COMPARISONS = frozenset({"lt", "le", "eq", "ne"})
_TRUTHS = _COMPARISONS | {"and", "or", "not"}
_FREE = _TRUTHS | {"if_else_zero", "select", "neg"}  # as cheap as what finds out about a change
_COST = {"inv": 8.0, "sqrt": 8.0, "exp": 40.0, "sin": 40.0, "cos": 40.0, "log": 40.0, "pow": 60.0}
_WORTH_ATOM, _WORTH_MODE = 4.0, 0.15


@dataclass(frozen=True)
class Modes:
    """A substep in three parts.

    Parameters
    ----------
    first
        Nodes from which the truth values follow, in order.
    atoms
        The truth values; empty where a mode does not pay.
    values
        Nodes to renew when one of them changes, in order; no truth values.
    rest
        All other nodes, in order.
    """

    first: list[Node]
    atoms: list[Node]
    values: list[Node]
    rest: list[Node]

    def without(self, known: Collection[Node]) -> Modes:
        """Return the parts less nodes that are known already."""
        return Modes(
            *(
                [n for n in each if n not in known]
                for each in (self.first, self.atoms, self.values, self.rest)
            )
        )


def modes(graph: Graph, roots: Sequence[Node], level: Levels) -> Modes:
    """Split what a substep computes.

    Parameters
    ----------
    roots
        Results of the substep.
    level
        Tells how often a node changes, see ``stages.LEVEL``.
    """
    substep = needed(graph, roots, lambda n: level[n] < 2)
    order = needed(graph, roots, lambda n: level[n] == 0)
    refused: set[Node] = set()
    while True:
        deciding = _classified(graph, order, level, refused)
        poor = _poor_atoms(graph, order, deciding)
        if not poor:
            break
        refused |= poor
    atoms = sorted({a for own in deciding.values() for a in own})
    first = needed(graph, atoms, lambda n: level[n] < 2)
    early = frozenset(first)
    values = [n for n in order if n in deciding and n not in early and not _is_truth(graph, n)]
    saved = sum(cost(graph, n) for n in values if level[n] == 2) - 2.0 * len(atoms)
    if saved < _WORTH_MODE * sum(cost(graph, n) for n in substep):
        return Modes([], [], [], substep)
    late = frozenset(values)
    return Modes(first, atoms, values, [n for n in substep if n not in early and n not in late])


def _is_truth(graph: Graph, node: Node) -> bool:
    return graph.nodes[node].op in _TRUTHS


def cost(graph: Graph, node: Node) -> float:
    """Return about how long an operation takes, a product being 1."""
    return _COST.get(graph.nodes[node].op, 1.0)


def _classified(
    graph: Graph, order: Sequence[Node], level: Levels, refused: Collection[Node]
) -> dict[Node, frozenset[Node]]:
    """Return every node that a mode decides, and the truth values that it follows from."""
    deciding: dict[Node, frozenset[Node]] = {}
    late: set[Node] = set()  # follows from such a node, but not from it alone
    for node in order:
        changing = [a for a in graph.arguments(node) if level[a] > 0]
        if all(a in deciding for a in changing):
            deciding[node] = frozenset().union(*(deciding[a] for a in changing))
        elif any(a in deciding or a in late for a in changing):
            late.add(node)
        elif graph.nodes[node].op in _COMPARISONS and node not in refused:
            deciding[node] = frozenset({node})
    return deciding


def _poor_atoms(
    graph: Graph, order: Sequence[Node], deciding: dict[Node, frozenset[Node]]
) -> set[Node]:
    """Return truth values from which too little follows."""
    worth: dict[Node, float] = {}
    for node in order:
        price = 0.0 if graph.nodes[node].op in _FREE else cost(graph, node)
        for atom in deciding.get(node, ()):
            worth[atom] = worth.get(atom, 0.0) + price
    return {atom for atom, value in worth.items() if value < _WORTH_ATOM}
