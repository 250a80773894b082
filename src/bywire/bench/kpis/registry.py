"""Find the key figures by family and by name, and evaluate a family on a recording."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType, ModuleType
from typing import Any

import xarray as xr

from bywire.bench.kpis.kpi import Kpi, Measure
from bywire.bench.kpis.loop_family import LoopFamily
from bywire.bench.kpis.samples import signal
from bywire.core.errors import ModelError
from bywire.core.registry import Kind


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
    measures
        Its figures by name, in the order of the file; each has ``name``, ``unit`` and
        ``definition``.
    select
        ``select(recording, setting)``: the data that its functions take; None where they loop over
        samples.
    loops
        How those are run; None where there is ``select``.
    """

    name: str
    summary: str
    setting_class: type
    measures: Mapping[str, Measure]
    select: Callable[[xr.Dataset, Any], Any] | None = None
    loops: LoopFamily | None = None


def _declared(module: ModuleType) -> Iterator[Family]:
    """Yield the family that a module is: every module that declares figures."""
    figures = {m.name: m for m in vars(module).values() if isinstance(m, Measure)}
    if figures:
        summary = (module.__doc__ or "").strip().splitlines()[0]
        name = module.__name__.rpartition(".")[2]
        select = getattr(module, "select", None)
        if not hasattr(module, "Setting"):
            raise ModelError(
                f"{module.__file__}: key figures need a data class Setting beside them, with the "
                "names of their signals"
            )
        loops = None if select else LoopFamily(module)
        if loops is not None and not module.__name__.startswith("bywire.bench."):
            # A brake's: its author sees a mistake in the first run, and not in the first study.
            loops.translate()
        yield Family(name, summary, module.Setting, figures, select, loops)


FAMILIES = Kind("family of key figures", ("kpis",), _declared, "bywire.bench.kpis")
"""every family of key figures"""


def definitions() -> Mapping[str, Measure]:
    """Return every key figure by name, for listings; names are unique over the families."""
    known: dict[str, Measure] = {}
    for each in FAMILIES.all().values():
        twice = known.keys() & each.measures.keys()
        if twice:
            raise TypeError(f"key figures declared twice: {', '.join(sorted(twice))}")
        known |= each.measures
    return known


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
    figures = (figure for name in names for figure in FAMILIES.find(name).measures.values())
    return {figure.name: resolved.get(figure.unit, figure.unit) for figure in figures}


def recorded(name: str, setting: Any, signals: Collection[str]) -> dict[str, str]:
    """Return the unit of every figure of a family that such a recording can show, by its name.

    Parameters
    ----------
    name
        Name of the family.
    setting
        The family's ``Setting``.
    signals
        Names of the recorded signals.
    """
    return {
        figure.name: figure.unit
        for figure in FAMILIES.find(name).measures.values()
        if not figure.needs or any(getattr(setting, need) in signals for need in figure.needs)
    }


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
    chosen = FAMILIES.find(name)
    if chosen.loops is not None:
        return _by_loops(chosen.loops, recording, setting)
    assert chosen.select is not None
    data = chosen.select(recording, setting)
    return {figure.name: figure(data) for figure in chosen.measures.values()}


def _by_loops(family: LoopFamily, recording: xr.Dataset, setting: Any) -> dict[str, Kpi]:
    """Return the figures of one run; of a long one by C, where there is a compiler."""
    t, _ = signal(recording, "time")
    signals, level = family.signals_of(recording, setting)
    if family.is_worth_c(t.size):
        one = [None if y is None else y[None, :] for y in signals.values()]
        made = family.in_c(t, one, [setting])
        values: list[Any] = [
            family.undefined(why, numbers) if why else value
            for value, why, numbers in zip(
                made.values[:, 0].tolist(), made.reasons[:, 0], made.numbers[:, 0], strict=True
            )
        ]
    else:
        lists = {name: None if y is None else y.tolist() for name, y in signals.items()}
        values = list(family.in_python(t.tolist(), lists, setting).values())
    return {
        name: family.kpi(figure, value, setting, level)
        for (name, figure), value in zip(family.measures.items(), values, strict=True)
    }
