"""Savings in a kernel: values that depend only on a mode, skipped branches, and ramps.

A mode is a set of a few truth values. Some values depend only on the mode and on parameters, such
as a substep's matrix, its pivots and their reciprocals. The kernel recomputes them when a truth
value changes, which happens a few hundred times in a run of many thousand substeps.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from bywire.simulation.expressions import COSTLY, Namer, as_number, condition, needed
from bywire.simulation.graph import Graph, Node
from bywire.simulation.quadrature import Levels

_COMPARISONS = frozenset({"lt", "le", "eq", "ne"})
_TRUTHS = _COMPARISONS | {"and", "or", "not"}
_FREE = _TRUTHS | {"if_else_zero", "select", "neg"}  # about the cost of detecting a change
_COST = {"inv": 8.0, "sqrt": 8.0, "exp": 40.0, "sin": 40.0, "cos": 40.0, "log": 40.0, "pow": 60.0}
_WORTH_ATOM, _WORTH_MODE = 4.0, 0.15
_SELECTIONS = ("if_else_zero", "select")
_AHEAD = 40  # maximum number of further operations to compute early for a costly function


@dataclass(frozen=True)
class Modes:
    """A substep in three parts.

    Parameters
    ----------
    first
        Nodes that determine the truth values, in order.
    atoms
        The truth values; empty if a mode would not save time.
    values
        Other nodes to recompute when a truth value changes, in order.
    rest
        All other nodes, in order.
    """

    first: list[Node]
    atoms: list[Node]
    values: list[Node]
    rest: list[Node]

    def without(self, known: Collection[Node]) -> Modes:
        """Return the parts without nodes that are already computed."""
        return Modes(
            *(
                [n for n in each if n not in known]
                for each in (self.first, self.atoms, self.values, self.rest)
            )
        )


def modes(graph: Graph, roots: Sequence[Node], level: Levels) -> Modes:
    """Split the nodes of a substep by how often they change.

    Parameters
    ----------
    roots
        Results of the substep.
    level
        How often each node changes, see ``stages.LEVEL``.
    """
    substep = needed(graph, roots, lambda n: level[n] < 2)
    order = needed(graph, roots, lambda n: level[n] == 0)
    refused: set[Node] = set()
    while True:
        deciding = _classified(graph, order, level, refused)
        poor = _poor_atoms(graph, order, deciding)
        if not poor:
            break
        refused |= poor
    atoms = sorted({a for own in deciding.values() for a in own})
    first = needed(graph, atoms, lambda n: level[n] < 2)
    early = frozenset(first)
    values = [n for n in order if n in deciding and n not in early and not _is_truth(graph, n)]
    saved = sum(cost(graph, n) for n in values if level[n] == 2) - 2.0 * len(atoms)
    if saved < _WORTH_MODE * sum(cost(graph, n) for n in substep):
        return Modes([], [], [], _costly_first(graph, substep))
    apart = early.union(values)
    rest = [n for n in substep if n not in apart]
    return Modes(first, atoms, values, _costly_first(graph, rest))


def _costly_first(graph: Graph, order: Sequence[Node]) -> list[Node]:
    """Return an order that begins with costly functions, if they need few further operations.

    A processor computes a few hundred instructions at the same time. If a long function is needed
    soon after it begins, the processor waits for it.
    """
    users: dict[Node, list[Node]] = {}
    for node in order:
        for argument in graph.arguments(node):
            users.setdefault(argument, []).append(node)
    place = {node: k for k, node in enumerate(order)}
    leading: set[Node] = set()
    for node in order:
        if graph.nodes[node].op not in COSTLY:
            continue
        cone, stack = set[Node](), [_selection_of(graph, node, users)]
        while stack:
            each = stack.pop()
            if each in place and each not in leading and each not in cone:
                cone.add(each)
                stack.extend(graph.arguments(each))
        if len(cone) <= _AHEAD:
            leading |= cone
    return sorted(order, key=lambda n: (n not in leading, place[n]))


def _selection_of(graph: Graph, node: Node, users: Mapping[Node, Sequence[Node]]) -> Node:
    """Return the selection that alone reads a function or its product; otherwise, the function."""
    end = node
    while len(readers := users.get(end, ())) == 1:
        end = readers[0]
        if graph.nodes[end].op in _SELECTIONS:
            return end
        if graph.nodes[end].op != "mul":
            break
    return node


def _is_truth(graph: Graph, node: Node) -> bool:
    return graph.nodes[node].op in _TRUTHS


def cost(graph: Graph, node: Node) -> float:
    """Return the approximate cost of an operation, relative to a product."""
    return _COST.get(graph.nodes[node].op, 1.0)


def _classified(
    graph: Graph, order: Sequence[Node], level: Levels, refused: Collection[Node]
) -> dict[Node, frozenset[Node]]:
    """Return each node that a mode determines, with the truth values that determine the node."""
    deciding: dict[Node, frozenset[Node]] = {}
    late: set[Node] = set()  # nodes that also depend on other nodes
    for node in order:
        changing = [a for a in graph.arguments(node) if level[a] > 0]
        if all(a in deciding for a in changing):
            deciding[node] = frozenset().union(*(deciding[a] for a in changing))
        elif any(a in deciding or a in late for a in changing):
            late.add(node)
        elif graph.nodes[node].op in _COMPARISONS and node not in refused:
            deciding[node] = frozenset({node})
    return deciding


def _poor_atoms(
    graph: Graph, order: Sequence[Node], deciding: dict[Node, frozenset[Node]]
) -> set[Node]:
    """Return the truth values that determine too few values to save time."""
    worth: dict[Node, float] = {}
    for node in order:
        price = 0.0 if graph.nodes[node].op in _FREE else cost(graph, node)
        for atom in deciding.get(node, ()):
            worth[atom] = worth.get(atom, 0.0) + price
    return {atom for atom, value in worth.items() if value < _WORTH_ATOM}


# --- Branches and ramps
# A selection computes both arms. If only one arm needs costly functions, such as the friction curve
# of a sliding tire, a branch skips them while the other arm is selected. Selections with the same
# condition share common nodes of their arms: the first selection computes these nodes for the
# others. The values do not change.

_WORTH = 45.0  # cost of operations: a costly function and a few before it


@dataclass(frozen=True)
class Arm:
    """Nodes that only one arm of a selection needs.

    Parameters
    ----------
    nodes
        Nodes that the arm computes, in order.
    kept
        Nodes that a later selection with the same condition reuses.
    taken
        Nodes that the arm reuses from earlier arms.
    """

    nodes: tuple[Node, ...] = ()
    kept: tuple[Node, ...] = ()
    taken: tuple[Node, ...] = ()


Arms = tuple[Arm, Arm]


def branched(
    graph: Graph, order: Sequence[Node], kept: Collection[Node]
) -> tuple[list[Node], dict[Node, Arms]]:
    """Remove the nodes that only arms of selections need from an order of operations.

    Parameters
    ----------
    graph
        The expressions.
    order
        Operations, arguments first.
    kept
        Operations whose results are also read from outside.

    Returns
    -------
    tuple
        The order without these nodes, and both arms by selection.
    """
    users: dict[Node, list[Node]] = {}
    for node in order:
        for argument in graph.arguments(node):
            users.setdefault(argument, []).append(node)
    inside: set[Node] = set()
    fixed = set(kept)
    arms: dict[Node, Arms] = {}
    for node in reversed(order):  # outermost first
        if node in inside or node in arms or graph.nodes[node].op not in _SELECTIONS:
            continue
        truth = graph.nodes[node].args[0]
        alike = [
            n
            for n in order
            if n not in inside
            and n not in arms
            and graph.nodes[n].op in _SELECTIONS
            and graph.nodes[n].args[0] == truth
        ]
        if len(alike) > 1 and (together := _together(graph, order, alike, users, fixed)):
            arms.update(together)
            fixed.update(together)  # computed once, by the first selection
            inside.update(n for each in together.values() for arm in each for n in arm.nodes)
            continue
        cones = [_cone(graph, (node,), place, users, fixed) for place in (1, 2)]
        chosen = [cone if worth(graph, cone) else set[Node]() for cone in cones]
        if any(chosen):
            inside.update(*chosen)
            first, last = (Arm(tuple(n for n in order if n in cone)) for cone in chosen)
            arms[node] = first, last
    return [node for node in order if node not in inside], arms


def _together(
    graph: Graph,
    order: Sequence[Node],
    selections: Sequence[Node],
    users: Mapping[Node, Sequence[Node]],
    kept: Collection[Node],
) -> dict[Node, Arms]:
    """Return the arms of selections with a common condition; empty without costly nodes."""
    pinned = {*kept, *selections}
    cones, pays = [], False
    for place in (1, 2):
        cone = _cone(graph, selections, place, users, pinned)
        alone = (_cone(graph, (node,), place, users, pinned) for node in selections)
        pays |= worth(graph, cone - set().union(*alone))
        cones.append(cone if worth(graph, cone) else set[Node]())
    if not pays:
        return {}
    shared: dict[Node, list[Arm]] = {node: [] for node in selections}
    for place, cone in enumerate(cones, 1):
        left = set(cone)
        computed: dict[Node, set[Node]] = {}
        read: dict[Node, set[Node]] = {}
        for node in selections:
            needs = _needs(graph, _arm(graph, node, place), cone)
            computed[node] = needs & left
            read[node] = _read(graph, node, place, computed[node], cone) - computed[node]
            left -= needs
        for node in selections:
            later = set().union(*(read[n] for n in selections if n != node))
            shared[node].append(
                Arm(
                    *(
                        tuple(n for n in order if n in part)
                        for part in (computed[node], computed[node] & later, read[node])
                    )
                )
            )
    return {node: (first, last) for node, (first, last) in shared.items() if first or last}


def _arm(graph: Graph, selection: Node, place: int) -> Node | None:
    args = graph.nodes[selection].args
    return args[place] if place < len(args) else None


def _needs(graph: Graph, end: Node | None, cone: Collection[Node]) -> set[Node]:
    """Return the nodes of a cone on which a value depends."""
    needs: set[Node] = set()
    stack = [] if end is None else [end]
    while stack:
        node = stack.pop()
        if node in cone and node not in needs:
            needs.add(node)
            stack.extend(graph.arguments(node))
    return needs


def _read(
    graph: Graph, selection: Node, place: int, computed: Collection[Node], cone: Collection[Node]
) -> set[Node]:
    """Return the nodes of a cone in an arm's text, which contains truth values as expressions."""
    end = _arm(graph, selection, place)
    stack = [a for node in computed for a in graph.arguments(node)]
    stack += [] if end is None else [end]
    named: set[Node] = set()
    while stack:
        node = stack.pop()
        if graph.is_boolean(node):
            stack.extend(graph.arguments(node))
        elif node in cone:
            named.add(node)
    return named


def worth(graph: Graph, cone: Collection[Node]) -> bool:
    """Return whether nodes cost more than a test of whether they are needed."""
    if not any(graph.nodes[node].op in COSTLY for node in cone):
        return False
    return sum(cost(graph, node) for node in cone) > _WORTH


def _cone(
    graph: Graph,
    selections: Sequence[Node],
    place: int,
    users: Mapping[Node, Sequence[Node]],
    kept: Collection[Node],
) -> set[Node]:
    """Return the nodes that only one arm of selections needs."""
    ends: dict[Node, set[Node]] = {}
    for selection in selections:
        arm = _arm(graph, selection, place)
        if arm is not None and graph.arguments(selection).count(arm) == 1:
            ends.setdefault(arm, set()).add(selection)
    cone: set[Node] = set()
    candidates = set(ends)
    while candidates:
        node = max(candidates)  # arguments have lower numbers than the nodes that read them
        candidates.discard(node)
        readers = set(users.get(node, ())) - ends.get(node, set())
        if node in kept or not graph.arguments(node) or not readers <= cone:
            continue
        cone.add(node)
        candidates.update(a for a in graph.arguments(node) if a in users)
    return cone


def branch(
    graph: Graph, node: Node, arms: Arms, lines: tuple[Sequence[str], Sequence[str]], name: Namer
) -> list[str]:
    """Return the statements of a selection; ``lines``: statements of its arms."""
    truth, value, *other = graph.nodes[node].args
    ends = (as_number(graph, value, name), as_number(graph, other[0], name) if other else "0.0")
    texts = []
    for arm, computed, end in zip(arms, lines, ends, strict=True):
        taken = [f"const double {name(n)} = kept_{name(n)};" for n in arm.taken]
        kept = [f"kept_{name(n)} = {name(n)};" for n in arm.kept]
        text = [*taken, *computed, *kept, f"{name(node)} = {end};"]
        texts.append([f"  {line}" for line in text])
    kept_ones = [f"double kept_{name(n)} = 0.0;" for arm in arms for n in arm.kept]
    test = condition(graph, truth, name)
    declared = [*kept_ones, f"double {name(node)};"]
    return [*declared, f"if ({test}) {{", *texts[0], "} else {", *texts[1], "}"]


# --- Values that depend only on ramps are stored while the ramps are constant
# A ramp is a linear function of states between two limits, such as the fraction of a road's second
# surface along the road. It is at a limit nearly all the time. Values that depend only on ramps and
# parameters, such as peak adhesion with its logarithm, then need not be recomputed. Results stay
# the same.

_LINEAR = ("add", "sub", "neg", "mul")
_OPPOSITE = {"fmin": "fmax", "fmax": "fmin"}


@dataclass(frozen=True)
class Remembered:
    """Values that depend on the same ramps.

    Parameters
    ----------
    ramps
        The ramps.
    values
        Nodes to recompute when a ramp moves, in order.
    read
        Nodes that other nodes read.
    """

    ramps: tuple[Node, ...]
    values: tuple[Node, ...]
    read: tuple[Node, ...]


def remembered(
    graph: Graph,
    order: Sequence[Node],
    kept: Collection[Node],
    states: Collection[Node],
    level: Levels,
) -> tuple[list[Node], tuple[Remembered, ...], list[Node]]:
    """Split a substep into values worth storing, their inputs, and the rest.

    Parameters
    ----------
    graph
        The expressions.
    order
        Operations of a substep, arguments first.
    kept
        Operations whose results are also read from outside.
    states
        Nodes that already exist and are linear in states.
    level
        How often each node changes, see ``stages.LEVEL``.

    Returns
    -------
    tuple
        Operations to compute first, groups to update next, and all other operations, each in order.
    """
    follows: dict[Node, frozenset[Node]] = {}
    linear = set(states)
    for node in order:
        arguments = graph.arguments(node)
        changing = [a for a in arguments if level[a] == 2]
        if _is_linear(graph, node, changing, linear):
            linear.add(node)
        if _is_ramp(graph, node, linear, level):
            follows[node] = frozenset({node})
        elif changing and all(a in follows for a in changing):
            follows[node] = frozenset().union(*(follows[a] for a in changing))
    groups: dict[frozenset[Node], list[Node]] = {}
    for node, ramps in follows.items():
        if node not in ramps:
            groups.setdefault(ramps, []).append(node)
    # Groups with fewer ramps come first, because other groups may depend on them.
    chosen = [(r, groups[r]) for r in sorted(groups, key=len) if worth(graph, groups[r])]
    inside = {node for _, nodes in chosen for node in nodes}
    leading = {r for ramps, _ in chosen for r in ramps}
    leading |= {a for node in inside for a in graph.arguments(node) if a not in inside}
    for node in reversed(order):
        if node in leading:
            leading.update(graph.arguments(node))
    left = [node for node in order if node not in inside]
    groups_found = tuple(
        Remembered(tuple(sorted(ramps)), tuple(nodes), _read_outside(graph, nodes, order, kept))
        for ramps, nodes in chosen
    )
    return [n for n in left if n in leading], groups_found, [n for n in left if n not in leading]


def _is_linear(
    graph: Graph, node: Node, changing: Sequence[Node], linear: Collection[Node]
) -> bool:
    op = graph.nodes[node].op
    if op not in _LINEAR or (op == "mul" and len(changing) != 1):
        return False
    return all(graph.nodes[a].op == "leaf" or a in linear for a in changing)


def _is_ramp(graph: Graph, node: Node, linear: Collection[Node], level: Levels) -> bool:
    """Return whether a node is a linear function clipped to two limits."""
    opposite = _OPPOSITE.get(graph.nodes[node].op)
    if opposite is None:
        return False
    for inner in graph.arguments(node):
        others = [a for a in graph.arguments(node) if a != inner]
        if graph.nodes[inner].op == opposite and all(level[a] < 2 for a in others):
            return any(
                a in linear and all(level[b] < 2 for b in graph.arguments(inner) if b != a)
                for a in graph.arguments(inner)
            )
    return False


def _read_outside(
    graph: Graph, nodes: Sequence[Node], order: Collection[Node], kept: Collection[Node]
) -> tuple[Node, ...]:
    """Return the nodes that outside code reads, directly or in inline truth values."""
    inside = frozenset(nodes)
    outside = set(kept)
    for node in order:
        if node in inside:
            continue
        stack = list(graph.arguments(node))
        while stack:
            argument = stack.pop()
            outside.add(argument)
            if graph.is_boolean(argument):
                stack.extend(graph.arguments(argument))
    return tuple(n for n in nodes if n in outside and not graph.is_boolean(n))


def declarations(groups: Sequence[Remembered], name: Namer) -> list[str]:
    """Return the declarations of stored values, which are initially invalid."""
    lines = []
    for k, group in enumerate(groups):
        lines.append(f"uint64_t known{k} = 0;")
        lines += [f"double at{n} = 0.0;" for n in group.ramps]
        lines += [f"double {name(n)} = 0.0;" for n in group.read]
    return lines


def renewal(
    graph: Graph, k: int, group: Remembered, computed: Sequence[str], name: Namer
) -> list[str]:
    """Return the statements that recompute a group when one of its ramps has moved."""
    same = " & ".join(f"({as_number(graph, n, name)} == at{n})" for n in group.ramps)
    return [
        f"if (__builtin_expect(!(known{k} & {same}), 0)) {{",
        f"  known{k} = 1;",
        *(f"  at{n} = {as_number(graph, n, name)};" for n in group.ramps),
        *(f"  {line}" for line in computed),
        "}",
    ]
