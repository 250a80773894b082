"""C text of single operations for scalars and vectors, and the order of computation."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from bywire.simulation.graph import Graph, Node

Namer = Callable[[Node], str]

_INFIX = {"add": "+", "sub": "-", "mul": "*"}
_LIBRARY = ("sqrt", "fabs", "floor", "ceil", "tan", "atan", "tanh", "copysign")
OWN = frozenset({"exp", "log", "sin", "cos"})
COSTLY = OWN | {"pow", "constpow"}  # operations that justify a branch
EXPONENT_RANGE = 708.0  # maximum magnitude of a negative argument of the exponential


@dataclass(frozen=True)
class Dialect:
    """C dialect for operations other than arithmetic.

    Parameters
    ----------
    calls
        Functions by operation.
    select, compare, both, either, negation, extreme, inverse
        Format strings of selections, comparisons, truth values, maxima and reciprocals.
    exp_where, exp_decayed
        Format strings of "c ? exp(a) : 0" as a single operation, in general and for the case that c
        implies an argument a <= 0 within the function's range.
    kept
        Condition for a truth value that is stored as a number; empty for other truth values.
    """

    calls: dict[str, str]
    select: str
    compare: dict[str, str]
    both: str
    either: str
    negation: str
    extreme: dict[str, str]
    inverse: str
    zero: str
    one: str
    exp_where: str = ""
    exp_decayed: str = ""
    kept: Callable[[Node], str] = lambda _: ""


PLAIN_C = Dialect(
    calls={
        **{op: f"bw_{op}" for op in OWN},
        **{op: op for op in _LIBRARY},
        "pow": "bw_pow",
        "constpow": "bw_pow",
    },
    select="{c} ? {a} : {b}",
    compare={
        "lt": "({a} < {b})",
        "le": "({a} <= {b})",
        "eq": "({a} == {b})",
        "ne": "({a} != {b})",
    },
    both="({a} & {b})",
    either="({a} | {b})",
    negation="(!{a})",
    extreme={"fmax": "{a} > {b} ? {a} : {b}", "fmin": "{a} < {b} ? {a} : {b}"},
    inverse="1.0 / {a}",
    zero="0.0",
    one="1.0",
)

VECTOR_C = Dialect(
    calls={
        **{op: op.upper() for op in (*OWN, *_LIBRARY, "pow")},
        "constpow": "POW",
    },
    select="SELECT({c}, {a}, {b})",
    compare={op: f"{op.upper()}({{a}}, {{b}})" for op in ("lt", "le", "eq", "ne")},
    both="({a} & {b})",
    either="({a} | {b})",
    negation="NOT({a})",
    extreme={"fmax": "MAX({a}, {b})", "fmin": "MIN({a}, {b})"},
    inverse="INVERSE({a})",
    zero="SET(0.0)",
    one="SET(1.0)",
    exp_where="EXP_WHERE({c}, {a})",
    exp_decayed="EXP_DECAYED({c}, {a})",
)


def needed(graph: Graph, roots: Iterable[Node], stop: Callable[[Node], bool]) -> list[Node]:
    """Return the operations that the roots need, arguments first, down to nodes that are excluded.

    The argument that needs the most registers comes first. This keeps the lifetimes of values short
    (Sethi and Ullman, Journal of the ACM 17, 1970).
    """
    order: list[Node] = []
    seen: set[Node] = set()
    stack = list(roots)[::-1]
    while stack:
        node = stack.pop()
        if node < 0:  # all arguments of this node are already in the order
            order.append(~node)
            continue
        if node in seen:
            continue
        seen.add(node)
        operands = graph.operands[node]
        if operands and not stop(node):
            stack.append(~node)
            stack.extend(operands)
    return order


def text(graph: Graph, node: Node, name: Namer, dialect: Dialect = PLAIN_C) -> str:
    """Return the C expression of an operation; ``name`` returns the text of an argument."""
    operation = graph.nodes[node]
    op = operation.op

    def number(a: Node) -> str:
        return as_number(graph, a, name, dialect)

    if op in _INFIX:
        a, b = operation.args
        return f"{number(a)} {_INFIX[op]} {number(b)}"
    if op == "neg":
        return f"-{number(operation.args[0])}"
    if op == "inv":
        return dialect.inverse.format(a=number(operation.args[0]))
    if op == "if_else_zero" and dialect.exp_where and graph.nodes[operation.args[1]].op == "exp":
        truth, power = operation.args
        argument = graph.nodes[power].args[0]
        form = dialect.exp_decayed if _decayed(graph, truth, argument) else dialect.exp_where
        return form.format(c=condition(graph, truth, name, dialect), a=number(argument))
    if op in ("if_else_zero", "select"):
        truth, value, *other = operation.args
        return dialect.select.format(
            c=condition(graph, truth, name, dialect),
            a=number(value),
            b=number(other[0]) if other else dialect.zero,
        )
    if op in dialect.extreme:
        # A constant comes second, so that compilers use the processor's maximum instruction.
        ordered = sorted(operation.args, key=lambda x: graph.nodes[x].op == "const")
        a, b = (number(x) for x in ordered)
        return dialect.extreme[op].format(a=a, b=b)
    return f"{dialect.calls[op]}({', '.join(number(a) for a in operation.args)})"


def _decayed(graph: Graph, truth: Node, argument: Node) -> bool:
    """Return whether ``truth`` is -argument < b, where b is within the exponential's range."""
    compared, operation = graph.nodes[truth], graph.nodes[argument]
    if compared.op != "lt" or operation.op != "neg" or not graph.intervals[argument].negative:
        return False
    lower, bound = compared.args
    is_bounded = graph.nodes[bound].op == "const" and graph.intervals[bound].high <= EXPONENT_RANGE
    return bool(lower == operation.args[0] and is_bounded)


def as_number(graph: Graph, node: Node, name: Namer, dialect: Dialect = PLAIN_C) -> str:
    """Return the C text of a value as a number; a truth value becomes 1 or 0."""
    if not graph.is_boolean(node):
        return name(node)
    chosen = dialect.select.format(
        c=condition(graph, node, name, dialect), a=dialect.one, b=dialect.zero
    )
    return f"({chosen})"


def condition(graph: Graph, node: Node, name: Namer, dialect: Dialect = PLAIN_C) -> str:
    """Return the C condition that a node is not zero."""
    operation = graph.nodes[node]
    op = operation.op
    if kept := dialect.kept(node):
        return kept
    if op in dialect.compare:
        a, b = (as_number(graph, x, name, dialect) for x in operation.args)
        return dialect.compare[op].format(a=a, b=b)
    if op == "not":
        inner = condition(graph, operation.args[0], name, dialect)
        return dialect.negation.format(a=inner)
    if op in ("and", "or"):
        a, b = (condition(graph, x, name, dialect) for x in operation.args)
        return (dialect.both if op == "and" else dialect.either).format(a=a, b=b)
    return dialect.compare["ne"].format(a=name(node), b=dialect.zero)
