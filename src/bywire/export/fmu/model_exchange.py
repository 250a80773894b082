"""A plant in model exchange: modes between events, variables, and its equations as C text.

Set-valued forces become modes that change only at events. A body with dry friction slides forward
or backward, or sticks until the applied force exceeds the friction bounds. A state with a limit is
similar: its force is any push away from the limit. A contact is closed or open.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any

import casadi as ca

from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.signals import Signal, signals_of
from bywire.export.exported import (
    Exported,
    Interface,
    Variable,
    braced,
    leaves_read,
    memory_variable,
    number,
    parameter_variables,
    readings,
    row_variable,
    state_variable,
)
from bywire.simulation.c_runtime import SCALAR
from bywire.simulation.contacts import gaps, stiffness
from bywire.simulation.expressions import as_number, needed
from bywire.simulation.graph import Graph, Node
from bywire.simulation.scheme import NEVER, solve_small
from bywire.simulation.stages import indented, leaf_namer, statements
from bywire.simulation.symbols import SX, column, scalars, symbol_tuple


@dataclass(frozen=True)
class Continuous:
    """A plant's symbolic functions between two events.

    Parameters
    ----------
    modal
        States with a set-valued force: first those with friction, then those with a limit.
    contacts
        Number of contacts.
    closing
        ``(x, p) -> closed``: 1 for each closed contact, else 0.
    equations
        ``(x, m, p, closed) -> (balance, mass, low, high, pressed, lack)``: right-hand sides without
        set-valued forces, and factors of the derivatives, (nx,) each; bounds of the set-valued
        forces; each contact's force if only this contact were closed; and its overlap minus its
        elastic deflection.
    stops
        Stop operators.
    widths
        ``(x, m, p, closed, rate) -> (width, growth)``: widths of the stop operators, and their
        derivatives for the given derivatives of the states.
    output
        ``(x, m, p, closed, reaction, flow) -> o``: recorded signals; ``flow``: integrals.
    """

    modal: tuple[str, ...]
    contacts: int
    stops: tuple[str, ...]
    closing: Any
    equations: Any
    widths: Any
    output: Any


def build_continuous(model: Model, par: ParameterSet) -> Continuous:
    """Evaluate a plant on symbols.

    Parameters
    ----------
    model
        The system.
    par
        Any parameter set with the required structure. Its numbers become arguments.
    """
    names = tuple(par.leaves())
    p, x = SX.sym("p", len(names)), SX.sym("x", len(model.State._fields))
    symbolic: Any = par.with_leaves(dict(zip(names, scalars(p), strict=True)))
    m = SX.sym("m", len(model.Memory._fields))
    overlap = gaps(model, symbolic, x, x)
    closed = SX.sym("closed", overlap.shape[0])
    modal = (*model.frictions, *model.limits)
    reaction = SX.sym("reaction", len(modal) + len(model.stops))
    compliance = _compliance(model, symbolic)
    force = _forces(compliance, overlap, closed)
    state, memory = symbol_tuple(model.State, x), symbol_tuple(model.Memory, m)
    pressed = scalars(force)
    pairs = [
        (ca.fmin(SX(low), 0), ca.fmax(SX(high), 0))
        for low, high in model.bounds(state, state, memory, symbolic, pressed)
    ]
    pairs += [(SX(0), SX(NEVER))] * len(model.limits)
    equations = [
        column(model.balance(state, state, memory, symbolic, pressed)),
        column(model.mass(state, symbolic)),
        column([low for low, _ in pairs]),
        column([high for _, high in pairs]),
        column([compliance[k, k] * force[k] for k in range(overlap.shape[0])]),
        overlap - compliance @ force,
    ]
    rate = SX.sym("rate", x.shape[0])
    width = column(model.widths(state, state, memory, symbolic, pressed))
    width = ca.fmax(width, 0) if model.stops else width
    flow = SX.sym("flow", len(model.Flow._fields))
    integrals = symbol_tuple(model.Flow, flow)
    shown = model.output(state, memory, symbolic, pressed, scalars(reaction), integrals)
    K = stiffness(model, symbolic, overlap, exact=True)
    presses = column([ca.if_else(K[k, k] > 0, 1, 0) for k in range(overlap.shape[0])])
    return Continuous(
        modal,
        overlap.shape[0],
        model.stops,
        _function("closing", [x, p], [presses]),
        _function("equations", [x, m, p, closed], equations),
        _function("widths", [x, m, p, closed, rate], [width, ca.jtimes(width, x, rate)]),
        _function("output", [x, m, p, closed, reaction, flow], [column(shown)]),
    )


def _function(name: str, arguments: list[Any], results: list[Any]) -> Any:
    return ca.Function(name, arguments, [ca.densify(SX(each)) for each in results])


def _compliance(model: Model, par: ParameterSet) -> Any:
    """Return the compliances of all groups, block by block, shape (n, n)."""
    groups = [C for C in model.compliance(par) if C]
    blocks = [SX(ca.vertcat(*(ca.horzcat(*map(SX, row)) for row in C))) for C in groups]
    return ca.densify(ca.diagcat(*blocks)) if blocks else SX(0, 0)


def _forces(C: Any, overlap: Any, closed: Any) -> Any:
    """Return the contact forces F: C F = d for closed contacts, zero for open ones."""
    n = overlap.shape[0]
    if n == 0:
        return SX(0, 1)
    M, b = SX(C), SX(n, 1)
    for k in range(n):
        b[k] = ca.if_else(closed[k], overlap[k], 0)
        for j in range(n):
            if not M[k, j].is_zero():
                M[k, j] = ca.if_else(closed[k], C[k, j], 1.0 if j == k else 0.0)
    return ca.densify(solve_small(M, b))


# --- Variables and C text

LEAVES = {"p": "p", "x": "x", "m": "m", "c": "closed", "r": "reaction", "v": "rate"}
"""arguments of the C functions by kind of leaf, without the integrals, which the FMU omits"""


@dataclass(frozen=True, eq=False)
class Equations:
    """The equations of an exported run's plant between two events, in one graph."""

    made: Exported

    @cached_property
    def continuous(self) -> Continuous:
        """Symbolic functions of the plant."""
        return build_continuous(self.made.run.model, self.made.run.par)

    @cached_property
    def graph(self) -> Graph:
        """Graph that contains the nodes of the other properties."""
        return Graph()

    def _added(self, function: object, kinds: str) -> list[list[Node]]:
        n = self.made.program.sizes
        lengths = {
            "p": n.parameters,
            "x": n.x,
            "m": n.memory,
            "c": self.continuous.contacts,
            "r": len(self.continuous.modal) + len(self.continuous.stops),
            "v": n.x,
            "q": n.flow,
        }
        leaves = [[self.graph.leaf(kind, k) for k in range(lengths[kind])] for kind in kinds]
        return self.graph.add_function(function, leaves)

    @cached_property
    def closing(self) -> list[Node]:
        """Whether each contact is closed."""
        return self._added(self.continuous.closing, "xp")[0]

    @cached_property
    def equations(self) -> list[list[Node]]:
        """Right-hand sides, factors of derivatives, bounds, and overlaps of contacts."""
        return self._added(self.continuous.equations, "xmpc")

    @cached_property
    def widths(self) -> list[list[Node]]:
        """Widths of the stop operators, and their derivatives."""
        return self._added(self.continuous.widths, "xmpcv")

    @cached_property
    def output(self) -> list[Node]:
        """Recorded signals."""
        return self._added(self.continuous.output, "xmpcrq")[0]

    @property
    def shown(self) -> list[int]:
        """Recorded signals that depend on state and inputs, without integrals and ECU signals."""
        held = leaves_read(self.graph, chain(*self.equations, *self.widths))["m"]
        reads = [leaves_read(self.graph, [node]) for node in self.output]
        return [k for k, each in enumerate(reads) if not each["q"] and each["m"] <= held]

    @property
    def counts(self) -> dict[str, object]:
        """Constants for the C functions that use the equations, by the name of their macro."""
        states = list(signals_of(self.made.run.model.State).values())
        names = self.made.run.model.State._fields
        modal, stops = (
            [names.index(name) for name in listed]
            for listed in (self.continuous.modal, self.continuous.stops)
        )
        return {
            "MODAL": len(modal),
            "CONTACTS": self.continuous.contacts,
            "STOPS": len(stops),
            "MODAL_STATES": braced(map(str, modal)),
            "STOP_STATES": braced(map(str, stops)),
            "NOMINALS": braced(number(signal.nominal) for signal in states),
        }

    def source(self) -> str:
        """Return the C source."""
        names = ("balance", "mass", "low", "high", "pressed", "lack")
        results = {
            f"{name}[{k}]": node
            for name, nodes in zip(names, self.equations, strict=True)
            for k, node in enumerate(nodes)
        }
        outputs = ", ".join(f"double *{name}" for name in names)
        held = "const double *m, const double *closed"
        return SCALAR + "\n".join(
            (
                self._function(
                    "bw_closing",
                    "double *closed",
                    {f"closed[{k}]": node for k, node in enumerate(self.closing)},
                ),
                self._function("bw_equations", f"{held}, {outputs}", results),
                self._function(
                    "bw_widths",
                    f"{held}, const double *rate, double *width, double *growth",
                    {
                        f"{name}[{k}]": node
                        for name, nodes in zip(("width", "growth"), self.widths, strict=True)
                        for k, node in enumerate(nodes)
                    },
                ),
                self._function(
                    "bw_output",
                    f"{held}, const double *reaction, double *row",
                    {f"row[{k}]": self.output[k] for k in self.shown},
                ),
            )
        )

    def _function(self, name: str, arguments: str, results: dict[str, Node]) -> str:
        graph = self.graph
        named = leaf_namer(graph, lambda kind, k: f"{LEAVES[kind]}[{k}]", lambda n: f"v{n}")
        order = needed(graph, results.values(), lambda _: False)
        lines = statements(graph, order, named, "const double ")
        lines += [f"{place} = {as_number(graph, node, named)};" for place, node in results.items()]
        given = ["p", "x", *(each.rpartition("*")[2] for each in arguments.split(", "))]
        unused = f"{', '.join(f'(void){each}' for each in given)};"
        return (
            f"void {name}(const double *p, const double *x, {arguments}) {{\n"
            f"  {unused}\n  {indented(lines, 2)}\n}}\n"
        )


# --- Variables: states, derivatives, modes, event indicators


def exchange_interface(equations: Equations, start_reads: frozenset[int]) -> Interface:
    """Return the variables of a plant whose states a client integrates.

    Parameters
    ----------
    start_reads
        Indices of the parameters that the initial values depend on.
    """
    made, graph = equations.made, equations.graph
    read = leaves_read(graph, chain(*equations.equations, *equations.widths))
    shown = equations.shown
    names = _state_names(equations, shown)
    outputs = set(made.program.outputs)
    variables = [memory_variable(made, k, "input") for k in sorted(read["m"])]
    asked = readings(made)
    for k, name in enumerate(names):
        is_output = name in outputs or k in asked
        variables.append(state_variable(made, k, name, "output" if is_output else "local"))
    taken = {each.name for each in variables}
    rows = [row_variable(made, k, "row") for k in shown]
    variables += (each for each in rows if each.name not in taken)
    variables += _rates(made, names)
    variables += _modes(equations)
    closing = leaves_read(graph, equations.closing)
    outputs_read = leaves_read(graph, [equations.output[k] for k in shown])
    parameters = read["p"] | closing["p"] | outputs_read["p"] | start_reads
    variables += parameter_variables(made, parameters, frozenset())
    return Interface("plant", tuple(variables), "model-exchange")


def _state_names(equations: Equations, shown: list[int]) -> list[str]:
    """Return the names of the states, renamed where another signal has the same name."""
    made = equations.made
    recorded = list(made.program.outputs)
    taken = set(made.run.model.Memory._fields)
    taken |= {
        recorded[k]
        for k in shown
        if recorded[k] in made.run.model.State._fields
        and equations.output[k]
        != equations.graph.leaf("x", made.run.model.State._fields.index(recorded[k]))
    }
    return [f"state.{name}" if name in taken else name for name in made.run.model.State._fields]


def _rates(made: Exported, names: list[str]) -> Iterator[Variable]:
    for k, (name, signal) in enumerate(
        zip(names, signals_of(made.run.model.State).values(), strict=True)
    ):
        unit = "1/s" if signal.unit == "1" else f"{signal.unit}/s"
        yield Variable(f"der({name})", "local", "rate", k, unit, f"derivative: {signal.label}")


def _modes(equations: Equations) -> Iterator[Variable]:
    """Yield the modes, the number of mode changes, and the event indicators."""
    model = equations.made.run.model
    continuous = equations.continuous
    known = signals_of(model.State)
    for k, name in enumerate(continuous.modal):
        label = f"{known[name].label}: 0 stuck, otherwise its direction of motion"
        yield Variable(f"mode.{name}", "local", "mode", k, "1", label, is_held=True)
    for k in range(continuous.contacts):
        label = f"contact {k + 1}: 1 while closed"
        yield Variable(f"mode.contact_{k + 1}", "local", "closed", k, "1", label, is_held=True)
    for k, name in enumerate(continuous.stops, len(continuous.modal)):
        label = f"{known[name].label}: 0 follows its motion, otherwise the direction of its slip"
        yield Variable(f"mode.{name}", "local", "mode", k, "1", label, is_held=True)
    label = "number of mode changes"
    yield Variable("mode.changes", "local", "events", 0, "1", label, is_held=True)
    at = 0
    for name in continuous.modal:
        yield _indicator(at, f"{name}.motion", known[name], "distance to reversal or to its limit")
        yield _indicator(
            at + 1,
            f"{name}.hold",
            Signal("1", known[name].label),
            "margin of the holding force while stuck",
        )
        at += 2
    for k in range(continuous.contacts):
        label = "compression or gap"
        yield _indicator(at + k, f"contact_{k + 1}", Signal("1", f"contact {k + 1}"), label)
    for k, name in enumerate(continuous.stops, at + continuous.contacts):
        label = "distance to its width, or slip speed"
        yield _indicator(k, f"{name}.slip", Signal("1", known[name].label), label)


def _indicator(at: int, name: str, signal: Signal, meaning: str) -> Variable:
    label = f"{signal.label}: {meaning}"
    return Variable(f"indicator.{name}", "local", "indicator", at, signal.unit, label)
