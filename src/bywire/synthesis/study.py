"""A sizing study: many designs of a brake, compared at equal demands, and the best of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import xarray as xr

from bywire.bench.kpis.kpi import Kpi
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.registry import Kind, instances

Progress = Callable[[str, float], None]
"""called with a label and the finished share, 0 to 1"""


@dataclass(frozen=True)
class Mark:
    """A design on a map.

    Parameters
    ----------
    label
        What the legend says.
    x, y
        Where it lies, SI.
    """

    label: str
    x: float
    y: float


@dataclass(frozen=True)
class Map:
    """How a variable of a study's dataset is shown over two of its dimensions.

    Parameters
    ----------
    values, x, y
        Names of the variable and of its coordinates.
    caption
        What the figure shows, one sentence.
    marks
        Designs to mark; the first is the optimum.
    limits
        Label -> variable and the level at which it draws the border of what is possible. Beyond
        it the variable is larger.
    curves
        Label -> abscissas and ordinates [SI] of a line to compare with, for instance a closed form.
    """

    values: str
    x: str
    y: str
    caption: str
    marks: tuple[Mark, ...] = ()
    limits: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    curves: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]] = field(default_factory=dict)


@dataclass(frozen=True)
class Cut:
    """Rows of the dataset as a table.

    Parameters
    ----------
    title
        What is listed.
    data
        Variables over one dimension.
    columns
        Names of the columns, the dimension first.
    """

    title: str
    data: xr.Dataset
    columns: tuple[str, ...]


@dataclass(frozen=True)
class Found:
    """What a study found.

    Parameters
    ----------
    data
        All designs; variables with ``units`` and ``long_name``.
    kpis
        The optimum and what it is compared with.
    assumptions
        What is kept equal, and what is left out, a sentence each.
    maps
        Name -> map, in the order in which they are shown.
    cuts
        Tables.
    warnings
        What the user should know.
    limits
        What limits the best design, a sentence each.
    """

    data: xr.Dataset
    kpis: tuple[Kpi, ...]
    assumptions: tuple[str, ...]
    maps: Mapping[str, Map]
    cuts: tuple[Cut, ...] = ()
    warnings: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()


@dataclass(frozen=True)
class Study:
    """A named study.

    Parameters
    ----------
    name
        What the command line calls it.
    assembly
        Name of the brake that it sizes.
    summary
        One line for listings.
    options
        Class of its options, each with unit and range.
    defaults
        Options unless others are given.
    compute
        ``compute(par, options, progress) -> Found``.
    ruled
        Parameters, or groups of them, without effect on the study -> what rules them instead.
    """

    name: str
    assembly: str
    summary: str
    options: type[ParameterSet]
    defaults: ParameterSet
    compute: Callable[[Any, Any, Progress], Found]
    ruled: Mapping[str, str] = field(default_factory=dict)

    def require_effect(self, names: Iterable[str]) -> None:
        """Refuse to set parameters that would change nothing.

        Raises
        ------
        ParameterError
            With what to set instead.
        """
        for name in names:
            for ruled, instead in self.ruled.items():
                if name == ruled or name.startswith(f"{ruled}."):
                    raise ParameterError(
                        f"{name} has no effect on study {self.name!r}: {instead}"
                    )


def variable(values: Any, dims: tuple[str, ...], unit: str, label: str) -> xr.Variable:
    """Return a variable with its unit and label."""
    return xr.Variable(dims, values, {"units": unit, "long_name": label})


STUDIES = Kind("study", ("studies",), instances(Study), declared="a Study")
"""every sizing study"""
