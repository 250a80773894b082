"""C text of what is rare: a substep that one ordinary pass does not serve.

Its functions stand alone and compute for any length of a step what does not follow from parameters
alone. A substep in which a velocity with dry friction changes its sign is cut where it passes zero:
friction jumps there, and with it the acceleration. Within each part every velocity keeps its sign;
what has come to zero rests or moves on in the next part, as its bounds decide.
"""

from __future__ import annotations

from bywire.simulation.emission import indented, leaf_namer, statements
from bywire.simulation.expressions import as_number, needed
from bywire.simulation.graph import Graph
from bywire.simulation.layout import ATTEMPTS, CAP, CLOSE, EDGE, STILL, most_cuts
from bywire.simulation.operation import Node
from bywire.simulation.quadrature import Levels
from bywire.simulation.stages import STATE, Stages

APART = "__attribute__((noinline))"  # but fast: what is cold is compiled to be short

# A pass gives o: x, d, r, q, jump, doubt. Where the ordinary one is in doubt, the exact one is
# repeated from its own increment until its contact sets reproduce.
_SETTLE = """
static APART int settle(const double *c, double h, const double *m, const double *x, double *d,
    double *o) {
  fast_pass(c, h, m, x, d, o);
  if (o[DOUBT] == 0.0) return 0;
  for (int pass = 0; pass < CAP; ++pass) {
    exact_pass(c, h, m, x, d, o);
    if (o[DOUBT] == 0.0) return 0;
    memcpy(d, o + NX, NX * sizeof(double));
  }
  return 1;
}
"""

_CUT = """
// Where a substep was cut: length of each part but the last, and which state is zero at its end.
typedef struct { int count, state[CUTS]; double length[CUTS]; } cuts;

// The velocity that is the first to change its sign within a part, -1 if none does, and when.
static inline int first_turn(const double *x, const double *o, double *share) {
  int first = -1;
  *share = 1.0;
  for (int k = 0; k < VELOCITIES; ++k) {
    const double v = x[velocity[k]], w = o[velocity[k]];
    if (v * w * o[JUMP + k] < 0.0 && v / (v - w) <= *share) {
      *share = v / (v - w);
      first = velocity[k];
    }
  }
  return first;
}

// A part of length t; last: half increments of a whole substep h, from which it is predicted.
static int part(const double *c, double h, double t, const double *m, const double *x,
    const double *last, double *d, double *o) {
  for (int k = 0; k < NX; ++k) d[k] = last[k] * (t / h);
  return settle(c, t, m, x, d, o);
}

// Where a velocity that goes from v to w within a part of length t is zero, on the parabola that
// has the mean slope before over an earlier length h, too.
static inline double zero_of(double v, double w, double t, double before, double h) {
  const double mean = (w - v) / t, linear = -v / mean;
  const double bend = before != 0.0 ? 2.0 * (mean - before) / (t + h) : 0.0;
  const double slope = mean + bend * (linear - 0.5 * t);
  const double zero = linear - 0.5 * bend * linear * (linear - t) / slope;
  return zero > 0.0 && zero < t ? zero : linear;
}

// Shorten a part of length *t to the first instant at which a velocity is zero: by the parabola
// through three lengths, within what is known to lie before and behind. Before, o is that of *t in
// the velocities, behind in everything. Return which velocity it is; failed: that part did not
// settle.
static APART int locate(const double *c, double h, double *t, const double *m, const double *x,
    const double *last, double *o, int *failed) {
  double d[NX], share, low = 0.0, high = *t;
  const double first = EDGE * *t, final = (1.0 - EDGE) * *t;
  int turns = first_turn(x, o, &share);
  double P = 0.0, at_P = x[turns], Q = *t, at_Q = o[turns];
  double N = zero_of(at_P, at_Q, Q, 2.0 * last[turns] / h, h);
  double close = CLOSE * fabs(at_P - at_Q);
  for (int n = 1;; ++n) { // what is left of the last attempt is of the length that is returned
    N = fmin(fmax(N, first), final);
    *failed = part(c, h, N, m, x, last, d, o);
    const int other = first_turn(x, o, &share);
    if (other >= 0 && other != turns && n < ATTEMPTS) { // another one is earlier
      turns = other;
      low = 0.0, high = N;
      P = 0.0, at_P = x[turns], Q = N, at_Q = o[turns], N = N * share;
      close = CLOSE * fabs(at_P - at_Q);
      continue;
    }
    const double at_N = o[turns];
    if (fabs(at_N) <= close || N <= first || N >= final || N == P || N == Q || n == ATTEMPTS) break;
    if (at_N * x[turns] > 0.0) low = N; else high = N;
    const double slope = (at_N - at_P) / (N - P) + (at_N - at_Q) / (N - Q)
        - (at_Q - at_P) / (Q - P);
    const double next = N - at_N / slope;
    if (fabs(P - next) > fabs(Q - next)) P = N, at_P = at_N; else Q = N, at_Q = at_N;
    N = next > low && next < high ? next : 0.5 * (low + high);
  }
  *t = N;
  return turns;
}

// At the end of a part that was cut, from speeds x: what is zero there, with its increment.
static inline void rest(const double *x, int turns, double *at, double *last) {
  at[turns] = last[turns] = 0.0;
  for (int k = 0; k < VELOCITIES; ++k) {
    const int v = velocity[k]; // bodies that are alike stop at once
    if (fabs(at[v]) < STILL * fabs(x[v])) at[v] = last[v] = 0.0;
  }
}

// A substep, repeated until it settles, and cut where velocities pass zero. Behind a cut
// accelerations differ from those that the midpoint was predicted from: the last part is computed
// twice.
static APART int located(const double *c, double h, const double *m, const double *x,
    const double *d, double *o, cuts *made) {
  double at[NX], last[NX], guess[NX], sum[FLOWS + 1], left = h, share;
  int failed = 0, before = 0;
  memcpy(at, x, sizeof(at));
  memcpy(last, d, sizeof(last));
  memset(sum, 0, sizeof(sum));
  for (made->count = 0;; ++made->count) {
    failed = part(c, h, left, m, at, last, guess, o);
    if (made->count) {
      memcpy(guess, o + NX, sizeof(guess));
      failed = settle(c, left, m, at, guess, o);
    }
    if (first_turn(at, o, &share) < 0) break;
    if (made->count == CUTS) { // there is no end to it
      for (int k = 0; k < VELOCITIES; ++k)
        if (at[velocity[k]] * o[velocity[k]] * o[JUMP + k] < 0.0) o[velocity[k]] = 0.0;
      failed = 1;
      break;
    }
    double t = left;
    const int turns = locate(c, h, &t, m, at, last, o, &failed);
    before |= failed;
    for (int k = 0; k < NX; ++k) last[k] = o[NX + k] * (h / t);
    rest(at, turns, o, last);
    memcpy(at, o, sizeof(at));
    for (int k = 0; k < FLOWS; ++k) sum[k] += o[FLOW + k] * (t / h);
    made->state[made->count] = turns;
    made->length[made->count] = t;
    left -= t;
  }
  if (made->count) {
    for (int k = 0; k < NX; ++k) o[NX + k] *= h / left;
    for (int k = 0; k < FLOWS; ++k) o[FLOW + k] = sum[k] + o[FLOW + k] * (left / h);
  }
  return failed | before;
}
"""


def rare_substep(stages: Stages) -> str:
    """Return the C functions of a substep that is repeated or cut.

    ``constants(p, c)`` fills c, shape (CONSTANTS,), with what they read of the parameters p.
    """
    velocities = stages.velocities
    nx, nr, nq = (len(stages.exact[kind]) for kind in ("x", "r", "q"))
    slots = _constants(stages)
    return f"""
#if defined(QUICK) && !defined(__clang__)
#define RARE __attribute__((noinline, optimize("O0")))
#else
#define RARE __attribute__((noinline, cold))
#endif
#define APART {APART}
enum {{ NX = {nx}, FLOW = {2 * nx + nr}, FLOWS = {nq}, VELOCITIES = {len(velocities)},
  JUMP = FLOW + FLOWS, DOUBT = JUMP + VELOCITIES, RESULTS = DOUBT + 1, CONSTANTS = {len(slots)},
  CAP = {CAP}, CUTS = {most_cuts(len(velocities))}, ATTEMPTS = {ATTEMPTS} }};
#define EDGE {EDGE}
#define CLOSE {CLOSE}
#define STILL {STILL}
static const int velocity[] = {{{", ".join(map(str, velocities or (0,)))}}};
{_constants_function(stages.graph, slots)}
{_pass_function(stages, stages.fast, slots, "fast_pass", APART)}
{_pass_function(stages, stages.exact, slots, "exact_pass", "RARE")}
{_SETTLE}{_CUT}"""


def _roots(results: dict[str, list[Node]]) -> list[Node]:
    return [node for kind in (*STATE, "jump", "doubt") for node in results[kind]]


def _constants(stages: Stages) -> dict[Node, int]:
    """Return the places of what follows from parameters alone and is read beside other things."""
    graph, level = stages.graph, Levels(stages.graph, {"p": 0})
    roots = [*_roots(stages.fast), *_roots(stages.exact)]
    order = needed(graph, roots, lambda _: False)
    readers = [node for node in order if level[node] or graph.is_boolean(node)]
    read = [*roots, *(a for node in readers for a in graph.arguments(node))]
    chosen = [
        node for node in dict.fromkeys(read)
        if not level[node] and not graph.is_boolean(node) and graph.nodes[node].op != "const"
    ]  # fmt: skip
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


def _pass_function(
    stages: Stages,
    results: dict[str, list[Node]],
    slots: dict[Node, int],
    title: str,
    attribute: str,
) -> str:
    graph, roots = stages.graph, _roots(results)
    other = leaf_namer(graph, _leaf, lambda node: f"v{node}")

    def name(node: Node) -> str:
        return f"c[{slots[node]}]" if node in slots else other(node)

    body = statements(graph, needed(graph, roots, slots.__contains__), name, "const double ")
    body += [f"o[{k}] = {as_number(graph, node, name)};" for k, node in enumerate(roots)]
    return f"""static {attribute} void {title}(const double *restrict c, double h,
    const double *restrict m, const double *restrict x, const double *restrict d,
    double *restrict o) {{
  {indented(body, 2)}
}}"""
