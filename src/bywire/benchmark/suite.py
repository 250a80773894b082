"""The whole benchmark, in one run: what the toolkit and every brake measure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bywire.benchmark.result import Result, machine
from bywire.core.errors import CompilerError
from bywire.core.registry import Kind, instances
from bywire.report.tables import Table, text_table
from bywire.simulation.compiler import find_compiler


@dataclass(frozen=True)
class Part:
    """A part of the benchmark.

    Parameters
    ----------
    name
        What the progress bar calls it.
    measure
        ``measure()``: its figures.
    """

    name: str
    measure: Callable[[], list[Result]]


PARTS = Kind("part of the benchmark", ("benchmarks",), instances(Part), "bywire.benchmark.parts")
"""every part of the benchmark"""


@dataclass(frozen=True)
class Benchmark:
    """All figures, and the machine."""

    machine: dict[str, object]
    results: tuple[Result, ...]


def measure(progress: Callable[[str, float], None] | None = None) -> Benchmark:
    """Measure everything; takes a minute or two.

    Raises
    ------
    CompilerError
        Without a C compiler there is nothing to compare.
    """
    if find_compiler() is None:
        raise CompilerError("the benchmark compares compiled C: install a C compiler")
    here = machine()
    results: list[Result] = []
    for label, part in PARTS.all().items():
        if progress is not None:
            progress(f"benchmark: {label}", 0.0)
        results += part.measure()
        if progress is not None:
            progress(f"benchmark: {label}", 1.0)
    return Benchmark(here, tuple(results))


def as_json(found: Benchmark) -> dict[str, Any]:
    """Return the object that ``bywire benchmark --json`` prints."""
    return {
        "machine": found.machine,
        "results": [
            {
                "id": r.id,
                "value": r.value,
                "unit": r.unit,
                "goal": r.goal,
                "holds": r.holds,
                "note": r.note,
            }
            for r in found.results
        ],
    }


def as_table(found: Benchmark) -> Table:
    """Return the figures as a table."""
    verdict = {True: "yes", False: "no", None: "-"}
    rows = [
        (
            r.id,
            "-" if r.value is None else f"{r.value:.3g} {r.unit}",
            r.goal or "-",
            verdict[r.holds],
            r.note,
        )
        for r in found.results
    ]
    return text_table(("figure", "value", "goal", "holds", "how"), rows)
