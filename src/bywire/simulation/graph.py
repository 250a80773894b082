"""Expression graph shared by all stages of a kernel: every value once, divisions as products.

CasADi's instruction lists go in; common subexpressions meet across stages, constants fold, a/b
becomes a times a reciprocal that others can share, and paired selections become one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import casadi as ca

from bywire.simulation.operation import BOOLEAN, COMMUTATIVE, Node, Operation
from bywire.simulation.signs import ANYTHING, Interval, interval_of
from bywire.simulation.simplify import RULES


@cache
def _names() -> dict[int, str]:
    wanted = [
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
    operands, registers
        Of every node: its arguments, that which takes most registers last, and how many it takes
        when these are computed first.
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
        # repr keeps 0.0 and -0.0 apart: dict keys would not.
        return self.intern(Operation("const", (repr(float(value)),)))

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
        """Return the nodes that a node is computed from."""
        operation = self.nodes[node]
        return () if operation.op in ("leaf", "const") else operation.args

    def read_by(self, roots: Iterable[Node]) -> frozenset[Node]:
        """Return all nodes, leaves and constants too, that values are computed from."""
        seen: set[Node] = set()
        stack = list(roots)
        while stack:
            node = stack.pop()
            if node not in seen:
                seen.add(node)
                stack.extend(self.arguments(node))
        return frozenset(seen)

    def intern(self, operation: Operation) -> Node:
        """Return the node of an operation as it stands."""
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
        """Return the number that a node is, or None."""
        operation = self.nodes[node]
        return float(operation.args[0]) if operation.op == "const" else None

    def _folded(self, op: str, values: Sequence[float | None]) -> Node | None:
        try:
            value = _FOLD[op](*values)
        except (ArithmeticError, ValueError):
            return None  # let the run show it
        return self.constant(value)
