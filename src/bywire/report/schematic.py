"""Schematic of a model as SVG: parts as boxes, wires with their names, and a table of both.

The layout is that of K. Sugiyama et al.: edges against the flow are reversed, every edge
gets passages in the layers that it crosses, and nodes move toward their neighbors.

References
----------
K. Sugiyama, S. Tagawa, M. Toda, "Methods for visual understanding of hierarchical system
structures", IEEE Trans. Systems, Man, Cybernetics 11 (2), 1981.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from typing import Any, TypeVar

from bywire.core.assembly import Assembly
from bywire.core.wiring import Connection, Network, Node, network
from bywire.report.document import Details, Drawing, TableBlock
from bywire.report.tables import Table, text_table

K = TypeVar("K", bound=Hashable)

_SWEEPS = 24
_LOWEST = 12.0  # height of a passage that only an edge crosses


@dataclass(frozen=True)
class Passage:
    """A passage in a layer, shared by all edges of one source in one direction."""

    source: Hashable
    forward: bool
    layer: int


@dataclass(frozen=True)
class Layers:
    """Nodes and passages in layers.

    Parameters
    ----------
    members
        Nodes and passages of each layer, from top to bottom.
    layer
        Index of the layer of each node.
    top
        Upper edge of each node and passage.
    """

    members: tuple[tuple[Hashable, ...], ...]
    layer: Mapping[Hashable, int]
    top: Mapping[Hashable, float]

    def passages(self, source: Hashable, target: Hashable) -> list[Passage]:
        """Return the passages of an edge in the layers between its ends."""
        first, last = self.layer[source], self.layer[target]
        step = 1 if last > first else -1
        return [Passage(source, step > 0, k) for k in range(first + step, last, step)]


def layered(
    heights: Mapping[K, float], edges: Iterable[tuple[K, K]], gap: float, first: Sequence[K] = ()
) -> Layers:
    """Return a layered layout without overlaps.

    Parameters
    ----------
    heights
        Height of every node.
    edges
        Source and target; a node is not its own target.
    gap
        Minimum distance between two nodes in a layer.
    first
        Nodes that each have a separate layer, before all others.
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
    """Return the layer of every node: after all its predecessors in the direction of the flow."""
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
    """Return the nodes in the order in which a signal from the first ones reaches them."""
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
    """Return the best layers found, with each node near its neighbors' mean position."""
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
    """Return the upper edges: each node as near to its neighbors as the others allow."""
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
    """Return the least-squares positions nearest to the desired ones, with minimum distances."""
    shifts = [0.0]
    for each in apart:
        shifts.append(shifts[-1] + each)
    blocks: list[list[float]] = []  # sum and number of positions that move together
    for value, shift in zip(wanted, shifts, strict=False):
        blocks.append([value - shift, 1.0])
        while len(blocks) > 1 and blocks[-2][0] / blocks[-2][1] > blocks[-1][0] / blocks[-1][1]:
            total, number = blocks.pop()
            blocks[-1][0] += total
            blocks[-1][1] += number
    level = [total / number for total, number in blocks for _ in range(int(number))]
    return [a + b for a, b in zip(level, shifts, strict=False)]


# --- The drawing

_LETTER = 7.3  # width of a letter at 13 px, slightly more than the mean
_SMALL = 6.2  # the same at 11 px
_HEAD, _ROW, _PILL = 40.0, 17.0, 24.0
_GAP, _CHANNEL, _MARGIN = 16.0, 54.0, 34.0
_TIP = 6.0

Point = tuple[float, float]


@dataclass(frozen=True)
class Box:
    """A node with its position.

    Parameters
    ----------
    x, y, width, height
        Upper left corner and size [px].
    left, right
        Ports on either side: signals along the flow enter at the left, feedback at the right.
    """

    node: Node
    x: float
    y: float
    width: float
    height: float
    left: tuple[str, ...]
    right: tuple[str, ...]

    @property
    def is_wire(self) -> bool:
        """Whether it is a wire, which has no ports."""
        return self.node.kind == "wire"

    def exit(self, forward: bool) -> Point:
        """Return the position where its output leaves."""
        y = self.y + (self.height if self.is_wire else _HEAD) / 2
        return (self.x + self.width if forward else self.x), y

    def entrance(self, port: str, forward: bool) -> Point:
        """Return the position of a port."""
        x = self.x if forward else self.x + self.width
        if self.is_wire:
            return x, self.y + self.height / 2
        row = (self.left if forward else self.right).index(port)
        return x, self.y + _HEAD + _ROW * (row + 0.5)


@dataclass(frozen=True)
class Schematic:
    """A network with the positions of all parts.

    Parameters
    ----------
    network
        The network to draw.
    boxes
        Every node by itself.
    curves
        Points of each connection: curved from the first to the second, straight across a layer to
        the third, and so on.
    columns
        Left edge and width of each layer.
    """

    network: Network
    boxes: dict[Node, Box]
    curves: dict[Connection, tuple[Point, ...]]
    columns: tuple[tuple[float, float], ...]

    @property
    def size(self) -> Point:
        """Width and height [px]."""
        x, width = self.columns[-1]
        points = [p for curve in self.curves.values() for p in curve]
        low = max([box.y + box.height for box in self.boxes.values()] + [y for _, y in points])
        return x + width + 12.0, low + 12.0


def schematic(network: Network) -> Schematic:
    """Lay out a network: the ECU first, then the plant along the flow of its signals."""
    first = [node for node in network.nodes if node.kind == "stimulus"]
    first += [node for node in network.nodes if node.kind == "task"]
    edges = [(c.source, c.target) for c in network.connections]
    # Sides follow from the layers, heights from the sides: the first layout gives sides, the second
    # all.
    whole = {node: _size(node, network, network.ports.get(node, ()), ()) for node in network.nodes}
    layers = layered({node: size[1] for node, size in whole.items()}, edges, _GAP, first)
    sides = {node: _sides(node, network, layers) for node in network.nodes}
    sizes = {node: _size(node, network, *sides[node]) for node in network.nodes}
    layers = layered({node: size[1] for node, size in sizes.items()}, edges, _GAP, first)
    columns, x = [], 12.0
    for members in layers.members:
        width = max((sizes[node][0] for node in members if isinstance(node, Node)), default=10.0)
        columns.append((x, width))
        x += width + _CHANNEL
    boxes = {}
    for node, (width, height) in sizes.items():
        left, column = columns[layers.layer[node]]
        y = _MARGIN + layers.top[node]
        boxes[node] = Box(node, left + (column - width) / 2, y, width, height, *sides[node])
    curves = {c: _curve(c, boxes, layers, columns) for c in network.connections}
    return Schematic(network, boxes, curves, tuple(columns))


def schematic_svg(network: Network, title: str) -> str:
    """Return the schematic of a model as an SVG element in the page's text color.

    ``title``: its text for screen readers; every name in it is text as well.
    """
    plan = schematic(network)
    width, height = plan.size
    parts = [
        f'<svg class="schematic" viewBox="0 0 {width:.0f} {height:.0f}" role="img" '
        f'aria-label="{escape(title, quote=True)}" font-family="inherit" fill="currentColor" '
        'stroke="none">',
        *_groups(plan, height),
        *(_connection(c, curve) for c, curve in plan.curves.items()),
        *(_box(box, network) for box in plan.boxes.values()),
        "</svg>",
    ]
    return "\n".join(parts)


def _sides(node: Node, network: Network, layers: Layers) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the ports on the left and the right; a port with inputs from both is on both."""
    left, right = [], []
    for port in network.ports.get(node, ()):
        ways = {layers.layer[s] < layers.layer[node] for s in network.sources(node, port)}
        left += [port] if True in ways or not ways else []
        right += [port] if False in ways else []
    return tuple(left), tuple(right)


def _size(node: Node, network: Network, left: tuple[str, ...], right: tuple[str, ...]) -> Point:
    if node.kind == "wire":
        return _LETTER * len(node.name) + 18.0, _PILL
    title = max(_LETTER * len(node.name), _SMALL * len(network.labels[node])) + 20.0
    ports = _SMALL * (max(map(len, left), default=0) + max(map(len, right), default=0)) + 26.0
    rows = max(len(left), len(right))
    return max(title, ports), _HEAD + _ROW * rows + (4.0 if rows else 0.0)


def _curve(
    connection: Connection,
    boxes: dict[Node, Box],
    layers: Layers,
    columns: list[tuple[float, float]],
) -> tuple[Point, ...]:
    """Return the points of a connection: curved between layers, straight across them."""
    source, target = connection.source, connection.target
    forward = layers.layer[source] < layers.layer[target]
    points = [boxes[source].exit(forward)]
    for each in layers.passages(source, target):
        x, width = columns[each.layer]
        y = _MARGIN + layers.top[each] + 6.0
        points += [(x, y), (x + width, y)] if forward else [(x + width, y), (x, y)]
    return (*points, boxes[target].entrance(connection.port, forward))


def _groups(plan: Schematic, height: float) -> list[str]:
    """Return a frame around the ECU and one around the plant."""
    frames = []
    for label, kinds in (("ECU", ("task",)), ("plant", ("part", "wire"))):
        inside = [box for node, box in plan.boxes.items() if node.kind in kinds]
        if not inside:
            continue
        low = min(box.x for box in inside) - 9.0
        wide = max(box.x + box.width for box in inside) + 9.0 - low
        frames.append(
            f'<rect x="{low:.1f}" y="4" width="{wide:.1f}" height="{height - 8:.1f}" rx="8" '
            'fill-opacity=".035" stroke="currentColor" stroke-opacity=".25" '
            f'stroke-dasharray="4 4"/>\n<text x="{low + 10:.1f}" y="20" font-size="12" '
            f'font-weight="600" fill-opacity=".7">{label}</text>'
        )
    return frames


def _connection(connection: Connection, points: tuple[Point, ...]) -> str:
    """Return a connection with its tip."""
    path = f"M{points[0][0]:.1f} {points[0][1]:.1f}"
    sign = 1.0 if points[-1][0] > points[0][0] else -1.0
    x, y = points[-1]
    ends = [*points[:-1], (x - sign * _TIP, y)]
    for k, (start, end) in enumerate(pairwise(ends)):
        if k % 2:  # across a layer
            path += f"H{end[0]:.1f}"
            continue
        bend = sign * max(14.0, 0.5 * abs(end[0] - start[0]))
        path += (
            f"C{start[0] + bend:.1f} {start[1]:.1f} {end[0] - bend:.1f} {end[1]:.1f} "
            f"{end[0]:.1f} {end[1]:.1f}"
        )
    tip = f"M{x:.1f} {y:.1f}l{-sign * _TIP:.1f} -3.2v6.4z"
    said = f"{connection.source.name} to {connection.target.name}"
    said += f", {connection.port}" if connection.port else ""
    return (
        f'<g><title>{escape(said)}</title><path d="{path}" fill="none" stroke="currentColor" '
        f'stroke-opacity=".5" stroke-width="1.2"/><path d="{tip}" fill-opacity=".7"/></g>'
    )


def _box(box: Box, network: Network) -> str:
    """Return a box with its name, kind and ports; for a wire only its name."""
    name, label = escape(box.node.name), escape(network.labels[box.node])
    middle = box.x + box.width / 2
    look = {
        "wire": 'rx="12" stroke-opacity=".45"',
        "part": 'rx="4" stroke-opacity=".8" stroke-width="1.3"',
    }.get(box.node.kind, 'rx="4" stroke-opacity=".9" stroke-width="2"')
    rect = (
        f'<rect class="{box.node.kind}" x="{box.x:.1f}" y="{box.y:.1f}" width="{box.width:.1f}" '
        f'height="{box.height:.1f}" {look} stroke="currentColor"'
    )
    if box.is_wire:
        return (
            f'<g><title>{label}</title>{rect} fill-opacity=".06"/>'
            f'<text x="{middle:.1f}" y="{box.y + 16:.1f}" font-size="13" font-style="italic" '
            f'text-anchor="middle">{name}</text></g>'
        )
    texts = [
        f'<text x="{middle:.1f}" y="{box.y + 17:.1f}" font-size="13" font-weight="600" '
        f'text-anchor="middle">{name}</text>',
        f'<text x="{middle:.1f}" y="{box.y + 32:.1f}" font-size="11" fill-opacity=".75" '
        f'text-anchor="middle">{label}</text>',
    ]
    sides = ((box.left, box.x + 7, "start"), (box.right, box.x + box.width - 7, "end"))
    for ports, x, anchor in sides:
        texts += [
            f'<text x="{x:.1f}" y="{box.y + _HEAD + _ROW * (k + 0.5) + 4:.1f}" font-size="11" '
            f'text-anchor="{anchor}">{escape(port)}</text>'
            for k, port in enumerate(ports)
        ]
    shade = ".04" if box.node.kind == "part" else ".12"
    return f'<g>{rect} fill-opacity="{shade}"/>{"".join(texts)}</g>'


# --- Table: the source of every input


def schematic_blocks(model: Any, par: Any) -> list[Drawing | Details]:
    """Return the drawing of a model and a table with the same content; nothing without parts.

    Parameters
    ----------
    model
        The model of the run; only an `Assembly` has parts.
    par
        Parameters, whose choices determine the equations.
    """
    if not isinstance(model, Assembly):
        return []
    known = network(model, par)
    parts = sum(node.kind == "part" for node in known.nodes)
    wires = sum(node.kind == "wire" for node in known.nodes)
    caption = (
        f"Schematic of {known.name}, from its equations: {parts} parts, {wires} wires (rounded). "
        "Forward signals enter on the left, and feedback enters on the right."
    )
    title = f'Schematic of {known.name}; the table "Parts and wires" has the same content'
    return [
        Drawing(lambda: schematic_svg(known, title), caption),
        Details("Parts and wires", [TableBlock(connection_table(known))]),
    ]


def connection_table(known: Network) -> Table:
    """Return every input and wire with its sources."""
    rows = []
    for node in known.nodes:
        for port in known.ports.get(node, ()) or ("",):
            sources = ", ".join(each.name for each in known.sources(node, port))
            rows.append((node.name, known.labels[node], port or "-", sources or _unfed(node)))
    return text_table(("name", "type", "input", "source"), rows)


def _unfed(node: Node) -> str:
    return "the driver" if node.kind == "stimulus" else "itself and its parameters"
