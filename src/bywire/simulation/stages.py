"""Program as one expression graph: when to compute each node, and its C code.

A substep is one long chain of dependent operations, whose latency limits the speed. This module
therefore reorders sums and products of three or more operands, so that a late operand passes
through as few operations as possible. k a + k b becomes k (a + b) if k changes rarely. This affects
only rounding.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from bywire.simulation.expressions import COSTLY, PLAIN_C, Dialect, Namer, needed, text
from bywire.simulation.graph import NOT_NEGATIVE, Graph, Interval, Node, Operation, raised
from bywire.simulation.program import Program
from bywire.simulation.quadrature import Levels, Quadrature, collapsed, factored
from bywire.simulation.schedule import Layout

# Cycles from operands to result, approximately, for processors of the last ten years.
_LATENCY = {"inv": 13, "sqrt": 18, "exp": 40, "sin": 50, "cos": 50, "log": 40, "pow": 80}
_USUAL = 4
_SUMS = ("add", "sub", "neg")


class _Balance:
    """Bottom-up rebuilding of nodes."""

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
        """Return rebuilt summands, merging equal summands and those with a common rare factor."""
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
        """Return a rarely changing factor and the rest of a product, if nothing else needs it.

        The factors a - b and b - a are treated as the same factor with opposite sign.
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
        """Return the time at which a node is ready, in cycles after the substep's start."""
        if node not in self._ready:
            operation = self._graph.nodes[node]
            late = 0
            if self._level[node] == 2 and operation.op != "leaf":
                before = max(self._time(a) for a in self._graph.arguments(node))
                late = before + _LATENCY.get(operation.op, _USUAL)
            self._ready[node] = late
        return self._ready[node]


def balanced(graph: Graph, roots: Sequence[Node], level: Levels) -> list[Node]:
    """Return nodes with the same values but an order of operations with less latency."""
    balance = _Balance(graph, roots, level)
    return [balance.node(root) for root in roots]


# --- Stages

# When a leaf changes: 0 once per run, 1 once per frame (a tick may change it), 2 every substep.
LEVEL = {"p": 0, "h": 0, "sp": 0, "su": 0, "m": 1, "sm": 1}
SEEDS = frozenset({"sp", "su", "sm", "sx", "sd", "sr", "sq", "sh"})
STATE = ("x", "d", "r", "q")  # updated in every substep, in the order of the state vector


@dataclass(frozen=True)
class Stages:
    """Result nodes of each stage of a kernel.

    Parameters
    ----------
    fast, exact
        Nodes for each result of a pass: x, d, r (reactions), q (flows), jump, flag, doubt; see
        ``Program``. Flag and ``doubtful`` of the fast pass are truth values. The exact pass uses
        the solution of ``posed``, which are leaves of the kinds w, force and failed.
    posed
        Nodes of S, row by row, c, low and high, for the set-valued forces of the exact pass.
    rows
        Number of set-valued forces.
    ticks
        Nodes of the memory after each task.
    output
        Nodes of the recorded signals.
    velocities
        Indices of the states with dry friction.
    quadrature
        Integrals of the fast pass as combinations of running sums.
    fast_t, exact_t, ticks_t, output_t
        Tangents in one direction; empty lists without sensitivities. The exact pass also has
        tangents with respect to the step's length, because the time of a cut may move.
    """

    graph: Graph
    fast: dict[str, list[Node]]
    exact: dict[str, list[Node]]
    posed: list[Node]
    rows: int
    ticks: list[list[Node]]
    output: list[Node]
    velocities: tuple[int, ...]
    quadrature: Quadrature
    fast_t: dict[str, list[Node]]
    exact_t: dict[str, list[Node]]
    ticks_t: list[list[Node]]
    output_t: list[Node]

    def level(self) -> Levels:
        """Return how often each node must be computed, as in ``LEVEL``."""
        return Levels(self.graph, LEVEL)

    def varies(self, kinds: frozenset[str]) -> list[bool]:
        """Return whether each node depends on a leaf of one of the kinds."""
        found: list[bool] = []
        for node, operation in enumerate(self.graph.nodes):
            if operation.op == "leaf":
                found.append(operation.args[0] in kinds)
            else:
                found.append(any(found[a] for a in self.graph.arguments(node)))
        return found


def build_stages(
    program: Program, directions: Sequence[int] = (), outputs: Sequence[int] | None = None
) -> Stages:
    """Put all functions of a program into one graph.

    Parameters
    ----------
    program
        The symbolic functions.
    directions
        Indices of the parameters for which to compute tangents; may be empty.
    outputs
        Indices of the signals to compute. Default: all. Integrals that no signal reads stay zero.
    """
    n = program.sizes
    ranges = {("p", k): Interval(*r) for k, r in enumerate(program.parameter_ranges.values())}
    fixed = frozenset(kind for kind, level in LEVEL.items() if level < 2)
    graph = Graph({**ranges, ("h", 0): NOT_NEGATIVE}, fixed)
    lengths = {
        "x": n.x,
        "d": n.x,
        "m": n.memory,
        "u": n.stimulus,
        "r": n.reaction,
        "q": n.flow,
        "p": n.parameters,
        "h": 1,
        "w": program.rows,
        "force": program.rows,
        "failed": 1,
    }
    leaves = {
        kind: [graph.leaf(kind, k) for k in range(length)] for kind, length in lengths.items()
    }

    def add(function: Any, kinds: Sequence[str]) -> list[list[Node]]:
        return graph.add_function(function, [leaves[k] for k in kinds])

    def tangent(function: Any, kinds: str, fixed: str = "h") -> list[list[Node]]:
        if not directions:
            return [[] for _ in range(function.n_out())]
        seeded = _with_tangents(function, kinds, directions, fixed)
        inputs = [leaves[k] for k in kinds]
        for kind in kinds:
            if kind == "p":
                inputs.append([graph.leaf("sp", k) for k in range(len(directions))])
            elif kind not in fixed:
                inputs.append([graph.leaf(f"s{kind}", k) for k in range(lengths[kind])])
        return graph.add_function(seeded, inputs)

    parts = ("x", "d", "r", "q", "jump", "flag", "doubt")
    output = add(program.output, "xmprqh")[0]
    output = output if outputs is None else [output[k] for k in outputs]
    fast = dict(zip(parts, add(program.fast, "xdmph"), strict=True))
    level = Levels(graph, LEVEL)
    substep = frozenset(needed(graph, _all_but(fast, "q"), lambda _: False))
    quadrature = factored(graph, fast["q"], substep, level)
    fast, quadrature = _balanced(graph, fast, quadrature, level)
    if outputs is not None:  # here, so that the order of operations is the same as for all outputs
        read = graph.read_by(output)
        is_needed, zero = [leaf in read for leaf in leaves["q"]], graph.constant(0.0)
        quadrature = quadrature.of(is_needed)
        fast["q"] = [
            n if is_read else zero for n, is_read in zip(fast["q"], is_needed, strict=True)
        ]
    fast["flag"] = [raised(graph, fast["flag"][0])]
    fast["doubtful"] = [raised(graph, fast["doubt"][0])]
    return Stages(
        graph=graph,
        fast=fast,
        velocities=program.velocities,
        quadrature=quadrature,
        exact=dict(zip(parts, add(program.after, (*"xdmph", "w", "force", "failed")), strict=True)),
        posed=[node for nodes in add(program.before, "xdmph") for node in nodes],
        rows=program.rows,
        ticks=[add(tick, "xmup")[0] for tick in program.ticks],
        output=output,
        fast_t=dict(zip(parts, tangent(program.fast, "xdmph"), strict=True)),
        exact_t=dict(zip(parts, tangent(program.exact, "xdmph", fixed=""), strict=True)),
        ticks_t=[tangent(tick, "xmup")[0] for tick in program.ticks],
        output_t=tangent(program.output, "xmprqh")[0],
    )


def _all_but(results: dict[str, list[Node]], left_out: str) -> list[Node]:
    return [node for kind, nodes in results.items() if kind != left_out for node in nodes]


def _balanced(
    graph: Graph, fast: dict[str, list[Node]], quadrature: Quadrature, level: Levels
) -> tuple[dict[str, list[Node]], Quadrature]:
    """Return the fast pass with its sums and products in a faster order."""
    kinds = [(kind, len(nodes)) for kind, nodes in fast.items() if kind != "q"]
    roots = [*_all_but(fast, "q"), *quadrature.products]
    new = iter(balanced(graph, collapsed(graph, roots, level), level))
    renewed = {kind: [next(new) for _ in range(count)] for kind, count in kinds}
    known = dict(zip(roots, [*_all_but(renewed, "q"), *(products := list(new))], strict=True))
    renewed["q"] = _renewed(graph, fast["q"], known)
    return renewed, Quadrature(products, quadrature.combinations)


def _renewed(graph: Graph, roots: list[Node], known: dict[Node, Node]) -> list[Node]:
    """Return nodes with other arguments.

    The original loss rates cannot be negative. Sums of products can be negative due to rounding.
    """
    new = dict(known)
    for node in needed(graph, roots, known.__contains__):
        parts = graph.arguments(node)
        renewed = tuple(new.get(a, a) for a in parts)
        if renewed != parts:
            new[node] = graph.apply(graph.nodes[node].op, *renewed)
    return [new.get(root, root) for root in roots]


def _with_tangents(function: Any, kinds: str, directions: Sequence[int], fixed: str) -> Any:
    """Return the tangent function: the same arguments, then seeds of all changing arguments."""
    arguments = function.sx_in()
    seeds, points, extra = [], [], []
    for kind, argument in zip(kinds, arguments, strict=True):
        if kind in fixed:
            continue
        if kind == "p":
            chosen = ca.SX.sym("sp", len(directions))
            seed = ca.SX.zeros(argument.shape[0])
            for k, index in enumerate(directions):
                seed[index] = chosen[k]
            extra.append(chosen)
        else:
            seed = ca.SX.sym(f"s{kind}", argument.shape[0])
            extra.append(seed)
        seeds.append(seed)
        points.append(argument)
    results = function(*arguments)
    results = results if isinstance(results, tuple) else (results,)
    point, seed = ca.vertcat(*points), ca.vertcat(*seeds)
    tangents = [ca.densify(ca.jtimes(r, point, seed)) for r in results]
    return ca.Function(f"{function.name()}_t", [*arguments, *extra], tangents)


# --- C statements of a stage

# plan: first frame, end frame, whether the end is recorded, substeps per frame, frames per stimulus
# row, frames per recorded row, first recorded row, recorded signals, frames per tick of each task.
PLAN = """const int64_t begin = plan[0], end = plan[1], last = plan[2], substeps = plan[3];
  const int64_t stim = plan[4], every = plan[5], row0 = plan[6], chosen = plan[7];"""
"""C text that reads a run's plan"""


def unread(stages: Stages) -> frozenset[str]:
    """Return the half increments and reactions that no stage reads.

    The kernel does not store them. A cut substep reads those of velocities with dry friction.
    """
    roots = [
        node for pass_ in (stages.fast, stages.exact) for nodes in pass_.values() for node in nodes
    ]
    roots += [node for tick in stages.ticks for node in tick] + stages.output + stages.posed
    read = stages.graph.read_by(roots)
    return frozenset(
        f"{kind}{k}"
        for kind in ("d", "r")
        for k in range(len(stages.fast[kind]))
        if stages.graph.leaf(kind, k) not in read and not (kind == "d" and k in stages.velocities)
    )


def midpoints(graph: Graph, order: Iterable[Node]) -> dict[Node, int]:
    """Return the nodes that are a state plus its half increment, with the index of the state.

    A kernel passes these nodes from substep to substep, because the next substep begins with them.
    Only cut substeps read the half increments separately.
    """
    chosen = {}
    for node in order:
        parts = {graph.nodes[a] for a in graph.arguments(node)}
        for k in {op.args[1] for op in parts if op.op == "leaf" and op.args[0] == "d"}:
            if graph.nodes[node].op == "add" and Operation("leaf", ("x", k)) in parts:
                chosen[node] = int(k)
    return chosen


def leaf_count(stages: Stages, kind: str) -> int:
    """Return the number of inputs of a kind, for example ``"u"`` for the stimulus."""
    return sum(1 for op in stages.graph.nodes if op.op == "leaf" and op.args[0] == kind)


def layout_of(stages: Stages) -> Layout:
    """Return the layout of a model's state vector."""
    length = {kind: len(stages.fast[kind]) for kind in STATE}
    length["m"] = len(stages.ticks[0])
    start, at = {}, 0
    for kind, count in length.items():
        start[kind] = at
        at += count
    start["counters"] = at
    return Layout(start, length)


def literal(graph: Graph, node: Node) -> str:
    """Return a constant as C text."""
    value = str(graph.nodes[node].args[0])
    return f"({value})" if value.startswith("-") else value


def leaf_namer(
    graph: Graph, leaf: Callable[[str, int], str], other: Namer, constant: str = "{}"
) -> Namer:
    """Return a function that names constants and leaves, and calls another one for operations."""

    def name(node: Node) -> str:
        operation = graph.nodes[node]
        if operation.op == "const":
            return constant.format(literal(graph, node))
        if operation.op == "leaf":
            return leaf(*operation.args)
        return other(node)

    return name


def statements(
    graph: Graph,
    order: Sequence[Node],
    name: Namer,
    declare: str,
    dialect: Dialect = PLAIN_C,
) -> list[str]:
    """Return one declaration per operation, with truth values inline."""
    return [
        f"{declare}{name(node)} = {text(graph, node, name, dialect)};"
        for node in order
        if not graph.is_boolean(node)
    ]


def branching_statements(
    graph: Graph,
    order: Sequence[Node],
    name: Namer,
    declare: str,
    dialect: Dialect = PLAIN_C,
    later: Iterable[Node] = (),
) -> list[str]:
    """Return declarations with each costly function inside the only branch that needs it.

    If the condition is false, the branch skips the function. ``later``: other nodes that read these
    declarations.
    """
    uses = Counter(a for node in (*order, *later) for a in graph.arguments(node))
    inside = {
        graph.nodes[node].args[1]
        for node in order
        if graph.nodes[node].op == "if_else_zero"
        and graph.nodes[graph.nodes[node].args[1]].op in COSTLY
        and uses[graph.nodes[node].args[1]] == 1
    }

    def inlined(node: Node) -> str:
        return f"({text(graph, node, inlined, dialect)})" if node in inside else name(node)

    rest = [node for node in order if node not in inside]
    return statements(graph, rest, inlined, declare, dialect)


def indented(lines: Iterable[str], spaces: int) -> str:
    """Return lines joined with an indentation."""
    return ("\n" + " " * spaces).join(lines)
