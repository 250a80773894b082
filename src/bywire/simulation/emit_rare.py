"""C code of rare substeps, which need more than one ordinary pass.

The functions are self-contained. For any step length, they compute all values except those that
depend only on parameters. If a velocity with dry friction changes sign, the functions cut the
substep at the zero crossing, where friction and acceleration jump. No velocity changes sign within
a part. In the next part, a velocity that has reached zero stays at zero or changes, depending on
its bounds.
"""

from __future__ import annotations

from collections.abc import Collection

from bywire.simulation.expressions import as_number, needed
from bywire.simulation.graph import Graph, Node
from bywire.simulation.quadrature import Levels
from bywire.simulation.schedule import ATTEMPTS, CAP, CLOSE, EDGE, NEAR, STILL, most_cuts
from bywire.simulation.scheme import FITTING, NEVER, NOTHING, RESIDUAL
from bywire.simulation.stages import STATE, Stages, indented, leaf_namer, statements

# The method of ``scheme.project_exact``, which explains it, but as a loop with a tenth of the code.
PROJECTION = """
// Solve S w = b for the moving rows, by elimination on the diagonal. Rows at rest get w = 0.
static inline void with_signs(const double *S, const double *c, const double *low,
    const double *high, const int *sign, double *w) {
  double A[SETS][SETS], b[SETS], inverse[SETS];
  int at[SETS], n = 0;
  for (int k = 0; k < SETS; ++k) {
    w[k] = 0.0;
    if (sign[k]) at[n++] = k;
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) A[i][j] = S[at[i] * SETS + at[j]];
    b[i] = c[at[i]] + (sign[at[i]] > 0 ? low[at[i]] : high[at[i]]);
  }
  for (int k = 0; k < n; ++k) {
    inverse[k] = 1.0 / A[k][k];
    for (int i = k + 1; i < n; ++i) {
      const double factor = A[i][k] * inverse[k];
      for (int j = k + 1; j < n; ++j) A[i][j] -= factor * A[k][j];
      b[i] -= factor * b[k];
    }
  }
  for (int k = n - 1; k >= 0; --k) {
    double sum = 0.0;
    for (int j = k + 1; j < n; ++j) sum += A[k][j] * w[at[j]];
    w[at[k]] = (b[k] - sum) * inverse[k];
  }
}

// Return by how much velocities violate the conditions, relative to the sums of their rows.
static inline double misfit(const double *S, const double *c, const double *low,
    const double *high, const double *w) {
  double total = 0.0;
  for (int k = 0; k < SETS; ++k) {
    const double inverse = 1.0 / S[k * SETS + k];
    double others = 0.0, parts = fabs(c[k]);
    for (int j = 0; j < SETS; ++j) {
      const double part = j == k ? 0.0 : S[k * SETS + j] * w[j];
      others += part;
      parts += fabs(part);
    }
    const double z = c[k] - others, above = z + low[k], below = z + high[k];
    const double row = ((above > 0.0 ? above : 0.0) + (below < 0.0 ? below : 0.0)) * inverse;
    total += fabs(row - w[k]) / (parts * inverse + 1e-300);
  }
  return total;
}

enum { GUESSES = 4 }; // maximum number of updates of the signs from the other rows' velocities

// Iterate on the signs of the rows, and accept them if they fit. Otherwise, try every combination
// and use the one that fits best. Return whether this fails.
static APART int project(const double *posed, double *w, double *force) {
  const double *S = posed, *c = S + SETS * SETS, *low = c + SETS, *high = low + SETS;
  double best = NEVER, tried[SETS];
  int sign[SETS], k = 0;
  memset(w, 0, SETS * sizeof(double));
  for (int turn = 0; turn < GUESSES && best > FITTING; ++turn) {
    best = 0.0;
    for (int i = 0; i < SETS; ++i) {
      double z = c[i];
      for (int j = 0; j < SETS; ++j) z -= j == i ? 0.0 : S[i * SETS + j] * w[j];
      sign[i] = (z + low[i] > 0.0) - (z + high[i] < 0.0);
      best += !sign[i] && low[i] >= high[i];
    }
    with_signs(S, c, low, high, sign, w);
    best += misfit(S, c, low, high, w);
  }
  if (best <= FITTING) k = -1;
  else {
    best = NEVER;
    memset(w, 0, SETS * sizeof(double));
    memset(sign, 0, sizeof(sign));
  }
  while (k >= 0) {
    with_signs(S, c, low, high, sign, tried);
    double total = misfit(S, c, low, high, tried);
    for (int i = 0; i < SETS; ++i) total += !sign[i] && low[i] >= high[i];
    if (total < best) {
      best = total;
      memcpy(w, tried, sizeof(tried));
    }
    for (k = SETS - 1; k >= 0; --k) { // 0, 1, -1, starting with the last row
      sign[k] = sign[k] ? (sign[k] > 0 ? -1 : 0) : 1;
      if (sign[k]) break;
    }
  }
  const double left = misfit(S, c, low, high, w) * NOTHING;
  for (int i = 0; i < SETS; ++i) w[i] += left;
  for (int i = 0; i < SETS; ++i) {
    double sum = 0.0;
    for (int j = 0; j < SETS; ++j) sum += S[i * SETS + j] * w[j];
    const double held = sum - c[i] > low[i] ? sum - c[i] : low[i];
    force[i] = held < high[i] ? held : high[i];
  }
  return best > RESIDUAL;
}
"""

# A pass returns o: x, d, r, q, jump, doubt. If the ordinary pass is in doubt, the exact pass
# repeats from its own increment until its contact sets no longer change.
CUT = """
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

// Cuts of a substep: length of each part except the last, index of the velocity that is zero at the
// part's end, and number of attempted parts.
typedef struct { int count, which[CUTS], tries; double length[CUTS]; } cuts;

// Return the first velocity to change sign within a part, or -1, and the time as a fraction.
static inline int first_turn(const double *x, const double *o, double *share) {
  int first = -1;
  *share = 1.0;
  for (int k = 0; k < VELOCITIES; ++k) {
    const double v = x[velocity[k]], w = o[velocity[k]];
    if (v * w * o[JUMP + k] < 0.0 && v / (v - w) <= *share) {
      *share = v / (v - w);
      first = k;
    }
  }
  return first;
}

// Compute a part of length t; last: half increments of a whole substep h, for the prediction.
static inline int part(const double *c, double h, double t, const double *m, const double *x,
    const double *last, double *d, double *o) {
  for (int k = 0; k < NX; ++k) d[k] = last[k] * (t / h);
  return settle(c, t, m, x, d, o);
}

// Return the zero of a velocity that changes from v to w within a part of length t. The velocity is
// approximated by a parabola, whose mean slope over the preceding length h is before.
static inline double zero_of(double v, double w, double t, double before, double h) {
  const double mean = (w - v) / t, linear = -v / mean;
  const double bend = before != 0.0 ? 2.0 * (mean - before) / (t + h) : 0.0;
  const double slope = mean + bend * (linear - 0.5 * t);
  const double zero = linear - 0.5 * bend * linear * (linear - t) / slope;
  return zero > 0.0 && zero < t ? zero : linear;
}

// Shorten a part of length *t to the first time at which a velocity is zero. The search uses the
// parabola through three lengths, and stays between known bounds of the zero. On entry, the
// velocities in o belong to *t. On return, all of o belongs to *t. Return the index of the
// velocity, or -1 if only velocities were known and the friction does not jump; failed: the part
// did not settle.
static APART int locate(const double *c, double h, double *t, const double *m, const double *x,
    const double *last, int known, double *o, int *failed, int *tries) {
  double d[NX], share, low = 0.0, high = *t;
  const double first = EDGE * *t, final = (1.0 - EDGE) * *t;
  int which = first_turn(x, o, &share), turns = velocity[which];
  double P = 0.0, at_P = x[turns], Q = *t, at_Q = o[turns];
  double N = zero_of(at_P, at_Q, Q, 2.0 * last[turns] / h, h);
  double change = fabs(at_P - at_Q), before = 0.0, was[RESULTS];
  for (int n = 1;; ++n) { // the last attempt has the returned length
    N = fmin(fmax(N, first), final);
    *failed = part(c, h, N, m, x, last, d, o);
    ++*tries;
    if (known && o[JUMP + which] == 0.0) return -1;
    const int other = VELOCITIES > 1 ? first_turn(x, o, &share) : -1;
    if (other >= 0 && other != which && n < ATTEMPTS) { // another velocity reaches zero earlier
      which = other, turns = velocity[which];
      low = 0.0, high = N;
      P = 0.0, at_P = x[turns], Q = N, at_Q = o[turns], N = N * share;
      change = fabs(at_P - at_Q), before = 0.0;
      continue;
    }
    const double at_N = o[turns];
    if (fabs(at_N) <= CLOSE * change || N <= first || N >= final || N == P || N == Q
        || n == ATTEMPTS) break;
    if (at_N * x[turns] > 0.0) low = N; else high = N;
    const double slope = (at_N - at_P) / (N - P) + (at_N - at_Q) / (N - Q)
        - (at_Q - at_P) / (Q - P);
    const double next = N - at_N / slope;
    const int is_near = fabs(at_N) <= NEAR * change && next > first && next < final;
    if (is_near && before > 0.0) { // continue on the line through two attempts
      const double share = (next - N) / (N - before);
#ifdef TURNS // only for lanes, whose compilers support this pragma
      #pragma omp simd
#endif
      for (int k = 0; k < JUMP; ++k) o[k] += share * (o[k] - was[k]);
      N = next;
      break;
    }
    memcpy(was, o, sizeof(was));
    before = N;
    if (fabs(P - next) > fabs(Q - next)) P = N, at_P = at_N; else Q = N, at_Q = at_N;
    N = next > low && next < high ? next : 0.5 * (low + high);
  }
  *t = N;
  return which;
}

// Return half the increment after a zero, where a is half the increment before the zero. The jump j
// of the friction reduces it. It is zero if friction holds the body.
static inline double turned_back(double a, double j) {
  return copysign(fmax(fabs(a) - j, 0.0), a);
}

// End a part of length t of a cut substep h, from velocities x. Set zero velocities in o, and set
// last, the half increments for the prediction of the next part.
static inline void rest(const double *x, int which, double t, double h, double *o, double *last) {
  for (int k = 0; k < NX; ++k) last[k] = o[NX + k] * (h / t);
  for (int k = 0; k < VELOCITIES; ++k) {
    const int v = velocity[k]; // equal bodies stop at the same time
    if (k != which && fabs(o[v]) >= STILL * fabs(x[v])) continue;
    o[v] = 0.0;
    last[v] = turned_back(last[v], o[JUMP + k] * (h / t));
  }
}

// Compute a substep. Repeat it until it settles, and cut it at zeros of velocities. known: o
// contains the velocities of the whole settled substep from an ordinary pass.
static APART int located(const double *c, double h, const double *m, const double *x,
    const double *d, int known, double *o, cuts *made) {
  double at[NX], last[NX], guess[NX], sum[FLOWS + 1], left = h, share;
  int failed = 0, before = 0;
  memcpy(at, x, sizeof(at));
  memcpy(last, d, sizeof(last));
  memset(sum, 0, sizeof(sum));
  for (int k = 0; k < VELOCITIES; ++k) o[JUMP + k] = known;
  made->tries = 0;
  for (made->count = 0;; known = 0, ++made->count) {
    if (!known) failed = part(c, h, left, m, at, last, guess, o), ++made->tries;
    const int turns = first_turn(at, o, &share) >= 0;
    if (!turns && !known) break;
    if (made->count == CUTS) { // too many cuts
      for (int k = 0; k < VELOCITIES; ++k)
        if (at[velocity[k]] * o[velocity[k]] * o[JUMP + k] < 0.0) o[velocity[k]] = 0.0;
      failed = 1;
      break;
    }
    double t = left;
    const int which = turns ? locate(c, h, &t, m, at, last, known, o, &failed, &made->tries) : -1;
    if (which < 0) { // repeat without known velocities
      --made->count;
      continue;
    }
    before |= failed;
    rest(at, which, t, h, o, last);
    memcpy(at, o, sizeof(at));
    for (int k = 0; k < FLOWS; ++k) sum[k] += o[FLOW + k] * (t / h);
    made->which[made->count] = which;
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


# --- Model-dependent code

_TRIES = 200_000
APART = "__attribute__((noinline))"  # not "cold": compilers optimize cold functions for size


def rare_substep(stages: Stages) -> str:
    """Return the C functions of a substep that is repeated or cut.

    ``constants(p, c)`` fills c, shape (CONSTANTS,), with values that depend on the parameters p.
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
    """Return the limit for attempted parts in a call of a kernel, which take tens of milliseconds.

    A part takes one or a few exact passes, each of which may try all combinations of signs.
    """
    return max(_TRIES // (10 + int(3**stages.rows)), 1)


def rare_header(stages: Stages) -> str:
    """Return a model's definitions for the C code that all models share."""
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
    """Return a pass's results in the order of the array o."""
    return [node for kind in (*STATE, "jump", "doubt") for node in results[kind]]


def rare_roots(stages: Stages) -> list[Node]:
    """Return all nodes that the passes of a rare substep compute."""
    return [*rare_results(stages.fast), *stages.posed, *rare_results(stages.exact)]


def _constants(stages: Stages) -> dict[Node, int]:
    """Return the indices of values that depend only on parameters and that other nodes read."""
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
    """Return the statements of the exact pass, which solves for forces between its two halves."""
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
    """Return the statements that compute roots, without operations that are already computed."""
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
