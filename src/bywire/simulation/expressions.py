"""C text of single operations, and the order in which a set of nodes is computed."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from bywire.simulation.graph import Graph, Node

_CALLS = {
    "sqrt": "sqrt",
    "fabs": "fabs",
    "floor": "floor",
    "ceil": "ceil",
    "tan": "tan",
    "atan": "atan",
    "tanh": "tanh",
    "copysign": "copysign",
    "pow": "pow",
    "constpow": "pow",
}
_INFIX = {"add": "+", "sub": "-", "mul": "*"}
_COMPARE = {"lt": "<", "le": "<=", "eq": "==", "ne": "!="}
OWN = frozenset({"exp", "log", "sin", "cos"})  # inline versions, so that lanes vectorize


def needed(graph: Graph, roots: Iterable[Node], stop: Callable[[Node], bool]) -> list[Node]:
    """Return the operations that the roots need, arguments first, down to nodes that stop."""
    order: list[Node] = []
    seen: set[Node] = set()
    stack = [(node, False) for node in reversed(list(roots))]
    while stack:
        node, ready = stack.pop()
        if ready:
            order.append(node)
            continue
        if node in seen or stop(node) or graph.nodes[node].op in ("leaf", "const"):
            continue
        seen.add(node)
        stack.append((node, True))
        stack.extend((a, False) for a in reversed(graph.arguments(node)))
    return order


def text(graph: Graph, node: Node, name: Callable[[Node], str]) -> str:
    """Return the C expression of an operation; ``name`` gives that of its arguments."""
    operation = graph.nodes[node]
    op = operation.op

    def number(a: Node) -> str:
        return f"({condition(graph, a, name)} ? 1.0 : 0.0)" if graph.is_boolean(a) else name(a)

    if op in _INFIX:
        a, b = operation.args
        return f"{number(a)} {_INFIX[op]} {number(b)}"
    if op == "neg":
        return f"-{number(operation.args[0])}"
    if op == "inv":
        return f"1.0 / {number(operation.args[0])}"
    if op == "if_else_zero":
        truth, value = operation.args
        return f"{condition(graph, truth, name)} ? {number(value)} : 0.0"
    if op == "select":
        truth, value, other = operation.args
        return f"{condition(graph, truth, name)} ? {number(value)} : {number(other)}"
    if op in ("fmax", "fmin"):
        a, b = (number(x) for x in operation.args)
        return f"{a} {'>' if op == 'fmax' else '<'} {b} ? {a} : {b}"
    if op == "sign":
        a = number(operation.args[0])
        return f"({a} > 0.0 ? 1.0 : 0.0) - ({a} < 0.0 ? 1.0 : 0.0)"
    if op in OWN:
        return f"bw_{op}({number(operation.args[0])})"
    return f"{_CALLS[op]}({', '.join(number(a) for a in operation.args)})"


def condition(graph: Graph, node: Node, name: Callable[[Node], str]) -> str:
    """Return the C condition of a node, true where it is not zero."""
    operation = graph.nodes[node]
    op = operation.op
    if op in _COMPARE:
        a, b = (
            f"({condition(graph, x, name)} ? 1.0 : 0.0)" if graph.is_boolean(x) else name(x)
            for x in operation.args
        )
        return f"({a} {_COMPARE[op]} {b})"
    if op == "not":
        return f"(!{condition(graph, operation.args[0], name)})"
    if op in ("and", "or"):
        a, b = (condition(graph, x, name) for x in operation.args)
        return f"({a} {'&' if op == 'and' else '|'} {b})"
    return f"({name(node)} != 0.0)"
