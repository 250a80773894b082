"""The section ``[vary]``: what varies of a bench."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from bywire.bench.bench import Bench
from bywire.bench.ensemble import varied_leaf
from bywire.bench.option_names import OPTION
from bywire.bench.varied_choices import varied_choices
from bywire.core.errors import InputError, ParameterError, quoted, unknown_name
from bywire.core.parameters import leaf_fields
from bywire.studies.admissible import require_following
from bywire.studies.distribution_section import ENTRY_KEYS, read_distribution
from bywire.studies.measured import MeasuredSection, varied_as_measured
from bywire.studies.plan import Varied
from bywire.studies.single_values import choice_text, read_choice


def read_all_varied(
    bench: Bench, section: Mapping[str, Any], estimates: MeasuredSection | None, folder: Path
) -> tuple[tuple[Varied, ...], Mapping[tuple[str, str], float]]:
    """Return what varies, as the file says or as it was measured, and what goes together so.

    Parameters
    ----------
    bench
        What is tested.
    section, estimates
        ``[vary]`` and ``[measured]`` of its file.
    folder
        Where its paths start.

    Raises
    ------
    InputError
        For sections that do not fit, and what varies twice.
    """
    measured: tuple[Varied, ...] = ()
    correlations: Mapping[tuple[str, str], float] = {}
    if estimates is not None:
        measured, correlations = varied_as_measured(bench, estimates, folder)
    varied = tuple(read_varied(bench, section))
    places: dict[str, str] = {}
    for title, each in (("[measured]", measured), ("[vary]", varied)):
        for quantity in each:
            _put_once(places, quantity.name, title)
            for name in quantity.together:
                _put_once(places, name, f"{title} {quantity.name}.together")
    return (*measured, *varied), correlations


def _put_once(places: dict[str, str], name: str, place: str) -> None:
    """Note where a quantity varies, or refuse one that varies elsewhere too."""
    if name in places:
        raise ParameterError(
            f"[vary] {name} varies twice, by {places[name]} and by {place}: leave one of both out"
        )
    places[name] = place


def read_varied(bench: Bench, section: Mapping[str, Any]) -> Iterator[Varied]:
    """Yield what a section ``[vary]`` varies of a bench.

    Raises
    ------
    InputError
        For names that are no numbers or choices of the bench, and values that do not fit.
    """
    values, choices = quantities_of(bench), varied_choices(bench)
    for name, entry in entries_of(section, values).items():
        if name not in values:
            raise unknown_name("parameter or option to vary", name, values)
        together = _together(name, entry, bench, values)
        if name in choices:
            if together:
                raise ParameterError(f"[vary] {name} is a choice: nothing varies by its ratio")
            law = read_choice(name, entry, choices[name])
            _require_alike(bench, name, law.singles)
            yield Varied(name, "", choice_text(values[name]), law)
            continue
        if isinstance(values[name], (str, bool)):
            raise ParameterError(
                f"[vary] {name} = {quoted(values[name])} names a signal or a file: only numbers "
                "vary, and choices among what is listed"
            )
        if isinstance(values[name], tuple):
            raise ParameterError(f"[vary] {name} is a table: single numbers vary, and choices")
        leaf = varied_leaf(bench, name)
        nominal = float(values[name])
        if not choices.keys() & section.keys():  # one of them may switch it on
            bench.require_effect(name)
        law = read_distribution(name, entry, leaf, nominal)
        for each in filter(values.get, together):
            require_following(
                f"[vary] {name}.together {each}",
                law,
                varied_leaf(bench, each),
                leaf.unit,
                values[each] / nominal,
            )
        yield Varied(name, leaf.unit.symbol, nominal, law, together)


def quantities_of(bench: Bench) -> dict[str, Any]:
    """Return all numbers [SI], tables and choices of a bench by name, ``options.NAME`` too."""
    options = bench.chosen_options.flat()
    return {**bench.par.flat(), **{f"{OPTION}{name}": value for name, value in options.items()}}


def _require_alike(bench: Bench, name: str, values: Sequence[str]) -> None:
    """Refuse values of an option with which the experiment is another one.

    What it drives may have another unit with them, and its key figures may be others: neither a
    stimulus nor a requirement would mean the same in all cases.
    """
    if not name.startswith(OPTION):
        return
    figures = bench.definition.kpis_with(bench.chosen_options)
    for value in values:
        options = {**bench.options, name.removeprefix(OPTION): value}
        try:
            other = replace(bench, options=options, requirements={})
        except InputError as error:
            raise type(error)(f"[vary] {name} = {value!r}: {error}") from None
        given = other.definition.kpis_with(other.chosen_options)
        if given != figures:
            differing = sorted(given.keys() ^ figures.keys()) or sorted(figures)
            raise ParameterError(
                f"[vary] {name} = {value!r}: {bench.experiment!r} has other key figures with it "
                f"than with the bench's own ({', '.join(differing)}): vary it among values that "
                "have the same, or make it a study of its own"
            )


def entries_of(section: Mapping[str, Any], known: Collection[str]) -> dict[str, Any]:
    """Return the entries of ``[vary]`` by dotted name, however the file nests them.

    Parameters
    ----------
    section
        What the file holds.
    known
        Names that may vary: a table under one of them is an entry, whatever it holds.

    Raises
    ------
    ParameterError
        For a name that is written in two ways, ``motor.R_m`` and ``"motor.R_m"``.
    """
    entries: dict[str, Any] = {}
    for name, entry in _spread(section, known):
        if name in entries:
            raise ParameterError(
                f'[vary] {name} varies twice, by {name} and by "{name}" in quotation marks: '
                "leave one of both out"
            )
        entries[name] = entry
    return entries


def _spread(
    section: Mapping[str, Any], known: Collection[str], prefix: str = ""
) -> Iterator[tuple[str, Any]]:
    for key, value in section.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping) and value and not _is_entry(name, value, known):
            yield from _spread(value, known, f"{name}.")
        else:
            yield name, value


def _is_entry(name: str, value: Mapping[str, Any], known: Collection[str]) -> bool:
    """Return whether a table says how a quantity varies, and is no group of quantities."""
    if name in known or any(each.startswith(f"{name}.") for each in known):
        return name in known
    return "kind" in value or value.keys() <= ENTRY_KEYS  # of a name that nothing answers to


def _together(name: str, entry: Any, bench: Bench, values: Mapping[str, Any]) -> tuple[str, ...]:
    given = entry.get("together", []) if isinstance(entry, Mapping) else []
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise ParameterError(f"[vary] {name}.together = {quoted(given)}: a list of names is wanted")
    leaves = leaf_fields(type(bench.par))
    for each in given:
        if not isinstance(each, str) or each not in leaves:
            kind = f"parameter that varies together with {name}"
            raise unknown_name(kind, choice_text(each), leaves)
        if isinstance(values[each], tuple):
            raise ParameterError(f"[vary] {name}.together {each} is a table: single numbers vary")
        if leaves[each].is_whole:
            raise ParameterError(
                f"[vary] {name}.together {each} is a whole number, which keeps no ratio: vary it "
                "by itself, or leave it as in the bench"
            )
    if given and not values.get(name):
        raise ParameterError(f"[vary] {name} is zero in the bench: nothing can keep its ratio")
    return tuple(given)
