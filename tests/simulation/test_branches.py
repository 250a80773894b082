"""What an arm of a selection alone needs stands in its branch, and nothing else does."""

from __future__ import annotations

from bywire.simulation.branches import branch, branched
from bywire.simulation.expressions import needed
from bywire.simulation.graph import Graph


def selection() -> tuple[Graph, dict[str, int]]:
    graph = Graph()
    x, y = graph.leaf("x", 0), graph.leaf("x", 1)
    shared = graph.apply("exp", x)
    alone = graph.apply("log", graph.apply("add", graph.apply("mul", x, x), graph.apply("fabs", y)))
    bent = graph.apply("sqrt", alone)
    arm = graph.apply("mul", graph.apply("mul", bent, shared), y)
    chosen = graph.apply("select", graph.apply("lt", x, y), arm, y)
    total = graph.apply("add", chosen, shared)
    return graph, {"shared": shared, "alone": alone, "arm": arm, "chosen": chosen, "total": total}


def test_only_what_one_arm_alone_needs_stands_in_it() -> None:
    graph, nodes = selection()
    order = needed(graph, [nodes["total"]], lambda _: False)
    left, arms = branched(graph, order, {nodes["total"]})
    (first, last) = arms[nodes["chosen"]]
    assert {nodes["alone"], nodes["arm"]} <= set(first)
    assert nodes["shared"] in left
    assert last == []
    assert sorted([*left, *first]) == sorted(order)
    assert first == [node for node in order if node in first]


def test_what_is_read_elsewhere_or_cheap_stays_outside() -> None:
    graph, nodes = selection()
    order = needed(graph, [nodes["total"]], lambda _: False)
    left, arms = branched(graph, order, {nodes["total"], nodes["alone"]})
    assert nodes["alone"] in left
    assert arms == {}


def test_text_assigns_in_both_arms() -> None:
    graph, nodes = selection()
    lines = branch(graph, nodes["chosen"], (["const double a = 1.0;"], []), lambda n: f"v{n}")
    name = f"v{nodes['chosen']}"
    assert lines[0] == f"double {name};"
    assert [line for line in lines if f"{name} = " in line] == [
        f"  {name} = v{nodes['arm']};", f"  {name} = v1;"
    ]  # fmt: skip
