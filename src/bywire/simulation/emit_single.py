"""Kernel of a single run: one function with only local scalars.

The code around its statements depends on the caller, which is a run on the processor, or one thread
of a graphics processor for each case.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from bywire.simulation.branches import (
    Modes,
    Remembered,
    branch,
    branched,
    declarations,
    modes,
    remembered,
    renewal,
)
from bywire.simulation.c_runtime import SCALAR
from bywire.simulation.emit_rare import most_tries, rare_substep
from bywire.simulation.expressions import (
    PLAIN_C,
    Dialect,
    Namer,
    as_number,
    condition,
    needed,
)
from bywire.simulation.graph import Graph, Node
from bywire.simulation.schedule import Layout
from bywire.simulation.stages import (
    PLAN,
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

SIGNATURE = """{} bw_run(const double *restrict p, double h, const double *restrict u,
    double *restrict state, const int64_t *restrict plan, const int32_t *restrict selection,
    double *restrict rec)"""


@dataclass(frozen=True)
class Caller:
    """Caller of a kernel of scalars, with its memory layout, as C text.

    Parameters
    ----------
    runtime, head
        First part of the source, and the function's head.
    begin
        Statements after the plan, which store the parameters in ``p``.
    stimulus, entry
        Format strings for number ``k`` of a stimulus row and of the state vector.
    row
        Statements that find the stimulus row of a frame ``f``; ``nu``: its length.
    outputs, record
        Declarations of the outputs ``o``, and statements that record them; ``count``: their number.
    pause, end
        Statements at the beginning of a frame ``f``, which pause after ``most`` attempted parts of
        substeps, and statements after the last frame.
    in_place
        Whether the substep contains the code of elementary functions instead of calls, before which
        a processor stores all registers.
    """

    runtime: str
    head: str
    begin: str
    stimulus: str
    entry: str
    row: str
    record: str
    outputs: str = "double o[{count} + 1];"
    pause: str = ""
    end: str = ""
    in_place: bool = False


EXPORTED = Caller(
    runtime=SCALAR,
    head=SIGNATURE.format("void"),
    begin="",
    stimulus="uk[{k}]",
    entry="state[{k}]",
    row="const double *restrict uk = u + (f / stim) * {nu};\n    (void)uk;",
    record="""double *row = rec + (f / every - row0) * chosen;
      for (int64_t j = 0; j < chosen; ++j) row[j] = o[selection[j]];""",
)
"""one run, with all frames of its plan"""
ONE_RUN = replace(
    EXPORTED,
    head=SIGNATURE.format("int64_t"),
    begin="const double most = "
    + EXPORTED.entry.format(k="{tries}")
    + """ + {most};
  int is_whole = chosen == {count};
  for (int64_t j = 0; j < chosen; ++j) is_whole &= selection[j] == j;""",
    outputs="""double own[{count} + 1], *const row = rec + (f / every - row0) * chosen;
      double *const o = is_whole ? row : own; // a row of all outputs needs no copy""",
    record="if (!is_whole) for (int64_t j = 0; j < chosen; ++j) row[j] = own[selection[j]];",
    pause="if (__builtin_expect(tries > most, 0) && f > begin && f < end) break;",
    end="return f;",
    in_place=True,
)
"""one run; a long call ends early and returns the frame at which to continue"""


def emit_single(stages: Stages, caller: Caller = ONE_RUN) -> str:
    """Return the C source of the kernel for one run.

    The kernel computes values that depend only on parameters once, values that depend on a tick
    once per frame, and all other values in every substep.
    """
    graph, level, layout = stages.graph, stages.level(), layout_of(stages)

    def leaf(kind: str, index: int) -> str:
        if kind in ("p", "u"):
            return f"p[{index}]" if kind == "p" else caller.stimulus.format(k=index)
        return "h" if kind == "h" else f"{kind}{index}"

    skipped = unread(stages)
    results = {
        f"{kind}{k}": node
        for kind in ("x", "d", "r")
        for k, node in enumerate(stages.fast[kind])
        if f"{kind}{k}" not in skipped
    }
    products = stages.quadrature.products
    pass_roots = [*results.values(), *products, stages.fast["flag"][0]]
    coefficients = [c for pairs in stages.quadrature.combinations for c, _ in pairs]
    tick_roots = [node for task in stages.ticks for node in task]
    every_root = pass_roots + coefficients + tick_roots + stages.output
    once = needed(graph, every_root, lambda _: False)
    hoisted = [node for node in once if level[node] == 0]
    carried = midpoints(graph, needed(graph, pass_roots, lambda n: level[n] < 2))
    name = leaf_namer(
        graph, leaf, lambda node: f"y{carried[node]}" if node in carried else f"v{node}"
    )
    ahead = [f"y{k} = x{k} + d{k};" for k in carried.values()]
    mode = modes(graph, pass_roots, level).without(carried)
    framed = [
        node
        for node in needed(graph, pass_roots + coefficients, lambda n: level[n] == 0)
        if level[node] == 1 and node not in mode.values
    ]

    dialect = _in_place(graph, mode.rest) if caller.in_place else PLAIN_C

    def block(order: Sequence[Node], dialect: Dialect = PLAIN_C) -> list[str]:
        return branching_statements(graph, order, name, "const double ", dialect)

    lead, groups, rest = remembered(graph, mode.rest, pass_roots, carried, level)

    def renewed(k: int, group: Remembered) -> list[str]:
        kept = frozenset(group.read)
        lines = [
            line
            for node in group.values
            for line in statements(graph, [node], name, "" if node in kept else "const double ")
        ]
        return renewal(graph, k, group, lines, name)

    def substep(order: Sequence[Node], kept: Collection[Node]) -> list[str]:
        left, arms = branched(graph, order, kept)
        lines: list[str] = []
        while left:
            at = next((k for k, node in enumerate(left) if node in arms), len(left))
            lines += block(left[:at], dialect)
            if at < len(left):
                both = arms[left[at]]
                first, last = (substep(arm.nodes, {*kept, *arm.kept}) for arm in both)
                lines += branch(graph, left[at], both, (first, last), name)
            left = left[at + 1 :]
        return lines

    ticks = []
    for k, roots in enumerate(stages.ticks):
        lines = block(needed(graph, roots, lambda n: level[n] == 0))
        lines += [f"const double w{j} = {as_number(graph, n, name)};" for j, n in enumerate(roots)]
        lines += [f"m{j} = w{j};" for j in range(len(roots))]
        ticks.append(f"if (f % plan[{8 + k}] == 0) {{\n      {indented(lines, 6)}\n    }}")
    outputs = block(needed(graph, stages.output, lambda n: level[n] == 0))
    outputs += [f"o[{j}] = {as_number(graph, n, name)};" for j, n in enumerate(stages.output)]
    parts = {
        "nu": leaf_count(stages, "u"),
        "np": leaf_count(stages, "p"),
        "tasks": len(stages.ticks),
        "count": len(stages.output),
        "most": most_tries(stages),
        "tries": layout.start["counters"] + 2,
    }
    return f"""{caller.runtime}{rare_substep(stages)}
{caller.head} {{
  {PLAN}
  {caller.begin.format(**parts)}
  double c[CONSTANTS + 1];
  constants(p, c);
  {indented(_loads(layout, caller), 2)}
  {indented(block(hoisted), 2)}
  {indented(_mode_state(mode, name), 2)}
  {indented(declarations(groups, name), 2)}
  {indented([f"double {each}" for each in ahead], 2)}
  int64_t f = begin;
  for (; f < end + last; ++f) {{
    {caller.pause}
    {caller.row.format(**parts)}
    {indented(ticks, 4)}
    if (f % every == 0) {{
      {caller.outputs.format(**parts)}
      {indented(outputs, 6)}
      {caller.record.format(**parts)}
    }}
    if (f == end) break;
    {indented(block(framed), 4)}
    {indented([f"double s{k} = 0.0;" for k in range(len(products))], 4)}
    for (int64_t s = 0; s < substeps; ++s) {{
      {indented(block(mode.first), 6)}
      {indented(_mode_change(mode, graph, name), 6)}
      {indented(block(lead), 6)}
      {indented([line for k, each in enumerate(groups) for line in renewed(k, each)], 6)}
      {indented(substep(rest, frozenset(pass_roots)), 6)}
      if (__builtin_expect({condition(graph, stages.fast["flag"][0], name)}, 0)) {{
        {indented(_repeat(stages, results, name) + ahead, 8)}
      }} else {{
        {indented(_commit(results, products, name) + ahead, 8)}
      }}
    }}
    {indented(_integrals(stages, name), 4)}
  }}
  {indented(_stores(layout, caller), 2)}
  {caller.end}
}}
"""


_FEW = 4  # maximum number of copies of the exponential, whose compilation takes time


def _in_place(graph: Graph, order: Sequence[Node]) -> Dialect:
    """Return the dialect of a substep with elementary functions in place.

    Compilers then share the sine and cosine of the same angle.
    """
    chosen = {"sin", "cos"}
    if sum(1 for node in order if graph.nodes[node].op == "exp") <= _FEW:
        chosen.add("exp")
    calls = {op: f"{f}_here" if op in chosen else f for op, f in PLAIN_C.calls.items()}
    return replace(PLAIN_C, calls=calls)


def _mode_state(mode: Modes, name: Namer) -> list[str]:
    """Return the declarations of values that depend only on the mode, and of an invalid mode."""
    if not mode.atoms:
        return []
    return [*(f"double {name(n)} = 0.0;" for n in mode.values), "uint64_t mode = 0, fresh = 1;"]


def _mode_change(mode: Modes, graph: Graph, name: Namer) -> list[str]:
    """Return the statements that recompute these values after a change of the mode."""
    if not mode.atoms:
        return []
    bits = [f"(uint64_t){condition(graph, n, name)} << {k}" for k, n in enumerate(mode.atoms)]
    return [
        f"const uint64_t now = {' | '.join(bits)};",
        "if (__builtin_expect((now ^ mode) | fresh, 0)) {",
        "  mode = now;",
        "  fresh = 0;",
        *(f"  {line}" for line in statements(graph, mode.values, name, "")),
        "}",
    ]


def _entries(layout: Layout, caller: Caller) -> list[tuple[str, str]]:
    """Return the name of each entry of the state vector, and its location in memory."""
    places = [
        (f"{kind}{k}", layout.start[kind] + k)
        for kind, count in layout.length.items()
        for k in range(count)
    ]
    counters = layout.start["counters"]
    places += [(name, counters + k) for k, name in enumerate(("failures", "repeats", "tries"))]
    return [(name, caller.entry.format(k=at)) for name, at in places]


def _loads(layout: Layout, caller: Caller) -> list[str]:
    return [f"double {name} = {place};" for name, place in _entries(layout, caller)]


def _stores(layout: Layout, caller: Caller) -> list[str]:
    return [f"{place} = {name};" for name, place in _entries(layout, caller)]


def _commit(results: dict[str, Node], products: list[Node], name: Namer) -> list[str]:
    new = [f"const double {target}_ = {name(node)};" for target, node in results.items()]
    sums = [f"s{k} += {name(node)};" for k, node in enumerate(products)]
    return [*new, *sums, *(f"{target} = {target}_;" for target in results)]


def _integrals(stages: Stages, name: Namer) -> list[str]:
    """Return the statements that turn a frame's sums into integrals."""
    lines = []
    for j, pairs in enumerate(stages.quadrature.combinations):
        terms = [f"{name(c)} * s{k}" for c, k in pairs] or ["0.0"]
        lines.append(f"q{j} += {' + '.join(terms)};")
    return lines


def _repeat(stages: Stages, results: dict[str, Node], name: Namer) -> list[str]:
    graph, layout = stages.graph, layout_of(stages)
    nx, nm = layout.length["x"], layout.length["m"]
    xs = ", ".join(f"x{k}" for k in range(nx))
    ds = ", ".join(f"d{k}" for k in range(nx))
    ms = ", ".join(f"m{k}" for k in range(nm)) or "0.0"
    lines = [
        "double o[RESULTS];",
        f"const double xs[] = {{{xs}}}, ms[] = {{{ms}}};",
        f"const double ds[] = {{{ds}}};",
        f"const int known = !({condition(graph, stages.fast['doubtful'][0], name)});",
        *(f"o[{v}] = {as_number(graph, results[f'x{v}'], name)};" for v in stages.velocities),
        "cuts made;",
        "failures += located(c, h, ms, xs, ds, known, o, &made);",
        "repeats += 1.0;",
        "tries += made.tries;",
    ]
    at = 0
    for kind in STATE:
        sign = "+=" if kind == "q" else "="
        lines += [f"{kind}{k} {sign} o[{at + k}];" for k in range(layout.length[kind])]
        at += layout.length[kind]
    return lines
