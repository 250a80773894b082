"""The run of a bench that is exported: what its kernel is emitted from, and where it begins."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case
from bywire.bench.running import run_of
from bywire.core.errors import BywireError, ParameterError, unknown_name
from bywire.simulation.emit_single import EXPORTED, emit_single
from bywire.simulation.engine import prepare
from bywire.simulation.expressions import as_number, needed
from bywire.simulation.graph import Graph, Node
from bywire.simulation.program import Program
from bywire.simulation.run import Run, initial_vector
from bywire.simulation.schedule import Layout, Schedule
from bywire.simulation.stages import (
    Stages,
    build_stages,
    indented,
    layout_of,
    leaf_namer,
    statements,
)
from bywire.simulation.symbols import SX, column, scalars


@dataclass(frozen=True, eq=False)
class Exported:
    """One run of a bench, for export.

    Parameters
    ----------
    bench
        Whose parameters, step and seed are exported.
    number, case
        Which of its runs.
    run
        The engine's description of it; its time begins with the settling.
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
        """Where what stands in the state vector."""
        return layout_of(self.stages)

    @cached_property
    def schedule(self) -> Schedule:
        """Its integer plan."""
        return self.run.schedule()

    @property
    def demanded(self) -> list[float]:
        """What drives the run at its start, without noise."""
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
    """Return the runs of a bench, of which there is one at least.

    Raises
    ------
    ParameterError
        When the bench makes no run.
    """
    cases = bench.cases()
    if not cases:
        raise ParameterError(
            f"experiment {bench.experiment!r} computes a characteristic without any run, and "
            "there is nothing to export: take another experiment, for instance 'open-loop'"
        )
    return cases


def exported(bench: Bench, label: str = "") -> Exported:
    """Return the run of a bench that is exported.

    Parameters
    ----------
    label
        Which of its runs; may be left out where there is but one.

    Raises
    ------
    ParameterError
        When the bench makes no run, several without a choice, or one whose parameters change.
    UnknownNameError
        When it has no run of that label.
    """
    cases = cases_of(bench)
    labels = [case.label for case in cases]
    if label and label not in labels:
        raise unknown_name("run", label, labels)
    if not label and len(cases) > 1:
        raise ParameterError(
            f"the bench makes {len(cases)} runs, and one is exported: choose it, "
            f"case = {' or '.join(map(repr, labels))}"
        )
    number = labels.index(label) if label else 0
    run = run_of(bench, cases[number], number)
    if run.changes:
        raise ParameterError(
            "parameters of this bench change during the run, which cannot be exported: leave out "
            "its [[faults]], or export it with the changed parameters"
        )
    return Exported(bench, number, cases[number], run)


# --- The state in which a run begins, for other parameters than the exported ones, also in C

_AGREES = 1e-9  # of a value, that the same start may differ where it was computed otherwise
_NOT_SYMBOLIC = (BywireError, TypeError, ValueError, ArithmeticError, RuntimeError)

HEADING = "void bw_start(const double *p, double *state)"


@dataclass(frozen=True)
class Start:
    """The state in which a run begins, over parameters.

    Parameters
    ----------
    graph, targets
        Expressions, and the node of every place in the state vector that they set.
    reads
        Parameters that they read, by index.
    """

    graph: Graph
    targets: dict[int, Node]
    reads: frozenset[int]


def start_nodes(made: Exported) -> Start | None:
    """Return the equations of the start; None where it is not known for other parameters."""
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
    """Return the C function that sets the state vector, and which parameters it reads.

    Empty text where the start is not known for other parameters: the exported one then stays.
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
    """Return state and memory over parameters; None where these cannot be symbols."""
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
