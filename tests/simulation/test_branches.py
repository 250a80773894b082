"""The branch of a selection's arm contains exactly the nodes that only this arm needs."""

from __future__ import annotations

import re
from typing import cast

from bywire.brakes.wedge.model import WedgeBrake
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.catalog import parameters
from bywire.simulation.branches import Arm, branch, branched, modes
from bywire.simulation.emit_lanes import emit_lanes
from bywire.simulation.expressions import needed
from bywire.simulation.graph import Graph
from bywire.simulation.program import build_program
from bywire.simulation.quadrature import Levels
from bywire.simulation.stages import LEVEL, build_stages


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
    assert {nodes["alone"], nodes["arm"]} <= set(first.nodes)
    assert nodes["shared"] in left
    assert last == Arm()
    assert sorted([*left, *first.nodes]) == sorted(order)
    assert list(first.nodes) == [node for node in order if node in first.nodes]


def test_what_is_read_elsewhere_or_cheap_stays_outside() -> None:
    graph, nodes = selection()
    order = needed(graph, [nodes["total"]], lambda _: False)
    left, arms = branched(graph, order, {nodes["total"], nodes["alone"]})
    assert nodes["alone"] in left
    assert arms == {}


def test_selections_by_one_condition_share_what_their_arms_need() -> None:
    graph = Graph()
    x, y = graph.leaf("x", 0), graph.leaf("x", 1)
    truth = graph.apply("lt", x, y)
    sine = graph.apply("sin", graph.apply("sqrt", graph.apply("fabs", y)))
    first = graph.apply("if_else_zero", truth, graph.apply("add", sine, y))
    # The second arm needs the sine too, and what follows from the first selection.
    arm = graph.apply("mul", graph.apply("sub", sine, x), first)
    second = graph.apply("if_else_zero", truth, arm)
    total = graph.apply("add", first, second)
    order = needed(graph, [total], lambda _: False)
    left, arms = branched(graph, order, {total})
    assert sine not in left
    (early, _), (late, _) = arms[first], arms[second]
    assert sine in early.nodes
    assert sine in early.kept
    assert late.taken == (sine,)
    assert arm in late.nodes
    assert sorted([*left, *early.nodes, *late.nodes]) == sorted(order)
    # Read from outside, it cannot stand in an arm.
    left, arms = branched(graph, order, {total, sine})
    assert sine in left


def test_text_assigns_in_both_arms() -> None:
    graph, nodes = selection()
    both = Arm(kept=(7,)), Arm(taken=(8,))
    computed = ["const double a = 1.0;"], ["const double b = 2.0;"]
    lines = branch(graph, nodes["chosen"], both, computed, lambda n: f"v{n}")
    name = f"v{nodes['chosen']}"
    assert lines[:2] == ["double kept_v7 = 0.0;", f"double {name};"]
    assert [line for line in lines if f" {name} = " in line] == [
        f"  {name} = v{nodes['arm']};",
        f"  {name} = v1;",
    ]
    assert lines.index("  kept_v7 = v7;") < lines.index("} else {")
    assert lines.index("  const double v8 = kept_v8;") > lines.index("} else {")


def test_lanes_compute_a_costly_arm_only_if_a_lane_selects_it() -> None:
    par = cast(WedgeParameters, parameters("roberts2003"))
    text = emit_lanes(build_stages(build_program(WedgeBrake(), par), outputs=(0,)))
    powers = re.findall(r"(\S.*)\n\s+const V v\d+ = MAX\(.*\n\s+const V v\d+ = POW\(", text)
    assert len(powers) == 2  # one friction curve for each motor
    assert all(re.fullmatch(r"if \(ANY\(if_v\d+\)\) \{", line) for line in powers)


def test_long_functions_come_first_with_the_selections_that_skip_them() -> None:
    graph = Graph()
    x, y = graph.leaf("x", 0), graph.leaf("x", 1)
    short = graph.apply("mul", graph.apply("add", x, y), y)
    sine = graph.apply("sin", graph.apply("mul", x, x))
    late = short
    for _ in range(30):  # needs too many operations to come early
        late = graph.apply("add", graph.apply("mul", late, x), y)
    late = graph.apply("exp", late)
    skipped = graph.apply("if_else_zero", graph.apply("lt", y, x), graph.apply("mul", sine, y))
    root = graph.apply("add", graph.apply("add", short, late), skipped)
    order = modes(graph, [root], Levels(graph, LEVEL)).rest
    place = {node: k for k, node in enumerate(order)}
    assert all(place[a] < place[n] for n in order for a in graph.arguments(n) if a in place)
    assert place[sine] < place[skipped] < place[late] < place[root]
    assert place[skipped] < len(order) - 40
