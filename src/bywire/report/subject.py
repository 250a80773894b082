"""What an analysis is made of, and the sections that every report of one has."""

from __future__ import annotations

from dataclasses import dataclass

from bywire.core.catalog import PARAMETER_SETS
from bywire.core.parameters import ParameterSet
from bywire.report.document import Details, Paragraph, Section, TableBlock
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
    """

    name: str
    summary: str
    parameters: str
    par: ParameterSet
    point: str = ""

    @property
    def line(self) -> str:
        """The line below a report's title."""
        at = f" at {self.point}" if self.point else ""
        return f"{self.summary}{at}; parameter set {self.parameters}"

    def provenance(self, *notes: str) -> Section:
        """Return the section on how a report was made: notes, source and all parameters.

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
                *map(Paragraph, notes),
                Paragraph(f"Source of the parameters: {cited.source}."),
                Details("All parameters", [TableBlock(parameter_table(rows))]),
            ],
        )
