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
// What a part of length t gives, and its tangents along parameters, start and length, in lanes.
static APART void part_tangents(int lanes, const double *p, const double *c, double t,
    const double *m, const double *x, const double *d, const double *sp, const double *sm,
    const double *sx, const double *sd, const double *st, double *o, double *o_t) {
  double guess[NX], moved[NX * L];
  memcpy(guess, d, sizeof(guess));
  memcpy(moved, sd, sizeof(moved));
  fast_pass(c, t, m, x, guess, o);
  if (o[DOUBT] == 0.0) exact_tangents(lanes, p, t, m, x, guess, sp, sm, sx, moved, st, o_t);
  for (int pass = 0; pass < CAP && o[DOUBT] != 0.0; ++pass) {
    exact_pass(c, t, m, x, guess, o);
    exact_tangents(lanes, p, t, m, x, guess, sp, sm, sx, moved, st, o_t);
    if (o[DOUBT] == 0.0) break;
    memcpy(guess, o + NX, sizeof(guess));
    memcpy(moved, o_t + NX * L, sizeof(moved));
  }
}

// At the end of a part of length t: its flows join the sum of the substep h, its increments and how
// they jump, become those of the whole.
static inline void part_ends(double t, double h, const double *moved, const double *end,
    double *o_t, double *sum) {
  for (int k = 0; k < FLOWS * L; ++k)
    sum[k] += (o_t[FLOW * L + k] * t + end[FLOW + k / L] * moved[k % L]) / h;
  for (int k = NX * L; k < 2 * NX * L; ++k)
    o_t[k] = (o_t[k] - end[k / L] * moved[k % L] / t) * (h / t);
  for (int k = JUMP * L; k < DOUBT * L; ++k)
    o_t[k] = (o_t[k] - end[k / L] * moved[k % L] / t) * (h / t);
}

// T: tangents of x, d, r, q, m before the substep.
static APART int located_tangents(const double *p, const double *c, double h, const double *m,
    const double *x, const double *d, double *o, const double *sp, const double *T, double *o_t,
    double *tries) {
  static const double none[(NX + MEMORY + SEEDED) * L];
  double at[NX], last[NX], guess[NX], at_t[NX * L], last_t[NX * L], guess_t[NX * L];
  double end[RESULTS], by[DOUBT * L], sum[FLOWS * L + 1], moved[L] = {0.0}, gone[L] = {0.0};
  double left = h;
  const double *sm = T + JUMP * L, one[L] = {1.0};
  cuts made;
  const int failed = located(c, h, m, x, d, 0, o, &made);
  *tries += made.tries;
  memcpy(at, x, sizeof(at));
  memcpy(last, d, sizeof(last));
  memcpy(at_t, T, sizeof(at_t));
  memcpy(last_t, T + NX * L, sizeof(last_t));
  memset(sum, 0, sizeof(sum));
  for (int n = 0; n < made.count; ++n) {
    const int which = made.which[n], turns = velocity[which];
    const double t = made.length[n];
    for (int k = 0; k < NX; ++k) guess[k] = last[k] * (t / h);
    for (int k = 0; k < NX * L; ++k) guess_t[k] = last_t[k] * (t / h);
    part_tangents(L, p, c, t, m, at, guess, sp, sm, at_t, guess_t, none, end, o_t);
    // Along the length in a lane of its own, which says how far it moves in every other.
    for (int k = 0; k < NX; ++k) guess_t[k * L] = last[k] / h;
    part_tangents(1, p, c, t, m, at, guess, none, none, none, guess_t, one, end, by);
    for (int l = 0; l < L; ++l) moved[l] = -o_t[turns * L + l] / by[turns * L];
    for (int k = 0; k < DOUBT; ++k)
      for (int l = 0; l < L; ++l) o_t[k * L + l] += by[k * L] * moved[l];
    part_ends(t, h, moved, end, o_t, sum);
    rest(at, which, t, h, end, last);
    memcpy(at, end, sizeof(at));
    memcpy(at_t, o_t, sizeof(at_t));
    memcpy(last_t, o_t + NX * L, sizeof(last_t));
    for (int l = 0; l < L; ++l) {
      double *turned = last_t + turns * L + l;
      at_t[turns * L + l] = 0.0;
      const double jump = copysign(1.0, last[turns]) * o_t[(JUMP + which) * L + l];
      *turned = last[turns] == 0.0 ? 0.0 : *turned - jump;
      gone[l] -= moved[l];
    }
    left -= t;
  }
  // The last part is what is left, and with it its tangents.
  for (int k = 0; k < NX; ++k) guess[k] = last[k] * (left / h);
  for (int k = 0; k < NX * L; ++k)
    guess_t[k] = last_t[k] * (left / h) + last[k / L] / h * gone[k % L];
  part_tangents(L, p, c, left, m, at, guess, sp, sm, at_t, guess_t, gone, end, o_t);
  if (made.count) {
    part_ends(left, h, gone, end, o_t, sum);
    memcpy(o_t + FLOW * L, sum, FLOWS * L * sizeof(double));
  }
  return failed;
}
"""


def exact_tangents(stages: Stages) -> str:
    """Return the C functions of the rare pass with tangents, and of the substep made of it."""
    graph = stages.graph
    lane = stages.varies(SEEDS)
    roots = [node for kind in (*STATE, "jump") for node in stages.exact_t[kind]]
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
static APART void exact_tangents(int lanes, const double *restrict p, double h,
    const double *restrict m, const double *restrict x, const double *restrict d,
    const double *restrict sp, const double *restrict sm, const double *restrict sx,
    const double *restrict sd, const double *restrict sh, double *restrict o) {{
  {indented(values, 2)}
  #pragma omp simd
  for (int l = 0; l < lanes; ++l) {{
    {indented(inner, 4)}
  }}
}}
{_LOCATED}"""


def located_statements(layout: Layout) -> list[str]:
    """Return the statements that repeat or cut a substep and take over what comes out."""
    nx, nm, q, m = (layout.length["x"], layout.length["m"], layout.start["q"], layout.start["m"])
    names = [f"{kind}{k}" for kind in STATE for k in range(layout.length[kind])]
    return [
        "double o[RESULTS], o_t[DOUBT * L];",
        f"const double xs[] = {{{', '.join(f'x{k}' for k in range(nx))}}};",
        f"const double ms[] = {{{', '.join(f'm{k}' for k in range(nm)) or '0.0'}}};",
        f"const double ds[] = {{{', '.join(f'd{k}' for k in range(nx))}}};",
        "failures += located_tangents(p, c, h, ms, xs, ds, o, seeds, T, o_t, &tries);",
        "repeats += 1.0;",
        *(f"{name} {'+=' if k >= q else '='} o[{k}];" for k, name in enumerate(names)),
        f"for (int k = 0; k < {q} * L; ++k) T[k] = o_t[k];",
        f"for (int k = {q} * L; k < {m} * L; ++k) T[k] += o_t[k];",
    ]
