"""Kernel of an ensemble: cases side by side in lanes, the state as structure of arrays."""

from __future__ import annotations

from collections.abc import Callable

from bywire.simulation.c_runtime import LANES
from bywire.simulation.emission import (
    Layout,
    exact_pass,
    indented,
    layout_of,
    leaf_namer,
    result,
    statements,
)
from bywire.simulation.expressions import needed
from bywire.simulation.graph import Node
from bywire.simulation.stages import STATE, Stages

SIGNATURE = """void bw_run_lanes(const double *restrict p, double h, const double *restrict u,
    double *restrict state, const int64_t *restrict plan, const int32_t *restrict selection,
    double *restrict rec)"""

# As for a single run; then the strides of the stimulus between entries and between lanes, and of
# the recording between lanes.
PLAN = """const int64_t begin = plan[0], end = plan[1], last = plan[2], substeps = plan[3];
  const int64_t stim = plan[4], every = plan[5], row0 = plan[6], chosen = plan[7];
  const int64_t entry = plan[{at}], lane = plan[{at} + 1], apart = plan[{at} + 2];"""


class _Values:
    """Names of all values as seen from inside a loop over lanes."""

    def __init__(self, stages: Stages) -> None:
        self.graph, self.level = stages.graph, stages.level()
        self.layout: Layout = layout_of(stages)
        self.pass_roots = [n for kind in (*STATE, "flag") for n in stages.fast[kind]]
        tick_roots = [node for task in stages.ticks for node in task]
        every_root = self.pass_roots + tick_roots + stages.output
        order = needed(self.graph, every_root, lambda _: False)
        self.once = [n for n in order if self.level[n] == 0]
        stop = needed(self.graph, self.pass_roots, lambda n: self.level[n] == 0)
        self.framed = [n for n in stop if self.level[n] == 1]
        late = [n for n in order if self.level[n] > 0]
        substep = needed(self.graph, self.pass_roots, lambda n: self.level[n] < 2)
        self.kept = self._slots(self.once, [*late, *every_root], every_root)
        self.frame_kept = self._slots(self.framed, substep, self.pass_roots)
        self.substep = substep

    def _slots(self, made: list[Node], users: list[Node], roots: list[Node]) -> dict[Node, int]:
        """Number the values of a stage that later stages use, truth values by their parts."""
        wanted: set[Node] = set(roots)
        for user in users:
            stack = list(self.graph.arguments(user))
            while stack:
                node = stack.pop()
                if self.graph.is_boolean(node):
                    stack.extend(self.graph.arguments(node))
                wanted.add(node)
        kept = [n for n in made if n in wanted and not self.graph.is_boolean(n)]
        return {node: k for k, node in enumerate(kept)}

    def namer(self, leaf: Callable[[str, int], str], stage: int) -> Callable[[Node], str]:
        """Return the namer inside stage 0 (once), 1 (a frame) or 2 (a substep)."""

        def other(node: Node) -> str:
            if stage > 0 and node in self.kept:
                return f"A[{self.kept[node]} * L + l]"
            if stage > 1 and node in self.frame_kept:
                return f"B[{self.frame_kept[node]} * L + l]"
            return f"v{node}"

        return leaf_namer(self.graph, leaf, other)

    def leaf(self, kind: str, index: int) -> str:
        """Return the text of an input."""
        if kind == "h":
            return "h"
        if kind == "p":
            return f"p[{index} * L + l]"
        if kind == "m":
            return f"M[{index} * L + l]"
        if kind == "u":
            return f"uk[{index} * entry + l * lane]"
        return f"S[{self.layout.start[kind] + index} * L + l]"


def emit_lanes(stages: Stages, lanes: int) -> str:
    """Return the C source of the kernel for ``lanes`` cases side by side."""
    values = _Values(stages)
    graph, layout, level = values.graph, values.layout, values.level
    size = layout.start["m"]  # entries that a substep renews
    counters, nm = layout.start["counters"], layout.length["m"]
    once = values.namer(values.leaf, 0)
    frame, inner = values.namer(values.leaf, 1), values.namer(values.leaf, 2)

    hoist = statements(graph, values.once, once, "const double ")
    hoist += [f"A[{k} * L + l] = {once(n)};" for n, k in values.kept.items()]
    framed = statements(graph, values.framed, frame, "const double ")
    framed += [f"B[{k} * L + l] = {frame(n)};" for n, k in values.frame_kept.items()]
    body = statements(graph, values.substep, inner, "const double ")
    at = 0
    for kind in STATE:
        for node in stages.fast[kind]:
            value = result(graph, node, inner)
            before = f"S[{at} * L + l] + " if kind == "q" else ""
            body.append(f"N[{at} * L + l] = {before}{value};")
            at += 1
    body.append(f"flag[l] = {result(graph, stages.fast['flag'][0], inner)};")

    def block(roots: list[Node]) -> list[str]:
        order = needed(graph, roots, lambda n: level[n] == 0)
        lines = statements(graph, order, frame, "const double ")
        return lines + [
            f"const double w{j} = {result(graph, n, frame)};" for j, n in enumerate(roots)
        ]

    ticks = []
    for k, roots in enumerate(stages.ticks):
        lines = block(roots) + [f"M[{j} * L + l] = w{j};" for j in range(nm)]
        ticks.append(
            f"if (f % plan[{8 + k}] == 0)\n      for (int l = 0; l < L; ++l) {{\n        "
            f"{indented(lines, 8)}\n      }}"
        )
    outputs = block(stages.output)
    outputs += [f"o[{j}] = w{j};" for j in range(len(stages.output))]
    return f"""{LANES}{exact_pass(stages)}
#define L {lanes}

static __attribute__((noinline)) void substep_pass(const double *restrict p, double h,
    const double *restrict A, const double *restrict B, const double *restrict M,
    const double *restrict S, double *restrict N, double *restrict flag) {{
  #pragma omp simd
  for (int l = 0; l < L; ++l) {{
    {indented(body, 4)}
  }}
}}

{_settle_lane(layout, len(values.pass_roots), _parameters(stages))}
{SIGNATURE} {{
  {PLAN.format(at=8 + len(stages.ticks))}
  double A[{max(len(values.kept), 1)} * L] __attribute__((aligned(64)));
  double B[{max(len(values.frame_kept), 1)} * L] __attribute__((aligned(64)));
  double both[2][{size} * L] __attribute__((aligned(64)));
  double M[{max(nm, 1)} * L] __attribute__((aligned(64)));
  double flag[L] __attribute__((aligned(64)));
  double *S = both[0], *N = both[1], *counters = state + {counters} * L;
  memcpy(S, state, sizeof(both[0]));
  memcpy(M, state + {size} * L, {nm} * L * sizeof(double));
  for (int l = 0; l < L; ++l) {{
    {indented(hoist, 4)}
  }}
  for (int64_t f = begin; f < end + last; ++f) {{
    const double *restrict uk = u + (f / stim) * {_stimuli(stages)} * entry;
    (void)uk; (void)lane;
    {indented(ticks, 4)}
    if (f % every == 0)
      for (int l = 0; l < L; ++l) {{
        double o[{max(len(stages.output), 1)}];
        {indented(outputs, 8)}
        double *row = rec + l * apart + (f / every - row0) * chosen;
        for (int64_t j = 0; j < chosen; ++j) row[j] = o[selection[j]];
      }}
    if (f == end) break;
    #pragma omp simd
    for (int l = 0; l < L; ++l) {{
      {indented(framed, 6)}
    }}
    for (int64_t s = 0; s < substeps; ++s) {{
      substep_pass(p, h, A, B, M, S, N, flag);
      double any = 0.0;
      for (int l = 0; l < L; ++l) any += flag[l];
      if (__builtin_expect(any != 0.0, 0))
        for (int l = 0; l < L; ++l)
          if (flag[l] != 0.0) settle_lane(p, h, M, S, N, counters, l);
      double *swap = S; S = N; N = swap;
    }}
  }}
  memcpy(state, S, sizeof(both[0]));
  memcpy(state + {size} * L, M, {nm} * L * sizeof(double));
}}
"""


def _stimuli(stages: Stages) -> int:
    return sum(1 for op in stages.graph.nodes if op.op == "leaf" and op.args[0] == "u")


def _parameters(stages: Stages) -> int:
    return sum(1 for op in stages.graph.nodes if op.op == "leaf" and op.args[0] == "p")


def _settle_lane(layout: Layout, size: int, parameters: int) -> str:
    nx, nm = layout.length["x"], layout.length["m"]
    before = layout.start["q"]
    return f"""static __attribute__((noinline, cold)) void settle_lane(const double *p, double h,
    const double *M, const double *S, double *N, double *counters, int l) {{
  double ps[{max(parameters, 1)}], ms[{max(nm, 1)}], xs[{nx}], ds[{nx}], o[{size}];
  for (int k = 0; k < {parameters}; ++k) ps[k] = p[k * L + l];
  for (int k = 0; k < {nm}; ++k) ms[k] = M[k * L + l];
  for (int k = 0; k < {nx}; ++k) {{ xs[k] = S[k * L + l]; ds[k] = S[({nx} + k) * L + l]; }}
  counters[l] += settle(ps, h, ms, xs, ds, o);
  counters[L + l] += 1.0;
  for (int k = 0; k < {before}; ++k) N[k * L + l] = o[k];
  for (int k = {before}; k < {size - 1}; ++k) N[k * L + l] = S[k * L + l] + o[k];
}}
"""
