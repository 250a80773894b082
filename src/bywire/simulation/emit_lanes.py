"""Kernel of an ensemble: as many cases side by side as the processor's vectors hold.

Where the substep of a model is short it waits for chains of operations as long as it computes. Then
two vectors are carried on in turn, statement by statement: each computes while the other waits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from bywire.simulation.c_runtime import LANES
from bywire.simulation.emission import indented, leaf_count
from bywire.simulation.emit_rare import most_tries, rare_substep
from bywire.simulation.lane_repeats import repeated_lanes, repeated_results, settling_function
from bywire.simulation.lane_statements import Lanes
from bywire.simulation.layout import Layout
from bywire.simulation.operation import Node
from bywire.simulation.stages import Stages

SIGNATURE = """int bw_lanes(void) { return TURNS * W; }

int64_t bw_run_lanes(const double *restrict p, double h_, const double *restrict u,
    double *restrict state, const int64_t *restrict plan, double *restrict rec,
    double *restrict ends)"""

# As `emission.PLAN`; then whether each lane has a stimulus of its own, how many lanes are recorded,
# the distances between the entries of two lanes, rows and signals, the frames at which the signals
# recorded at both ends alone are, and the distance between two of these.
PLAN = """const int64_t begin = plan[0], end = plan[1], last = plan[2], substeps = plan[3];
  const int64_t stim = plan[4], every = plan[5];
  const int64_t own = plan[{at}], used = plan[{at} + 1], by_lane = plan[{at} + 2];
  const int64_t by_row = plan[{at} + 3], by_signal = plan[{at} + 4];
  const int64_t end0 = plan[{at} + 5], end1 = plan[{at} + 6], by_end = plan[{at} + 7];"""


# Rows are put down eight at a time: a signal of a lane is a line of memory then, and one page of
# a hundred or more that are touched in turn.
_PUT = """#define HELD 8

static __attribute__((noinline)) void put_rows(const V *held, int64_t signals, int64_t rows,
    int64_t lanes, double *to, int64_t by_lane, int64_t by_row, int64_t by_signal) {
  for (int64_t j = 0; j < signals; ++j)
    for (int64_t l = 0; l < lanes; ++l)
      for (int64_t r = 0; r < rows; ++r)
        to[j * by_signal + l * by_lane + r * by_row] = held[j * HELD + r][l];
}
"""


# Operations of a substep up to which two vectors take turns: more do not fit into registers.
_SHORT = 160


def takes_turns(stages: Stages) -> bool:
    """Return whether a substep is so short that two vectors in turn are quicker than one."""
    t = Lanes(stages)
    return not t.mode.atoms and len(t.lines(t.mode.rest)) <= _SHORT


def emit_lanes(stages: Stages, in_turn: bool = False, ends: int = 0) -> str:
    """Return the C source of the kernel for one vector of cases, or for two that take turns.

    It ends earlier where it takes long, and returns the frame at which it goes on.
    ``ends``: how many of the signals, the last ones, are recorded at both ends alone.
    """
    t = Lanes(stages)
    turns = [Lanes(stages, at, 2) for at in (0, 1)] if in_turn else [t]

    def each(lines: Callable[[Lanes], Sequence[str]], spaces: int) -> str:
        rows = zip(*(lines(turn) for turn in turns), strict=True)
        return indented([line for row in rows for line in row], spaces)

    counters, stimuli = t.layout.start["counters"], leaf_count(stages, "u")
    return f"""{LANES}
#define TURNS {len(turns)}
{rare_substep(stages)}
{settling_function(t)}
{_PUT}
{SIGNATURE} {{
  {PLAN.format(at=8 + len(stages.ticks))}
  const M *restrict P = (const M *)p;
  M *restrict vectors = (M *)state;
  const V h = SET(h_);
  int64_t held = 0, put = 0;
  double ps[{max(leaf_count(stages, "p"), 1)}];
  {each(_begin, 2)}
  {each(Lanes.once, 2)}
  {each(Lanes.mode_state, 2)}
  {each(lambda t: [f"V {line}" for line in _ahead(t)], 2)}
  int64_t f = begin, tried = 0;
  for (; f < end + last; ++f) {{
    if (__builtin_expect(tried > {most_tries(stages)}, 0) && f > begin && f < end) break;
    const double *row = u + (f / stim) * {stimuli} * (own ? TURNS * W : 1);
    {each(_stimulus, 4)}
    {each(_ticks, 4)}
    if (f % every == 0) {{
      {each(lambda t: _record(t, ends), 6)}
      ++held;
    }}
    if (held == HELD) {{
      {each(lambda t: _put(t, ends), 6)}
      put += held, held = 0;
    }}
    if (f == end) break;
    {each(Lanes.framed, 4)}
    {each(lambda t: [f"V s{k}{t.mark} = SET(0.0);" for k in range(len(t.products))], 4)}
    for (int64_t s = 0; s < substeps; ++s) {{
      {each(Lanes.judged, 6)}
      {each(repeated_lanes, 6)}
      {each(Lanes.sums, 6)}
      {each(_commit, 6)}
    }}
    {each(_integrals, 4)}
  }}
  {each(lambda t: _put(t, ends), 2)}
  {each(_stores, 2)}
  (void)P; (void)h; (void)own; (void){counters}; (void)end0; (void)end1; (void)by_end; (void)ends;
  return f;
}}
"""


def _begin(t: Lanes) -> list[str]:
    """Return the declarations of what every vector has, with its values at the start."""
    parameters, m = leaf_count(t.stages, "p"), t.mark
    return [
        f"V U{m}[{max(leaf_count(t.stages, 'u'), 1)}];",
        f"double c{m}[W * (CONSTANTS + 1)];",
        f"V o{m}[{max(len(t.stages.output), 1)} * HELD];",
        f"int64_t lanes{m} = used - {t.at} * W;",
        f"lanes{m} = lanes{m} < 0 ? 0 : lanes{m} > W ? W : lanes{m};",
        "for (int l = 0; l < W; ++l) {\n"
        f"    for (int k = 0; k < {parameters}; ++k) ps[k] = P[k * TURNS + {t.at}][l];\n"
        f"    constants(ps, c{m} + l * (CONSTANTS + 1));\n"
        "  }",
        *(f"V {name}{m} = vectors[{t.row(k)}];" for k, name in enumerate(_names(t.layout))),
    ]


def _stimulus(t: Lanes) -> list[str]:
    here = f"(V)((const M *)row)[j * TURNS + {t.at}]"
    return [
        f"for (int j = 0; j < {leaf_count(t.stages, 'u')}; ++j)\n"
        f"      U{t.mark}[j] = own ? {here} : SET(row[j]);",
        f"(void)U{t.mark};",
    ]


def _ahead(t: Lanes) -> list[str]:
    return [f"y{k}{t.mark} = x{k}{t.mark} + d{k}{t.mark};" for k in t.carried.values()]


def _commit(t: Lanes) -> list[str]:
    """Return, in one piece, what takes over the results.

    Those that no flag waits for are computed only here: nothing reads the values before them any
    longer, so that each takes the place of its own. Earlier, both would have to be kept.
    """
    results = [
        *t.finished(),
        *(f"const V {name}_ = {t.number(n)};" for name, n in t.results.items()),
        *(f"{name}{t.mark} = {name}_;" for name in t.results),
        *_ahead(t),
    ]
    repeated = [*repeated_results(t), *_ahead(t)]
    return [
        f"if (__builtin_expect(!is_rare{t.mark}, 1)) {{\n"
        f"        {indented(results, 8)}\n"
        f"      }} else {{\n"
        f"        {indented(repeated, 8)}\n"
        "      }",
    ]


def _integrals(t: Lanes) -> list[str]:
    return [
        f"q{j}{t.mark} += "
        f"{' + '.join(f'{t.number(c)} * s{k}{t.mark}' for c, k in pairs) or 'SET(0.0)'};"
        for j, pairs in enumerate(t.stages.quadrature.combinations)
    ]


def _stores(t: Lanes) -> list[str]:
    names = t.marked(*_names(t.layout))
    return [f"vectors[{t.row(k)}] = {name};" for k, name in enumerate(names)]


def _names(layout: Layout) -> list[str]:
    """Return the names of all entries of the state vector, in order."""
    entries = [f"{kind}{k}" for kind, count in layout.length.items() for k in range(count)]
    return [*entries, "failures", "repeats", "tries"]


def _ticks(t: Lanes) -> list[str]:
    texts = []
    for k, roots in enumerate(t.stages.ticks):
        lines = t.block(roots, 1)
        lines += [f"const V w{j} = {t.number(n)};" for j, n in enumerate(roots)]
        lines += [f"m{j}{t.mark} = w{j};" for j in range(len(roots))]
        texts.append(f"if (f % plan[{8 + k}] == 0) {{\n      {indented(lines, 6)}\n    }}")
    return texts


def _record(t: Lanes, ends: int) -> list[str]:
    every = t.stages.output
    roots = every[: len(every) - ends]
    return [
        *t.block(roots, 1),
        *(f"o{t.mark}[{j} * HELD + held] = {t.number(n)};" for j, n in enumerate(roots)),
        *(_record_ends(t, every[len(every) - ends :]) if ends else ()),
    ]


def _put(t: Lanes, ends: int) -> list[str]:
    return [
        f"put_rows(o{t.mark}, {len(t.stages.output) - ends}, held, lanes{t.mark},\n"
        f"        rec + put * by_row + {t.at} * W * by_lane, by_lane, by_row, by_signal);"
    ]


def _record_ends(t: Lanes, roots: Sequence[Node]) -> list[str]:
    """Return, in one piece, what records the signals of both ends alone where a row is one."""
    first, numbers = f"{t.at} * W", [f"e[{j}] = {t.number(n)};" for j, n in enumerate(roots)]
    lines = [
        *t.block(roots, 1),
        f"V e[{len(roots)}];",
        *numbers,
        f"for (int j = 0; j < {len(roots)}; ++j)\n"
        f"          for (int l = 0; l < W && l + {first} < used; ++l) {{\n"
        f"            double *at = ends + j * by_end + (l + {first}) * 2;\n"
        "            if (f == end0) at[0] = e[j][l];\n"
        "            if (f == end1) at[1] = e[j][l];\n"
        "          }",
    ]
    return [f"if (f == end0 || f == end1) {{\n        {indented(lines, 8)}\n      }}"]
