"""C text of a plant's equations in continuous time, for model exchange."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import chain

from bywire.core.signals import signals_of
from bywire.export.exported import Exported
from bywire.export.interface import leaves_read
from bywire.export.model_header import braced, number
from bywire.simulation.c_runtime import SCALAR
from bywire.simulation.continuous import Continuous, build_continuous
from bywire.simulation.emission import indented, leaf_namer, statements
from bywire.simulation.expressions import as_number, needed
from bywire.simulation.graph import Graph
from bywire.simulation.operation import Node

LEAVES = {"p": "p", "x": "x", "m": "m", "c": "closed", "r": "reaction"}
"""arguments of the C functions by kind of leaf; integrals are none, they are not computed"""


@dataclass(frozen=True, eq=False)
class Equations:
    """The equations of an exported run's plant between two events, in one graph."""

    made: Exported

    @cached_property
    def continuous(self) -> Continuous:
        """Its symbolic functions."""
        return build_continuous(self.made.run.model, self.made.run.par)

    @cached_property
    def graph(self) -> Graph:
        """What the other properties put their nodes into."""
        return Graph()

    def _added(self, function: object, kinds: str) -> list[list[Node]]:
        n = self.made.program.sizes
        lengths = {
            "p": n.parameters,
            "x": n.x,
            "m": n.memory,
            "c": self.continuous.contacts,
            "r": len(self.continuous.modal),
            "q": n.flow,
        }
        leaves = [[self.graph.leaf(kind, k) for k in range(lengths[kind])] for kind in kinds]
        return self.graph.add_function(function, leaves)

    @cached_property
    def closing(self) -> list[Node]:
        """Whether each contact presses."""
        return self._added(self.continuous.closing, "xp")[0]

    @cached_property
    def equations(self) -> list[list[Node]]:
        """Right-hand sides, factors of derivatives, bounds, and of contacts what presses."""
        return self._added(self.continuous.equations, "xmpc")

    @cached_property
    def output(self) -> list[Node]:
        """What is recorded."""
        return self._added(self.continuous.output, "xmpcrq")[0]

    @property
    def shown(self) -> list[int]:
        """Recorded signals that state and inputs decide: no integrals, nothing of the ECU alone."""
        held = leaves_read(self.graph, chain(*self.equations))["m"]
        reads = [leaves_read(self.graph, [node]) for node in self.output]
        return [k for k, each in enumerate(reads) if not each["q"] and each["m"] <= held]

    @property
    def counts(self) -> dict[str, object]:
        """What the functions around the equations must know, by name of its macro."""
        states = list(signals_of(self.made.run.model.State).values())
        names = self.made.run.model.State._fields
        modal = [names.index(name) for name in self.continuous.modal]
        return {
            "MODAL": len(modal),
            "CONTACTS": self.continuous.contacts,
            "MODAL_STATES": braced(map(str, modal)),
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
