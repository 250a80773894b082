"""The whole benchmark, in one run: what the toolkit and every brake measure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

from bywire.benchmark.result import Result, machine
from bywire.core.errors import CompilerError
from bywire.core.registry import Kind, instances
from bywire.report.answer import Answer
from bywire.report.document import Document, Section, TableBlock
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
class Benchmark(Answer):
    """All figures, and the machine that they depend on."""

    machine: dict[str, object]
    results: tuple[Result, ...]

    def document(self) -> Document:
        """Return the figures with their goals."""
        table = TableBlock(self._table())
        shown = "; ".join(f"{name} {value}" for name, value in self.machine.items())
        return Document(
            "Benchmark",
            shown,
            sections=[Section("Figures", [table])],
            brief=[table],
            has_files=False,
            data={"machine": self.machine, "results": [asdict(each) for each in self.results]},
        )

    def _table(self) -> Table:
        verdict = {True: "yes", False: "no", None: "-"}
        rows = [
            (
                r.id,
                "-" if r.value is None else f"{r.value:.3g} {r.unit}",
                r.goal or "-",
                verdict[r.holds],
                r.note,
            )
            for r in self.results
        ]
        return text_table(("figure", "value", "goal", "holds", "how"), rows)


def measure(
    progress: Callable[[str, float], None] | None = None, parts: Sequence[str] = ()
) -> Benchmark:
    """Measure everything, which takes several minutes, or parts of it.

    Parameters
    ----------
    progress
        Called with the name of a part and its finished share, 0 to 1.
    parts
        Names of the parts to measure, for instance ``["commands"]``; all where empty.

    Returns
    -------
    Benchmark
        Every figure in its own unit, with its goal.

    Raises
    ------
    UnknownNameError
        When there is no such part.
    ------
    CompilerError
        Without a C compiler there is nothing to compare.
    """
    if find_compiler() is None:
        raise CompilerError("the benchmark compares compiled C: install a C compiler")
    wanted = {name: PARTS.find(name) for name in parts} or PARTS.all()
    here = machine()
    results: list[Result] = []
    for label, part in wanted.items():
        if progress is not None:
            progress(f"benchmark: {label}", 0.0)
        results += part.measure()
        if progress is not None:
            progress(f"benchmark: {label}", 1.0)
    return Benchmark(here, tuple(results))
