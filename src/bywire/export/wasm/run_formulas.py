"""The formulas of a run, where their inputs and results stand, and that in C."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from bywire.export.exported import Exported
from bywire.export.initial_values import start_nodes
from bywire.export.model_header import braced, number
from bywire.export.wasm.formulas import OPERATIONS, Formula, table
from bywire.simulation.emission import leaf_count, unread
from bywire.simulation.emit_rare import rare_header, rare_results
from bywire.simulation.expressions import needed
from bywire.simulation.graph import Graph
from bywire.simulation.layout import COUNTERS
from bywire.simulation.operation import Node, Operation
from bywire.simulation.rare_text import PROJECTION
from bywire.simulation.stages import STATE, Stages

_OWN = OPERATIONS[OPERATIONS.index("exp") : OPERATIONS.index("pow") + 1]  # functions of the kernel


@dataclass(frozen=True)
class RunFormulas:
    """The table of a run, and the C text that tells how it is laid out."""

    table: bytes
    header: str


def run_formulas(made: Exported) -> RunFormulas:
    """Return the formulas of a run."""
    stages, graph = made.stages, made.stages.graph
    lengths = {kind: len(stages.fast[kind]) for kind in STATE}
    results, exact = rare_results(stages.fast), rare_results(stages.exact)
    products = stages.quadrature.products
    blocks = {
        **lengths,
        "m": len(stages.ticks[0]),
        "counters": COUNTERS,
        "p": made.program.sizes.parameters,
        "h": 1,
        "u": leaf_count(stages, "u"),
        "w": stages.rows,
        "force": stages.rows,
        "failed": 1,
        "posed": len(stages.posed),
        "o": len(results),
        "out": len(stages.output),
        "s": len(products),
    }
    at, total = {}, 0
    for kind, length in blocks.items():
        at[kind] = total
        total += length
    leaves = {(k, i): at[k] + i for k, length in blocks.items() for i in range(length)}

    def placed(kind: str, nodes: Sequence[Node]) -> list[tuple[int, Node]]:
        return [(at[kind] + k, node) for k, node in enumerate(nodes)]

    skipped = unread(stages)
    again = [
        (at[kind] + k, node)
        for kind in ("x", "d", "r")
        for k, node in enumerate(stages.fast[kind])
        if f"{kind}{k}" not in skipped
    ]
    start = start_nodes(made)
    others = [
        Formula(graph, [(0, stages.fast["flag"][0]), *again, *placed("s", products)], len(again)),
        Formula(graph, placed("o", results)),
        Formula(graph, placed("posed", stages.posed)),
        Formula(graph, placed("o", exact)),
        Formula(graph, placed("q", _integrals(stages))),
        Formula(graph, placed("out", stages.output)),
        Formula(start.graph, list(start.targets.items())) if start else Formula(Graph(), []),
        *(
            Formula(
                graph,
                [
                    each
                    for k, each in enumerate(placed("m", roots))
                    if each[1] != graph.leaf("m", k)
                ],
            )
            for roots in stages.ticks
        ),
    ]
    kept = _kept(stages, [n for each in others if each.graph is graph for _, n in each.results])
    first = Formula(graph, [(total + k, node) for k, node in enumerate(kept)])
    used = {
        f.graph.nodes[n].op
        for f in (first, *others)
        for n in needed(f.graph, [n for _, n in f.results], lambda _: False)
    }
    used = {"pow" if op == "constpow" else op for op in used}
    header = _header(made, at, total + len(kept), used)
    return RunFormulas(table([first, *others], leaves), header)


def _integrals(stages: Stages) -> list[Node]:
    """Return the integrals after a frame, in which coefficients do not change."""
    graph, nodes = stages.graph, []
    for k, pairs in enumerate(stages.quadrature.combinations):
        total = None
        for coefficient, product in pairs:  # as they stand: the order is that of the bench's kernel
            part = graph.intern(Operation("mul", (coefficient, graph.leaf("s", product))))
            total = part if total is None else graph.intern(Operation("add", (total, part)))
        q = graph.leaf("q", k)
        nodes.append(q if total is None else graph.intern(Operation("add", (q, total))))
    return nodes


def _kept(stages: Stages, roots: Sequence[Node]) -> list[Node]:
    """Return what follows from parameters and step alone and is read beside other things."""
    graph, level = stages.graph, stages.level()
    order = needed(graph, roots, lambda _: False)
    readers = [node for node in order if level[node] or graph.is_boolean(node)]
    read = [*roots, *(a for node in readers for a in graph.arguments(node))]
    return [
        node
        for node in dict.fromkeys(read)
        if not level[node] and not graph.is_boolean(node) and graph.arguments(node)
    ]


def _header(made: Exported, at: dict[str, int], total: int, used: set[str]) -> str:
    stages, schedule = made.stages, made.schedule
    places = ", ".join(f"{kind.upper()}_AT = {place}" for kind, place in at.items())
    projected = "project(area + POSED_AT, area + W_AT, area + FORCE_AT)" if stages.rows else "0.0"
    return f"""{rare_header(stages)}
enum {{ {places}, AREA = {total} }};
enum {{ PRODUCTS = {len(stages.quadrature.products)}, STIMULI = {leaf_count(stages, "u")},
  ROWS = {len(stages.output)}, STATE = {made.layout.total}, SUBSTEPS = {schedule.substeps},
  TASKS = {len(schedule.task_frames)} }};
#define STEP {number(schedule.step)}
#define PROJECTED {projected}
static const int task_frames[] = {braced(map(str, schedule.task_frames))};
static const double state_start[] = {braced(map(number, made.vector))};
{PROJECTION if stages.rows else ""}
{"".join(_lent(op) for op in _OWN if op in used)}"""


def _lent(op: str) -> str:
    """Return the C text that lends an elementary function to formulas."""
    given, taken = ("double a, double b", "a, b") if op == "pow" else ("double a", "a")
    return f"PAGE({op}) double lent_{op}({given}) {{ return bw_{op}({taken}); }}\n"
