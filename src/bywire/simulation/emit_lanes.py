"""Kernel of an ensemble: as many cases side by side as fit into the processor's vectors.

In a short substep, the latency of dependent operations takes as much time as the computation. The
kernel then alternates two vectors, statement by statement. One computes while the other waits.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence

from bywire.simulation.branches import Arms, branched, modes
from bywire.simulation.c_runtime import LANES
from bywire.simulation.emit_rare import most_tries, rare_roots, rare_substep
from bywire.simulation.expressions import VECTOR_C, as_number, condition, needed
from bywire.simulation.graph import Node
from bywire.simulation.schedule import Layout
from bywire.simulation.stages import (
    STATE,
    Stages,
    branching_statements,
    indented,
    layout_of,
    leaf_count,
    leaf_namer,
    midpoints,
    statements,
    unread,
)


class Lanes:
    """Statements of each stage for one of the alternating vectors.

    ``at``: index of this vector among the ``turns`` vectors.
    """

    def __init__(self, stages: Stages, at: int = 0, turns: int = 1) -> None:
        self.at, self.turns, self.mark = at, turns, "ab"[at] if turns > 1 else ""
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
        judged = self._read_by([self.flag, stages.fast["doubtful"][0]])
        self._judged = [n for n in self.mode.rest if n in judged]
        self._later = [n for n in self.mode.rest if n not in judged]

    def _read_by(self, roots: Iterable[Node]) -> frozenset[Node]:
        """Return all operations that the roots need, at any level of change."""
        return frozenset(needed(self.graph, roots, lambda _: False))

    def _leaf(self, kind: str, index: int) -> str:
        if kind == "p":
            return f"P[{self.row(index)}]"
        if kind == "u":
            return f"U{self.mark}[{index}]"
        return "h" if kind == "h" else f"{kind}{index}{self.mark}"

    def row(self, index: int) -> int:
        """Return the index of an entry's vector in memory."""
        return index * self.turns + self.at

    def marked(self, *names: str) -> list[str]:
        """Return the names of variables that are separate for each vector."""
        return [f"{name}{self.mark}" for name in names]

    def _value(self, node: Node) -> str:
        name = f"y{self.carried[node]}" if node in self.carried else f"v{node}"
        return f"{name}{self.mark}"

    def block(self, roots: Sequence[Node], below: int) -> list[str]:
        """Return the statements for results, without those that are computed less often."""
        order = needed(self.graph, roots, lambda n: self.level[n] < below)
        return self.lines(order)

    def lines(self, order: Sequence[Node], later: Sequence[Node] = ()) -> list[str]:
        """Return the statements of nodes; ``later``: other nodes that read them."""
        return branching_statements(self.graph, order, self.name, "const V ", VECTOR_C, later)

    def branching(self, order: Sequence[Node], later: Sequence[Node] = ()) -> list[str]:
        """Return the statements of a substep's nodes, without the arms that no lane selects.

        ``later``: other nodes that read them.
        """
        read = set(self.pass_roots)
        stack = [a for node in later for a in self.graph.arguments(node)]
        while stack:
            node = stack.pop()
            read.add(node)
            if self.graph.is_boolean(node):  # its text contains its arguments
                stack.extend(self.graph.arguments(node))
        return self._branching(order, read, later)

    def _branching(
        self, order: Sequence[Node], kept: Collection[Node], later: Sequence[Node]
    ) -> list[str]:
        left, arms = branched(self.graph, order, kept)
        lines: list[str] = []
        while left:
            at = next((k for k, node in enumerate(left) if node in arms), len(left))
            lines += self.lines(left[:at], (*left[at:], *later))
            if at < len(left):
                lines.append(self._selected(left[at], arms[left[at]], kept))
            left = left[at + 1 :]
        return lines

    def _selected(self, node: Node, arms: Arms, kept: Collection[Node]) -> str:
        """Return the C text of a selection that computes an arm only if a lane selects it."""
        truth, *ends = self.graph.nodes[node].args
        test, own = condition(self.graph, truth, self.name, VECTOR_C), self.name(node)
        declared, parts, values = [], [], []
        for k, (arm, end) in enumerate(zip(arms, (*ends, None), strict=False)):
            value = "SET(0.0)" if end is None else self.number(end)
            if not arm.nodes and not arm.taken:
                values.append(value)
                continue
            values.append(f"{own}_{k}")
            declared += [f"V kept_{self.name(n)} = SET(0.0);" for n in arm.kept]
            declared.append(f"V {own}_{k} = SET(0.0);")
            body = [
                *(f"const V {self.name(n)} = kept_{self.name(n)};" for n in arm.taken),
                *self._branching(arm.nodes, {*kept, *arm.kept}, ()),
                *(f"kept_{self.name(n)} = {self.name(n)};" for n in arm.kept),
                f"{own}_{k} = {value};",
            ]
            taken = f"NOT(if_{own})" if k else f"if_{own}"
            parts.append(f"if (ANY({taken})) {{\n        {indented(body, 8)}\n      }}")
        selected = VECTOR_C.select.format(c=f"if_{own}", a=values[0], b=values[1])
        lines = [f"const B if_{own} = {test};", *declared, *parts, f"const V {own} = {selected};"]
        return indented(lines, 6)

    def number(self, node: Node) -> str:
        """Return the C text of a result."""
        return as_number(self.graph, node, self.name, VECTOR_C)

    def once(self) -> list[str]:
        """Return the statements for values that depend only on parameters."""
        ticks = [n for task in self.stages.ticks for n in task]
        roots = [*self.pass_roots, *self.coefficients, *ticks, *self.stages.output]
        order = needed(self.graph, roots, lambda _: False)
        return self.lines([n for n in order if self.level[n] == 0])

    def framed(self) -> list[str]:
        """Return the statements for values that change with the ticks."""
        roots = [*self.pass_roots, *self.coefficients]
        order = needed(self.graph, roots, lambda n: self.level[n] == 0)
        own = frozenset(self.mode.values)
        return self.lines([n for n in order if self.level[n] == 1 and n not in own])

    def mode_state(self) -> list[str]:
        """Return the declarations of values that depend only on the mode, and of the mode."""
        if not self.mode.atoms:
            return []
        values = [f"V {self.name(n)} = SET(0.0);" for n in self.mode.values]
        return [*values, *(f"B b{n} = (B){{0}};" for n in self.mode.atoms), "int fresh = 1;"]

    def judged(self) -> list[str]:
        """Return the statements that determine whether one pass is sufficient for a substep.

        They recompute values that depend on the mode when the mode changes.
        """
        mode = self.mode
        rest = self.branching(self._judged, self._later)
        if not mode.atoms:
            return rest
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
            *rest,
        ]

    def sums(self) -> list[str]:
        """Return the statements of the integrands, each added to its sum as soon as possible."""
        lines, rest = [], self._later
        for k, product in enumerate(self.products):
            read = self._read_by([product])
            order, rest = [n for n in rest if n in read], [n for n in rest if n not in read]
            lines += [*self.branching(order, rest), f"s{k}{self.mark} += {self.number(product)};"]
        return lines

    def finished(self, is_summed: bool = True) -> list[str]:
        """Return the statements of the results that the flag does not need.

        ``is_summed``: whether the statements of `sums` are already written.
        """
        there = self._read_by(self.products if is_summed else ())
        needed_nodes = self._read_by(self.results.values()) - there
        return self.branching([n for n in self._later if n in needed_nodes])


# --- Lanes whose substep needs more than one ordinary pass
# These lanes raise a flag, and the kernel settles them one by one. It then computes the remaining
# results and integrands for all lanes, and replaces the values of the settled lanes.


def repeated_lanes(t: Lanes) -> list[str]:
    """Return the code for lanes that raise their flag."""
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
    """Return the statements that use the results of settled lanes.

    For these lanes, they restore the sums without the pass's integrands.
    """
    new, before, settled = t.marked("new", "before", "settled")
    return [
        *(f"{name} = {new}[{k}];" for k, name in enumerate(t.marked(*t.results))),
        *(f"{s} = SELECT({settled}, {before}[{k}], {s});" for k, s in enumerate(_sums(t))),
        f"(void){before}; (void){settled};",
    ]


def settling_function(t: Lanes) -> str:
    """Return the C function that settles the flagged lanes one by one.

    It works on copies, because a vector with addressed lanes would always stay in memory. For a
    lane that is not in doubt, the velocities of the ordinary pass are valid.
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
    """Return the statements that pass a substep with flagged lanes to ``settle_lanes``."""
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
    """Return the memory entries that a rare pass reads."""
    read = t.graph.read_by(rare_roots(t.stages))
    return [k for k in range(t.layout.length["m"]) if t.graph.leaf("m", k) in read]


def _flows(t: Lanes) -> list[str]:
    """Return the integrals that signals read; other integrals stay unchanged."""
    read = t.graph.read_by(t.stages.output)
    return [f"q{k}" for k in range(t.layout.length["q"]) if t.graph.leaf("q", k) in read]


def _sums(t: Lanes) -> list[str]:
    return t.marked(*(f"s{k}" for k in range(len(t.products))))


# --- The kernel

SIGNATURE = """int bw_lanes(void) { return TURNS * W; }

int64_t bw_run_lanes(const double *restrict p, double h_, const double *restrict u,
    double *restrict state, const int64_t *restrict plan, double *restrict rec,
    double *restrict ends)"""

# `stages.PLAN`, then whether each lane has its own stimulus, the number of recorded lanes, the
# distances between the entries of two lanes, rows and signals, the frames of the first and last
# rows, and the distance between two signals that are recorded only in these rows.
PLAN = """const int64_t begin = plan[0], end = plan[1], last = plan[2], substeps = plan[3];
  const int64_t stim = plan[4], every = plan[5];
  const int64_t own = plan[{at}], used = plan[{at} + 1], by_lane = plan[{at} + 2];
  const int64_t by_row = plan[{at} + 3], by_signal = plan[{at} + 4];
  const int64_t end0 = plan[{at} + 5], end1 = plan[{at} + 6], by_end = plan[{at} + 7];"""


# Rows are written eight at a time, so a lane's signal fills a cache line. The cache lines are on a
# hundred or more pages, which the kernel writes in turn.
_PUT = """#define HELD 8

static __attribute__((noinline)) void put_rows(const V *held, int64_t signals, int64_t rows,
    int64_t lanes, double *to, int64_t by_lane, int64_t by_row, int64_t by_signal) {
  for (int64_t j = 0; j < signals; ++j)
    for (int64_t l = 0; l < lanes; ++l)
      for (int64_t r = 0; r < rows; ++r)
        to[j * by_signal + l * by_lane + r * by_row] = held[j * HELD + r][l];
}
"""


# Maximum number of a substep's operations with two vectors. More would not fit into registers.
_SHORT = 160


def takes_turns(stages: Stages) -> bool:
    """Return whether a substep is so short that two alternating vectors are faster than one."""
    t = Lanes(stages)
    return not t.mode.atoms and len(t.lines(t.mode.rest)) <= _SHORT


def emit_lanes(stages: Stages, in_turn: bool = False, ends: int = 0) -> str:
    """Return the C source of the kernel for one vector of cases, or for two that alternate.

    A long call of the kernel ends early and returns the frame at which to continue.
    ``ends``: number of signals at the end of the list that the kernel records only in the first and
    last rows.
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
    """Return the declarations of each vector's variables, with their initial values."""
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
    """Return the code that commits the results.

    Results on which no flag depends are computed only here. After this point, nothing reads the
    previous values, so each result can overwrite its own. Earlier code would need both values.
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
    """Return the code that records the signals of the first and last rows."""
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
