"""Expression graph of all stages of a kernel, with each value only once and without divisions.

The input consists of CasADi's instruction lists. The graph merges common subexpressions across
stages and folds constants. It turns a/b into a product with a reciprocal, which other expressions
can share, and merges paired selections.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, reduce
from typing import Any, NamedTuple

import casadi as ca

Node = int
BOOLEAN = frozenset({"lt", "le", "eq", "ne", "not", "and", "or"})
COMMUTATIVE = frozenset({"add", "mul", "eq", "ne", "and", "or", "fmin", "fmax"})


class Operation(NamedTuple):
    """Node: a leaf (``args``: kind and index), a constant, or an operation on nodes."""

    op: str
    args: tuple[Any, ...]


# --- Signs: values that cannot be negative because of parameter ranges


@dataclass(frozen=True)
class Interval:
    """Closed interval of a value."""

    low: float = -math.inf
    high: float = math.inf

    @property
    def positive(self) -> bool:
        """Whether the value is >= 0."""
        return self.low >= 0.0

    @property
    def negative(self) -> bool:
        """Whether the value is <= 0."""
        return self.high <= 0.0


ANYTHING = Interval()
NOT_NEGATIVE = Interval(0.0)


def interval_of(op: str, arguments: list[Interval]) -> Interval:
    """Return the interval of an operation's result; infinite if no bound is known.

    Only the signs of the bounds matter. Rounding never changes the sign of a sum with an exact
    bound of zero.
    """
    rule = _RULES.get(op)
    return ANYTHING if rule is None else rule(*arguments)


def _added(a: Interval, b: Interval) -> Interval:
    return Interval(a.low + b.low, a.high + b.high)


def _negated(a: Interval) -> Interval:
    return Interval(-a.high, -a.low)


def _multiplied(a: Interval, b: Interval) -> Interval:
    if (a.positive and b.positive) or (a.negative and b.negative):
        return NOT_NEGATIVE
    if (a.positive and b.negative) or (a.negative and b.positive):
        return Interval(high=0.0)
    return ANYTHING


def _inverted(a: Interval) -> Interval:
    return NOT_NEGATIVE if a.positive else Interval(high=0.0) if a.negative else ANYTHING


_RULES: dict[str, Callable[..., Interval]] = {
    "add": _added,
    "sub": lambda a, b: _added(a, _negated(b)),
    "neg": _negated,
    "mul": _multiplied,
    "inv": _inverted,
    "fabs": lambda a: NOT_NEGATIVE,
    "exp": lambda a: NOT_NEGATIVE,
    "sqrt": lambda a: NOT_NEGATIVE,
    "fmax": lambda a, b: Interval(max(a.low, b.low), max(a.high, b.high)),
    "fmin": lambda a, b: Interval(min(a.low, b.low), min(a.high, b.high)),
    "if_else_zero": lambda c, a: Interval(min(a.low, 0.0), max(a.high, 0.0)),
    "select": lambda c, a, b: Interval(min(a.low, b.low), max(a.high, b.high)),
}


# --- Simplifications: one rule per operation, which returns the simpler node or None


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
    """Turn a + (b + x) into (a + b) + x if a and b are fixed and x is not; same for a b x."""
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
    """Turn (x <= y)/((x <= y) + (y <= x)), a slope of an extreme, into 0, 1/2 or 1."""
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
    """Turn a (b + x) into a b + a x if a and b are fixed and x is not.

    The number of operations is the same, but chains of such factors collapse into one product and
    one sum.
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
        # c ? k exp(x) : 0 equals k (c ? exp(x) : 0). Other expressions can share the second
        # selection, or it can become a branch.
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


# --- The graph


@cache
def _names() -> dict[int, str]:
    supported = [
        "add",
        "sub",
        "mul",
        "div",
        "neg",
        "exp",
        "log",
        "sqrt",
        "sin",
        "cos",
        "fabs",
        "floor",
        "fmin",
        "fmax",
        "lt",
        "le",
        "eq",
        "ne",
        "not",
        "and",
        "or",
        "inv",
        "sq",
        "twice",
        "if_else_zero",
        "assign",
        "pow",
        "constpow",
        "sign",
        "tan",
        "atan",
        "tanh",
        "ceil",
        "copysign",
    ]
    return {getattr(ca, f"OP_{name.upper()}"): name for name in supported}


_FOLD: dict[str, Callable[..., float]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "neg": lambda a: -a,
    "exp": math.exp,
    "log": math.log,
    "sqrt": math.sqrt,
    "sin": math.sin,
    "cos": math.cos,
    "fabs": abs,
    "floor": lambda a: float(math.floor(a)),
    "fmin": min,
    "fmax": max,
    "inv": lambda a: 1.0 / a,
}


@dataclass
class Graph:
    """Growing set of nodes; equal operations on equal arguments are the same node.

    Parameters
    ----------
    ranges
        Ranges of leaves, by kind and index. The graph drops limits that a value cannot reach.
    fixed_leaves
        Kinds of leaves that change rarely. The graph groups values that depend only on these
        leaves: a + (b + x) becomes (a + b) + x, so a + b is also computed rarely.
    operands, registers
        For each node, its arguments in an order where the argument that needs the most registers is
        last, and the number of registers if this argument is computed first.
    """

    ranges: Mapping[tuple[str, int], Interval] = field(default_factory=dict)
    fixed_leaves: frozenset[str] = frozenset()
    nodes: list[Operation] = field(default_factory=list)
    intervals: list[Interval] = field(default_factory=list)
    fixed: list[bool] = field(default_factory=list)
    operands: list[tuple[Node, ...]] = field(default_factory=list)
    registers: list[int] = field(default_factory=list)
    _known: dict[Operation, Node] = field(default_factory=dict)

    def leaf(self, kind: str, index: int) -> Node:
        """Return the node of an input."""
        return self.intern(Operation("leaf", (kind, index)))

    def constant(self, value: float) -> Node:
        """Return the node of a number."""
        # repr distinguishes 0.0 and -0.0. A number as a key would not.
        return self.intern(Operation("const", (repr(float(value)),)))

    def add_function(self, function: Any, inputs: Sequence[Sequence[Node]]) -> list[list[Node]]:
        """Add a CasADi SX function.

        Parameters
        ----------
        function
            SX function without free variables.
        inputs
            Nodes of the entries of each argument.

        Returns
        -------
        list of list of int
            Nodes of the entries of each result.
        """
        work: dict[int, Node] = {}
        results: list[list[Node]] = [
            [self.constant(0.0)] * function.nnz_out(k) for k in range(function.n_out())
        ]
        for k in range(function.n_instructions()):
            code = function.instruction_id(k)
            source, target = function.instruction_input(k), function.instruction_output(k)
            if code == ca.OP_INPUT:
                work[target[0]] = inputs[source[0]][source[1]]
            elif code == ca.OP_OUTPUT:
                results[target[0]][target[1]] = work[source[0]]
            elif code == ca.OP_CONST:
                work[target[0]] = self.constant(function.instruction_constant(k))
            else:
                work[target[0]] = self.apply(_names()[code], *(work[s] for s in source))
        return results

    def apply(self, op: str, *args: Node) -> Node:
        """Return the simplified node of an operation."""
        if op in _FOLD and all(self.nodes[a].op == "const" for a in args):
            folded = self._folded(op, [self.value(a) for a in args])
            if folded is not None:
                return folded
        rule = RULES.get(op)
        if rule is not None:
            simpler = rule(self, *args)
            if simpler is not None:
                return int(simpler)
        if op in COMMUTATIVE:
            args = tuple(sorted(args))
        return self.intern(Operation(op, args))

    def is_boolean(self, node: Node) -> bool:
        """Return whether a node is a truth value."""
        return self.nodes[node].op in BOOLEAN

    def arguments(self, node: Node) -> tuple[Node, ...]:
        """Return the arguments of a node."""
        operation = self.nodes[node]
        return () if operation.op in ("leaf", "const") else operation.args

    def read_by(self, roots: Iterable[Node]) -> frozenset[Node]:
        """Return all nodes on which values depend, including leaves and constants."""
        seen: set[Node] = set()
        stack = list(roots)
        while stack:
            node = stack.pop()
            if node not in seen:
                seen.add(node)
                stack.extend(self.arguments(node))
        return frozenset(seen)

    def intern(self, operation: Operation) -> Node:
        """Return the node of an operation without simplification."""
        known = self._known.get(operation)
        if known is None:
            known = len(self.nodes)
            self.nodes.append(operation)
            self.intervals.append(self._interval(operation))
            self.fixed.append(
                operation.args[0] in self.fixed_leaves
                if operation.op == "leaf"
                else all(self.fixed[a] for a in self.arguments(known))
            )
            operands = sorted(self.arguments(known), key=self.registers.__getitem__)
            waiting = (self.registers[a] + k for k, a in enumerate(reversed(operands)))
            self.operands.append(tuple(operands))
            self.registers.append(max(waiting, default=0) or int(bool(operands)))
            self._known[operation] = known
        return known

    def _interval(self, operation: Operation) -> Interval:
        if operation.op == "leaf":
            return self.ranges.get(operation.args, ANYTHING)
        if operation.op == "const":
            value = float(operation.args[0])
            return Interval(value, value)
        return interval_of(operation.op, [self.intervals[a] for a in operation.args])

    def value(self, node: Node) -> float | None:
        """Return the number of a constant node; None for any other node."""
        operation = self.nodes[node]
        return float(operation.args[0]) if operation.op == "const" else None

    def _folded(self, op: str, values: Sequence[float | None]) -> Node | None:
        try:
            value = _FOLD[op](*values)
        except (ArithmeticError, ValueError):
            return None  # the run reports the error
        return self.constant(value)


# --- Test whether a nonnegative number is above zero, without computing the number
# A pass's flag is the maximum of several violations: gaps, distances beyond the ends of tables, and
# products of velocities before and after. A kernel only tests whether the flag is above zero. It
# uses independent comparisons instead of differences and maxima.


def raised(graph: Graph, node: Node) -> Node:
    """Return the truth value of ``node > 0``, or of ``node != 0`` if it may be negative.

    A difference is above zero if and only if its first term is larger, because tiny differences do
    not underflow to zero.
    """
    if not graph.intervals[node].positive:
        return graph.apply("ne", node, graph.constant(0.0))
    truths = dict.fromkeys(_above_zero(graph, term) for term in _terms(graph, node))
    return reduce(lambda a, b: graph.apply("or", a, b), truths) if truths else node


def _terms(graph: Graph, node: Node) -> list[Node]:
    """Return the operands of a maximum, without constants <= 0."""
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
