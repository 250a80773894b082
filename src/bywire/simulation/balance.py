"""Order of sums and products in a substep: what is ready first is combined first.

A substep is one long chain of dependent operations, and the processor waits for it. Sums and
products of three and more are therefore rebuilt such that a late operand passes through as few
operations as possible, and k a + k b as k (a + b) where k changes rarely. Only rounding changes.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Sequence

from bywire.simulation.expressions import needed
from bywire.simulation.graph import Graph
from bywire.simulation.operation import Node
from bywire.simulation.quadrature import Levels

# Cycles from operands to result, about right for the processors of the last ten years.
_LATENCY = {"inv": 13, "sqrt": 18, "exp": 40, "sin": 50, "cos": 50, "log": 40, "pow": 80}
_USUAL = 4
_SUMS = ("add", "sub", "neg")


class _Balance:
    """Rebuilds nodes bottom-up."""

    def __init__(self, graph: Graph, roots: Sequence[Node], level: Levels) -> None:
        self._graph, self._level = graph, level
        order = needed(graph, roots, lambda n: level[n] < 2)
        self._uses = Counter(a for node in order for a in graph.arguments(node))
        self._uses.update(roots)
        self._new: dict[Node, Node] = {}
        self._ready: dict[Node, int] = {}
        self._differences: dict[frozenset[Node], Node] = {}
        for node in order:
            self._new[node] = self._rebuilt(node)

    def node(self, node: Node) -> Node:
        """Return the rebuilt node."""
        return self._new.get(node, node)

    def _rebuilt(self, node: Node) -> Node:
        operation = self._graph.nodes[node]
        if operation.op in ("add", "sub"):
            return self._combined("add", self._joined(self._summands(node, 1, top=True)))
        if operation.op == "mul":
            return self._combined("mul", [(1, f) for f in self._factors(node, top=True)])
        return self._graph.apply(operation.op, *(self.node(a) for a in operation.args))

    def _summands(self, node: Node, sign: int, top: bool = False) -> list[tuple[int, Node]]:
        operation = self._graph.nodes[node]
        own = top or (self._level[node] == 2 and self._uses[node] == 1)
        if operation.op not in _SUMS or not own:
            return [(sign, node)]
        signs = {"add": (sign, sign), "sub": (sign, -sign), "neg": (-sign,)}[operation.op]
        return [
            part
            for s, a in zip(signs, operation.args, strict=True)
            for part in self._summands(a, s)
        ]

    def _joined(self, parts: list[tuple[int, Node]]) -> list[tuple[int, Node]]:
        """Return summands rebuilt: what is there twice, or has a rare factor in common, as one."""
        groups: dict[Node, list[tuple[int, int, Node, Node]]] = {}
        joined: list[tuple[int, Node]] = []
        for (sign, node), times in Counter(parts).items():
            if times > 1 and times == self._uses[node]:
                number = self._graph.constant(float(times))
                joined.append((sign, self._graph.apply("mul", number, self.node(node))))
            elif times == 1 and (split := self._split(node)) is not None:
                turned, factor, rest = split
                groups.setdefault(factor, []).append((sign, sign * turned, rest, node))
            else:
                joined += [(sign, self.node(node))] * times
        for factor, terms in groups.items():
            sign, first, _, node = terms[0]
            if len(terms) == 1:
                joined.append((sign, self.node(node)))
                continue
            inner = self._combined("add", [(first * s, self.node(a)) for _, s, a, _ in terms])
            joined.append((first, self._graph.apply("mul", inner, factor)))
        return joined

    def _split(self, node: Node) -> tuple[int, Node, Node] | None:
        """Return a rare factor and the rest of a product that nothing else needs.

        Of two factors a - b and b - a the same is taken for both, and the sign that this turns.
        """
        nodes, level = self._graph.nodes, self._level
        if nodes[node].op != "mul" or level[node] < 2 or self._uses[node] > 1:
            return None
        rest, factor = sorted(nodes[node].args, key=level.__getitem__, reverse=True)
        if level[factor] == 2:
            return None
        if nodes[factor].op != "sub":
            return 1, factor, rest
        same = self._differences.setdefault(frozenset(nodes[factor].args), factor)
        return 1 if same == factor else -1, same, rest

    def _factors(self, node: Node, top: bool = False) -> list[Node]:
        operation = self._graph.nodes[node]
        own = top or (self._level[node] == 2 and self._uses[node] == 1)
        if operation.op != "mul" or not own:
            return [self.node(node)]
        return [f for a in operation.args for f in self._factors(a)]

    def _combined(self, op: str, parts: list[tuple[int, Node]]) -> Node:
        heap = [(self._time(n), k, sign, n) for k, (sign, n) in enumerate(parts)]
        heapq.heapify(heap)
        number = len(heap)
        while len(heap) > 1:
            (_, _, s1, a), (_, _, s2, b) = heapq.heappop(heap), heapq.heappop(heap)
            sign, node = s1 * s2 if op == "mul" else s1, self._graph.apply(op, a, b)
            if op == "add" and s1 != s2:
                first, second = (a, b) if s1 > 0 else (b, a)
                sign, node = 1, self._graph.apply("sub", first, second)
            number += 1
            heapq.heappush(heap, (self._time(node), number, sign, node))
        _, _, sign, node = heap[0]
        return node if sign > 0 else self._graph.apply("neg", node)

    def _time(self, node: Node) -> int:
        """Return when a node is ready, in cycles after the substep's start."""
        if node not in self._ready:
            operation = self._graph.nodes[node]
            late = 0
            if self._level[node] == 2 and operation.op != "leaf":
                before = max(self._time(a) for a in self._graph.arguments(node))
                late = before + _LATENCY.get(operation.op, _USUAL)
            self._ready[node] = late
        return self._ready[node]


def balanced(graph: Graph, roots: Sequence[Node], level: Levels) -> list[Node]:
    """Return nodes of the same values, in an order of operations that waits less."""
    balance = _Balance(graph, roots, level)
    return [balance.node(root) for root in roots]
