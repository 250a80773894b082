"""Families of key figures: found by name, evaluated on one recording or on many cases."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from bywire.bench.kpis.kpi import Kpi, KpiOfCases, Measure
from bywire.bench.kpis.loop_family import FiguresInC, LoopFamily
from bywire.bench.kpis.samples import signal
from bywire.bench.recording import Rows
from bywire.core.errors import CompilerError, ModelError
from bywire.core.parameters import ParameterSet
from bywire.core.registry import Kind

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Family:
    """Family of key figures, computed from the same data.

    Parameters
    ----------
    name
        Name of its module, for example ``"step_response"``.
    summary
        One line for listings.
    setting_class
        Class of the family's inputs in addition to the recording.
    measures
        Its figures by name, in the order of the file; each has ``name``, ``unit`` and
        ``definition``.
    select
        ``select(recording, setting)``: data for its functions; None if they loop over samples.
    loops
        Functions that loop over samples; None with ``select``.
    """

    name: str
    summary: str
    setting_class: type
    measures: Mapping[str, Measure]
    select: Callable[[xr.Dataset, Any], Any] | None = None
    loops: LoopFamily | None = None


def _declared(module: ModuleType) -> Iterator[Family]:
    """Yield the family of a module that declares figures."""
    figures = {m.name: m for m in vars(module).values() if isinstance(m, Measure)}
    if figures:
        summary = (module.__doc__ or "").strip().splitlines()[0]
        name = module.__name__.rpartition(".")[2]
        select = getattr(module, "select", None)
        if not hasattr(module, "Setting"):
            raise ModelError(
                f"{module.__file__} declares key figures but no data class Setting. Add one with "
                "the names of the signals that the key figures need",
                name="Setting",
            )
        loops = None if select else LoopFamily(module)
        if loops is not None and not module.__name__.startswith("bywire.bench."):
            # So a brake's author gets the error in the first run, not in the first study.
            loops.translate()
        yield Family(name, summary, module.Setting, figures, select, loops)


FAMILIES = Kind("family of key figures", ("kpis",), _declared, "bywire.bench.kpis")
"""every family of key figures"""


def definitions() -> Mapping[str, Measure]:
    """Return every key figure by name, for listings; names are unique across families."""
    known: dict[str, Measure] = {}
    for each in FAMILIES.all().values():
        twice = known.keys() & each.measures.keys()
        if twice:
            raise TypeError(f"key figures declared twice: {', '.join(sorted(twice))}")
        known |= each.measures
    return known


def units_of(*names: str, resolved: Mapping[str, str] = MappingProxyType({})) -> dict[str, str]:
    """Return the units of all figures of some families, by the figure's name.

    Parameters
    ----------
    names
        Names of the families.
    resolved
        SI unit of every placeholder that their figures declare, for example
        ``{"level": "Pa"}``.
    """
    figures = (figure for name in names for figure in FAMILIES.find(name).measures.values())
    return {figure.name: resolved.get(figure.unit, figure.unit) for figure in figures}


def recorded(name: str, setting: Any, signals: Collection[str]) -> dict[str, str]:
    """Return the unit of every figure of a family with recorded signals, by name.

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
        A recording with only the dimension ``time``.
    setting
        The family's ``Setting``.

    Raises
    ------
    UnknownNameError
        When the family, or a signal in the setting, is unknown.
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
    """Return the figures of one run; C computes those of a long run, if there is a compiler."""
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


# --- Many cases


@dataclass(frozen=True)
class FamilyJudge:
    """Judge of an experiment with one run whose key figures come from families.

    It judges many cases at once, from only the needed signals.

    Parameters
    ----------
    settings
        ``settings(options)``: the ``Setting`` of each family by its name.
    left_out
        Figures of these families to omit.
    levels
        ``levels(run, options)``: values of settings that depend on the parameters of a run, by the
        family's name and the setting's field; None if there are none.
    further
        ``further(run, options)``: additional figures of the experiment, which come first.
    further_signals
        Names of all signals that these figures read.
    """

    settings: Callable[[Any], Mapping[str, Any]]
    left_out: Collection[str] = ()
    levels: Callable[[xr.Dataset, Any], Mapping[str, Mapping[str, Any]]] | None = None
    further: Callable[[xr.Dataset, Any], tuple[Kpi, ...]] | None = None
    further_signals: tuple[str, ...] = ()

    def __call__(self, recordings: Mapping[str, xr.Dataset], options: Any) -> tuple[Kpi, ...]:
        """Return the key figures of the run."""
        (run,) = recordings.values()
        settings = self._of_run(self.settings(options), run, options)
        given = [evaluate(name, run, each) for name, each in settings.items()]
        own = () if self.further is None else self.further(run, options)
        return own + tuple(kpi for each in given for kpi in each.values() if self._wants(kpi.name))

    def of_cases(
        self, rows: Rows, options: Sequence[Any], pars: Sequence[ParameterSet | None] = ()
    ) -> tuple[KpiOfCases, ...]:
        """Return the key figures of many cases.

        ``rows``: signals of shape (cases, time); ``options``, ``pars``: options and parameters of
        each case, of one structure; levels and additional figures need the parameters.
        """
        distinct = {id(chosen): chosen for chosen in options}  # mostly one
        known = {number: self.settings(chosen) for number, chosen in distinct.items()}
        each = [known[id(chosen)] for chosen in options]
        own: Iterable[KpiOfCases] = ()
        if self.levels is not None or self.further is not None:
            runs = [cast("xr.Dataset", rows.case(k, par=par)) for k, par in enumerate(pars)]
            each = list(map(self._of_run, each, runs, options))
            if self.further is not None:
                own = of_cases(list(map(self.further, runs, options)))
        given = [evaluate_cases(name, rows, [s[name] for s in each]) for name in each[0]]
        wanted = (kpi for kpis in given for kpi in kpis.values() if self._wants(kpi.name))
        return (*own, *wanted)

    def signals(self, options: Sequence[Any]) -> set[str]:
        """Return the names of all signals that the judge may read for cases with these options."""
        distinct = {id(chosen): chosen for chosen in options}.values()
        each = {setting for chosen in distinct for setting in self.settings(chosen).values()}
        named = {name for setting in each for name in signals_of_setting(setting)}
        return named.union(self.further_signals)

    def _of_run(
        self, settings: Mapping[str, Any], run: xr.Dataset, options: Any
    ) -> Mapping[str, Any]:
        """Return the settings with the values that depend on the parameters of a run."""
        if self.levels is None:
            return settings
        levels = self.levels(run, options)
        return {name: replace(each, **levels.get(name, {})) for name, each in settings.items()}

    def _wants(self, name: str) -> bool:
        return name not in self.left_out


def signals_of_setting(setting: Any) -> set[str]:
    """Return all texts in a family's ``Setting``: names of signals, and possibly others."""
    return {value for value in vars(setting).values() if isinstance(value, str) and value}


def evaluate_cases(name: str, rows: Rows, settings: Sequence[Any]) -> dict[str, KpiOfCases]:
    """Return all figures of a family by name, of many cases at once.

    A family that loops over samples runs in C. Other families, and all families on a machine
    without a compiler, run case by case in Python.

    Parameters
    ----------
    name
        Name of the family.
    rows
        Signals of shape ``(cases, time)``.
    settings
        The family's ``Setting`` of each case.

    Raises
    ------
    UnknownNameError
        When the family, or a signal in a setting, is unknown.
    """
    chosen = FAMILIES.find(name)
    if chosen.loops is not None:
        together = _in_c(chosen.loops, rows, settings)
        if together is not None:
            return together
    each = [
        evaluate(name, cast("xr.Dataset", rows.case(k)), setting).values()
        for k, setting in enumerate(settings)
    ]
    return {figure.name: figure for figure in of_cases(each)}


def of_cases(each: Sequence[Iterable[Kpi]]) -> Iterator[KpiOfCases]:
    """Yield each key figure for all cases; every case has the same figures."""
    for kpis in zip(*each, strict=True):
        values, notes = np.array([kpi.value for kpi in kpis]), [kpi.note for kpi in kpis]
        first, is_open = kpis[0], [kpi.is_open for kpi in kpis]
        yield KpiOfCases(
            first.name, values, first.unit, first.definition, notes.__getitem__, is_open.__getitem__
        )


def _in_c(family: LoopFamily, rows: Rows, settings: Sequence[Any]) -> dict[str, KpiOfCases] | None:
    """Return the figures of cases with the same signals from C; None without a compiler."""
    first = settings[0]
    distinct = {id(setting): setting for setting in settings}.values()
    if not family.is_compiled or any(
        getattr(each, name) != getattr(first, name) for each in distinct for name in family.signals
    ):
        return None
    on_device = _on_device(family, rows, settings)
    if on_device is None:
        signals, level = family.signals_of(cast("xr.Dataset", rows), first)
        made = family.in_c(rows["time"].values, list(signals.values()), settings)
    else:
        made, level = on_device

    left_open = [place for place, each in enumerate(family.reasons, 1) if each.is_open]

    def note(place: int, figure: Measure, k: Any) -> str:
        reason = int(made.reasons[place, k])
        numbers = made.numbers[place, k].tolist()
        given = family.undefined(reason, numbers) if reason else 0.0
        return family.kpi(figure, given, settings[k], level).note

    return {
        name: KpiOfCases(
            name,
            made.values[place],
            family.kpi(figure, 0.0, first, level).unit,
            figure.definition,
            partial(note, place, figure),
            np.isin(made.reasons[place], left_open).tolist().__getitem__,
        )
        for place, (name, figure) in enumerate(family.measures.items())
    }


def _on_device(
    family: LoopFamily, rows: Rows, settings: Sequence[Any]
) -> tuple[FiguresInC, str] | None:
    """Return the figures of cases whose rows a graphics processor holds, and the level's unit.

    None for other rows, and if a signal that the family needs is missing.
    """
    if rows.held is None or not family.is_on_device:
        return None
    wanted = {name: getattr(settings[0], name) for name in family.signals}
    names = [each if each in rows.held.names else None for each in wanted.values()]
    if any(
        name is None and not is_optional
        for name, is_optional in zip(names, family.signals.values(), strict=True)
    ):
        return None
    first = names[0] if names else None
    level = "1" if first is None else rows.unit(first)
    try:
        return family.on_device(rows["time"].values, rows.held, names, settings), level
    except CompilerError:  # this machine's processor computes the same figures
        family.is_on_device = False
        return None
