"""Lanes whose substep one ordinary pass does not serve, beside others that it does.

They raise a flag, and are settled one by one. The other lanes' results and integrands are computed
after that, for all lanes alike; what the settled ones have instead is then put in its place.
"""

from __future__ import annotations

from bywire.simulation.emission import indented
from bywire.simulation.emit_rare import rare_roots
from bywire.simulation.expressions import VECTOR_C, condition
from bywire.simulation.lane_statements import Lanes
from bywire.simulation.stages import STATE


def repeated_lanes(t: Lanes) -> list[str]:
    """Return, in one piece, what becomes of lanes that raise their flag."""
    flagged, is_rare, settled = t.marked("flagged", "is_rare", "settled")
    return [
        f"const B {flagged} = {condition(t.graph, t.flag, t.name, VECTOR_C)};\n"
        f"      const int {is_rare} = ANY({flagged});\n"
        f"      V new{t.mark}[{len(t.results)}], before{t.mark}[{max(len(t.products), 1)}];\n"
        f"      B {settled};\n"
        f"      if (__builtin_expect({is_rare}, 0)) {{\n"
        f"        {indented(_handed_over(t), 8)}\n"
        "      }",
    ]


def repeated_results(t: Lanes) -> list[str]:
    """Return the statements that take over the results where lanes were settled.

    Of these, the integrands of the pass are taken from the sums again.
    """
    new, before, settled = t.marked("new", "before", "settled")
    return [
        *(f"{name} = {new}[{k}];" for k, name in enumerate(t.marked(*t.results))),
        *(f"{s} = SELECT({settled}, {before}[{k}], {s});" for k, s in enumerate(_sums(t))),
        f"(void){before}; (void){settled};",
    ]


def settling_function(t: Lanes) -> str:
    """Return the C function that settles the flagged lanes one by one.

    It works on copies: a vector whose lanes are addressed would live in memory everywhere. Of a
    lane that is not in doubt the velocities of the ordinary pass are known.
    """
    stages, nx = t.stages, t.layout.length["x"]
    targets = {name: k for k, name in enumerate(t.results)}
    places = [f"{kind}{k}" for kind in STATE for k in range(t.layout.length[kind])]
    given = [f"ms[{k}] = m[{j}][l];" for j, k in enumerate(_memory(t))]
    given += [f"o[{v}] = n[{targets[f'x{v}']}][l];" for v in stages.velocities]
    taken = [
        f"n[{k}] = SELECT(ONLY(l), SET(o[{places.index(name)}]), n[{k}]);"
        for name, k in targets.items()
    ]
    added = [f"q[{j}][l] += o[{places.index(name)}];" for j, name in enumerate(_flows(t))]
    return f"""static RARE void settle_lanes(B flagged, B doubtful, const double *c, double h,
    const V *m, const V *old, V *n, V *q, V *counters, int64_t *tried) {{
  double ms[{max(t.layout.length["m"], 1)}], xs[{nx}], ds[{nx}], o[RESULTS];
  EACH_LANE(l, flagged) {{
    for (int k = 0; k < {nx}; ++k) {{ xs[k] = old[k][l]; ds[k] = old[{nx} + k][l]; }}
    {indented(given, 4)}
    cuts made;
    counters[0][l] += located(c + l * (CONSTANTS + 1), h, ms, xs, ds, !LANE(doubtful, l), o, &made);
    counters[1][l] += 1.0;
    counters[2][l] += made.tries;
    *tried += made.tries;
    {indented(taken + added, 4)}
  }}
  (void)m; (void)q;
}}
"""


def _handed_over(t: Lanes) -> list[str]:
    """Return the statements that hand a substep with flagged lanes to ``settle_lanes``."""
    old = t.marked(*(f"{kind}{k}" for kind in ("x", "d") for k in range(t.layout.length[kind])))
    flow = t.marked(*_flows(t))
    memory = t.marked(*(f"m{k}" for k in _memory(t)))
    failures, repeats, tries = t.marked("failures", "repeats", "tries")
    flagged, c = t.marked("flagged", "c")
    doubtful = condition(t.graph, t.stages.fast["doubtful"][0], t.name, VECTOR_C)
    nothing = ["SET(0.0)"]
    arrays = {"old": old, "memory": memory or nothing, "flow": flow or nothing}
    new, before, settled = t.marked("new", "before", "settled")
    return [
        *t.finished(is_summed=False),
        *(f"{new}[{k}] = {t.number(n)};" for k, n in enumerate(t.results.values())),
        f"{settled} = {flagged};",
        *(f"{before}[{k}] = {name};" for k, name in enumerate(_sums(t))),
        *(f"V {name}[] = {{{', '.join(values)}}};" for name, values in arrays.items()),
        f"V count[] = {{{failures}, {repeats}, {tries}}};",
        f"settle_lanes({flagged}, {doubtful}, {c}, h_, memory, old, {new}, flow, count, &tried);",
        *(f"{name} = flow[{k}];" for k, name in enumerate(flow)),
        f"{failures} = count[0];",
        f"{repeats} = count[1];",
        f"{tries} = count[2];",
    ]


def _memory(t: Lanes) -> list[int]:
    """Return the entries of the memory that a rare pass reads."""
    read = t.graph.read_by(rare_roots(t.stages))
    return [k for k in range(t.layout.length["m"]) if t.graph.leaf("m", k) in read]


def _flows(t: Lanes) -> list[str]:
    """Return the integrals that signals read; the others stay as they are."""
    read = t.graph.read_by(t.stages.output)
    return [f"q{k}" for k in range(t.layout.length["q"]) if t.graph.leaf("q", k) in read]


def _sums(t: Lanes) -> list[str]:
    return t.marked(*(f"s{k}" for k in range(len(t.products))))
