"""The exported run of a bench: its variables, and C text of its model's data."""

from __future__ import annotations

import json
import math
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import Literal, get_args

import casadi as ca
import numpy as np

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case
from bywire.bench.running import run_of
from bywire.core.errors import BywireError, ParameterError, unknown_name
from bywire.core.parameters import Leaf, field_notes, leaf_fields
from bywire.core.signals import ranges_of, signals_of
from bywire.simulation.c_runtime import SCALAR
from bywire.simulation.emit_single import EXPORTED, emit_single
from bywire.simulation.engine import prepare
from bywire.simulation.expressions import as_number, needed
from bywire.simulation.graph import Graph, Node
from bywire.simulation.program import Program
from bywire.simulation.run import Run, initial_vector
from bywire.simulation.schedule import COUNTERS, Layout, Schedule
from bywire.simulation.stages import (
    Stages,
    build_stages,
    indented,
    layout_of,
    leaf_namer,
    statements,
)
from bywire.simulation.symbols import SX, column, scalars

_PLACES = {
    "parameter": "PARAMETER",
    "stimulus": "STIMULUS",
    "state": "IN_STATE",
    "row": "IN_ROW",
    "sampled": "IN_SAMPLED",
    "rate": "IN_RATE",
    "mode": "IN_MODE",
    "closed": "IN_CLOSED",
    "indicator": "IN_INDICATOR",
    "events": "IN_EVENTS",
}


def model_header(
    made: Exported,
    faces: Interface,
    start: str,
    token: str,
    modes: Mapping[str, object] | None = None,
) -> str:
    """Return the C header of an exported part.

    Parameters
    ----------
    start
        C function of the initial values, empty for none.
    token
        Unique identifier of the model.
    modes
        Further counts, for a plant in model exchange.
    """
    schedule, n = made.schedule, made.program.sizes
    counts = {
        "TOKEN": text(token),
        "STEP": number(schedule.step),
        "SUBSTEPS": schedule.substeps,
        "TASKS": len(schedule.task_frames),
        "TASK_FRAMES": braced(map(str, schedule.task_frames)),
        "PARAMETERS": n.parameters,
        "STIMULI": n.stimulus,
        "ROWS": n.output,
        "STATES": n.x,
        "STATE": made.layout.total,
        "COUNTERS": COUNTERS,
        "VARIABLES": len(faces.variables),
        "IS_PLANT": int(faces.part == "plant"),
        "IS_ECU": int(faces.part == "ecu"),
        "X_AT": made.layout.start["x"],
        "M_AT": made.layout.start["m"],
        **(modes or {}),
    }
    defines = "\n".join(f"#define {name} {value}" for name, value in counts.items())
    values, name = made.run.par.leaves().values(), made.bench.name or made.bench.experiment
    states = made.run.model.State._fields
    names = [text(task.name) for task in made.run.model.tasks(made.run.par)]
    rows = ",\n  ".join(map(_row, faces.variables))
    begins = start or f"{HEADING} {{\n  (void)p, (void)state;\n}}\n"
    return f"""/* Made by bywire of the bench {comment(name)}. */
#ifndef MODEL_H
#define MODEL_H
{SCALAR}
{defines}

enum {{ {", ".join(_PLACES.values())} }};
enum {{ FIXED, TUNABLE, GIVEN, RESULT }};
typedef struct {{
  const char *name, *unit, *range;
  int place, kind, index;
  double low, high;
}} variable;

static const variable variables[] = {{
  {rows}
}};
/* How many numbers a variable of version 3.0 holds: a table stands where its first node does. */
static const int sizes[] __attribute__((unused)) = {braced(_sizes(faces))};
static const char *const task_names[] __attribute__((unused)) = {braced(names)};
static const char *const state_names[] = {braced(map(text, states))};
static const double p_start[] = {braced(map(number, values))};
static const double u_start[] __attribute__((unused)) = {braced(map(number, made.demanded))};
static const double state_start[] = {braced(map(number, made.vector))};

static {begins}
#endif
"""


def _sizes(faces: Interface) -> Iterator[str]:
    for nodes in tables(faces):
        yield str(len(nodes))
        yield from ("0" for _ in nodes[1:])


def _row(each: Variable) -> str:
    kind = {"parameter": "TUNABLE" if each.is_tunable else "FIXED", "input": "GIVEN"}.get(
        each.causality, "RESULT"
    )
    if each.leaf is None:
        low, high = (end if math.isfinite(end) else None for end in each.ends)
        wanted = _ends(each) or "any finite number"
    else:
        (low, high), wanted = finite_range(each.leaf), each.leaf.range_text
    unit = "" if each.unit == "1" else f" {each.unit}"
    return (
        f"{{{text(each.name)}, {text(unit)}, {text(wanted)}, {_PLACES[each.place]}, {kind}, "
        f"{each.index}, {'-HUGE_VAL' if low is None else number(low)}, "
        f"{'HUGE_VAL' if high is None else number(high)}}}"
    )


def _ends(each: Variable) -> str:
    unit = "" if each.unit == "1" else f" {each.unit}"
    low, high = each.ends
    parts = [f">= {low:g}{unit}"] * math.isfinite(low)
    return " and ".join([*parts, *([f"<= {high:g}{unit}"] * math.isfinite(high))])


def text(value: str) -> str:
    """Return a C string; non-ASCII characters as octal bytes."""
    encoded = value.encode("utf-8")
    return (
        '"'
        + "".join(
            f"\\{chr(b)}" if chr(b) in '"\\' else chr(b) if 32 <= b < 127 else f"\\{b:03o}"
            for b in encoded
        )
        + '"'
    )


def comment(value: str) -> str:
    """Return a text that cannot end a C comment, in one line."""
    return re.sub(r"[^\w .,:()=+-]", "_", value)


def number(value: float) -> str:
    """Return a number that C reads as exactly the same double."""
    if not math.isfinite(value):
        raise ValueError(f"{value} cannot be written in C")
    return json.dumps(float(value))


def braced(values: Iterable[str]) -> str:
    """Return an initializer; for an empty one, a form that is valid in C."""
    return f"{{{', '.join(values) or '0'}}}"


# --- The exported run of a bench, and its variables: inputs and outputs


@dataclass(frozen=True, eq=False)
class Exported:
    """One run of a bench, for export.

    Parameters
    ----------
    bench
        Bench whose parameters, step and seed are exported.
    number, case
        Number of the run, and the run itself.
    run
        The engine's description of the run; its time begins with the settling.
    """

    bench: Bench
    number: int
    case: Case
    run: Run

    @cached_property
    def program(self) -> Program:
        """Its symbolic functions."""
        return prepare(self.run.model, self.run.par).program

    @cached_property
    def stages(self) -> Stages:
        """Its one expression graph."""
        return build_stages(self.program)

    @cached_property
    def kernel(self) -> str:
        """C source of its kernel: that of the bench's own run, without its pauses."""
        return emit_single(self.stages, EXPORTED)

    @property
    def layout(self) -> Layout:
        """Layout of the state vector."""
        return layout_of(self.stages)

    @cached_property
    def schedule(self) -> Schedule:
        """Its integer plan."""
        return self.run.schedule()

    @property
    def demanded(self) -> list[float]:
        """Stimulus at the start, without noise."""
        names = self.run.model.Stimulus._fields
        (row,) = self.run.stimulus(np.zeros(1))
        return [
            0.0 if name.startswith("noise_") else float(value)
            for name, value in zip(names, row, strict=True)
        ]

    @property
    def vector(self) -> list[float]:
        """State vector at the start."""
        started: list[float] = initial_vector(self.layout, self.run.state, self.run.memory).tolist()
        return started


def cases_of(bench: Bench) -> tuple[Case, ...]:
    """Return the runs of a bench, at least one.

    Raises
    ------
    ParameterError
        If the bench makes no run.
    """
    cases = bench.cases()
    if not cases:
        raise ParameterError(
            f"experiment {bench.experiment!r} computes a characteristic without any run, so bywire "
            "cannot export it. Use another experiment, for example 'open-loop'",
            name="experiment",
            value=repr(bench.experiment),
        )
    return cases


def exported(bench: Bench, label: str = "") -> Exported:
    """Return the exported run of a bench.

    Parameters
    ----------
    label
        Label of the run; may be omitted if there is only one.

    Raises
    ------
    ParameterError
        If the bench makes no run, several without a choice, or one whose parameters change.
    UnknownNameError
        If it has no run with that label.
    """
    cases = cases_of(bench)
    labels = [case.label for case in cases]
    if label and label not in labels:
        raise unknown_name("run", label, labels)
    if not label and len(cases) > 1:
        raise ParameterError(
            f"the bench has {len(cases)} runs, but bywire exports only one. Choose a run with "
            "case, "
            f"one of {', '.join(labels)}",
            name="case",
            value=str(len(cases)),
            valid=", ".join(labels),
        )
    number = labels.index(label) if label else 0
    run = run_of(bench, cases[number], number)
    if run.changes:
        raise ParameterError(
            "parameters of this bench change during the run, which bywire cannot export. Remove "
            "its [[faults]], or export it with the changed parameters",
            name="[[faults]]",
        )
    return Exported(bench, number, cases[number], run)


# --- The state in which a run begins, for other parameters than the exported ones, also in C

_AGREES = 1e-9  # relative difference of equal starts, computed in different ways
_NOT_SYMBOLIC = (BywireError, TypeError, ValueError, ArithmeticError, RuntimeError)

HEADING = "void bw_start(const double *p, double *state)"


@dataclass(frozen=True)
class Start:
    """Initial state of a run as a function of the parameters.

    Parameters
    ----------
    graph, targets
        Expressions, and the node for every place in the state vector that they set.
    reads
        Parameters that they read, by index.
    """

    graph: Graph
    targets: dict[int, Node]
    reads: frozenset[int]


def start_nodes(made: Exported) -> Start | None:
    """Return the equations of the start; None if it is not known for other parameters."""
    function = _start(made)
    if function is None:
        return None
    graph = Graph()
    leaves = [graph.leaf("p", k) for k in range(made.program.sizes.parameters)]
    states, memory = graph.add_function(function, [leaves])
    targets = {made.layout.start["x"] + k: node for k, node in enumerate(states)}
    targets |= {made.layout.start["m"] + k: node for k, node in enumerate(memory)}
    read = graph.read_by(targets.values())
    return Start(graph, targets, frozenset(k for k, leaf in enumerate(leaves) if leaf in read))


def start_source(made: Exported) -> tuple[str, frozenset[int]]:
    """Return the C function that sets the state vector, and the parameters that it reads.

    Empty text if the start is not known for other parameters: then the exported one is used.
    """
    start = start_nodes(made)
    if start is None:
        return "", frozenset()
    graph, roots = start.graph, list(start.targets.values())
    name = leaf_namer(graph, lambda kind, k: f"{kind}[{k}]", lambda node: f"v{node}")
    lines = statements(graph, needed(graph, roots, lambda _: False), name, "const double ")
    lines += [f"state[{at}] = {as_number(graph, n, name)};" for at, n in start.targets.items()]
    return f"{HEADING} {{\n  (void)p;\n  {indented(lines, 2)}\n}}\n", start.reads


def _start(made: Exported) -> ca.Function | None:
    """Return state and memory as functions of parameters; None if these cannot be symbols."""
    start, par = made.case.start, made.run.par
    if start is None:
        return None
    numbers = par.leaves()
    p = SX.sym("p", len(numbers))
    symbolic = par.with_leaves(dict(zip(numbers, scalars(p), strict=True)))
    try:
        state, memory = start(symbolic)
        results = [ca.densify(column(list(each))) for each in (state, memory)]
        function = ca.Function("start", [p], results)
    except _NOT_SYMBOLIC:
        return None
    computed = [np.asarray(each).ravel() for each in function(list(numbers.values()))]
    wanted = [np.array(each, dtype=np.float64) for each in (made.run.state, made.run.memory)]
    for value, exact in zip(computed, wanted, strict=True):
        if not np.allclose(value, exact, rtol=_AGREES, atol=1e-300):
            return None
    return function


# --- Variables

Place = Literal[
    "parameter",
    "stimulus",
    "state",
    "row",
    "sampled",
    "rate",
    "mode",
    "closed",
    "indicator",
    "events",
]
Causality = Literal["parameter", "input", "output", "local"]


@dataclass(frozen=True)
class Variable:
    """A number that a client sets or reads.

    Parameters
    ----------
    name
        Structured: ``motor.R_m``, ``caliper.p_table[1]``.
    causality
        Its role for a client.
    place, index
        Its place in the C code.
    unit, label
        SI unit, and meaning.
    start
        Initial value; None for computed variables.
    leaf
        Range of a parameter.
    is_tunable
        Whether a parameter may change during the run: only those of the ECU may.
    is_held
        Whether it changes only at ticks.
    ends
        Valid range of an input whose signal declares one.
    """

    name: str
    causality: Causality
    place: Place
    index: int
    unit: str
    label: str
    start: float | None = None
    leaf: Leaf | None = None
    is_tunable: bool = False
    is_held: bool = False
    ends: tuple[float, float] = (-math.inf, math.inf)


def row_variable(made: Exported, k: int, place: Literal["row", "sampled"]) -> Variable:
    """Return a recorded signal: its current value, or that of the last tick."""
    name, signal = list(made.program.outputs.items())[k]
    if place == "row":
        return Variable(name, "output", place, k, signal.unit, signal.label)
    label = f"{signal.label}, after the tick at the beginning of the last step"
    return Variable(f"sampled.{name}", "local", place, k, signal.unit, label, is_held=True)


def state_variable(made: Exported, k: int, name: str, causality: Causality) -> Variable:
    """Return a continuous state as a variable with a given name."""
    signal = list(signals_of(made.run.model.State).values())[k]
    at = made.layout.start["x"] + k
    start = made.vector[at] if causality == "input" else None
    return Variable(name, causality, "state", at, signal.unit, signal.label, start)


def memory_variable(made: Exported, k: int, causality: Causality) -> Variable:
    """Return an output of the ECU as a variable."""
    name, signal = list(signals_of(made.run.model.Memory).items())[k]
    at = made.layout.start["m"] + k
    start = made.vector[at] if causality == "input" else None
    return Variable(name, causality, "state", at, signal.unit, signal.label, start, is_held=True)


def parameter_variables(
    made: Exported, read: frozenset[int], tunable: frozenset[int]
) -> Iterator[Variable]:
    """Yield the parameters that are read, some of them tunable, by index."""
    fields = leaf_fields(type(made.run.par))
    notes = field_notes(type(made.run.par))
    for k, (name, value) in enumerate(made.run.par.leaves().items()):
        if k not in read:
            continue
        group, _, node = name.rpartition(".")
        leaf = fields.get(name) or fields[group]
        is_node = name not in fields
        shown = f"{group}[{int(node) + 1}]" if is_node else name
        label = notes[group if is_node else name]
        yield Variable(
            shown,
            "parameter",
            "parameter",
            k,
            leaf.unit.symbol,
            label,
            value,
            leaf,
            is_tunable=k in tunable,
        )


def finite_range(leaf: Leaf) -> tuple[float | None, float | None]:
    """Return the valid ends of a parameter's range; None for an infinite end.

    An open end becomes the next number within.
    """
    low = math.nextafter(leaf.low, math.inf) if leaf.low_open else leaf.low
    high = math.nextafter(leaf.high, -math.inf) if leaf.high_open else leaf.high
    return (None if math.isinf(leaf.low) else low, None if math.isinf(leaf.high) else high)


# --- Inputs, outputs and parameters

Part = Literal["brake", "plant", "ecu"]
PARTS: tuple[Part, ...] = get_args(Part)
Kind = Literal["co-simulation", "model-exchange"]
KINDS: tuple[Kind, ...] = get_args(Kind)
Numbered = tuple[int, Variable]


@dataclass(frozen=True)
class Interface:
    """All variables of a part of an exported run.

    Parameters
    ----------
    part
        The whole brake, the plant (outputs of the ECU are inputs), or the ECU (its readings of the
        plant are inputs).
    variables
        In the order of their value references.
    kind
        Whether it contains its own solver, or a client's solver integrates it.
    """

    part: Part
    variables: tuple[Variable, ...]
    kind: Kind = "co-simulation"

    def of(self, causality: Causality) -> tuple[Variable, ...]:
        """Return the variables of a causality."""
        return tuple(each for each in self.variables if each.causality == causality)

    def at(self, place: Place) -> dict[int, int]:
        """Return the value references of the variables in a place, by index there."""
        return {v.index: k for k, v in enumerate(self.variables) if v.place == place}


def interface(made: Exported, part: Part, start_reads: frozenset[int] = frozenset()) -> Interface:
    """Return the variables of a part.

    Parameters
    ----------
    start_reads
        Parameters that the initial values depend on, by index.
    """
    reads = _Reads.of(made.stages)
    asked = readings(made)
    signals: list[Variable] = []
    if part != "plant":
        signals += _stimuli(made, reads)
    if part == "plant":
        signals += (memory_variable(made, k, "input") for k in sorted(reads.plant["m"]))
    if part == "ecu":
        signals += (state_variable(made, k, name, "input") for k, name in asked.items())
        signals += (memory_variable(made, k, "output") for k in range(made.program.sizes.memory))
    taken = {each.name for each in signals}
    rows = [row_variable(made, k, "row") for k in reads.shown(part)]
    signals += (each for each in rows if each.name not in taken)
    if part == "plant":
        named = {each.name for each in rows}
        signals += (
            state_variable(made, k, name, "output")
            for k, name in asked.items()
            if name not in named
        )
    if part == "brake":
        signals += (row_variable(made, k, "sampled") for k in reads.shown(part))
    parameters = reads.parameters(part) | start_reads
    return Interface(part, (*signals, *parameter_variables(made, parameters, reads.tunable)))


@dataclass(frozen=True)
class _Reads:
    """Indices of the leaves, by kind, that the passes, the ticks and each recorded signal read."""

    plant: dict[str, frozenset[int]]
    ecu: dict[str, frozenset[int]]
    outputs: tuple[dict[str, frozenset[int]], ...]

    @classmethod
    def of(cls, stages: Stages) -> _Reads:
        passes = [
            node
            for each in (stages.fast, stages.exact)
            for nodes in each.values()
            for node in nodes
        ]
        passes += stages.posed + stages.quadrature.products
        passes += [c for pairs in stages.quadrature.combinations for c, _ in pairs]
        ticks = [node for roots in stages.ticks for node in _changed(stages, roots)]
        return cls(
            leaves_read(stages.graph, passes),
            leaves_read(stages.graph, ticks),
            tuple(leaves_read(stages.graph, [node]) for node in stages.output),
        )

    def shown(self, part: Part) -> list[int]:
        """Return the recorded signals of a part: those of a plant depend only on its inputs."""
        held = self.plant["m"]
        if part == "plant":
            return [k for k, each in enumerate(self.outputs) if each["m"] <= held]
        return list(range(len(self.outputs))) if part == "brake" else []

    def parameters(self, part: Part) -> frozenset[int]:
        """Return the parameters that a part depends on."""
        shown = frozenset[int]().union(*(self.outputs[k]["p"] for k in self.shown(part)))
        own = {
            "brake": self.plant["p"] | self.ecu["p"],
            "plant": self.plant["p"],
            "ecu": self.ecu["p"],
        }[part]
        return own | shown

    @property
    def tunable(self) -> frozenset[int]:
        """Parameters of the ECU alone."""
        return self.ecu["p"] - self.plant["p"]


def _changed(stages: Stages, roots: list[Node]) -> list[Node]:
    """Return the results of a task, without memory that it leaves unchanged."""
    return [node for k, node in enumerate(roots) if node != stages.graph.leaf("m", k)]


def leaves_read(graph: Graph, roots: Iterable[Node]) -> dict[str, frozenset[int]]:
    """Return the indices of the leaves that values are computed from, by kind."""
    read: defaultdict[str, set[int]] = defaultdict(set)
    for node in graph.read_by(roots):
        operation = graph.nodes[node]
        if operation.op == "leaf":
            read[operation.args[0]].add(operation.args[1])
    return defaultdict(frozenset, {kind: frozenset(each) for kind, each in read.items()})


def _stimuli(made: Exported, reads: _Reads) -> Iterator[Variable]:
    known, starts = signals_of(made.run.model.Stimulus), made.demanded
    ranges = ranges_of(made.run.model.Stimulus)
    for k, (name, signal) in enumerate(known.items()):
        if k in reads.ecu["u"]:
            label = signal.label + ", a standard normal number" * name.startswith("noise_")
            yield Variable(
                name,
                "input",
                "stimulus",
                k,
                signal.unit,
                label,
                starts[k],
                is_held=True,
                ends=ranges.get(name, (-math.inf, math.inf)),
            )


def readings(made: Exported) -> dict[int, str]:
    """Return the names of the states that ticks read; recorded names where they are equal."""
    outputs = list(made.program.outputs)
    memory = set(made.run.model.Memory._fields)
    names = {}
    for k in sorted(_Reads.of(made.stages).ecu["x"]):
        name = made.run.model.State._fields[k]
        leaf = made.stages.graph.leaf("x", k)
        is_other = name in outputs and made.stages.output[outputs.index(name)] != leaf
        names[k] = f"state.{name}" if is_other or name in memory else name
    return names


def tables(faces: Interface) -> Iterator[list[Numbered]]:
    """Yield the variables, the nodes of a table together, each with its value reference."""

    def owner(numbered: Numbered) -> tuple[str, int]:
        group, bracket, _ = numbered[1].name.partition("[")
        return (group, -1) if bracket else (group, numbered[0])

    for _, nodes in groupby(enumerate(faces.variables), owner):
        yield list(nodes)


def identifier_of(name: str) -> str:
    """Return a name in C for a bench.

    Examples
    --------
    >>> identifier_of("2nd brake: 37 bar")
    'b2nd_brake_37_bar'
    """
    plain = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "bench"
    return plain[:60] if plain[0].isalpha() else f"b{plain[:59]}"
