"""What an analysis is made of, and the sections that every report of one has."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from bywire.bench.bench import Bench
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.parameters import ParameterSet
from bywire.report.changes import bench_changes, changes_block, set_changes
from bywire.report.document import Change, Details, Paragraph, Section, TableBlock
from bywire.report.parameter_rows import parameter_rows
from bywire.report.tables import parameter_table


@dataclass(frozen=True)
class Subject:
    """A loop or a brake with its parameters.

    Parameters
    ----------
    name, summary
        What it is called, and one line on it.
    parameters, par
        Name of the parameter set, and the values in use.
    point
        Operating point as text; empty for none.
    bench
        The bench that is looked at; None where it is no bench.
    further
        What was changed beside a parameter set or a bench.
    varied
        Quantities that take several values.
    """

    name: str
    summary: str
    parameters: str
    par: ParameterSet
    point: str = ""
    bench: Bench | None = None
    further: tuple[Change, ...] = ()
    varied: tuple[str, ...] = ()

    @classmethod
    def of_bench(
        cls,
        bench: Bench,
        name: str = "",
        summary: str = "",
        varied: Collection[str] = (),
        further: tuple[Change, ...] = (),
    ) -> Subject:
        """Return a bench as a subject, called as it is itself unless something is given.

        ``varied``: quantities that take several values; ``further``: what else was changed.
        """
        return cls(
            name or bench.name or bench.experiment,
            summary or bench.summary(varied),
            bench.parameters,
            bench.par,
            bench=bench,
            varied=tuple(varied),
            further=further,
        )

    @property
    def changes(self) -> tuple[Change, ...]:
        """What the user changed."""
        if self.bench is not None:
            return (*bench_changes(self.bench), *self.further)
        return (*set_changes(self.parameters, self.par), *self.further)

    @property
    def changes_block(self) -> TableBlock | Paragraph:
        """The table of changes, or that there are none."""
        defaults = "" if self.bench is None else self.bench.experiment
        return changes_block(self.changes, self.parameters, defaults, self.varied)

    @property
    def line(self) -> str:
        """The line below a report's title."""
        at = f" at {self.point}" if self.point else ""
        return f"{self.summary}{at}; parameter set {self.parameters}"

    def provenance(self, *notes: str, has_changes: bool = True) -> Section:
        """Return the section on how a report was made: notes, changes, source, all parameters.

        ``has_changes``: whether the changes are part of it, rather than of an earlier section.

        Raises
        ------
        UnknownNameError
            When the parameter set is unknown.
        """
        cited = PARAMETER_SETS.find(self.parameters)
        rows = parameter_rows(self.par, cited.values)
        return Section(
            "How it was made",
            [
                *map(Paragraph, filter(None, notes)),
                *([self.changes_block] if has_changes else []),
                Paragraph(f"Source of the parameters: {cited.source}."),
                Details("All parameters", [TableBlock(parameter_table(rows))]),
            ],
        )
