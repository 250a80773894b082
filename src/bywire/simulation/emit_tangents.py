"""Kernel of a run with exact forward sensitivities: scalar values, and their tangents in lanes.

The time t of a substep's cut depends on the parameters, because v(t) = 0 determines t. The lengths
of the parts before and after the cut change with t. Derivatives therefore include the jump of the
acceleration (saltation), with all computations before and after the cut.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from bywire.simulation.c_runtime import SCALAR
from bywire.simulation.emit_rare import most_tries, rare_substep
from bywire.simulation.expressions import PLAIN_C, Dialect, as_number, needed
from bywire.simulation.graph import Node
from bywire.simulation.schedule import Layout
from bywire.simulation.stages import (
    PLAN,
    SEEDS,
    STATE,
    Stages,
    indented,
    layout_of,
    leaf_count,
    leaf_namer,
    statements,
)

_LOCATED = """
// Compute a part of length t, with tangents for parameters, initial state and length in lanes.
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

// End a part of length t: add its flows to the sum of the substep h, and scale the increments and
// their jumps to the whole substep.
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
    // One separate lane for the length gives the change of the length in all other lanes.
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
  // The last part is the remainder, with its tangents.
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
    """Return the C functions of the rare pass with tangents, and of the substep that uses it."""
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
    """Return the statements that repeat or cut a substep and commit its result."""
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


# --- The kernel

SIGNATURE = """int64_t bw_run_tangents(const double *restrict p, double h, const double *restrict u,
    double *restrict state, const int64_t *restrict plan, const int32_t *restrict selection,
    double *restrict rec, const double *restrict seeds, double *restrict tangents,
    double *restrict rec_t)"""


class _Tangents:
    """Sorted statements of each stage: first values, then nodes that differ between lanes."""

    def __init__(self, stages: Stages) -> None:
        self.stages, self.graph, self.level = stages, stages.graph, stages.level()
        self.lane = stages.varies(SEEDS)
        self.layout: Layout = layout_of(stages)
        self.value_roots = [n for kind in (*STATE, "flag") for n in stages.fast[kind]]
        self.tangent_roots = [n for kind in STATE for n in stages.fast_t[kind]]
        ticks = [n for task in (*stages.ticks, *stages.ticks_t) for n in task]
        self.pass_roots = self.value_roots + self.tangent_roots
        every_root = self.pass_roots + ticks + stages.output + stages.output_t
        order = needed(self.graph, every_root, lambda _: False)
        self.once = [n for n in order if self.level[n] == 0]
        framed = needed(self.graph, self.pass_roots, lambda n: self.level[n] == 0)
        self.framed = [n for n in framed if self.level[n] == 1]
        hoisted = [n for n in (*self.once, *self.framed) if self.lane[n]]
        self.slot = {node: k for k, node in enumerate(hoisted)}
        # Compilers do not vectorize nested selections with truth values that all lanes share. In
        # the substep, each lane therefore has its own copy, stored as a number.
        operations = (self.graph.nodes[n] for n in self.block(self.pass_roots, 2) if self.lane[n])
        truths = [o.args[0] for o in operations if o.op in ("select", "if_else_zero")]
        self.truths = [n for n in dict.fromkeys(truths) if not self.lane[n]]
        self.kept = replace(PLAIN_C, kept=self._kept)

    def name(self, node: Node) -> str:
        """Return the text of a value or a tangent."""
        return leaf_namer(self.graph, self.leaf, self._operation)(node)

    def _operation(self, node: Node) -> str:
        return f"C[{self.slot[node]} * L + l]" if node in self.slot else f"v{node}"

    def _kept(self, node: Node) -> str:
        return f"K[{self.truths.index(node)} * L + l] != 0.0" if node in self.truths else ""

    def leaf(self, kind: str, index: int) -> str:
        """Return the text of an input."""
        if kind in ("sp", "su"):
            first = 0 if kind == "sp" else leaf_count(self.stages, "sp")
            return f"seeds[{first + index} * L + l]"
        if kind in SEEDS:
            return f"T[{self.layout.start[kind[1:]] + index} * L + l]"
        if kind == "h":
            return "h"
        return {"p": f"p[{index}]", "u": f"uk[{index}]"}.get(kind, f"{kind}{index}")

    def truth_lines(self) -> list[str]:
        """Return the statements that store a substep's truth values for each lane."""
        if not self.truths:
            return []
        values = [as_number(self.graph, n, self.name) for n in self.truths]
        return [
            f"double K[{len(values)} * L] __attribute__((aligned(64)));",
            *(f"for (int l = 0; l < L; ++l) K[{k} * L + l] = {v};" for k, v in enumerate(values)),
        ]

    def lines(self, order: Sequence[Node], lane: bool, dialect: Dialect = PLAIN_C) -> list[str]:
        """Return the statements of the nodes that differ between lanes, or of the others."""
        chosen = [n for n in order if self.lane[n] == lane]
        stored = [n for n in chosen if n in self.slot]
        local = [n for n in chosen if n not in self.slot]
        if not stored:
            return statements(self.graph, local, self.name, "const double ", dialect)
        lines = []
        for node in chosen:
            declare = "" if node in self.slot else "const double "
            lines += statements(self.graph, [node], self.name, declare)
        return lines

    def results(self, roots: Sequence[Node], prefix: str) -> list[str]:
        """Return the declarations of results with separate names."""
        return [
            f"const double {prefix}{k} = {as_number(self.graph, n, self.name)};"
            for k, n in enumerate(roots)
        ]

    def block(self, roots: Sequence[Node], below: int) -> list[Node]:
        """Return the nodes to compute for results, without hoisted nodes."""
        return needed(self.graph, roots, lambda n: self.level[n] < below)


def emit_tangents(stages: Stages, lanes: int) -> str:
    """Return the C source of the kernel with ``lanes`` directions."""
    t = _Tangents(stages)
    layout = t.layout
    start, length = layout.start, layout.length
    declared = [(f"{kind}{k}", start[kind] + k) for kind in length for k in range(length[kind])]
    loads = [f"double {name} = state[{at}];" for name, at in declared]
    stores = [f"state[{at}] = {name};" for name, at in declared]
    substep = t.block(t.pass_roots, 2)
    before = start["m"]  # tangents that a substep updates
    commits = [
        f"{name} {'+=' if name[0] == 'q' else '='} s{k};"
        for k, (name, _) in enumerate(declared[:before])
    ]
    new_t = [f"T[{k} * L + l] {'+=' if k >= start['q'] else '='} t{k};" for k in range(before)]
    return f"""{SCALAR}{rare_substep(stages)}
#define L {lanes}

{exact_tangents(stages)}
{SIGNATURE} {{
  {PLAN}
  double failures = state[{start["counters"]}], repeats = state[{start["counters"] + 1}];
  double tries = state[{start["counters"] + 2}];
  const double most = tries + {most_tries(stages)};
  double *restrict T = tangents;
  double C[{max(len(t.slot), 1)} * L] __attribute__((aligned(64)));
  double c[CONSTANTS + 1];
  constants(p, c);
  {indented(loads, 2)}
  {indented(t.lines(t.once, False), 2)}
  #pragma omp simd
  for (int l = 0; l < L; ++l) {{
    {indented(t.lines(t.once, True), 4)}
  }}
  int64_t f = begin;
  for (; f < end + last; ++f) {{
    if (__builtin_expect(tries > most, 0) && f > begin && f < end) break;
    const double *restrict uk = u + (f / stim) * {leaf_count(stages, "u")};
    (void)uk;
    {indented(_ticks(t), 4)}
    if (f % every == 0) {{
      {indented(_record(t), 6)}
    }}
    if (f == end) break;
    {indented(t.lines(t.framed, False), 4)}
    #pragma omp simd
    for (int l = 0; l < L; ++l) {{
      {indented(t.lines(t.framed, True), 6)}
    }}
    for (int64_t s = 0; s < substeps; ++s) {{
      {indented(t.lines(substep, False), 6)}
      {indented(t.results(t.value_roots, "s"), 6)}
      if (__builtin_expect(s{len(t.value_roots) - 1} != 0.0, 0)) {{
        {indented(located_statements(layout), 8)}
      }} else {{
        {indented(t.truth_lines(), 8)}
        #pragma omp simd
        for (int l = 0; l < L; ++l) {{
          {indented(t.lines(substep, True, t.kept), 10)}
          {indented(t.results(t.tangent_roots, "t"), 10)}
          {indented(new_t, 10)}
        }}
        {indented(commits, 8)}
      }}
    }}
  }}
  {indented(stores, 2)}
  state[{start["counters"]}] = failures;
  state[{start["counters"] + 1}] = repeats;
  state[{start["counters"] + 2}] = tries;
  return f;
}}
"""


def _ticks(t: _Tangents) -> list[str]:
    texts, m = [], t.layout.start["m"]
    for k, (roots, roots_t) in enumerate(zip(t.stages.ticks, t.stages.ticks_t, strict=True)):
        order = t.block([*roots, *roots_t], 1)
        order = [n for n in order if n not in t.slot]
        values = t.lines(order, False) + t.results(roots, "w")
        inner = t.lines(order, True) + t.results(roots_t, "t")
        inner += [f"T[{m + j} * L + l] = t{j};" for j in range(len(roots_t))]
        texts.append(f"""if (f % plan[{8 + k}] == 0) {{
      {indented(values, 6)}
      for (int l = 0; l < L; ++l) {{
        {indented(inner, 8)}
      }}
      {indented([f"m{j} = w{j};" for j in range(len(roots))], 6)}
    }}""")
    return texts


def _record(t: _Tangents) -> list[str]:
    roots, roots_t = t.stages.output, t.stages.output_t
    order = t.block([*roots, *roots_t], 1)
    order = [n for n in order if n not in t.slot]
    values = t.lines(order, False) + t.results(roots, "w")
    values += [f"double o[{max(len(roots), 1)}], o_t[{max(len(roots), 1)} * L];"]
    values += [f"o[{j}] = w{j};" for j in range(len(roots))]
    inner = t.lines(order, True) + t.results(roots_t, "t")
    inner += [f"o_t[{j} * L + l] = t{j};" for j in range(len(roots_t))]
    return [
        *values,
        "for (int l = 0; l < L; ++l) {",
        *(f"  {line}" for line in inner),
        "}",
        "const int64_t at = (f / every - row0) * chosen;",
        "for (int64_t j = 0; j < chosen; ++j) {",
        "  rec[at + j] = o[selection[j]];",
        "  memcpy(rec_t + (at + j) * L, o_t + selection[j] * L, L * sizeof(double));",
        "}",
    ]
