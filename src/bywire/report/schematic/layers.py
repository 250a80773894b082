"""Nodes of a directed graph in layers, cycles and all: which layer, in which order, at what height.

As K. Sugiyama et al. do it: edges against the flow are turned round, every edge spans one layer
after it has got places in those between, and nodes move toward what they are connected to.

References
----------
K. Sugiyama, S. Tagawa, M. Toda, "Methods for visual understanding of hierarchical system
structures", IEEE Trans. Systems, Man, Cybernetics 11 (2), 1981.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

K = TypeVar("K", bound=Hashable)

_SWEEPS = 24
_LOWEST = 12.0  # height of a place that an edge only passes


@dataclass(frozen=True)
class Passage:
    """A place in a layer between, that all edges of one source share which go the same way."""

    source: Hashable
    forward: bool
    layer: int


@dataclass(frozen=True)
class Layers:
    """Nodes and passages in layers.

    Parameters
    ----------
    members
        Of each layer, from top to bottom.
    layer
        Of each node.
    top
        Upper edge of each node and passage.
    """

    members: tuple[tuple[Hashable, ...], ...]
    layer: Mapping[Hashable, int]
    top: Mapping[Hashable, float]

    def passages(self, source: Hashable, target: Hashable) -> list[Passage]:
        """Return the places in which an edge crosses the layers between its ends."""
        first, last = self.layer[source], self.layer[target]
        step = 1 if last > first else -1
        return [Passage(source, step > 0, k) for k in range(first + step, last, step)]


def layered(
    heights: Mapping[K, float], edges: Iterable[tuple[K, K]], gap: float, first: Sequence[K] = ()
) -> Layers:
    """Return a layered layout in which nothing overlaps.

    Parameters
    ----------
    heights
        Height of every node.
    edges
        Source and target; nodes are no targets of their own.
    gap
        Least distance of two nodes of a layer.
    first
        Nodes with a layer of their own each, before all others.
    """
    links = list(dict.fromkeys(edges))
    layer = _layer_of(list(heights), links, list(first))
    count = 1 + max(layer.values(), default=0)
    plan = Layers(((),) * count, layer, {})
    members: list[dict[Hashable, None]] = [{} for _ in range(count)]
    for node, k in layer.items():
        members[k][node] = None
    segments: dict[tuple[Hashable, Hashable], None] = {}
    for source, target in links:
        way = plan.passages(source, target)
        for each in way:
            members[each.layer][each] = None
        segments |= dict.fromkeys(pairwise([source, *way, target]))
    beside = _neighbours(segments)
    order = _ordered([list(each) for each in members], beside)
    known: dict[Hashable, float] = {node: height for node, height in heights.items()}
    top = _heights(order, beside, known, gap)
    return Layers(tuple(map(tuple, order)), layer, top)


def _layer_of(
    nodes: Sequence[K], edges: Sequence[tuple[K, K]], first: Sequence[K]
) -> dict[Hashable, int]:
    """Return the layer of every node: behind all that it follows in the direction of the flow."""
    rank = {node: k for k, node in enumerate(_flow(nodes, edges, first))}
    forward = [(a, b) if rank[a] < rank[b] else (b, a) for a, b in edges]
    layer: dict[Hashable, int] = {node: k for k, node in enumerate(first)}
    before: dict[Hashable, list[Hashable]] = {}
    for a, b in forward:
        before.setdefault(b, []).append(a)
    for node in sorted(rank, key=lambda each: rank[each]):
        if node not in layer:
            layer[node] = max((layer[a] + 1 for a in before.get(node, ())), default=len(first))
            layer[node] = max(layer[node], len(first))
    return layer


def _flow(nodes: Sequence[K], edges: Sequence[tuple[K, K]], first: Sequence[K]) -> list[K]:
    """Return the nodes in the order in which a signal from the first ones arrives."""
    after: dict[K, list[K]] = {node: [] for node in nodes}
    for a, b in edges:
        after[a].append(b)
    reached, order = set(first), list(first)
    fed = {b for _, b in edges}
    starts = [*first, *(n for n in nodes if n not in fed), *nodes]
    for start in starts:
        waiting = [start]
        if start not in reached:
            reached.add(start)
            order.append(start)
        while waiting:
            node = waiting.pop(0)
            for each in after[node]:
                if each not in reached:
                    reached.add(each)
                    order.append(each)
                    waiting.append(each)
    return order


def _neighbours(segments: Iterable[tuple[Hashable, Hashable]]) -> dict[Hashable, list[Hashable]]:
    beside: dict[Hashable, list[Hashable]] = {}
    for a, b in segments:
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    return beside


def _ordered(
    members: list[list[Hashable]], beside: Mapping[Hashable, Sequence[Hashable]]
) -> list[list[Hashable]]:
    """Return the layers with each node near the mean place of its neighbours; the best found."""
    best, fewest = [list(each) for each in members], _crossings(members, beside)
    for sweep in range(_SWEEPS):
        ways = range(1, len(members)) if sweep % 2 == 0 else range(len(members) - 2, -1, -1)
        for k in ways:
            fixed = members[k - 1 if sweep % 2 == 0 else k + 1]
            place = {node: i / max(1, len(fixed) - 1) for i, node in enumerate(fixed)}
            now = {node: i / max(1, len(members[k]) - 1) for i, node in enumerate(members[k])}
            wanted: dict[Hashable, float] = {}
            for node in members[k]:
                places = [place[each] for each in beside.get(node, ()) if each in place]
                wanted[node] = sum(places) / len(places) if places else now[node]
            members[k].sort(key=wanted.__getitem__)
        crossings = _crossings(members, beside)
        if crossings < fewest:
            best, fewest = [list(each) for each in members], crossings
    return best


def _crossings(
    members: Sequence[Sequence[Hashable]], beside: Mapping[Hashable, Sequence[Hashable]]
) -> int:
    total = 0
    for left, right in pairwise(members):
        place = {node: i for i, node in enumerate(right)}
        ends = [sorted(place[b] for b in beside.get(a, ()) if b in place) for a in left]
        flat = [end for each in ends for end in each]
        total += sum(a > b for i, a in enumerate(flat) for b in flat[i + 1 :])
    return total


def _heights(
    order: Sequence[Sequence[Hashable]],
    beside: Mapping[Hashable, Sequence[Hashable]],
    heights: Mapping[Hashable, float],
    gap: float,
) -> dict[Hashable, float]:
    """Return the upper edges: each node as near to its neighbours as the others let it."""
    size = {node: heights.get(node, _LOWEST) for layer in order for node in layer}
    middle: dict[Hashable, float] = {}
    for layer in order:
        below = 0.0
        for node in layer:
            middle[node] = below + size[node] / 2
            below += size[node] + gap
    for sweep in range(_SWEEPS):
        for layer in order if sweep % 2 == 0 else reversed(order):
            wanted = []
            for node in layer:
                near = [middle[each] for each in beside.get(node, ())]
                wanted.append(sum(near) / len(near) if near else middle[node])
            apart = [
                size[a] / 2 + size[b] / 2 + (gap if a in heights or b in heights else 0.4 * gap)
                for a, b in pairwise(layer)
            ]
            middle |= dict(zip(layer, _spread(wanted, apart), strict=True))
    top = {node: middle[node] - size[node] / 2 for node in size}
    least = min(top.values(), default=0.0)
    return {node: value - least for node, value in top.items()}


def _spread(wanted: Sequence[float], apart: Sequence[float]) -> list[float]:
    """Return places nearest to those wanted, by least squares, that keep their distances."""
    shifts = [0.0]
    for each in apart:
        shifts.append(shifts[-1] + each)
    blocks: list[list[float]] = []  # sum and number of places that move as one
    for value, shift in zip(wanted, shifts, strict=False):
        blocks.append([value - shift, 1.0])
        while len(blocks) > 1 and blocks[-2][0] / blocks[-2][1] > blocks[-1][0] / blocks[-1][1]:
            total, number = blocks.pop()
            blocks[-1][0] += total
            blocks[-1][1] += number
    level = [total / number for total, number in blocks for _ in range(int(number))]
    return [a + b for a, b in zip(level, shifts, strict=False)]
