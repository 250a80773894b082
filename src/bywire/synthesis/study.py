"""Sizing studies: many designs of a brake, compared at equal demands, and the best design."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import xarray as xr

from bywire.bench.kpis.kpi import Kpi
from bywire.core.arguments import checked
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.registry import Kind, instances
from bywire.core.typing import Progress
from bywire.core.units import shown


@dataclass(frozen=True)
class Mark:
    """A design on a map.

    Parameters
    ----------
    label
        Text of the legend.
    x, y
        Coordinates, SI.
    """

    label: str
    x: float
    y: float


@dataclass(frozen=True)
class Map:
    """Map of a variable of a study's dataset over two of its dimensions.

    Parameters
    ----------
    values, x, y
        Names of the variable and of its coordinates.
    caption
        Caption of the figure, one sentence.
    marks
        Designs to mark; the first is the optimum.
    limits
        Label -> variable, and its level at the boundary of the feasible region, outside which the
        variable is larger.
    curves
        Label -> abscissas and ordinates [SI] of a line for comparison, for example a closed form.
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
        Title of the list.
    data
        Variables over one dimension.
    columns
        Names of the columns, the dimension first.
    """

    title: str
    data: xr.Dataset
    columns: tuple[str, ...]


@dataclass(frozen=True)
class Findings:
    """Findings of a study.

    Parameters
    ----------
    data
        All designs; variables with ``units`` and ``long_name``.
    kpis
        The optimum, and the design for comparison.
    assumptions
        Constraints and neglected effects, one sentence each.
    maps
        Name -> map, in display order.
    cuts
        Tables.
    warnings
        Warnings.
    limits
        Limits of the best design, one sentence each.
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
        Name on the command line.
    assembly
        Name of the brake that it sizes.
    summary
        One line for listings.
    options
        Class of its options, each with unit and range.
    defaults
        Default options.
    compute
        ``compute(par, options, progress) -> Findings``.
    ruled
        Parameters, or groups of them, without effect on the study -> advice on what to set instead.
    """

    name: str
    assembly: str
    summary: str
    options: type[ParameterSet]
    defaults: ParameterSet
    compute: Callable[[Any, Any, Progress], Findings]
    ruled: Mapping[str, str] = field(default_factory=dict)

    def require_effect(self, names: Iterable[str]) -> None:
        """Reject changes of parameters without effect.

        Raises
        ------
        ParameterError
            With advice on what to set instead.
        """
        for name in names:
            for ruled, instead in self.ruled.items():
                if name == ruled or name.startswith(f"{ruled}."):
                    raise ParameterError(
                        f"{name} has no effect on study {self.name!r}: {instead}", name=name
                    )


@checked
def variable(values: Any, dims: tuple[str, ...], unit: str, label: str) -> xr.Variable:
    """Return a variable with its unit and label."""
    return xr.Variable(dims, values, {"units": unit, "long_name": label})


@checked
def variables(
    values: Mapping[str, Any], dims: tuple[str, ...], labels: Mapping[str, tuple[str, str]]
) -> dict[str, xr.Variable]:
    """Return variables over the same dimensions, by name, with units and labels."""
    return {name: variable(array, dims, *labels[name]) for name, array in values.items()}


@checked
def require_ranges(options: ParameterSet, ranges: Iterable[tuple[str, str, str]]) -> None:
    """Reject options whose lower end is not below the upper end.

    Parameters
    ----------
    ranges
        Names of both ends and their SI unit.

    Raises
    ------
    RuleError
        When a lower end is too high, for a validator of the options.
    """
    for low, high, unit in ranges:
        a, b = getattr(options, low), getattr(options, high)
        if not a < b:
            raise RuleError(low, shown(a, unit), f"below {high} = {shown(b, unit)}")


def edge_warnings(
    name: str, value: float, ends: tuple[float, float], unit: str, within: float = 1e-9
) -> tuple[str, ...]:
    """Return a warning if an optimum is at an end of the compared range.

    Parameters
    ----------
    name, value, unit
        Chosen quantity, its value [SI] and SI unit.
    ends
        Ends of the range.
    within
        Relative distance from an end that is treated as equal.
    """
    return tuple(
        f"the optimum is at the limit {name} = {shown(end, unit)}. Widen the range of {name}"
        for end in ends
        if math.isclose(value, end, rel_tol=within)
    )


STUDIES = Kind("study", ("studies",), instances(Study), declared="a Study")
"""every sizing study"""
