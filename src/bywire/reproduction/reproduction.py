"""What the reproduction of a source consists of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import xarray as xr

from bywire.bench.running import Progress
from bywire.core.registry import Kind, instances
from bywire.report.tables import Table
from bywire.reproduction.item import Item
from bywire.reproduction.root_cause import RootCause
from bywire.reproduction.tolerance import Allowance

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Exhibit:
    """A figure with a name for its file and a caption."""

    name: str
    figure: Figure
    caption: str


@dataclass(frozen=True, eq=False)
class Part:
    """A table or a figure of the source, reproduced.

    Parameters
    ----------
    title
        Heading in the report.
    text
        What was done and what came out, for the report.
    items
        Statements beside computed numbers.
    exhibits
        Figures.
    recordings
        Runs worth keeping, by the name of their file.
    appendix
        Tables that stay folded in the report, by title.
    """

    title: str
    text: str
    items: tuple[Item, ...]
    exhibits: tuple[Exhibit, ...] = ()
    recordings: Mapping[str, xr.Dataset] = field(default_factory=dict)
    appendix: Mapping[str, Table] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Reproduction:
    """A source, reproduced.

    Parameters
    ----------
    source
        Name of the source.
    citation
        Full citation.
    parts
        Its tables and figures.
    causes
        Why statements disagree, the gravest cause first.
    allowances
        The tolerances in use, with their reasons.
    sets
        What to call the parameter sets, by what follows ``@`` in an item's id.
    """

    source: str
    citation: str
    parts: tuple[Part, ...]
    causes: tuple[RootCause, ...] = ()
    allowances: tuple[Allowance, ...] = ()
    sets: Mapping[str, str] = field(default_factory=dict)

    @property
    def items(self) -> tuple[Item, ...]:
        """All statements, in the order of the source."""
        return tuple(item for part in self.parts for item in part.items)

    @property
    def figures(self) -> tuple[Exhibit, ...]:
        """All figures."""
        return tuple(exhibit for part in self.parts for exhibit in part.exhibits)

    @property
    def recordings(self) -> dict[str, xr.Dataset]:
        """All recordings by name."""
        return {name: kept for part in self.parts for name, kept in part.recordings.items()}


@dataclass(frozen=True)
class Source:
    """A source that can be reproduced.

    Parameters
    ----------
    name
        What the command line calls it.
    summary
        One line for listings.
    reproduce
        ``reproduce(progress) -> Reproduction``; ``progress`` is called with the label of a piece
        of work and its finished share, 0 to 1, or is None.
    """

    name: str
    summary: str
    reproduce: Callable[[Progress | None], Reproduction]


SOURCES = Kind("source", ("paper",), instances(Source))
"""every source that can be reproduced"""
