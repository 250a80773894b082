"""The whole benchmark, in one run: what the toolkit and every brake measure."""

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
        What the progress bar calls it.
    measure
        ``measure()``: its figures, one by one where they take long.
    """

    name: str
    measure: Callable[[], Iterable[Result]]


@dataclass(frozen=True)
class Benchmark(Answer):
    """All figures, and the machine that they depend on."""

    machine: dict[str, object]
    results: tuple[Result, ...]
    status: str = "done"

    @property
    def failures(self) -> list[str]:
        """What could not be measured, and why."""
        return [f"{r.id} failed: {r.note}" for r in self.results if r.is_failed]

    @property
    def holds(self) -> bool:
        """Whether every part was measured; a goal that is missed is a figure like another."""
        return not self.failures

    @property
    def partial(self) -> str:
        """What an interrupted benchmark still shows."""
        return "the figures above were measured before" if self.results else ""

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
    """Measure everything, which takes several minutes, or parts of it.

    A part that fails is a row that names the reason. After Ctrl-C the finished rows are kept.

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
    CompilerError
        Without a C compiler there is nothing to compare.
    """
    if find_compiler() is None:
        raise CompilerError("the benchmark compares compiled C: install a C compiler")
    known = declared(Part)
    wanted = {name: pick(known, name, "part of the benchmark") for name in parts} or known
    here = machine()
    results: list[Result] = []
    try:
        for label, part in wanted.items():
            if progress is not None:
                progress(f"benchmark: {label}", 0.0)
            try:
                for result in part.measure():
                    results.append(result)
            except Exception as error:  # of whatever kind: the other parts do not depend on it
                results.append(failed(label, error))
            if progress is not None:
                progress(f"benchmark: {label}", 1.0)
    except KeyboardInterrupt:
        interrupt_handled()
        return Benchmark(here, tuple(results), "interrupted")
    return Benchmark(here, tuple(results))
