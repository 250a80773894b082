"""Expression graph shared by all stages of a kernel: every value once, divisions as products.

CasADi's instruction lists go in; common subexpressions meet across stages, constants fold, a/b
becomes a times a reciprocal that others can share, and paired selections become one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import casadi as ca

from bywire.simulation.signs import ANYTHING, Interval, interval_of

Node = int
BOOLEAN = frozenset({"lt", "le", "eq", "ne", "not", "and", "or"})
COMMUTATIVE = frozenset({"add", "mul", "eq", "ne", "and", "or", "fmin", "fmax"})


@dataclass(frozen=True)
class Operation:
    """One node: a leaf (``args`` = kind and index), a constant, or an operation on nodes."""

    op: str
    args: tuple[Any, ...]


@cache
def _names() -> dict[int, str]:
    wanted = [
        "add", "sub", "mul", "div", "neg", "exp", "log", "sqrt", "sin", "cos", "fabs", "floor",
        "fmin", "fmax", "lt", "le", "eq", "ne", "not", "and", "or", "inv", "sq", "twice",
        "if_else_zero", "assign", "pow", "constpow", "sign", "tan", "atan", "tanh", "ceil",
        "copysign",
    ]  # fmt: skip
    return {getattr(ca, f"OP_{name.upper()}"): name for name in wanted}


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
    """A growing set of nodes; equal operations on equal arguments are the same node.

    Parameters
    ----------
    ranges
        What is known of leaves, by kind and index; limits that a value cannot cross vanish.
    fixed_leaves
        Kinds of leaves that change rarely: values of these alone are gathered, a + (b + x)
        becoming (a + b) + x, so that they are computed rarely too.
    """

    ranges: Mapping[tuple[str, int], Interval] = field(default_factory=dict)
    fixed_leaves: frozenset[str] = frozenset()
    nodes: list[Operation] = field(default_factory=list)
    _intervals: list[Interval] = field(default_factory=list)
    _fixed: list[bool] = field(default_factory=list)
    _known: dict[Operation, Node] = field(default_factory=dict)

    def leaf(self, kind: str, index: int) -> Node:
        """Return the node of an input."""
        return self._intern(Operation("leaf", (kind, index)))

    def constant(self, value: float) -> Node:
        """Return the node of a number."""
        # repr keeps 0.0 and -0.0 apart: dict keys would not.
        return self._intern(Operation("const", (repr(float(value)),)))

    def add_function(self, function: Any, inputs: Sequence[Sequence[Node]]) -> list[list[Node]]:
        """Add a CasADi SX function.

        Parameters
        ----------
        function
            SX function without free variables.
        inputs
            For each argument the nodes of its entries.

        Returns
        -------
        list of list of int
            For each result the nodes of its entries.
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
        """Return the node of an operation, simplified."""
        values = [self._value(a) for a in args]
        if op in _FOLD and all(v is not None for v in values):
            folded = self._folded(op, values)
            if folded is not None:
                return folded
        rule = getattr(self, f"_{op}", None)
        if rule is not None:
            simpler = rule(*args)
            if simpler is not None:
                return int(simpler)
        if op in COMMUTATIVE:
            args = tuple(sorted(args))
        return self._intern(Operation(op, args))

    def is_boolean(self, node: Node) -> bool:
        """Return whether a node is a truth value."""
        return self.nodes[node].op in BOOLEAN

    def arguments(self, node: Node) -> tuple[Node, ...]:
        """Return the nodes that a node is computed from."""
        operation = self.nodes[node]
        return () if operation.op in ("leaf", "const") else operation.args

    def _intern(self, operation: Operation) -> Node:
        known = self._known.get(operation)
        if known is None:
            known = len(self.nodes)
            self.nodes.append(operation)
            self._intervals.append(self._interval(operation))
            self._fixed.append(
                operation.args[0] in self.fixed_leaves
                if operation.op == "leaf"
                else all(self._fixed[a] for a in self.arguments(known))
            )
            self._known[operation] = known
        return known

    def _interval(self, operation: Operation) -> Interval:
        if operation.op == "leaf":
            return self.ranges.get(operation.args, ANYTHING)
        if operation.op == "const":
            value = float(operation.args[0])
            return Interval(value, value)
        return interval_of(operation.op, [self._intervals[a] for a in operation.args])

    def _value(self, node: Node) -> float | None:
        operation = self.nodes[node]
        return float(operation.args[0]) if operation.op == "const" else None

    def _folded(self, op: str, values: Sequence[float | None]) -> Node | None:
        try:
            value = _FOLD[op](*values)
        except (ArithmeticError, ValueError):
            return None  # let the run show it
        return self.constant(value)

    # Simplifications: each returns the simpler node, or None.

    def _assign(self, a: Node) -> Node:
        return a

    def _div(self, a: Node, b: Node) -> Node:
        return self.apply("mul", a, self.apply("inv", b))

    def _inv(self, a: Node) -> Node | None:
        operation = self.nodes[a]
        return int(operation.args[0]) if operation.op == "inv" else None

    def _sq(self, a: Node) -> Node:
        return self.apply("mul", a, a)

    def _twice(self, a: Node) -> Node:
        return self.apply("mul", self.constant(2.0), a)

    def _constpow(self, a: Node, b: Node) -> Node | None:
        return self._pow(a, b)

    def _pow(self, a: Node, b: Node) -> Node | None:
        exponent = self._value(b)
        if exponent == 1.0:
            return a
        if exponent == 2.0:
            return self.apply("mul", a, a)
        if exponent == 0.5:
            return self.apply("sqrt", a)
        return None

    def _add(self, a: Node, b: Node) -> Node | None:
        if self._value(a) == 0.0:
            return b
        if self._value(b) == 0.0:
            return a
        if self.nodes[b].op == "neg":
            return self.apply("sub", a, self.nodes[b].args[0])
        if self.nodes[a].op == "neg":
            return self.apply("sub", b, self.nodes[a].args[0])
        return self._paired_selection(a, b) or self._gathered("add", a, b)

    def _gathered(self, op: str, a: Node, b: Node) -> Node | None:
        """Turn a + (b + x) into (a + b) + x where a and b are fixed and x is not; likewise a b x."""
        for fixed, other in ((a, b), (b, a)):
            inner = self.nodes[other]
            if not self._fixed[fixed] or self._fixed[other] or inner.op != op:
                continue
            for first, second in (inner.args, inner.args[::-1]):
                if self._fixed[first]:
                    return self.apply(op, self.apply(op, fixed, first), second)
        return None

    def _paired_selection(self, a: Node, b: Node) -> Node | None:
        """Turn (c ? x : 0) + (!c ? y : 0) into c ? x : y."""
        first, second = self.nodes[a], self.nodes[b]
        if first.op != "if_else_zero" or second.op != "if_else_zero":
            return None
        for (c, x), (negated, y) in ((first.args, second.args), (second.args, first.args)):
            if self.nodes[negated] == Operation("not", (c,)):
                return self._intern(Operation("select", (c, x, y)))
        return None

    def _sub(self, a: Node, b: Node) -> Node | None:
        if a == b:
            return self.constant(0.0)
        if self._value(b) == 0.0:
            return a
        if self._value(a) == 0.0:
            return self.apply("neg", b)
        if self.nodes[b].op == "neg":
            return self.apply("add", a, self.nodes[b].args[0])
        if self._fixed[b] and self.nodes[a].op in ("add", "sub") and not self._fixed[a]:
            inner = self.nodes[a]
            first, second = inner.args
            if self._fixed[first]:
                return self.apply(inner.op, self.apply("sub", first, b), second)
            if self._fixed[second] and inner.op == "add":
                return self.apply("add", self.apply("sub", second, b), first)
        return None

    def _mul(self, a: Node, b: Node) -> Node | None:
        for factor, other in ((a, b), (b, a)):
            value = self._value(factor)
            if value == 0.0:
                return self.constant(0.0)
            if value == 1.0:
                return other
            if value == -1.0:
                return self.apply("neg", other)
        return self._gathered("mul", a, b) or self._distributed(a, b)

    def _distributed(self, a: Node, b: Node) -> Node | None:
        """Turn a (b + x) into a b + a x where a and b are fixed and x is not.

        As many operations, but chains of such factors collapse into one product and one sum.
        """
        for factor, other in ((a, b), (b, a)):
            inner = self.nodes[other]
            if not self._fixed[factor] or self._fixed[other] or inner.op not in ("add", "sub"):
                continue
            if self._fixed[inner.args[0]] != self._fixed[inner.args[1]]:
                parts = (self.apply("mul", factor, x) for x in inner.args)
                return self.apply(inner.op, *parts)
        return None

    def _neg(self, a: Node) -> Node | None:
        operation = self.nodes[a]
        if operation.op == "neg":
            return int(operation.args[0])
        if operation.op == "sub":
            return self.apply("sub", operation.args[1], operation.args[0])
        return None

    def _sign(self, a: Node) -> Node:
        zero, one = self.constant(0.0), self.constant(1.0)
        above = self.apply("if_else_zero", self.apply("lt", zero, a), one)
        below = self.apply("if_else_zero", self.apply("lt", a, zero), one)
        return self.apply("sub", above, below)

    def _fmax(self, a: Node, b: Node) -> Node | None:
        first, second = self._intervals[a], self._intervals[b]
        return a if first.low >= second.high else b if second.low >= first.high else None

    def _fmin(self, a: Node, b: Node) -> Node | None:
        first, second = self._intervals[a], self._intervals[b]
        return a if first.high <= second.low else b if second.high <= first.low else None

    def _fabs(self, a: Node) -> Node | None:
        return a if self._intervals[a].positive else None

    def _if_else_zero(self, c: Node, a: Node) -> Node | None:
        if self._value(a) == 0.0:
            return self.constant(0.0)
        operation = self.nodes[a]
        if operation.op == "mul":
            # c ? k exp(x) : 0 is k (c ? exp(x) : 0): the selection can be shared, and branched on.
            for factor, costly in (operation.args, operation.args[::-1]):
                if self.nodes[costly].op == "exp":
                    return self.apply("mul", factor, self.apply("if_else_zero", c, costly))
        return None
