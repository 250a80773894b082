"""Files of an exported run: module, description, loader and types, with the formulas as a table.

Instructions of straight-line code refer to their operands by number, so they compress poorly. In
this table, a value that is read once has no number: its operation follows the operands and pops
them from a stack. Most other operands are stored as the distance to a named value. Such distances
are small numbers, which compress well. All formulas share one table, and each formula computes only
the values that its results need.
"""

from __future__ import annotations

import json
import struct
import subprocess
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from bywire.core.child_process import run_program
from bywire.core.errors import CompilerError
from bywire.core.libraries import how_to_install
from bywire.core.scratch import process_folder, scratch_folder
from bywire.core.signals import Signal, ranges_of, signals_of
from bywire.export.exported import (
    Exported,
    Interface,
    braced,
    finite_range,
    interface,
    number,
    parameter_variables,
    start_nodes,
)
from bywire.simulation.c_runtime import SCALAR
from bywire.simulation.compiler import KERNEL_MATH, TIMEOUT, bundled_compiler
from bywire.simulation.emit_rare import CUT, PROJECTION, rare_header, rare_results
from bywire.simulation.expressions import needed
from bywire.simulation.graph import Graph, Node, Operation
from bywire.simulation.run import sampled_stimulus
from bywire.simulation.schedule import COUNTERS
from bywire.simulation.stages import STATE, Stages, leaf_count, unread

OPERATIONS = (
    "add",
    "sub",
    "mul",
    "neg",
    "inv",
    "fabs",
    "sqrt",
    "floor",
    "ceil",
    "copysign",
    "fmax",
    "fmin",
    "lt",
    "le",
    "eq",
    "ne",
    "not",
    "and",
    "or",
    "if_else_zero",
    "select",
    "exp",
    "log",
    "sin",
    "cos",
    "pow",
    "tan",
    "atan",
    "tanh",
)
"""operations in the order of their numbers in the table, the same as in the loader"""

_NEAR = 64  # maximum distance to a named value in one byte; 0 means none, larger bytes differ
_MOST = 0xFFFF  # lengths and names take two bytes
_EITHER = frozenset({"add", "mul", "eq", "ne", "and", "or"})  # commutative operations

_Places = Mapping[tuple[str, int], int]
_Value = tuple[Any, ...]
_Token = tuple[str, int, bool]  # operation, operands with names, whether the result gets a name


@dataclass(frozen=True)
class Formula:
    """A function of the table.

    Parameters
    ----------
    graph, results
        Expressions, and pairs of a node and its place in the working memory.
    again
        Zero for straight-line code. In a loop, the first result ends the loop, the next ``again``
        results start its next turn, and the loop adds up the remaining results.
    """

    graph: Graph
    results: Sequence[tuple[int, Node]]
    again: int = 0


@dataclass
class _Table:
    """Written form of expressions: tokens, and operands with the number of names before them."""

    names: dict[_Value, int]
    tokens: list[_Token] = field(default_factory=list)
    operands: list[tuple[int, int]] = field(default_factory=list)

    def add(self, graph: Graph, named: Node) -> None:
        """Append an expression that gets a name, including its operands without a name."""
        stack = [named]
        while stack:
            node = stack.pop()
            if node < 0:
                self._write(graph, ~node, ~node == named)
                continue
            stack.append(~node)
            parts = _operands(graph, node, self.names)
            stack += [a for a in reversed(parts) if _value(graph, a) not in self.names]
        self.names[_value(graph, named)] = len(self.names)

    def _write(self, graph: Graph, node: Node, is_named: bool) -> None:
        read = [self.names.get(_value(graph, a)) for a in _operands(graph, node, self.names)]
        mask = sum(1 << k for k, name in enumerate(read) if name is not None)
        op = graph.nodes[node].op
        self.tokens.append(("pow" if op == "constpow" else op, mask, is_named))
        self.operands += [(name, len(self.names)) for name in read if name is not None]


def _operands(graph: Graph, node: Node, names: Mapping[_Value, int]) -> list[Node]:
    """Return the operands in the order of the table."""
    op, parts = graph.nodes[node].op, list(graph.arguments(node))
    if op in _EITHER:
        parts.sort(key=lambda a: _value(graph, a) in names)
    if op in ("fmax", "fmin"):
        parts.sort(key=lambda a: graph.value(a) is not None)  # as in C
    return parts


def _value(graph: Graph, node: Node) -> _Value:
    """Return the identity of a value across graphs, which share inputs and constants."""
    operation = graph.nodes[node]
    is_leaf = operation.op in ("leaf", "const")
    return (operation.op, *operation.args) if is_leaf else (id(graph), node)


def table(formulas: Sequence[Formula], places: _Places) -> bytes:
    """Return the table of formulas; the results of the first formula are inputs of the others.

    Parameters
    ----------
    places
        Places of the inputs in the working memory, by kind and index.

    Raises
    ------
    CompilerError
        If there are more values than the table can address.
    """
    orders = [needed(f.graph, [n for _, n in f.results], lambda _: False) for f in formulas]
    uses, graphs = _uses(formulas, orders)
    inputs = sorted((v for v in uses if v[0] == "leaf"), key=lambda v: places[v[1], v[2]])
    constants = [v for v in uses if v[0] == "const"]
    made = _Table({leaf: k for k, leaf in enumerate((*inputs, *constants))})
    leaves = len(made.names)
    for value, count in uses.items():
        if value not in made.names and count > 1:
            made.add(graphs[value], value[1])
    numbers = [
        len(inputs),
        len(constants),
        len(formulas),
        *_steps([places[v[1], v[2]] for v in inputs]),
    ]
    for formula in formulas:
        numbers += [formula.again, len(formula.results)]
        numbers += _steps([made.names[_value(formula.graph, n)] for _, n in formula.results])
        numbers += _steps([place for place, _ in formula.results])
    return _packed(made, leaves, numbers, [float(v[1]) for v in constants])


def _uses(
    formulas: Sequence[Formula], orders: Sequence[Sequence[Node]]
) -> tuple[dict[_Value, int], dict[_Value, Graph]]:
    """Return the number of reads of each value, with operands before the values that use them."""
    uses: dict[_Value, int] = {}
    graphs: dict[_Value, Graph] = {}
    for formula, order in zip(formulas, orders, strict=True):
        graph = formula.graph
        results = [node for _, node in formula.results]
        for node in order:
            value = _value(graph, node)
            if value not in graphs:
                graphs[value] = graph
                for part in (_value(graph, a) for a in graph.arguments(node)):
                    uses[part] = uses.get(part, 0) + 1
                uses.setdefault(value, 0)
        for node in results:
            uses[_value(graph, node)] = uses.get(_value(graph, node), 0) + 2  # it needs a name
    return uses, graphs


def _steps(numbers: Sequence[int]) -> list[int]:
    """Return the differences of consecutive numbers, which are constant for regular steps."""
    return [(b - a) & 0xFFFF for a, b in zip([0, *numbers], numbers, strict=False)]


def _packed(made: _Table, leaves: int, numbers: list[int], constants: Sequence[float]) -> bytes:
    """Return the bytes of the table: lengths, then planes of similar bytes."""
    kinds = [kind for kind, _ in Counter(made.tokens).most_common()]
    count = max(len(made.tokens), len(made.operands), len(numbers) + len(made.operands))
    if count > _MOST or len(kinds) > 255:
        raise CompilerError(
            f"this run's formulas have {count} operands, but a module can contain only {_MOST}. "
            "Export the run as an FMU, which contains a compiled kernel",
            name="operands",
            value=str(count),
            valid=str(_MOST),
        )
    far = Counter(name for name, count in made.operands if not _is_near(name, count, leaves))
    often = sorted(name for name, _ in far.most_common(255 - _NEAR))
    code = {name: _NEAR + 1 + k for k, name in enumerate(often)}
    operands = bytearray()
    escaped = []
    for name, count in made.operands:
        operands.append(count - name if _is_near(name, count, leaves) else code.get(name, 0))
        if not operands[-1]:
            escaped.append(name)
    numbers = [
        *numbers,
        len(kinds),
        *(_number(kind) for kind in kinds),
        len(often),
        *_steps(often),
        *escaped,
    ]
    planes = [
        bytes(kinds.index(token) for token in made.tokens),
        bytes(operands),
        bytes(n & 0xFF for n in numbers),
        bytes(n >> 8 for n in numbers),
        struct.pack(f"<{len(constants)}d", *constants),
    ]
    return struct.pack("<3H", *(len(each) for each in planes[:3])) + b"".join(planes)


def _is_near(name: int, count: int, leaves: int) -> bool:
    return name >= leaves and count - name <= _NEAR


def _number(kind: _Token) -> int:
    op, mask, is_named = kind
    return OPERATIONS.index(op) << 4 | mask << 1 | is_named


def _with_section(module: bytes, name: str, content: bytes) -> bytes:
    """Return a WebAssembly module with an added custom section, which engines ignore."""
    title = name.encode()
    body = bytes([len(title)]) + title + content
    length, left = bytearray(), len(body)
    while left > 0x7F:
        length.append(left & 0x7F | 0x80)
        left >>= 7
    return module + b"\0" + bytes(length) + bytes([left]) + body


# --- The formulas of a run, and the places of their inputs and results, also in C

_OWN = OPERATIONS[OPERATIONS.index("exp") : OPERATIONS.index("pow") + 1]  # functions of the kernel


@dataclass(frozen=True)
class RunFormulas:
    """The table of a run's formulas, and the C text of its memory layout."""

    table: bytes
    header: str


def _run_formulas(made: Exported) -> RunFormulas:
    """Return the formulas of a run."""
    stages, graph = made.stages, made.stages.graph
    lengths = {kind: len(stages.fast[kind]) for kind in STATE}
    results, exact = rare_results(stages.fast), rare_results(stages.exact)
    products = stages.quadrature.products
    blocks = {
        **lengths,
        "m": len(stages.ticks[0]),
        "counters": COUNTERS,
        "p": made.program.sizes.parameters,
        "h": 1,
        "u": leaf_count(stages, "u"),
        "w": stages.rows,
        "force": stages.rows,
        "failed": 1,
        "posed": len(stages.posed),
        "o": len(results),
        "out": len(stages.output),
        "s": len(products),
    }
    at, total = {}, 0
    for kind, length in blocks.items():
        at[kind] = total
        total += length
    leaves = {(k, i): at[k] + i for k, length in blocks.items() for i in range(length)}

    def placed(kind: str, nodes: Sequence[Node]) -> list[tuple[int, Node]]:
        return [(at[kind] + k, node) for k, node in enumerate(nodes)]

    skipped = unread(stages)
    again = [
        (at[kind] + k, node)
        for kind in ("x", "d", "r")
        for k, node in enumerate(stages.fast[kind])
        if f"{kind}{k}" not in skipped
    ]
    start = start_nodes(made)
    others = [
        Formula(graph, [(0, stages.fast["flag"][0]), *again, *placed("s", products)], len(again)),
        Formula(graph, placed("o", results)),
        Formula(graph, placed("posed", stages.posed)),
        Formula(graph, placed("o", exact)),
        Formula(graph, placed("q", _integrals(stages))),
        Formula(graph, placed("out", stages.output)),
        Formula(start.graph, list(start.targets.items())) if start else Formula(Graph(), []),
        *(
            Formula(
                graph,
                [
                    each
                    for k, each in enumerate(placed("m", roots))
                    if each[1] != graph.leaf("m", k)
                ],
            )
            for roots in stages.ticks
        ),
    ]
    kept = _kept(stages, [n for each in others if each.graph is graph for _, n in each.results])
    first = Formula(graph, [(total + k, node) for k, node in enumerate(kept)])
    used = {
        f.graph.nodes[n].op
        for f in (first, *others)
        for n in needed(f.graph, [n for _, n in f.results], lambda _: False)
    }
    used = {"pow" if op == "constpow" else op for op in used}
    header = _header(made, at, total + len(kept), used)
    return RunFormulas(table([first, *others], leaves), header)


def _integrals(stages: Stages) -> list[Node]:
    """Return the integrals at the end of a frame; their coefficients are constant."""
    graph, nodes = stages.graph, []
    for k, pairs in enumerate(stages.quadrature.combinations):
        total = None
        for coefficient, product in pairs:  # in the same order as in the bench's kernel
            part = graph.intern(Operation("mul", (coefficient, graph.leaf("s", product))))
            total = part if total is None else graph.intern(Operation("add", (total, part)))
        q = graph.leaf("q", k)
        nodes.append(q if total is None else graph.intern(Operation("add", (q, total))))
    return nodes


def _kept(stages: Stages, roots: Sequence[Node]) -> list[Node]:
    """Return the values that depend only on parameters and step, and that expressions read."""
    graph, level = stages.graph, stages.level()
    order = needed(graph, roots, lambda _: False)
    readers = [node for node in order if level[node] or graph.is_boolean(node)]
    read = [*roots, *(a for node in readers for a in graph.arguments(node))]
    return [
        node
        for node in dict.fromkeys(read)
        if not level[node] and not graph.is_boolean(node) and graph.arguments(node)
    ]


def _header(made: Exported, at: dict[str, int], total: int, used: set[str]) -> str:
    stages, schedule = made.stages, made.schedule
    places = ", ".join(f"{kind.upper()}_AT = {place}" for kind, place in at.items())
    projected = "project(area + POSED_AT, area + W_AT, area + FORCE_AT)" if stages.rows else "0.0"
    return f"""{rare_header(stages)}
enum {{ {places}, AREA = {total} }};
enum {{ PRODUCTS = {len(stages.quadrature.products)}, STIMULI = {leaf_count(stages, "u")},
  ROWS = {len(stages.output)}, STATE = {made.layout.total}, SUBSTEPS = {schedule.substeps},
  TASKS = {len(schedule.task_frames)} }};
#define STEP {number(schedule.step)}
#define PROJECTED {projected}
static const int task_frames[] = {braced(map(str, schedule.task_frames))};
static const double state_start[] = {braced(map(number, made.vector))};
{PROJECTION if stages.rows else ""}
{"".join(_lent(op) for op in _OWN if op in used)}"""


def _lent(op: str) -> str:
    """Return the C text that exports an elementary function for the formulas."""
    given, taken = ("double a, double b", "a, b") if op == "pow" else ("double a", "a")
    return f"PAGE({op}) double lent_{op}({given}) {{ return bw_{op}({taken}); }}\n"


# --- The files

_HERE = Path(__file__).parent
_LOADER = ("formulas.mjs", "loader.mjs")
_FLAGS = (
    "-target",
    "wasm32-freestanding",
    "-mbulk-memory",
    "-Os",
    "-std=c11",
    "-nostdlib",
    "-fno-builtin",
    "-fno-slp-vectorize",
    "-fno-unroll-loops",
    *KERNEL_MATH,
    "-Wl,--no-entry",
    "-Wl,--import-table",
    "-s",
)


def module_files(
    made: Exported, name: str, further: Mapping[str, str] = MappingProxyType({})
) -> dict[str, bytes]:
    """Return the files of an exported run by name.

    ``further``: additional C functions for the module, by their exported name.

    Raises
    ------
    CompilerError
        If the extra ``compiler`` is missing or the compiler fails.
    """
    start = start_nodes(made)
    faces = interface(made, "brake", start.reads if start else frozenset())
    description = json.dumps(_description(made, name, start is not None, faces), indent=1)
    return {
        f"{name}.wasm": _module(made, further),
        f"{name}.json": description.encode(),
        "bywire.mjs": b"".join((_HERE / each).read_bytes() for each in _LOADER),
        "bywire.d.mts": (_HERE / "loader.d.ts").read_bytes(),
    }


def _module(made: Exported, further: Mapping[str, str]) -> bytes:
    """Return the module: code that all benches share, and the run's formulas as a table."""
    formulas = _run_formulas(made)
    headers = {"runtime.h": SCALAR, "layout.h": formulas.header, "cut.h": CUT}
    return _with_section(_compiled(headers, further), "formulas", formulas.table)


def _compiled(headers: Mapping[str, str], further: Mapping[str, str]) -> bytes:
    """Return the compiled part of a module."""
    compiler = bundled_compiler()
    if compiler is None:
        raise CompilerError(
            "WebAssembly needs the extra bywire[compiler], which is not installed "
            f"({how_to_install('compiler')})",
            name="compiler",
            valid="bywire[compiler]",
        )
    with scratch_folder(process_folder()) as folder:
        for name in ("math.h", "string.h", "page.c"):
            (folder / name).write_bytes((_HERE / name).read_bytes())
        for name, text in headers.items():
            (folder / name).write_text(text, encoding="utf-8")
        sources = [folder / "page.c"]
        for entry, text in further.items():
            sources.append(folder / f"{entry}.c")
            sources[-1].write_text(text, encoding="utf-8")
        made = folder / "module.wasm"
        exported = [f"-Wl,--export={entry}" for entry in further]
        command = [*compiler, *_FLAGS, *exported, f"-I{folder}", *map(str, sources)]
        try:
            done = run_program([*command, "-o", str(made)], TIMEOUT)
        except subprocess.TimeoutExpired:
            raise CompilerError(f"the compiler exceeded its limit of {TIMEOUT:g} s") from None
        if done.returncode != 0:
            message = "\n".join(done.stderr.splitlines()[:6]) or "(no message)"
            raise CompilerError(f"the compiler rejected the kernel for WebAssembly:\n{message}")
        return made.read_bytes()


def _description(
    made: Exported, name: str, begins_anywhere: bool, faces: Interface
) -> dict[str, Any]:
    """Return the description of a run for the loader and for users."""
    schedule, par = made.schedule, made.run.par
    count = made.program.sizes.parameters  # all, because the loader fills the whole vector
    used = {each.name for each in faces.of("parameter")}
    parameters = []
    for each in parameter_variables(made, frozenset(range(count)), frozenset()):
        low, high = (None, None) if each.leaf is None else finite_range(each.leaf)
        parameters.append(
            {
                "name": each.name,
                "unit": each.unit,
                "start": each.start,
                "low": low,
                "high": high,
                "range": "" if each.leaf is None else each.leaf.range_in(each.leaf.unit.symbol),
                "meaning": each.label,
                "used": each.name in used,
            }
        )
    return {
        "name": name,
        "model": made.run.model.name,
        "duration": made.run.duration,
        "settle": made.case.settle,
        "step": schedule.step,
        "frame": schedule.frame,
        "recordFrames": schedule.record_frames,
        "stimulusFrames": schedule.stimulus_frames,
        "stateLength": made.layout.total,
        "unsettledAt": made.layout.start["counters"],
        "beginsAtRest": begins_anywhere,
        "choices": {k: v for k, v in par.choices().items() if isinstance(v, (str, int))},
        "parameters": parameters,
        "stimulus": _stimuli(made),
        "signals": [_signal(k, s) for k, s in made.program.outputs.items()],
    }


def _stimuli(made: Exported) -> list[dict[str, Any]]:
    """Return the bench's stimulus without noise as steps: pairs of a time and the new value."""
    rows = sampled_stimulus(made.run, made.schedule)
    times = made.schedule.stimulus_times
    ranges = ranges_of(made.run.model.Stimulus)
    told: list[dict[str, Any]] = []
    for k, (name, signal) in enumerate(signals_of(made.run.model.Stimulus).items()):
        values = np.zeros(len(rows)) if name.startswith("noise_") else rows[:, k]
        changes = np.flatnonzero(np.diff(values, prepend=0.0))
        steps = [[float(times[at]), float(values[at])] for at in changes]
        ends = zip(("low", "high"), ranges.get(name, ()), strict=False)
        known = {end: value for end, value in ends if np.isfinite(value)}
        told.append({**_signal(name, signal), **known, "steps": steps})
    return told


def _signal(name: str, signal: Signal) -> dict[str, str]:
    return {"name": name, "unit": signal.unit, "label": signal.label}
