"""The expression graph of kernels: what it simplifies, and that it changes no value."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np
import pytest

from bywire.simulation.expressions import PLAIN_C, VECTOR_C, Dialect, needed, text
from bywire.simulation.graph import BOOLEAN, Graph, Interval, Node, _names, raised
from bywire.simulation.quadrature import Levels
from bywire.simulation.stages import balanced

RANGES = {("p", 0): (0.0, math.inf), ("p", 1): (-1.0, 2.0), ("p", 2): (-math.inf, 0.0)}
UNARY = {
    "neg",
    "exp",
    "log",
    "sqrt",
    "sin",
    "cos",
    "fabs",
    "floor",
    "tan",
    "atan",
    "tanh",
    "ceil",
    "inv",
    "sq",
    "twice",
    "not",
    "assign",
    "sign",
}
VALUES: dict[str, Callable[..., float]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "neg": lambda a: -a,
    "inv": lambda a: 1.0 / a,
    "exp": math.exp,
    "sqrt": math.sqrt,
    "sin": math.sin,
    "cos": math.cos,
    "fabs": abs,
    "floor": math.floor,
    "fmax": max,
    "fmin": min,
    "lt": lambda a, b: a < b,
    "le": lambda a, b: a <= b,
    "eq": lambda a, b: a == b,
    "ne": lambda a, b: a != b,
    "not": lambda a: not a,
    "and": lambda a, b: bool(a) & bool(b),
    "or": lambda a, b: bool(a) | bool(b),
    "if_else_zero": lambda c, a: a if c else 0.0,
    "select": lambda c, a, b: a if c else b,
}


def evaluate(graph: Graph, root: Node, leaves: dict[tuple[str, int], float]) -> float:
    """Return the value of a node, computed operation by operation."""
    known: dict[Node, float] = {}
    for node, operation in enumerate(graph.nodes):
        if operation.op == "leaf":
            known[node] = leaves[operation.args]
        elif operation.op == "const":
            known[node] = float(operation.args[0])
    for node in needed(graph, [root], lambda _: False):
        operation = graph.nodes[node]
        known[node] = float(VALUES[operation.op](*(known[a] for a in operation.args)))
    return known[root]


def counts(graph: Graph, roots: Sequence[Node]) -> Counter[str]:
    """Return how often each operation is needed for some results."""
    return Counter(graph.nodes[n].op for n in needed(graph, roots, lambda _: False))


def built(expression: Callable[..., Any], fixed: bool = False) -> tuple[Graph, list[Node]]:
    """Return the graph of a function of three x and three p, and its results."""
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 3)
    result = expression(*(v[k] for v in (x, p) for k in range(3)))
    results = result if isinstance(result, tuple) else (result,)
    function = ca.Function("f", [x, p], [ca.vertcat(*results)])
    ranges = {leaf: Interval(*bounds) for leaf, bounds in RANGES.items()}
    graph = Graph(ranges, frozenset({"p"}) if fixed else frozenset())
    inputs = [[graph.leaf(kind, k) for k in range(3)] for kind in ("x", "p")]
    return graph, graph.add_function(function, inputs)[0]


def test_common_subexpressions_are_shared() -> None:
    """Within a function, and between functions that meet in one graph."""
    graph, roots = built(lambda x, y, z, p, q, r: ((x + y) * z, ca.sin(y + x), ca.exp(x + y)))
    assert counts(graph, roots) == {"add": 1, "mul": 1, "sin": 1, "exp": 1}
    before = len(graph.nodes)
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    again = ca.Function("g", [a, b], [ca.exp(b + a)])
    inputs = [[graph.leaf("x", 0)], [graph.leaf("x", 1)]]
    assert graph.add_function(again, inputs)[0] == [roots[2]]
    assert len(graph.nodes) == before


def test_divisions_become_products() -> None:
    """One reciprocal serves all that is divided by the same; twice inverted is not inverted."""
    graph, roots = built(lambda x, y, z, p, q, r: (x / z, y / z, 1.0 / z, x / (1.0 / z)))
    assert counts(graph, roots) == {"inv": 1, "mul": 3}
    assert all(operation.op != "div" for operation in graph.nodes)


def test_folding() -> None:
    graph, roots = built(
        lambda x, y, z, p, q, r: (
            ca.exp(ca.SX(0.0)) + 2.0 * ca.SX(3.0),
            0.0 * x + y,
            1.0 * x,
            x - x,
            0.0 - (-x),
            -1.0 * x,
            x + (-y),
            -(x - y),
            ca.sqrt(ca.SX(2.0)),
            x**2,
            x**0.5,
        )
    )
    names = [graph.nodes[n].op for n in roots]
    assert names[0] == names[8] == "const"
    assert float(graph.nodes[roots[0]].args[0]) == 7.0
    assert roots[1:5] == [graph.leaf("x", 1), graph.leaf("x", 0), graph.constant(0.0), roots[2]]
    assert names[5:8] == ["neg", "sub", "sub"]
    assert names[9:] == ["mul", "sqrt"]
    assert graph.constant(0.0) != graph.constant(-0.0)


def test_paired_selections() -> None:
    """CasADi writes c ? x : y as (c ? x : 0) + (!c ? y : 0)."""
    graph, roots = built(lambda x, y, z, p, q, r: ca.if_else(x > y, ca.sin(z), ca.cos(z)))
    assert counts(graph, roots) == {"select": 1, "sin": 1, "cos": 1, "lt": 1}
    for x, y in ((1.0, 2.0), (2.0, 1.0)):
        leaves = {("x", 0): x, ("x", 1): y, ("x", 2): 0.3, **dict.fromkeys(RANGES, 0.0)}
        wanted = math.sin(0.3) if x > y else math.cos(0.3)
        assert evaluate(graph, roots[0], leaves) == wanted
    graph, roots = built(lambda x, y, z, p, q, r: ca.if_else(x > y, z, 0.0))
    assert counts(graph, roots) == {"if_else_zero": 1, "lt": 1}


def test_limits_that_ranges_exclude() -> None:
    """Only where the parameter's range says so."""
    graph, roots = built(
        lambda x, y, z, p, q, r: (
            ca.fmax(p, 0.0),
            ca.fmin(r, 0.0),
            ca.fabs(p * ca.exp(x)),
            ca.fmax(q, -2.0),
            ca.fmax(q, 0.0),
            ca.fmax(x, 0.0),
            ca.fabs(r),
        )
    )
    assert [graph.nodes[n].op for n in roots] == [
        "leaf",
        "leaf",
        "mul",
        "leaf",
        "fmax",
        "fmax",
        "fabs",
    ]


def test_what_is_above_zero_is_told_by_comparisons() -> None:
    """Without a difference or a maximum, and exactly next to zero."""
    graph = Graph()
    a, b = graph.leaf("x", 0), graph.leaf("x", 1)
    differs, falls = graph.apply("sub", a, b), graph.apply("neg", b)
    largest = graph.apply("fmax", differs, graph.apply("fmax", falls, graph.constant(0.0)))
    truth = raised(graph, largest)
    ops = {graph.nodes[n].op for n in needed(graph, [truth], lambda _: False)}
    assert ops == {"lt", "or"}
    tiny = 5e-324
    for x in ((1.0, 1.0), (2.0 * tiny, tiny), (0.0, tiny), (-2.0, -1.0), (-0.0, 0.0)):
        leaves = dict(zip((("x", 0), ("x", 1)), x, strict=True))
        assert evaluate(graph, truth, leaves) == (evaluate(graph, largest, leaves) != 0.0), x
    assert graph.nodes[raised(graph, differs)].op == "ne"  # may be negative


def test_fixed_parts_are_gathered() -> None:
    """What does not change is combined first, so that it is computed once."""
    graph, roots = built(lambda x, y, z, p, q, r: ((x + p) + q, p * (x * q), (p * x) * r), True)
    for root in roots:
        moving = [
            n
            for n in needed(graph, [root], lambda _: False)
            if any(evaluates_x(graph, a) for a in graph.arguments(n))
        ]
        assert len(moving) == 1


def evaluates_x(graph: Graph, node: Node) -> bool:
    operation = graph.nodes[node]
    if operation.op == "leaf":
        return bool(operation.args[0] == "x")
    return any(evaluates_x(graph, a) for a in graph.arguments(node))


@pytest.mark.parametrize("dialect", [PLAIN_C, VECTOR_C], ids=["plain", "vector"])
def test_every_operation_has_its_text(dialect: Dialect) -> None:
    """Whatever CasADi may hand over, derivatives of |x| included, can be written in C."""
    graph = Graph()
    leaves = [graph.leaf("x", k) for k in range(2)]
    for name in _names().values():
        arguments = leaves[: 1 if name in UNARY else 2]
        if name in ("not", "and", "or", "if_else_zero"):
            arguments[0] = graph.apply("lt", *leaves)
        root = graph.apply(name, *arguments)
        for node in needed(graph, [root], lambda _: False):
            if graph.nodes[node].op not in BOOLEAN:
                assert text(graph, node, lambda n: f"v{n}", dialect)


def random_expression(rng: np.random.Generator, leaves: list[Any]) -> Any:
    """Return a random expression in which many rules can apply."""
    pool = [*leaves, *(ca.SX(c) for c in (0.0, 1.0, -1.0, 0.5))]

    def one() -> Any:
        return pool[rng.integers(len(pool))]

    makers: list[Callable[[], Any]] = [
        lambda: one() + one(),
        lambda: one() - one(),
        lambda: one() * one(),
        lambda: -one(),
        lambda: one() / (2.0 + ca.fabs(one())),
        lambda: ca.exp(ca.fmin(one(), 2.0)),
        lambda: ca.sqrt(1.0 + ca.fabs(one())),
        lambda: ca.sin(one()),
        lambda: ca.fabs(one()),
        lambda: ca.fmax(one(), one()),
        lambda: ca.fmin(one(), one()),
        lambda: ca.sign(one()),
        lambda: ca.if_else(one() > one(), one(), one()),
        lambda: ca.if_else(one() > 0.0, one(), 0.0),
        lambda: ca.if_else(ca.logic_and(one() > 0.0, one() < 1.0), one(), one()),
        lambda: ca.if_else(one() > 0.0, one() * ca.exp(ca.fmin(one(), 1.0)), 0.0),
        lambda: one() ** 2,
        lambda: ca.tanh(ca.fmin(one(), 1.0)) * 0.0 + one(),
    ]
    for _ in range(25):
        made = makers[rng.integers(len(makers))]()
        pool.append(made / (1.0 + 0.1 * ca.fabs(made)))  # keeps values small
    return sum((entry for entry in pool[-4:]), ca.SX(0.0))


def test_values_are_kept() -> None:
    """Random expressions: the simplified and rebalanced graph computes what CasADi computes."""
    rng = np.random.default_rng(1)
    for _ in range(200):
        assert_values_are_kept(rng)


def assert_values_are_kept(rng: np.random.Generator) -> None:
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 3)
    expression = random_expression(rng, [v[k] for v in (x, p) for k in range(3)])
    function = ca.Function("f", [x, p], [expression])
    graph = Graph({k: Interval(*b) for k, b in RANGES.items()}, frozenset({"p"}))
    inputs = [[graph.leaf(kind, k) for k in range(3)] for kind in ("x", "p")]
    (root,) = graph.add_function(function, inputs)[0]
    (reordered,) = balanced(graph, [root], Levels(graph, {"p": 0}))
    for _ in range(10):
        xs = rng.normal(scale=2.0, size=3)
        ps = np.array([rng.exponential(), rng.uniform(-1.0, 2.0), -rng.exponential()])
        leaves = {("x", k): float(v) for k, v in enumerate(xs)}
        leaves |= {("p", k): float(v) for k, v in enumerate(ps)}
        wanted = float(function(xs, ps))
        for node in (root, reordered):
            assert evaluate(graph, node, leaves) == pytest.approx(wanted, rel=1e-10, abs=1e-10)
