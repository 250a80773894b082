"""Find the key figures by family and by name, and evaluate a family on a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

import xarray as xr

from bywire.bench import kpis
from bywire.bench.kpis.kpi import Kpi, Measure
from bywire.core.discovery import modules_of, pick


@dataclass(frozen=True)
class Family:
    """Key figures that are computed from the same data.

    Parameters
    ----------
    name
        Name of its module, for instance ``"step_response"``.
    summary
        One line for listings.
    setting_class
        What the family needs to know beside the recording.
    select
        ``select(recording, setting)``: the family's data.
    measures
        Its figures by name, in the order of the file; each has ``name``, ``unit`` and
        ``definition``.
    """

    name: str
    summary: str
    setting_class: type
    select: Callable[[xr.Dataset, Any], Any]
    measures: Mapping[str, Measure[Any]]


@cache
def families() -> Mapping[str, Family]:
    """Return every family: the modules in this folder that declare figures."""
    found: dict[str, Family] = {}
    for loaded in modules_of(kpis):
        name = loaded.__name__.rpartition(".")[2]
        figures = {m.name: m for m in vars(loaded).values() if isinstance(m, Measure)}
        if figures:
            summary = (loaded.__doc__ or "").strip().splitlines()[0]
            found[name] = Family(
                name, summary, loaded.Setting, loaded.select, figures
            )
    return found


@cache
def definitions() -> Mapping[str, Measure[Any]]:
    """Return every key figure by name, for listings; names are unique over the families."""
    found: dict[str, Measure[Any]] = {}
    for each in families().values():
        twice = found.keys() & each.measures.keys()
        if twice:
            raise TypeError(f"key figures declared twice: {', '.join(sorted(twice))}")
        found |= each.measures
    return found


def family(name: str) -> Family:
    """Return one family.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    return pick(families(), name, "family of key figures")


def units_of(*names: str, resolved: Mapping[str, str] = MappingProxyType({})) -> dict[str, str]:
    """Return the unit of every figure of some families, by the figure's name.

    Parameters
    ----------
    names
        Names of the families.
    resolved
        SI unit of every placeholder that their figures declare, for instance
        ``{"level": "Pa"}``.
    """
    figures = (figure for name in names for figure in family(name).measures.values())
    return {figure.name: resolved.get(figure.unit, figure.unit) for figure in figures}


def evaluate(name: str, recording: xr.Dataset, setting: Any) -> dict[str, Kpi]:
    """Return all figures of a family by name.

    Parameters
    ----------
    name
        Name of the family.
    recording
        A recording with the dimension ``time`` alone.
    setting
        The family's ``Setting``.

    Raises
    ------
    UnknownNameError
        When the family, or a signal that the setting asks for by name, is unknown.
    ParameterError
        When a signal has more dimensions than time.
    """
    chosen = family(name)
    data = chosen.select(recording, setting)
    return {figure.name: figure(data) for figure in chosen.measures.values()}
