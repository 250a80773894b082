"""The whole benchmark in one run, with all parts of the toolkit and of every brake."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass

from benchmarks.declared import declared
from benchmarks.result import Result, failed, machine
from bywire.core.errors import CompilerError
from bywire.core.interrupts import interrupt_handled
from bywire.core.registry import pick
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
        Name in the progress bar.
    measure
        ``measure()``: returns the figures, one by one if they take long.
    """

    name: str
    measure: Callable[[], Iterable[Result]]


@dataclass(frozen=True)
class Benchmark(Answer):
    """All figures, and the machine on which they were measured."""

    machine: dict[str, object]
    results: tuple[Result, ...]
    status: str = "done"

    @property
    def failures(self) -> list[str]:
        """Failed measurements and their reasons."""
        return [f"{r.id} failed: {r.note}" for r in self.results if r.is_failed]

    @property
    def holds(self) -> bool:
        """Whether all parts were measured. Missing a goal is not a failure."""
        return not self.failures

    @property
    def partial(self) -> str:
        """Remark on the results of an interrupted benchmark."""
        return "the figures above were measured before the interruption" if self.results else ""

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
            data={
                "machine": self.machine,
                "status": self.status,
                "results": [asdict(each) for each in self.results],
            },
        )

    def _table(self) -> Table:
        verdict = {True: "yes", False: "no", None: "-"}
        rows = [
            (
                r.id,
                "failed" if r.is_failed else "-" if r.value is None else f"{r.value:.3g} {r.unit}",
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
    """Measure all parts, which takes several minutes, or some of them.

    A part that fails becomes a row with the reason. After Ctrl-C the result has the finished rows.

    Parameters
    ----------
    progress
        Called with the name of a part and its finished fraction, 0 to 1.
    parts
        Names of the parts to measure, for example ``["commands"]``. Default: all.

    Returns
    -------
    Benchmark
        All figures, each with its unit and goal.

    Raises
    ------
    UnknownNameError
        If a part does not exist.
    CompilerError
        If there is no C compiler.
    """
    if find_compiler() is None:
        raise CompilerError("the benchmark compares compiled C code. Install a C compiler")
    known = declared(Part)
    selected = {name: pick(known, name, "part of the benchmark") for name in parts} or known
    here = machine()
    results: list[Result] = []
    try:
        for label, part in selected.items():
            if progress is not None:
                progress(f"benchmark: {label}", 0.0)
            try:
                for result in part.measure():
                    results.append(result)
            except Exception as error:  # of any type, because other parts do not depend on it
                results.append(failed(label, error))
            if progress is not None:
                progress(f"benchmark: {label}", 1.0)
    except KeyboardInterrupt:
        interrupt_handled()
        return Benchmark(here, tuple(results), "interrupted")
    return Benchmark(here, tuple(results))
