"""Integrals of powers: a few running sums in the substep, combined once per frame.

A rate such as the copper loss R i^2 consists of a coefficient that is constant within a frame, and
a product that is not. The substep sums the products (i^2, i omega, omega^2, ...), which several
rates share. At the end of a frame, the kernel multiplies the sums by the coefficients.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from bywire.simulation.graph import Graph, Node

Terms = dict[Node | None, Node]  # product (None: the number one) -> coefficient
_MOST = 4  # maximum number of terms of an expanded product


@dataclass(frozen=True)
class Quadrature:
    """Running sums, and the integrals as their combinations.

    Parameters
    ----------
    products
        Nodes that each substep adds to the sums.
    combinations
        Pairs of a coefficient and the index of its product, for each integral.
    """

    products: list[Node]
    combinations: list[list[tuple[Node, int]]]

    def of(self, needed: Sequence[bool]) -> Quadrature:
        """Return the sums for some of the integrals; the other integrals stay unchanged."""
        chosen = [
            pairs if is_needed else []
            for pairs, is_needed in zip(self.combinations, needed, strict=True)
        ]
        places = sorted({k for pairs in chosen for _, k in pairs})
        return Quadrature(
            [self.products[k] for k in places],
            [[(c, places.index(k)) for c, k in pairs] for pairs in chosen],
        )


def factored(
    graph: Graph, rates: Sequence[Node], computed: Collection[Node], level: Levels
) -> Quadrature:
    """Split rates into coefficients and products.

    Parameters
    ----------
    rates
        Nodes of the rates.
    computed
        Nodes that the substep computes anyway. Such sums are not expanded.
    level
        How often each node changes, see ``stages.LEVEL``.
    """
    expansion = _Expansion(graph, computed, level)
    products: list[Node] = []
    combinations = []
    for rate in rates:
        pairs: list[tuple[Node, int]] = []
        for factor, coefficient in expansion.terms(rate).items():
            product = graph.constant(1.0) if factor is None else factor
            if coefficient == graph.constant(0.0):
                continue
            if product not in products:
                products.append(product)
            pairs.append((coefficient, products.index(product)))
        combinations.append(pairs)
    return Quadrature(products, combinations)


def collapsed(graph: Graph, roots: Sequence[Node], level: Levels) -> list[Node]:
    """Return the same values, written as sums of coefficients times values if this is shorter."""
    new = list(roots)
    needs = [_moving(graph, [root], level) for root in roots]
    users = Counter(node for each in needs for node in each)
    for k, root in enumerate(roots):
        users.subtract(needs[k])
        for node in needs[k]:
            if not users[node]:
                del users[node]  # other roots compute the remaining nodes
        if root not in users:
            alone = len(needs[k] - users.keys())
            terms = _Expansion(graph, users, level).terms(root)
            inner = [p for p in terms if p is not None]
            fresh = len(_moving(graph, inner, level) - users.keys())
            factors = sum(1 for p, c in terms.items() if p is not None and c != graph.constant(1.0))
            if fresh + factors + len(terms) - 1 < alone:
                new[k] = _summed(graph, terms)
                needs[k] = _moving(graph, [new[k]], level)
        users.update(needs[k])
    return new


def _moving(graph: Graph, roots: Sequence[Node], level: Levels) -> set[Node]:
    """Return the operations that the roots need and that change in every substep."""
    is_rare, operands = level.rare(), graph.operands
    moving: set[Node] = set()
    stack = list(roots)
    while stack:
        node = stack.pop()
        if node not in moving and operands[node] and not is_rare(node):
            moving.add(node)
            stack.extend(operands[node])
    return moving


def _summed(graph: Graph, terms: Terms) -> Node:
    total = None
    for product, coefficient in terms.items():
        part = coefficient if product is None else graph.apply("mul", coefficient, product)
        total = part if total is None else graph.apply("add", total, part)
    return graph.constant(0.0) if total is None else total


class Levels:
    """Levels of change of the nodes in a growing graph."""

    def __init__(self, graph: Graph, of_leaf: dict[str, int]) -> None:
        self._graph, self._of_leaf = graph, of_leaf
        self._known: list[int] = []
        self._rare: list[bool] = []

    def __getitem__(self, node: Node) -> int:
        if len(self._known) <= node:
            self._extend()
        return self._known[node]

    def rare(self) -> Callable[[Node], bool]:
        """Return a function that tests whether a node changes less often than every substep."""
        self._extend()
        return self._rare.__getitem__

    def _extend(self) -> None:
        known = self._known
        for new in range(len(known), len(self._graph.nodes)):
            operation = self._graph.nodes[new]
            if operation.op == "leaf":
                level = self._of_leaf.get(operation.args[0], 2)
            elif operation.op == "const":
                level = 0
            else:
                level = max([known[a] for a in operation.args])
            known.append(level)
            self._rare.append(level < 2)


class _Expansion:
    """Expansion of rates into sums of coefficients times products."""

    def __init__(self, graph: Graph, computed: Collection[Node], level: Levels) -> None:
        self._graph, self._computed, self._level = graph, computed, level
        self._one = graph.constant(1.0)

    def terms(self, node: Node) -> Terms:
        """Return the terms of a node."""
        if self._level[node] < 2:
            return {None: node}
        operation = self._graph.nodes[node]
        if operation.op == "neg":
            return self._scaled(self.terms(operation.args[0]), self._graph.constant(-1.0))
        if operation.op in ("add", "sub") and node not in self._computed:
            a, b = (self.terms(x) for x in operation.args)
            if operation.op == "sub":
                b = self._scaled(b, self._graph.constant(-1.0))
            return self._sum(a, b)
        if operation.op == "mul":
            a, b = (self.terms(x) for x in operation.args)
            if len(a) * len(b) <= _MOST and 1 in (len(a), len(b)):
                return self._product(a, b)
            return self._separated(node)  # the square of a difference is never negative
        return {node: self._one}

    def _separated(self, product: Node) -> Terms:
        """Return a product as its rarely changing factors times the remaining factors."""
        graph, coefficient, rest = self._graph, self._one, self._one
        stack = [product]
        while stack:
            node = stack.pop()
            if self._level[node] < 2:
                coefficient = graph.apply("mul", coefficient, node)
            elif graph.nodes[node].op == "mul" and node not in self._computed:
                stack.extend(graph.nodes[node].args)
            else:
                rest = graph.apply("mul", rest, node)
        return {rest: coefficient}

    def _scaled(self, terms: Terms, factor: Node) -> Terms:
        return {p: self._graph.apply("mul", c, factor) for p, c in terms.items()}

    def _sum(self, a: Terms, b: Terms) -> Terms:
        total = dict(a)
        for product, c in b.items():
            total[product] = self._graph.apply("add", total[product], c) if product in total else c
        return total

    def _product(self, a: Terms, b: Terms) -> Terms:
        total: Terms = {}
        for pa, ca in a.items():
            for pb, cb in b.items():
                product = pb if pa is None else pa
                if pa is not None and pb is not None:
                    product = self._graph.apply("mul", pa, pb)
                total = self._sum(total, {product: self._graph.apply("mul", ca, cb)})
        return total
