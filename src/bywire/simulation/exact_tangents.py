"""C text of the rare substep with its tangents: repeated until it settles, cut where it turns.

Where a substep is cut, the instant moves with what is differentiated: t follows from v(t) = 0, and
the parts before and behind get longer and shorter with it. That is how the jump of the acceleration
reaches derivatives (saltation), together with all that is computed on both sides of it.
"""

from __future__ import annotations

from bywire.simulation.emission import indented, leaf_count, leaf_namer, statements
from bywire.simulation.expressions import as_number, needed
from bywire.simulation.layout import Layout
from bywire.simulation.stages import SEEDS, STATE, Stages

_LOCATED = """
// What a part of length t gives, and its tangents along parameters, start and length.
static RARE void part_tangents(const double *p, const double *c, double t, const double *m,
    const double *x, const double *d, int twice, const double *sp, const double *sm,
    const double *sx, const double *sd, const double *st, double *o, double *o_t) {
  double guess[NX], moved[NX * L];
  memcpy(guess, d, sizeof(guess));
  memcpy(moved, sd, sizeof(moved));
  for (int times = 0; times <= twice; ++times) {
    fast_pass(c, t, m, x, guess, o);
    if (o[DOUBT] == 0.0) exact_tangents(p, t, m, x, guess, sp, sm, sx, moved, st, o_t);
    for (int pass = 0; pass < CAP && o[DOUBT] != 0.0; ++pass) {
      exact_pass(c, t, m, x, guess, o);
      exact_tangents(p, t, m, x, guess, sp, sm, sx, moved, st, o_t);
      if (o[DOUBT] == 0.0) break;
      memcpy(guess, o + NX, sizeof(guess));
      memcpy(moved, o_t + NX * L, sizeof(moved));
    }
    memcpy(guess, o + NX, sizeof(guess));
    memcpy(moved, o_t + NX * L, sizeof(moved));
  }
}

// T: tangents of x, d, r, q, m before the substep.
static RARE int located_tangents(const double *p, const double *c, double h, const double *m,
    const double *x, const double *d, double *o, const double *sp, const double *T, double *o_t) {
  static const double none[(NX + MEMORY + SEEDED) * L];
  double at[NX], last[NX], guess[NX], at_t[NX * L], last_t[NX * L], guess_t[NX * L], ones[L];
  double end[RESULTS], by[JUMP * L], sum[FLOWS * L + 1], gone[L] = {0.0}, left = h;
  const double *sm = T + JUMP * L;
  cuts made;
  const int failed = located(c, h, m, x, d, o, &made);
  memcpy(at, x, sizeof(at));
  memcpy(last, d, sizeof(last));
  memcpy(at_t, T, sizeof(at_t));
  memcpy(last_t, T + NX * L, sizeof(last_t));
  memset(sum, 0, sizeof(sum));
  for (int l = 0; l < L; ++l) ones[l] = 1.0;
  for (int n = 0; n <= made.count; ++n) {
    const int final = n == made.count, turns = final ? 0 : made.state[n];
    const double t = final ? left : made.length[n];
    double moved[L];
    for (int k = 0; k < NX; ++k) guess[k] = last[k] * (t / h);
    for (int k = 0; k < NX * L; ++k) guess_t[k] = last_t[k] * (t / h);
    part_tangents(p, c, t, m, at, guess, final && n, sp, sm, at_t, guess_t, none, end, o_t);
    if (!made.count) break;
    for (int k = 0; k < NX * L; ++k) guess_t[k] = last[k / L] / h;
    part_tangents(p, c, t, m, at, guess, final && n, none, none, none, guess_t, ones, end, by);
    for (int l = 0; l < L; ++l)
      moved[l] = final ? -gone[l] : -o_t[turns * L + l] / by[turns * L + l];
    for (int k = 0; k < JUMP * L; ++k) o_t[k] += by[k] * moved[k % L];
    for (int k = 0; k < FLOWS * L; ++k)
      sum[k] += (o_t[FLOW * L + k] * t + end[FLOW + k / L] * moved[k % L]) / h;
    for (int k = 0; k < NX * L; ++k)
      o_t[NX * L + k] = (o_t[NX * L + k] - end[NX + k / L] * moved[k % L] / t) * (h / t);
    if (final) {
      memcpy(o_t + FLOW * L, sum, FLOWS * L * sizeof(double));
      break;
    }
    memcpy(at_t, o_t, sizeof(at_t));
    memcpy(last_t, o_t + NX * L, sizeof(last_t));
    for (int k = 0; k < NX; ++k) last[k] = end[NX + k] * (h / t);
    rest(at, turns, end, last);
    memcpy(at, end, sizeof(at));
    for (int l = 0; l < L; ++l) {
      at_t[turns * L + l] = last_t[turns * L + l] = 0.0;
      gone[l] += moved[l];
    }
    left -= t;
  }
  return failed;
}
"""


def exact_tangents(stages: Stages) -> str:
    """Return the C functions of the rare pass with tangents, and of the substep made of it."""
    graph = stages.graph
    lane = stages.varies(SEEDS)
    roots = [node for kind in STATE for node in stages.exact_t[kind]]
    order = needed(graph, roots, lambda _: False)

    def leaf(kind: str, index: int) -> str:
        if kind in SEEDS:
            return f"{kind}[{index} * L + l]"
        return "h" if kind == "h" else f"{kind}[{index}]"

    name = leaf_namer(graph, leaf, lambda node: f"v{node}")
    values = statements(graph, [n for n in order if not lane[n]], name, "const double ")
    inner = statements(graph, [n for n in order if lane[n]], name, "const double ")
    inner += [f"o[{k} * L + l] = {as_number(graph, n, name)};" for k, n in enumerate(roots)]
    return f"""enum {{ MEMORY = {len(stages.ticks[0])}, SEEDED = {leaf_count(stages, "sp")} }};
static RARE void exact_tangents(const double *p, double h, const double *m, const double *x,
    const double *d, const double *sp, const double *sm, const double *sx, const double *sd,
    const double *sh, double *o) {{
  {indented(values, 2)}
  for (int l = 0; l < L; ++l) {{
    {indented(inner, 4)}
  }}
}}
{_LOCATED}"""


def located_statements(layout: Layout) -> list[str]:
    """Return the statements that repeat or cut a substep and take over what comes out."""
    nx, nm, q, m = (layout.length["x"], layout.length["m"], layout.start["q"], layout.start["m"])
    names = [f"{kind}{k}" for kind in STATE for k in range(layout.length[kind])]
    return [
        "double o[RESULTS], o_t[JUMP * L];",
        f"const double xs[] = {{{', '.join(f'x{k}' for k in range(nx))}}};",
        f"const double ms[] = {{{', '.join(f'm{k}' for k in range(nm)) or '0.0'}}};",
        f"const double ds[] = {{{', '.join(f'd{k}' for k in range(nx))}}};",
        "failures += located_tangents(p, c, h, ms, xs, ds, o, seeds, T, o_t);",
        "repeats += 1.0;",
        *(f"{name} {'+=' if k >= q else '='} o[{k}];" for k, name in enumerate(names)),
        f"for (int k = 0; k < {q} * L; ++k) T[k] = o_t[k];",
        f"for (int k = {q} * L; k < {m} * L; ++k) T[k] += o_t[k];",
    ]
