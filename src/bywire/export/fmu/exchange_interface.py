"""Variables of a plant in model exchange: states, derivatives, modes, event indicators."""

from __future__ import annotations

from collections.abc import Iterator

from bywire.core.signals import Signal, signals_of
from bywire.export.exported import Exported
from bywire.export.fmu.exchange_equations import Equations
from bywire.export.interface import Interface, leaves_read, readings
from bywire.export.variables import (
    Variable,
    memory_variable,
    parameter_variables,
    row_variable,
    state_variable,
)


def exchange_interface(equations: Equations, start_reads: frozenset[int]) -> Interface:
    """Return the variables of a plant whose states a client integrates.

    Parameters
    ----------
    start_reads
        Parameters that the initial values depend on, by index.
    """
    made, graph = equations.made, equations.graph
    read = leaves_read(graph, [n for nodes in equations.equations for n in nodes])
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
    """Return the names of the states; of those that are recorded otherwise, or held, another."""
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
    """Yield modes, how often they have changed, and what tells that they must."""
    model = equations.made.run.model
    continuous = equations.continuous
    known = signals_of(model.State)
    for k, name in enumerate(continuous.modal):
        label = f"{known[name].label}: 0 stuck, else the direction in which it moves"
        yield Variable(f"mode.{name}", "local", "mode", k, "1", label, is_held=True)
    for k in range(continuous.contacts):
        label = f"contact {k + 1}: 1 where it presses"
        yield Variable(f"mode.contact_{k + 1}", "local", "closed", k, "1", label, is_held=True)
    label = "how often a mode has changed"
    yield Variable("mode.changes", "local", "events", 0, "1", label, is_held=True)
    at = 0
    for name in continuous.modal:
        yield _indicator(at, f"{name}.motion", known[name], "until it turns, or meets its limit")
        yield _indicator(
            at + 1,
            f"{name}.hold",
            Signal("1", known[name].label),
            "what more would hold it where it is stuck",
        )
        at += 2
    for k in range(continuous.contacts):
        label = "how far it is pressed, or open"
        yield _indicator(at + k, f"contact_{k + 1}", Signal("1", f"contact {k + 1}"), label)


def _indicator(at: int, name: str, signal: Signal, meaning: str) -> Variable:
    label = f"{signal.label}: {meaning}"
    return Variable(f"indicator.{name}", "local", "indicator", at, signal.unit, label)
