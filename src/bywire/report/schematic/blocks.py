"""The schematic of a model with its text: which input of which part comes from where."""

from __future__ import annotations

from typing import Any

from bywire.core.assembly import Assembly
from bywire.core.connections import Network, Node, network
from bywire.report.document import Details, Drawing, TableBlock
from bywire.report.schematic.drawing import schematic_svg
from bywire.report.tables import Table, text_table


def schematic_blocks(model: Any, par: Any) -> list[Drawing | Details]:
    """Return the drawing of a model and a table that says the same; nothing without parts.

    Parameters
    ----------
    model
        What was run; only an `Assembly` knows its parts.
    par
        Parameters, whose choices say which equations hold.
    """
    if not isinstance(model, Assembly):
        return []
    known = network(model, par)
    parts = sum(node.kind == "part" for node in known.nodes)
    wires = sum(node.kind == "wire" for node in known.nodes)
    caption = (
        f"Schematic of {known.name}, from its equations: {parts} parts, {wires} wires (rounded). "
        "What comes with the flow enters at the left, what is fed back at the right."
    )
    title = f"Schematic of {known.name}; the table Parts and wires says the same"
    return [
        Drawing(lambda: schematic_svg(known, title), caption),
        Details("Parts and wires", [TableBlock(connection_table(known))]),
    ]


def connection_table(known: Network) -> Table:
    """Return every input and wire with what it follows from."""
    rows = []
    for node in known.nodes:
        for port in known.ports.get(node, ()) or ("",):
            sources = ", ".join(each.name for each in known.sources(node, port))
            rows.append((node.name, known.labels[node], port or "-", sources or _unfed(node)))
    return text_table(("part or wire", "what it is", "input", "follows from"), rows)


def _unfed(node: Node) -> str:
    return "the driver" if node.kind == "stimulus" else "itself and its parameters"
