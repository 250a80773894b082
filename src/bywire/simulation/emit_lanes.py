"""Kernel of an ensemble: as many cases side by side as the processor's vectors hold."""

from __future__ import annotations

from collections.abc import Sequence

from bywire.simulation.c_runtime import LANES
from bywire.simulation.emission import (
    branching_statements,
    indented,
    layout_of,
    leaf_count,
    leaf_namer,
    midpoints,
    statements,
    unread,
)
from bywire.simulation.emit_rare import rare_substep
from bywire.simulation.expressions import VECTOR_C, as_number, condition, needed
from bywire.simulation.layout import Layout
from bywire.simulation.modes import modes
from bywire.simulation.operation import Node
from bywire.simulation.stages import STATE, Stages

SIGNATURE = """int bw_lanes(void) { return W; }

void bw_run_lanes(const double *restrict p, double h_, const double *restrict u,
    double *restrict state, const int64_t *restrict plan, double *restrict rec)"""

# As `emission.PLAN`; then whether each lane has a stimulus of its own, how many lanes are recorded,
# and the distances between the entries of two lanes, rows and signals.
PLAN = """const int64_t begin = plan[0], end = plan[1], last = plan[2], substeps = plan[3];
  const int64_t stim = plan[4], every = plan[5], row0 = plan[6];
  const int64_t own = plan[{at}], used = plan[{at} + 1], by_lane = plan[{at} + 2];
  const int64_t by_row = plan[{at} + 3], by_signal = plan[{at} + 4];"""


class _Lanes:
    """Statements of every stage, in vectors."""

    def __init__(self, stages: Stages) -> None:
        self.stages, self.graph, self.level = stages, stages.graph, stages.level()
        self.layout: Layout = layout_of(stages)
        skipped = unread(stages)
        self.results = {
            f"{kind}{k}": node
            for kind in ("x", "d", "r")
            for k, node in enumerate(stages.fast[kind])
            if f"{kind}{k}" not in skipped
        }
        self.products = stages.quadrature.products
        self.flag = stages.fast["flag"][0]
        self.pass_roots = [*self.results.values(), *self.products, self.flag]
        self.coefficients = [c for pairs in stages.quadrature.combinations for c, _ in pairs]
        self.carried = midpoints(
            self.graph, needed(self.graph, self.pass_roots, lambda n: self.level[n] < 2)
        )
        self.name = leaf_namer(self.graph, self._leaf, self._value, "SET({})")
        self.mode = modes(self.graph, self.pass_roots, self.level).without(self.carried)

    def _leaf(self, kind: str, index: int) -> str:
        if kind in ("p", "u"):
            return f"{kind.upper()}[{index}]"
        return "h" if kind == "h" else f"{kind}{index}"

    def _value(self, node: Node) -> str:
        return f"y{self.carried[node]}" if node in self.carried else f"v{node}"

    def block(self, roots: Sequence[Node], below: int) -> list[str]:
        """Return the statements that results need, apart from what is computed less often."""
        order = needed(self.graph, roots, lambda n: self.level[n] < below)
        return self.lines(order)

    def lines(self, order: Sequence[Node]) -> list[str]:
        """Return the statements of nodes."""
        return branching_statements(self.graph, order, self.name, "const V ", VECTOR_C)

    def number(self, node: Node) -> str:
        """Return the text of a result."""
        return as_number(self.graph, node, self.name, VECTOR_C)

    def once(self) -> list[str]:
        """Return the statements of what depends on parameters alone."""
        ticks = [n for task in self.stages.ticks for n in task]
        roots = [*self.pass_roots, *self.coefficients, *ticks, *self.stages.output]
        order = needed(self.graph, roots, lambda _: False)
        return self.lines([n for n in order if self.level[n] == 0])

    def framed(self) -> list[str]:
        """Return the statements of what changes with the ticks."""
        roots = [*self.pass_roots, *self.coefficients]
        order = needed(self.graph, roots, lambda n: self.level[n] == 0)
        own = frozenset(self.mode.values)
        return self.lines([n for n in order if self.level[n] == 1 and n not in own])

    def mode_state(self) -> list[str]:
        """Return the declarations of what changes with the mode alone, and of the mode."""
        if not self.mode.atoms:
            return []
        values = [f"V {self.name(n)} = SET(0.0);" for n in self.mode.values]
        return [*values, *(f"B b{n} = (B){{0}};" for n in self.mode.atoms), "int fresh = 1;"]

    def substep(self) -> list[str]:
        """Return the statements of a substep; what hangs on the mode is renewed with it."""
        mode = self.mode
        if not mode.atoms:
            return self.lines(mode.rest)
        changed = " | ".join(f"(n{n} ^ b{n})" for n in mode.atoms)
        truth = [condition(self.graph, n, self.name, VECTOR_C) for n in mode.atoms]
        renewed = statements(self.graph, mode.values, self.name, "", VECTOR_C)
        return [
            *self.lines(mode.first),
            *(f"const B n{n} = {text};" for n, text in zip(mode.atoms, truth, strict=True)),
            f"if (__builtin_expect(fresh | ANY({changed}), 0)) {{",
            "  fresh = 0;",
            *(f"  b{n} = n{n};" for n in mode.atoms),
            *(f"  {line}" for line in renewed),
            "}",
            *self.lines(mode.rest),
        ]


def emit_lanes(stages: Stages) -> str:
    """Return the C source of the kernel for one vector of cases."""
    t = _Lanes(stages)
    layout = t.layout
    counters, names = layout.start["counters"], _names(layout)
    sums = [f"s{k}" for k in range(len(t.products))]
    new = [f"V {target}_ = {t.number(n)};" for target, n in t.results.items()]
    new += [f"V z{k} = {t.number(n)};" for k, n in enumerate(t.products)]
    commit = [f"{target} = {target}_;" for target in t.results]
    commit += [f"{s} += z{k};" for k, s in enumerate(sums)]
    ahead = [f"y{k} = x{k} + d{k};" for k in t.carried.values()]
    integrals = [
        f"q{j} += {' + '.join(f'{t.number(c)} * s{k}' for c, k in pairs) or 'SET(0.0)'};"
        for j, pairs in enumerate(stages.quadrature.combinations)
    ]
    parameters, stimuli = leaf_count(stages, "p"), leaf_count(stages, "u")
    return f"""{LANES}{rare_substep(stages)}
{_settle_lanes(t)}
{SIGNATURE} {{
  {PLAN.format(at=8 + len(stages.ticks))}
  const M *restrict P = (const M *)p;
  M *restrict vectors = (M *)state;
  const V h = SET(h_);
  V U[{max(stimuli, 1)}];
  double ps[{max(parameters, 1)}], c[W * (CONSTANTS + 1)];
  for (int l = 0; l < W; ++l) {{
    for (int k = 0; k < {parameters}; ++k) ps[k] = P[k][l];
    constants(ps, c + l * (CONSTANTS + 1));
  }}
  {indented([f"V {name} = vectors[{k}];" for k, name in enumerate(names)], 2)}
  {indented(t.once(), 2)}
  {indented(t.mode_state(), 2)}
  {indented([f"V {each}" for each in ahead], 2)}
  for (int64_t f = begin; f < end + last; ++f) {{
    for (int j = 0; j < {stimuli}; ++j) {{
      const double *row = u + (f / stim) * {stimuli} * (own ? W : 1);
      for (int l = 0; l < W; ++l) U[j][l] = own ? row[j * W + l] : row[j];
    }}
    {indented(_ticks(t), 4)}
    if (f % every == 0) {{
      {indented(_record(t), 6)}
    }}
    if (f == end) break;
    {indented(t.framed(), 4)}
    {indented([f"V {s} = SET(0.0);" for s in sums], 4)}
    for (int64_t s = 0; s < substeps; ++s) {{
      {indented(t.substep(), 6)}
      {indented(new, 6)}
      const B flagged = {condition(t.graph, t.flag, t.name, VECTOR_C)};
      if (__builtin_expect(ANY(flagged), 0)) {{
        {indented(_repeat(t), 8)}
      }}
      {indented(commit + ahead, 6)}
    }}
    {indented(integrals, 4)}
  }}
  {indented([f"vectors[{k}] = {name};" for k, name in enumerate(names)], 2)}
  (void)U; (void)P; (void)h; (void)own; (void){counters};
}}
"""


def _names(layout: Layout) -> list[str]:
    """Return the names of all entries of the state vector, in order."""
    entries = [f"{kind}{k}" for kind, count in layout.length.items() for k in range(count)]
    return [*entries, "failures", "repeats"]


def _ticks(t: _Lanes) -> list[str]:
    texts = []
    for k, roots in enumerate(t.stages.ticks):
        lines = t.block(roots, 1)
        lines += [f"const V w{j} = {t.number(n)};" for j, n in enumerate(roots)]
        lines += [f"m{j} = w{j};" for j in range(len(roots))]
        texts.append(f"if (f % plan[{8 + k}] == 0) {{\n      {indented(lines, 6)}\n    }}")
    return texts


def _record(t: _Lanes) -> list[str]:
    roots = t.stages.output
    return [
        *t.block(roots, 1),
        f"V o[{max(len(roots), 1)}];",
        *(f"o[{j}] = {t.number(n)};" for j, n in enumerate(roots)),
        "double *row = rec + (f / every - row0) * by_row;",
        f"for (int j = 0; j < {len(roots)}; ++j)",
        "  for (int l = 0; l < used; ++l) row[j * by_signal + l * by_lane] = o[j][l];",
    ]


def _settle_lanes(t: _Lanes) -> str:
    """Return the C function that settles the flagged lanes one by one.

    It works on copies: a vector whose lanes are addressed would live in memory everywhere.
    """
    layout = t.layout
    nx, nm, nz = layout.length["x"], layout.length["m"], len(t.products)
    at, lines = 0, []
    targets = {name: k for k, name in enumerate(t.results)}
    for kind in STATE:
        for k in range(layout.length[kind]):
            if kind == "q":
                lines.append(f"q[{k}][l] += o[{at}];")
            elif f"{kind}{k}" in targets:
                lines.append(f"n[{targets[f'{kind}{k}']}][l] = o[{at}];")
            at += 1
    return f"""static RARE void settle_lanes(B flagged, const double *c, double h, const V *m,
    const V *old, V *n, V *q, V *counters) {{
  double ms[{max(nm, 1)}], xs[{nx}], ds[{nx}], o[RESULTS];
  for (int l = 0; l < W; ++l) {{
    if (!LANE(flagged, l)) continue;
    for (int k = 0; k < {nm}; ++k) ms[k] = m[k][l];
    for (int k = 0; k < {nx}; ++k) {{ xs[k] = old[k][l]; ds[k] = old[{nx} + k][l]; }}
    cuts made;
    counters[0][l] += located(c + l * (CONSTANTS + 1), h, ms, xs, ds, o, &made);
    counters[1][l] += 1.0;
    for (int k = 0; k < {nz}; ++k) n[{len(targets)} + k][l] = 0.0;
    {indented(lines, 4)}
  }}
}}
"""


def _repeat(t: _Lanes) -> list[str]:
    """Return the statements that hand a substep with flagged lanes to ``settle_lanes``."""
    length = t.layout.length
    old = [f"{kind}{k}" for kind in ("x", "d") for k in range(length[kind])]
    new = [*(f"{target}_" for target in t.results), *(f"z{k}" for k in range(len(t.products)))]
    flow = [f"q{k}" for k in range(length["q"])]
    memory = [f"m{k}" for k in range(length["m"])]
    arrays = {"old": old, "memory": memory or ["SET(0.0)"], "n": new, "flow": flow or ["SET(0.0)"]}
    return [
        *(f"V {name}[] = {{{', '.join(values)}}};" for name, values in arrays.items()),
        "V count[] = {failures, repeats};",
        "settle_lanes(flagged, c, h_, memory, old, n, flow, count);",
        *(f"{name} = n[{k}];" for k, name in enumerate(new)),
        *(f"{name} = flow[{k}];" for k, name in enumerate(flow)),
        "failures = count[0];",
        "repeats = count[1];",
    ]
