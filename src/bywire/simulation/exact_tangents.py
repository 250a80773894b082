"""C text of the rare, exact pass with its tangents, and of its repetition until it settles."""

from __future__ import annotations

from bywire.simulation.emission import indented, leaf_namer, statements
from bywire.simulation.expressions import as_number, needed
from bywire.simulation.layout import CAP, Layout
from bywire.simulation.stages import SEEDS, STATE, Stages


def exact_tangents(stages: Stages) -> str:
    """Return the C functions of the rare pass with tangents, and of its repetition."""
    graph = stages.graph
    lane = stages.varies(SEEDS)
    roots = [node for kind in STATE for node in stages.exact_t[kind]]
    order = needed(graph, roots, lambda _: False)
    sizes = [len(stages.exact[kind]) for kind in STATE]
    nx = sizes[0]

    def leaf(kind: str, index: int) -> str:
        if kind in SEEDS:
            return f"{kind}[{index} * L + l]"
        return "h" if kind == "h" else f"{kind}[{index}]"

    name = leaf_namer(graph, leaf, lambda node: f"v{node}")
    values = statements(graph, [n for n in order if not lane[n]], name, "const double ")
    inner = statements(graph, [n for n in order if lane[n]], name, "const double ")
    inner += [f"o[{k} * L + l] = {as_number(graph, n, name)};" for k, n in enumerate(roots)]
    return f"""static __attribute__((noinline, cold)) void exact_tangents(const double *p, double h,
    const double *m, const double *x, const double *d, const double *sp, const double *sm,
    const double *sx, const double *sd, double *o) {{
  {indented(values, 2)}
  for (int l = 0; l < L; ++l) {{
    {indented(inner, 4)}
  }}
}}

static __attribute__((noinline, cold)) int settle_tangents(const double *p, double h,
    const double *m, const double *x, double *d, double *o, const double *sp, double *T,
    double *o_t) {{
  double sd[{nx} * L];
  memcpy(sd, T + {nx} * L, sizeof(sd));
  for (int pass = 0; pass < {CAP}; ++pass) {{
    exact_pass(p, h, m, x, d, o);
    exact_tangents(p, h, m, x, d, sp, T + {sum(sizes)} * L, T, sd, o_t);
    if (o[{sum(sizes)}] == 0.0) return 0;
    memcpy(d, o + {nx}, {nx} * sizeof(double));
    memcpy(sd, o_t + {nx} * L, sizeof(sd));
  }}
  return 1;
}}
"""


def settle_statements(layout: Layout, size: int) -> list[str]:
    """Return the statements that repeat a substep and take over what comes out.

    Parameters
    ----------
    layout
        Of the state vector.
    size
        Results of a pass, its flag included.
    """
    nx, nm, q, m = (layout.length["x"], layout.length["m"], layout.start["q"], layout.start["m"])
    names = [f"{kind}{k}" for kind in STATE for k in range(layout.length[kind])]
    return [
        f"double o[{size}], o_t[{size} * L];",
        f"const double xs[] = {{{', '.join(f'x{k}' for k in range(nx))}}};",
        f"const double ms[] = {{{', '.join(f'm{k}' for k in range(nm)) or '0.0'}}};",
        f"double ds[] = {{{', '.join(f'd{k}' for k in range(nx))}}};",
        "failures += settle_tangents(p, h, ms, xs, ds, o, seeds, T, o_t);",
        "repeats += 1.0;",
        *(f"{name} {'+=' if k >= q else '='} o[{k}];" for k, name in enumerate(names)),
        f"for (int k = 0; k < {q} * L; ++k) T[k] = o_t[k];",
        f"for (int k = {q} * L; k < {m} * L; ++k) T[k] += o_t[k];",
    ]
