"""Variables that a client of an exported part sets or gets, and what each of them means."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from bywire.core.field_notes import field_notes
from bywire.core.leaf import Leaf
from bywire.core.parameters import leaf_fields
from bywire.core.signals import signals_of
from bywire.export.exported import Exported

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
    """A number that a client sets or gets.

    Parameters
    ----------
    name
        Structured: ``motor.R_m``, ``caliper.p_table[1]``.
    causality
        What it is for a client.
    place, index
        Where the C code keeps it.
    unit, label
        SI unit, and what it means.
    start
        Value before anything is set; None of what is computed.
    leaf
        Range of a parameter.
    is_tunable
        Whether a parameter may change during the run: those that the ECU alone reads.
    is_held
        Whether it changes at ticks alone.
    ends
        Admissible range of an input whose signal declares one.
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
    """Return a recorded signal as it is now, or as the last tick left it."""
    name, signal = list(made.program.outputs.items())[k]
    if place == "row":
        return Variable(name, "output", place, k, signal.unit, signal.label)
    label = f"{signal.label}, after the tick at the beginning of the last step"
    return Variable(f"sampled.{name}", "local", place, k, signal.unit, label, is_held=True)


def state_variable(made: Exported, k: int, name: str, causality: Causality) -> Variable:
    """Return a continuous state as a variable of a name."""
    signal = list(signals_of(made.run.model.State).values())[k]
    at = made.layout.start["x"] + k
    start = made.vector[at] if causality == "input" else None
    return Variable(name, causality, "state", at, signal.unit, signal.label, start)


def memory_variable(made: Exported, k: int, causality: Causality) -> Variable:
    """Return what the ECU holds as a variable."""
    name, signal = list(signals_of(made.run.model.Memory).items())[k]
    at = made.layout.start["m"] + k
    start = made.vector[at] if causality == "input" else None
    return Variable(name, causality, "state", at, signal.unit, signal.label, start, is_held=True)


def parameter_variables(
    made: Exported, read: frozenset[int], tunable: frozenset[int]
) -> Iterator[Variable]:
    """Yield the parameters that are read, of which some are tunable, by index."""
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
    """Return the admissible ends of a parameter's range; None where it has no end.

    An end that does not belong to it becomes the next number within.
    """
    low = math.nextafter(leaf.low, math.inf) if leaf.low_open else leaf.low
    high = math.nextafter(leaf.high, -math.inf) if leaf.high_open else leaf.high
    return (None if math.isinf(leaf.low) else low, None if math.isinf(leaf.high) else high)
