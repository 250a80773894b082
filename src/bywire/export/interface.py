"""What an exported part takes and gives: inputs, outputs and parameters, with their meaning."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Literal, get_args

from bywire.core.signals import ranges_of, signals_of
from bywire.export.exported import Exported
from bywire.export.variables import (
    Causality,
    Place,
    Variable,
    memory_variable,
    parameter_variables,
    row_variable,
    state_variable,
)
from bywire.simulation.graph import Graph
from bywire.simulation.operation import Node
from bywire.simulation.stages import Stages

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
        The whole brake, the plant (what the ECU holds are inputs), or the ECU (its readings of the
        plant are inputs).
    variables
        In the order of their value references.
    kind
        Whether it steps by itself, or a client's solver integrates it.
    """

    part: Part
    variables: tuple[Variable, ...]
    kind: Kind = "co-simulation"

    def of(self, causality: Causality) -> tuple[Variable, ...]:
        """Return the variables of a causality."""
        return tuple(each for each in self.variables if each.causality == causality)

    def at(self, place: Place) -> dict[int, int]:
        """Return the value references of what stands in a place, by index there."""
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
    """Indices of the leaves, by kind, that the passes read, the ticks, and each recorded signal."""

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
        """Return the recorded signals of a part: a plant's depend on what it is given alone."""
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
    """Return what a task computes: not what it leaves in the memory as it is."""
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
    """Return the names of the states that ticks read; as recorded where that is the same."""
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
    """Return a name of C for a bench.

    Examples
    --------
    >>> identifier_of("2nd brake: 37 bar")
    'b2nd_brake_37_bar'
    """
    plain = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "bench"
    return plain[:60] if plain[0].isalpha() else f"b{plain[:59]}"
