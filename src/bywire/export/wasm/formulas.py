"""Formulas of a run as a table, of which the loader makes WebAssembly: a third of its length.

Instructions of straight-line code name their operands by number, in which nothing repeats. The
table says of most operands how many values ago they were computed: small numbers, which deflate
well. All formulas share one table, and each computes of it what its results need.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from bywire.simulation.expressions import needed
from bywire.simulation.graph import Graph
from bywire.simulation.operation import Node

OPERATIONS = (
    "add", "sub", "mul", "neg", "inv", "fabs", "sqrt", "floor", "ceil", "copysign", "fmax", "fmin",
    "lt", "le", "eq", "ne", "not", "and", "or", "if_else_zero", "select",
    "exp", "log", "sin", "cos", "pow", "tan", "atan", "tanh",
)  # fmt: skip
"""In the order of their numbers in the table; the loader has the same."""

_NEAR = 64  # values back that a byte of an operand reaches; bytes above are inputs, 0 is neither
_SWAPPED = frozenset({"add", "mul", "eq", "ne", "and", "or"})  # the nearer operand first

Places = Mapping[tuple[str, int], int]
_Value = tuple[object, ...]


@dataclass(frozen=True)
class Formula:
    """A function of the table.

    Parameters
    ----------
    graph, results
        Expressions, and pairs of place in the working memory and node.
    again
        Zero, or in a loop how many results behind the first, which ends it, begin its next turn;
        those behind them are added up.
    """

    graph: Graph
    results: Sequence[tuple[int, Node]]
    again: int = 0


@dataclass
class _Table:
    values: dict[_Value, int] = field(default_factory=dict)
    operations: bytearray = field(default_factory=bytearray)
    operands: bytearray = field(default_factory=bytearray)
    escaped: list[int] = field(default_factory=list)

    def add(self, graph: Graph, node: Node, leaves: int) -> None:
        """Append an operation whose operands are there."""
        op = {"constpow": "pow"}.get(graph.nodes[node].op, graph.nodes[node].op)
        here = len(self.values)
        read = [self.values[_value(graph, a)] for a in graph.arguments(node)]
        if op in _SWAPPED:
            read.sort(reverse=True)
        if op in ("fmax", "fmin") and graph.value(graph.nodes[node].args[0]) is not None:
            read.reverse()  # as in C, where the constant is second
        self.operations.append(OPERATIONS.index(op))
        for value in read:
            if value >= leaves and here - value <= _NEAR:
                self.operands.append(here - value)
            elif value < 255 - _NEAR and value < leaves:
                self.operands.append(_NEAR + 1 + value)
            else:
                self.operands.append(0)
                self.escaped.append(value)
        self.values[_value(graph, node)] = here


def _value(graph: Graph, node: Node) -> _Value:
    """Return what tells a value from those of other graphs: inputs and constants are shared."""
    operation = graph.nodes[node]
    is_leaf = operation.op in ("leaf", "const")
    return (operation.op, *operation.args) if is_leaf else (id(graph), node)


def table(formulas: Sequence[Formula], places: Places) -> bytes:
    """Return the table of some formulas.

    What the first of them computes the others read where that wrote it.

    Parameters
    ----------
    places
        Where inputs stand in the working memory, by kind and index.
    """
    made = _Table()
    orders = [needed(f.graph, [n for _, n in f.results], lambda _: False) for f in formulas]
    inputs: dict[_Value, int] = {}
    constants: dict[_Value, float] = {}
    for formula, order in zip(formulas, orders, strict=True):
        graph = formula.graph
        read = [a for node in order for a in graph.arguments(node)]
        for node in (*read, *(n for _, n in formula.results)):
            operation = graph.nodes[node]
            if operation.op == "leaf":
                inputs[_value(graph, node)] = places[operation.args]
            elif operation.op == "const":
                constants[_value(graph, node)] = float(operation.args[0])
    for leaf in (*inputs, *constants):
        made.values[leaf] = len(made.values)
    for formula, order in zip(formulas, orders, strict=True):
        for node in order:
            if _value(formula.graph, node) not in made.values:
                made.add(formula.graph, node, len(inputs) + len(constants))
    numbers = [len(inputs), len(constants), len(formulas), *_steps(list(inputs.values()))]
    for formula in formulas:
        numbers += [formula.again, len(formula.results)]
        numbers += [made.values[_value(formula.graph, node)] for _, node in formula.results]
        numbers += _steps([place for place, _ in formula.results])
    return _packed(made, numbers + made.escaped, list(constants.values()))


def _steps(numbers: Sequence[int]) -> list[int]:
    """Return the differences of numbers, which repeat where these go on in steps."""
    return [(b - a) & 0xFFFF for a, b in zip([0, *numbers], numbers, strict=False)]


def _packed(made: _Table, numbers: Sequence[int], constants: Sequence[float]) -> bytes:
    """Return lengths and planes: bytes that are alike stand together."""
    if max(len(made.values), len(numbers), len(made.operands)) > 0xFFFF:
        raise ValueError(f"{len(made.values)} values are too many for a table of formulas")
    planes = [bytes(n & 0xFF for n in numbers), bytes(n >> 8 for n in numbers)]
    lengths = (len(made.operations), len(made.operands), len(numbers))
    return b"".join((
        struct.pack("<3H", *lengths), bytes(made.operations), bytes(made.operands), *planes,
        struct.pack(f"<{len(constants)}d", *constants),
    ))  # fmt: skip


def with_section(module: bytes, name: str, content: bytes) -> bytes:
    """Return a module of WebAssembly with a section that engines leave alone."""
    title = name.encode()
    body = bytes([len(title)]) + title + content
    length, left = bytearray(), len(body)
    while left > 0x7F:
        length.append(left & 0x7F | 0x80)
        left >>= 7
    return module + b"\0" + bytes(length) + bytes([left]) + body
