"""Values that depend only on ramps are stored while the ramps are constant; others are not."""

from __future__ import annotations

import pytest

from bywire.simulation.branches import declarations, remembered, renewal
from bywire.simulation.expressions import needed
from bywire.simulation.graph import Graph

LEVEL = {"p": 0, "x": 2}


@pytest.fixture
def road() -> tuple[Graph, dict[str, int]]:
    graph = Graph()
    x, v, p, q = graph.leaf("x", 0), graph.leaf("x", 1), graph.leaf("p", 0), graph.leaf("p", 1)
    zero, one = graph.constant(0.0), graph.constant(1.0)
    along = graph.apply("mul", p, graph.apply("sub", x, q))
    share = graph.apply("fmin", graph.apply("fmax", along, zero), one)
    peak = graph.apply("log", graph.apply("add", q, graph.apply("mul", p, share)))
    wide = graph.apply("sqrt", graph.apply("mul", peak, share))
    # No ramp: a quotient between limits moves all the time.
    slip = graph.apply("fmin", graph.apply("fmax", graph.apply("div", v, x), zero), one)
    force = graph.apply("mul", graph.apply("exp", graph.apply("mul", p, slip)), wide)
    total = graph.apply("add", force, v)
    nodes = {"share": share, "peak": peak, "wide": wide, "slip": slip, "total": total}
    return graph, nodes


def split(graph: Graph, total: int):
    level = [
        LEVEL[graph.nodes[n].args[0]] if graph.nodes[n].op == "leaf" else 0
        for n in range(len(graph.nodes))
    ]
    for n in range(len(graph.nodes)):
        level[n] = max([level[n], *(level[a] for a in graph.arguments(n))])
    order = needed(graph, [total], lambda n: level[n] < 2)
    order = [n for n in order if level[n] == 2 and graph.nodes[n].op != "leaf"]
    return order, remembered(graph, order, {total}, (), level)


def test_only_what_follows_from_ramps_is_remembered(road) -> None:
    graph, nodes = road
    order, (first, (group,), rest) = split(graph, nodes["total"])
    assert group.ramps == (nodes["share"],)
    assert {nodes["peak"], nodes["wide"]} <= set(group.values)
    assert group.read == (nodes["wide"],)
    assert nodes["share"] in first
    assert nodes["slip"] in rest
    assert sorted([*first, *group.values, *rest]) == sorted(order)


def test_it_is_renewed_where_a_ramp_moved(road) -> None:
    graph, nodes = road
    _, (_, (group,), _) = split(graph, nodes["total"])

    def name(n: int) -> str:
        return f"v{n}"

    ramp = nodes["share"]
    assert declarations([group], name) == [
        "uint64_t known0 = 0;",
        f"double at{ramp} = 0.0;",
        f"double v{nodes['wide']} = 0.0;",
    ]
    lines = renewal(graph, 0, group, ["computed;"], name)
    assert lines[0] == f"if (__builtin_expect(!(known0 & (v{ramp} == at{ramp})), 0)) {{"
    assert lines[1:] == ["  known0 = 1;", f"  at{ramp} = v{ramp};", "  computed;", "}"]
