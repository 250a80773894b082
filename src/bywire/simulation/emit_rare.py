"""C text of what is rare: a substep that one ordinary pass does not serve.

Its functions stand alone and compute for any length of a step what does not follow from parameters
alone. A substep in which a velocity with dry friction changes its sign is cut where it passes zero:
friction jumps there, and with it the acceleration. Within each part every velocity keeps its sign;
what has come to zero rests or moves on in the next part, as its bounds decide.
"""

from __future__ import annotations

from collections.abc import Collection

from bywire.simulation.emission import indented, leaf_namer, statements
from bywire.simulation.expressions import as_number, needed
from bywire.simulation.graph import Graph
from bywire.simulation.layout import ATTEMPTS, CAP, CLOSE, EDGE, NEAR, STILL, most_cuts
from bywire.simulation.operation import Node
from bywire.simulation.quadrature import Levels
from bywire.simulation.rare_text import CUT, PROJECTION
from bywire.simulation.set_valued import FITTING, NEVER, NOTHING, RESIDUAL
from bywire.simulation.stages import STATE, Stages

_TRIES = 200_000
APART = "__attribute__((noinline))"  # but fast: what is cold is compiled to be short


def rare_substep(stages: Stages) -> str:
    """Return the C functions of a substep that is repeated or cut.

    ``constants(p, c)`` fills c, shape (CONSTANTS,), with what they read of the parameters p.
    """
    slots = _constants(stages)
    return f"""
#if defined(QUICK) && !defined(__clang__)
#define RARE __attribute__((noinline, optimize("O0")))
#else
#define RARE __attribute__((noinline, cold))
#endif
{rare_header(stages)}
enum {{ CONSTANTS = {len(slots)}, POSED = {len(stages.posed)} }};
{_constants_function(stages.graph, slots)}
{_pass_function("fast_pass", APART, _lines(stages, rare_results(stages.fast), slots))}
{PROJECTION if stages.rows else ""}{_pass_function("exact_pass", "RARE", _exact(stages, slots))}
{CUT}"""


def most_tries(stages: Stages) -> int:
    """Return after how many tried parts of substeps a call of a kernel ends: tens of milliseconds.

    A part takes an exact pass or a few, in which all combinations of signs may be tried.
    """
    return max(_TRIES // (10 + int(3**stages.rows)), 1)


def rare_header(stages: Stages) -> str:
    """Return what the C text of `rare_text` is told of a model."""
    nx, nr, nq = (len(stages.exact[kind]) for kind in ("x", "r", "q"))
    velocities = stages.velocities
    return f"""#define APART {APART}
enum {{ NX = {nx}, FLOW = {2 * nx + nr}, FLOWS = {nq}, VELOCITIES = {len(velocities)},
  JUMP = FLOW + FLOWS, DOUBT = JUMP + VELOCITIES, RESULTS = DOUBT + 1, SETS = {stages.rows},
  CAP = {CAP}, CUTS = {most_cuts(len(velocities))}, ATTEMPTS = {ATTEMPTS} }};
#define EDGE {EDGE}
#define CLOSE {CLOSE}
#define NEAR {NEAR}
#define STILL {STILL}
#define NEVER {NEVER}
#define NOTHING {NOTHING}
#define RESIDUAL {RESIDUAL}
#define FITTING {FITTING}
static const int velocity[] = {{{", ".join(map(str, velocities or (0,)))}}};"""


def rare_results(results: dict[str, list[Node]]) -> list[Node]:
    """Return the results of a pass in the order of o."""
    return [node for kind in (*STATE, "jump", "doubt") for node in results[kind]]


def rare_roots(stages: Stages) -> list[Node]:
    """Return all that the passes of a rare substep compute."""
    return [*rare_results(stages.fast), *stages.posed, *rare_results(stages.exact)]


def _constants(stages: Stages) -> dict[Node, int]:
    """Return the places of what follows from parameters alone and is read beside other things."""
    graph, level = stages.graph, Levels(stages.graph, {"p": 0})
    roots = rare_roots(stages)
    order = needed(graph, roots, lambda _: False)
    readers = [node for node in order if level[node] or graph.is_boolean(node)]
    read = [*roots, *(a for node in readers for a in graph.arguments(node))]
    chosen = [
        node
        for node in dict.fromkeys(read)
        if not level[node] and not graph.is_boolean(node) and graph.nodes[node].op != "const"
    ]
    return {node: k for k, node in enumerate(chosen)}


def _leaf(kind: str, index: int) -> str:
    return "h" if kind == "h" else f"{kind}[{index}]"


def _constants_function(graph: Graph, slots: dict[Node, int]) -> str:
    name = leaf_namer(graph, _leaf, lambda node: f"v{node}")
    body = statements(graph, needed(graph, slots, lambda _: False), name, "const double ")
    body += [f"c[{k}] = {name(node)};" for node, k in slots.items()]
    return f"""static APART void constants(const double *restrict p, double *restrict c) {{
  {indented(body, 2)}
}}"""


def _exact(stages: Stages, slots: dict[Node, int]) -> list[str]:
    """Return the statements of the exact pass, between whose halves forces are looked for."""
    posed = _lines(stages, stages.posed, slots, "posed")
    known = frozenset(needed(stages.graph, stages.posed, slots.__contains__))
    after = _lines(stages, rare_results(stages.exact), slots, "o", known)
    if not stages.rows:
        return ["const double failed[] = {0.0};", "(void)failed;", *after]
    return [
        "double posed[POSED], w[SETS], force[SETS];",
        *posed,
        "const double failed[] = {project(posed, w, force)};",
        *after,
    ]


def _lines(
    stages: Stages,
    roots: list[Node],
    slots: dict[Node, int],
    target: str = "o",
    known: Collection[Node] = frozenset(),
) -> list[str]:
    """Return the statements that compute roots, of which some operations are known."""
    graph = stages.graph
    other = leaf_namer(graph, _leaf, lambda node: f"v{node}")

    def name(node: Node) -> str:
        return f"c[{slots[node]}]" if node in slots else other(node)

    order = [n for n in needed(graph, roots, slots.__contains__) if n not in known]
    body = statements(graph, order, name, "const double ")
    return body + [f"{target}[{k}] = {as_number(graph, n, name)};" for k, n in enumerate(roots)]


def _pass_function(title: str, attribute: str, body: list[str]) -> str:
    return f"""static {attribute} void {title}(const double *restrict c, double h,
    const double *restrict m, const double *restrict x, const double *restrict d,
    double *restrict o) {{
  {indented(body, 2)}
}}"""
