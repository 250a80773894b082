"""The schematic of a model as SVG: parts as boxes, wires by their names, in the page's colors."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from itertools import pairwise

from bywire.core.connections import Connection, Network, Node
from bywire.report.schematic.layers import Layers, layered

_LETTER = 7.3  # width of a letter of 13 px, a little more than the mean
_SMALL = 6.2  # of 11 px
_HEAD, _ROW, _PILL = 40.0, 17.0, 24.0
_GAP, _CHANNEL, _MARGIN = 16.0, 54.0, 34.0
_TIP = 6.0

Point = tuple[float, float]


@dataclass(frozen=True)
class Box:
    """A node as it is drawn.

    Parameters
    ----------
    x, y, width, height
        Upper left corner and size [px].
    left, right
        Ports on either side: what comes with the flow enters at the left, what is fed back at
        the right.
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
        """Return where what it gives leaves."""
        y = self.y + (self.height if self.is_wire else _HEAD) / 2
        return (self.x + self.width if forward else self.x), y

    def entrance(self, port: str, forward: bool) -> Point:
        """Return where a port is."""
        x = self.x if forward else self.x + self.width
        if self.is_wire:
            return x, self.y + self.height / 2
        row = (self.left if forward else self.right).index(port)
        return x, self.y + _HEAD + _ROW * (row + 0.5)


@dataclass(frozen=True)
class Schematic:
    """A network with a place for everything.

    Parameters
    ----------
    network
        What is drawn.
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
    """Lay a network out: the ECU first, then the plant along the flow of its signals."""
    first = [node for node in network.nodes if node.kind == "stimulus"]
    first += [node for node in network.nodes if node.kind == "task"]
    edges = [(c.source, c.target) for c in network.connections]
    # Sides follow from the layers, heights from the sides: of one pass the first, of both the rest.
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
    """Return the schematic of a model as an SVG element that takes the color of the page's text.

    ``title``: what it says where it cannot be seen; every name in it is text as well.
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
    """Return the ports at the left and at the right; one that is fed from both stands at both."""
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
    """Return a box with its name, what it is and its ports; of a wire its name alone."""
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
