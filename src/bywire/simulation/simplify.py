"""Simplifications of an expression graph: one rule per operation, the simpler node or None."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from bywire.simulation.operation import Node, Operation
from bywire.simulation.signs import Interval


class Graph(Protocol):
    """What a rule asks of the graph that it simplifies, and adds to it."""

    @property
    def nodes(self) -> Sequence[Operation]:
        """Operation of every node."""
        ...

    @property
    def intervals(self) -> Sequence[Interval]:
        """Where the value of every node lies."""
        ...

    @property
    def fixed(self) -> Sequence[bool]:
        """Whether a node follows from leaves alone that change rarely."""
        ...

    def value(self, node: Node) -> float | None:
        """Return the number that a node is, None where it is none."""
        ...

    def constant(self, value: float) -> Node:
        """Return the node of a number."""
        ...

    def apply(self, op: str, *args: Node) -> Node:
        """Return the node of an operation, simplified."""
        ...

    def intern(self, operation: Operation) -> Node:
        """Return the node of an operation as it stands."""
        ...


def _assign(graph: Graph, a: Node) -> Node:
    return a


def _div(graph: Graph, a: Node, b: Node) -> Node:
    return graph.apply("mul", a, graph.apply("inv", b))


def _inv(graph: Graph, a: Node) -> Node | None:
    operation = graph.nodes[a]
    return int(operation.args[0]) if operation.op == "inv" else None


def _sq(graph: Graph, a: Node) -> Node:
    return graph.apply("mul", a, a)


def _twice(graph: Graph, a: Node) -> Node:
    return graph.apply("mul", graph.constant(2.0), a)


def _constpow(graph: Graph, a: Node, b: Node) -> Node | None:
    return _pow(graph, a, b)


def _pow(graph: Graph, a: Node, b: Node) -> Node | None:
    exponent = graph.value(b)
    if exponent == 1.0:
        return a
    if exponent == 2.0:
        return graph.apply("mul", a, a)
    if exponent == 0.5:
        return graph.apply("sqrt", a)
    return None


def _add(graph: Graph, a: Node, b: Node) -> Node | None:
    if graph.value(a) == 0.0:
        return b
    if graph.value(b) == 0.0:
        return a
    if graph.nodes[b].op == "neg":
        return graph.apply("sub", a, graph.nodes[b].args[0])
    if graph.nodes[a].op == "neg":
        return graph.apply("sub", b, graph.nodes[a].args[0])
    return _paired_selection(graph, a, b) or _gathered(graph, "add", a, b)


def _gathered(graph: Graph, op: str, a: Node, b: Node) -> Node | None:
    """Turn a + (b + x) into (a + b) + x where a and b are fixed and x is not; likewise a b x."""
    for fixed, other in ((a, b), (b, a)):
        inner = graph.nodes[other]
        if not graph.fixed[fixed] or graph.fixed[other] or inner.op != op:
            continue
        for first, second in (inner.args, inner.args[::-1]):
            if graph.fixed[first]:
                return graph.apply(op, graph.apply(op, fixed, first), second)
    return None


def _paired_selection(graph: Graph, a: Node, b: Node) -> Node | None:
    """Turn (c ? x : 0) + (!c ? y : 0) into c ? x : y."""
    first, second = graph.nodes[a], graph.nodes[b]
    if first.op != "if_else_zero" or second.op != "if_else_zero":
        return None
    for (c, x), (negated, y) in ((first.args, second.args), (second.args, first.args)):
        if graph.nodes[negated] == Operation("not", (c,)):
            return graph.intern(Operation("select", (c, x, y)))
    return None


def _sub(graph: Graph, a: Node, b: Node) -> Node | None:
    if a == b:
        return graph.constant(0.0)
    if graph.value(b) == 0.0:
        return a
    if graph.value(a) == 0.0:
        return graph.apply("neg", b)
    if graph.nodes[b].op == "neg":
        return graph.apply("add", a, graph.nodes[b].args[0])
    if graph.fixed[b] and graph.nodes[a].op in ("add", "sub") and not graph.fixed[a]:
        inner = graph.nodes[a]
        first, second = inner.args
        if graph.fixed[first]:
            return graph.apply(inner.op, graph.apply("sub", first, b), second)
        if graph.fixed[second] and inner.op == "add":
            return graph.apply("add", graph.apply("sub", second, b), first)
    return None


def _mul(graph: Graph, a: Node, b: Node) -> Node | None:
    for factor, other in ((a, b), (b, a)):
        value = graph.value(factor)
        if value == 0.0:
            return graph.constant(0.0)
        if value == 1.0:
            return other
        if value == -1.0:
            return graph.apply("neg", other)
    return _of_a_tie(graph, a, b) or _gathered(graph, "mul", a, b) or _distributed(graph, a, b)


def _of_a_tie(graph: Graph, a: Node, b: Node) -> Node | None:
    """Turn (x <= y)/((x <= y) + (y <= x)) into 0, 1/2 or 1: slopes of extremes need no division."""
    for factor, other in ((a, b), (b, a)):
        if graph.nodes[factor].op != "le" or graph.nodes[other].op != "inv":
            continue
        total = graph.nodes[graph.nodes[other].args[0]]
        back = graph.intern(Operation("le", graph.nodes[factor].args[::-1]))
        if total.op == "add" and sorted(total.args) == sorted((factor, back)):
            tie = Operation("select", (back, graph.constant(0.5), graph.constant(1.0)))
            return graph.apply("if_else_zero", factor, graph.intern(tie))
    return None


def _distributed(graph: Graph, a: Node, b: Node) -> Node | None:
    """Turn a (b + x) into a b + a x where a and b are fixed and x is not.

    As many operations, but chains of such factors collapse into one product and one sum.
    """
    for factor, other in ((a, b), (b, a)):
        inner = graph.nodes[other]
        if not graph.fixed[factor] or graph.fixed[other] or inner.op not in ("add", "sub"):
            continue
        if graph.fixed[inner.args[0]] != graph.fixed[inner.args[1]]:
            parts = (graph.apply("mul", factor, x) for x in inner.args)
            return graph.apply(inner.op, *parts)
    return None


def _neg(graph: Graph, a: Node) -> Node | None:
    operation = graph.nodes[a]
    if operation.op == "neg":
        return int(operation.args[0])
    if operation.op == "sub":
        return graph.apply("sub", operation.args[1], operation.args[0])
    return None


def _eq(graph: Graph, a: Node, b: Node) -> Node | None:
    """Turn k x == 0 into x == 0."""
    for zero, other in ((a, b), (b, a)):
        if graph.value(zero) == 0.0 and graph.nodes[other].op == "mul":
            factors = graph.nodes[other].args
            rest = [n for n in factors if graph.value(n) is None]
            if len(rest) < len(factors):
                return graph.apply("eq", rest[0], zero)
    return None


def _sign(graph: Graph, a: Node) -> Node:
    zero, one = graph.constant(0.0), graph.constant(1.0)
    above = graph.apply("if_else_zero", graph.apply("lt", zero, a), one)
    below = graph.apply("if_else_zero", graph.apply("lt", a, zero), one)
    return graph.apply("sub", above, below)


def _fmax(graph: Graph, a: Node, b: Node) -> Node | None:
    first, second = graph.intervals[a], graph.intervals[b]
    return a if first.low >= second.high else b if second.low >= first.high else None


def _fmin(graph: Graph, a: Node, b: Node) -> Node | None:
    first, second = graph.intervals[a], graph.intervals[b]
    return a if first.high <= second.low else b if second.high <= first.low else None


def _fabs(graph: Graph, a: Node) -> Node | None:
    return a if graph.intervals[a].positive else None


def _if_else_zero(graph: Graph, c: Node, a: Node) -> Node | None:
    if graph.value(a) == 0.0:
        return graph.constant(0.0)
    operation = graph.nodes[a]
    if operation.op == "mul":
        # c ? k exp(x) : 0 is k (c ? exp(x) : 0): the selection can be shared, and branched on.
        for factor, costly in (operation.args, operation.args[::-1]):
            if graph.nodes[costly].op == "exp":
                return graph.apply("mul", factor, graph.apply("if_else_zero", c, costly))
    return None


RULES: dict[str, Callable[..., Node | None]] = {
    "assign": _assign,
    "div": _div,
    "inv": _inv,
    "sq": _sq,
    "twice": _twice,
    "constpow": _constpow,
    "pow": _pow,
    "add": _add,
    "sub": _sub,
    "mul": _mul,
    "neg": _neg,
    "eq": _eq,
    "sign": _sign,
    "fmax": _fmax,
    "fmin": _fmin,
    "fabs": _fabs,
    "if_else_zero": _if_else_zero,
}
