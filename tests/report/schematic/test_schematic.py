"""The schematic of a model: parts and wires are connected as in the equations, without overlap."""

from __future__ import annotations

import html
import re
from contextlib import nullcontext
from itertools import combinations
from pathlib import Path

import pytest

import bywire
from bywire.core.catalog import main_set
from bywire.core.model import ASSEMBLIES
from bywire.core.wires import Wire
from bywire.core.wiring import STIMULUS, Network, Node, network
from bywire.report.schematic import Schematic, layered, schematic, schematic_svg
from systems.loading import loaded

EXAMPLES = Path(__file__).parents[3] / "examples"
MODELS = {
    "motorcycle-brake": None,
    "two-wheeler-by-wire": None,
    "wedge-brake": None,
    "wedge-corner": None,
    "wedge-corner-electric": None,
    "wheel-on-drum": None,
    "two-wheeler-whole-rear": None,
    "hydraulic-brake": EXAMPLES / "hydraulic_brake.py",
    "emb-caliper": EXAMPLES / "emb_caliper",
}


@pytest.fixture(scope="module", params=MODELS)
def known(request: pytest.FixtureRequest) -> tuple[type, Network, Schematic]:
    """Return an assembly, its connections, and the positions of its parts."""
    place = MODELS[request.param]
    with nullcontext() if place is None else loaded(place):
        model = ASSEMBLIES.find(request.param)
        found = network(model(), bywire.parameters(main_set(request.param)))
    return model, found, schematic(found)


def test_every_part_and_wire_is_in_it(known: tuple[type, Network, Schematic]) -> None:
    model, found, _ = known
    svg = schematic_svg(found, "a model")
    texts = {html.unescape(text) for text in re.findall(r"<text[^>]*>([^<]*)</text>", svg)}
    declared = {k: v for base in model.__mro__ for k, v in vars(base).items()}
    wires = {name for name, value in declared.items() if isinstance(value, Wire)}
    assert wires | set(model.parts) | set(model.subs) <= texts  # type: ignore[attr-defined]
    for name, part in model.parts.items():  # type: ignore[attr-defined]
        if part.has("Input"):
            assert set(part.element.Input._fields) <= set(found.ports[Node("part", name)])
            assert set(part.element.Input._fields) <= texts
    assert svg.count("<path") == 2 * len(found.connections)


def test_no_box_lies_on_another_and_no_connection_crosses_one(
    known: tuple[type, Network, Schematic],
) -> None:
    _, _, plan = known
    for a, b in combinations(plan.boxes.values(), 2):
        apart_x = a.x + a.width < b.x or b.x + b.width < a.x
        assert apart_x or a.y + a.height < b.y or b.y + b.height < a.y, (a.node, b.node)
    for points in plan.curves.values():
        for (start, y), (end, _) in zip(points[1:-1:2], points[2:-1:2], strict=True):
            for box in plan.boxes.values():
                is_beside = box.x > max(start, end) or box.x + box.width < min(start, end)
                assert is_beside or not box.y < y < box.y + box.height, box.node
    width, height = plan.size
    assert all(
        b.x >= 0 and b.x + b.width <= width and b.y + b.height <= height
        for b in plan.boxes.values()
    )


def test_connections_are_those_of_the_equations() -> None:
    """Read from ``MotorcycleBrake.wire`` by hand, including loops through the ECU."""
    found = network(ASSEMBLIES.find("motorcycle-brake")(), bywire.parameters("dardanelli2010"))

    def sources(kind: str, name: str, port: str = "") -> set[str]:
        return {each.name for each in found.sources(Node(kind, name), port)}  # type: ignore[arg-type]

    assert sources("part", "motor", "v") == {"voltage"}
    assert sources("part", "motor", "omega") == {"gear"}
    assert sources("wire", "load") == {"chamber", "stop"}
    assert sources("part", "chamber", "q") == {"line", "port"}  # not beyond them to the caliper
    assert sources("part", "gear", "friction") == {"seal"}
    assert sources("task", "ecu", "y_p") == {"filter_p"}
    assert found.sources(Node("task", "ecu"), "p_set") == [STIMULUS]
    ideal = bywire.parameters("dardanelli2010").replace({"drive.mode": "voltage-source"})
    without = network(ASSEMBLIES.find("motorcycle-brake")(), ideal)
    assert [each.name for each in without.nodes if each.kind == "task"] == ["source"]


def test_layers_take_loops_and_nodes_without_any_neighbor() -> None:
    edges = [("a", "b"), ("b", "c"), ("c", "a"), ("a", "d"), ("d", "c"), ("c", "b")]
    plan = layered(dict.fromkeys("abcde", 10.0), edges, 5.0, first=["a"])
    assert set(plan.layer) == set("abcde")
    assert plan.layer["a"] == 0
    assert all(plan.layer[a] != plan.layer[b] for a, b in edges)
    assert layered({}, [], 5.0).members == ((),)
