"""Section ``[vary]``: quantities of a bench that vary, including measured estimates."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from bywire.bench.bench import Bench
from bywire.bench.changes import OPTION
from bywire.bench.ensemble import varied_choices, varied_leaf
from bywire.core.errors import (
    FileError,
    InputError,
    ParameterError,
    not_valid,
    quoted,
    unknown_name,
)
from bywire.core.parameters import leaf_fields
from bywire.core.section import Hint, Name, Names, Section
from bywire.studies.distribution import (
    ENTRY_KEYS,
    choice_text,
    read_choice,
    read_distribution,
    require_following,
)
from bywire.studies.plan import Varied

# --- Quantities that vary by their measured uncertainty

_ESTIMATE = "estimate.json"
"""file with the estimates in an identification's folder"""
_LARGEST = 20_000_000  # maximum size of the file in bytes
_TRUNCATE = "Truncate the distribution with truncate = true"
_WEAK = 1e-9  # correlation that is treated as zero


class MeasuredSection(Section):
    """The section ``[measured]``: parameters that vary by the uncertainty of an identification."""

    file: Annotated[Name, Hint("specify the folder that 'bywire identify --out' created")]
    of: Names | None = None
    truncate: bool = False


@dataclass(frozen=True)
class Measured:
    """Estimated parameters.

    Parameters
    ----------
    values, deviations
        Estimates and standard deviations by name [SI].
    units
        SI unit by name.
    correlations
        Pairs of names, in alphabetical order -> correlation of their estimates.
    """

    values: Mapping[str, float]
    deviations: Mapping[str, float]
    units: Mapping[str, str]
    correlations: Mapping[tuple[str, str], float]

    def only(self, names: Sequence[str]) -> Measured:
        """Return some of the estimates.

        Raises
        ------
        UnknownNameError
            If a parameter was not estimated.
        """
        for name in names:
            if name not in self.values:
                raise unknown_name("estimate in [measured] of", name, self.values)
        return Measured(
            {n: self.values[n] for n in names},
            {n: self.deviations[n] for n in names},
            {n: self.units[n] for n in names},
            {pair: c for pair, c in self.correlations.items() if set(pair) <= set(names)},
        )


def _varied_as_measured(
    bench: Bench, section: MeasuredSection, folder: Path
) -> tuple[tuple[Varied, ...], dict[tuple[str, str], float]]:
    """Return parameters that vary by their measured uncertainty, with correlations of estimates.

    Each parameter is normally distributed around its estimate.

    Parameters
    ----------
    bench
        The tested bench.
    section
        ``[measured]`` of a study file: ``file``; ``of``, names, default: all that the bench has;
        ``truncate``, whether to truncate distributions to the valid range.
    folder
        Base folder of the file's path.

    Raises
    ------
    InputError
        For an invalid section, and for estimates that leave the valid range.
    """
    measured = _read_measured(folder / section.file)
    leaves, values = leaf_fields(type(bench.par)), bench.par.flat()
    of = [name for name in measured.values if name in leaves] if section.of is None else section.of
    if not of:
        raise ParameterError(
            f"[measured] {section.file} has no estimates of parameters in the bench. It contains "
            f"{', '.join(measured.values)}. Select parameters of the bench with of = [...]",
            name="[measured]",
            value=str(section.file),
            valid=", ".join(measured.values),
        )
    chosen = measured.only(of)
    varied = []
    for name, value in chosen.values.items():
        if name not in leaves:
            raise unknown_name("parameter of [measured]", name, leaves)
        leaf, unit = leaves[name], chosen.units[name]
        entry = {
            "kind": "normal",
            "mean": _text(value, unit),
            "sd": _text(chosen.deviations[name], unit),
        }
        ends = {"low": leaf.low, "high": leaf.high} if section.truncate else {}
        symbol = leaf.unit.symbol
        entry |= {key: _text(x, symbol) for key, x in ends.items() if math.isfinite(x)}
        nominal = float(values[name])
        law = read_distribution(name, entry, leaf, nominal, "[measured]", _TRUNCATE)
        varied.append(Varied(name, leaf.unit.symbol, nominal, law))
    return tuple(varied), dict(chosen.correlations)


def _text(value: float, unit: str) -> str:
    """Return a value in the form of a study file; a pure number has no unit."""
    return repr(value) if unit == "1" else f"{value!r} {unit}"


def _read_measured(path: Path) -> Measured:
    """Read the estimates of an identification.

    Parameters
    ----------
    path
        Folder that ``bywire identify --out`` created, or its ``estimate.json``.

    Raises
    ------
    FileError
        If it is missing or damaged.
    """
    file = path / _ESTIMATE if path.is_dir() else path
    try:
        data = file.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(
            f"cannot read {file}: {reason}. Specify the folder that 'bywire identify --out' "
            "created",
            name=str(file),
        ) from None
    try:
        if len(data) > _LARGEST:
            raise ValueError("it is too large")
        content = json.loads(data)
        return _joined(list(_estimates(content["estimates"])))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise FileError(
            f"{file} contains no estimates from an identification ({type(error).__name__}: "
            f"{quoted(str(error))}). Specify the folder that 'bywire identify --out' created",
            name=str(file),
        ) from None


def _estimates(groups: Mapping[str, Any]) -> Iterator[Measured]:
    for each in groups.values():
        rows = each["parameters"]
        values = {str(name): _number(row["value"]) for name, row in rows.items()}
        deviations = {str(name): _number(row["standard_deviation"]) for name, row in rows.items()}
        if not all(d > 0.0 for d in deviations.values()):
            raise ValueError("a standard deviation is not > 0")
        names = [str(name) for name in each["correlation"]["names"]]
        matrix = np.array(each["correlation"]["matrix"], dtype=float)
        if matrix.shape != (len(names), len(names)) or {*names} != {*values}:
            raise ValueError("the correlations belong to other parameters")
        pairs = {
            (min(a, b), max(a, b)): _number(float(matrix[i, k]))
            for (i, a), (k, b) in combinations(enumerate(names), 2)
            if abs(matrix[i, k]) > _WEAK
        }
        units = {str(name): str(row["unit"]) for name, row in rows.items()}
        yield Measured(values, deviations, units, pairs)


def _joined(each: Sequence[Measured]) -> Measured:
    """Return several identifications as one, with independent estimates."""
    names = [name for file in each for name in file.values]
    if not names:
        raise ParameterError("it contains no estimates")
    if len(names) != len({*names}):
        twice = next(name for name in names if names.count(name) > 1)
        raise ParameterError(f"it contains two estimates of {twice}")
    return Measured(
        {k: v for file in each for k, v in file.values.items()},
        {k: v for file in each for k, v in file.deviations.items()},
        {k: v for file in each for k, v in file.units.items()},
        {k: v for file in each for k, v in file.correlations.items()},
    )


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError(f"{quoted(value)} is not a number")
    return float(value)


# --- Quantities that vary


def read_all_varied(
    bench: Bench, section: Mapping[str, Any], estimates: MeasuredSection | None, folder: Path
) -> tuple[tuple[Varied, ...], Mapping[tuple[str, str], float]]:
    """Return the varied quantities from the file or from measurements, with their correlations.

    Parameters
    ----------
    bench
        The tested bench.
    section, estimates
        ``[vary]`` and ``[measured]`` of a study file.
    folder
        Base folder of its paths.

    Raises
    ------
    InputError
        For invalid sections, and for a quantity that varies twice.
    """
    measured: tuple[Varied, ...] = ()
    correlations: Mapping[tuple[str, str], float] = {}
    if estimates is not None:
        measured, correlations = _varied_as_measured(bench, estimates, folder)
    varied = tuple(read_varied(bench, section))
    places: dict[str, str] = {}
    for title, each in (("[measured]", measured), ("[vary]", varied)):
        for quantity in each:
            _put_once(places, quantity.name, title)
            for name in quantity.together:
                _put_once(places, name, f"{title} {quantity.name}.together")
    return (*measured, *varied), correlations


def _put_once(places: dict[str, str], name: str, place: str) -> None:
    """Record where a quantity varies, or reject a quantity that also varies elsewhere."""
    if name in places:
        raise ParameterError(
            f"[vary] {name} varies twice, in {places[name]} and in {place}. Remove one of them",
            name=f"[vary] {name}",
        )
    places[name] = place


def read_varied(bench: Bench, section: Mapping[str, Any]) -> Iterator[Varied]:
    """Yield the quantities of a bench that a section ``[vary]`` varies.

    Raises
    ------
    InputError
        For names that are not numbers or choices of the bench, and for invalid values.
    """
    values, choices = quantities_of(bench), varied_choices(bench)
    for name, entry in entries_of(section, values).items():
        if name not in values:
            raise unknown_name("parameter or option to vary", name, values)
        together = _together(name, entry, bench, values)
        if name in choices:
            if together:
                raise ParameterError(
                    f"[vary] {name} is a choice, so 'together' cannot apply to it. Remove "
                    "'together'",
                    name=f"[vary] {name}",
                )
            law = read_choice(name, entry, choices[name])
            _require_alike(bench, name, law.singles)
            yield Varied(name, "", choice_text(values[name]), law)
            continue
        if isinstance(values[name], (str, bool)):
            raise ParameterError(
                f"[vary] {name} = {quoted(values[name])} is a signal or a file. Only numbers and "
                "choices among listed values can vary",
                name=f"[vary] {name}",
                value=quoted(values[name]),
            )
        if isinstance(values[name], tuple):
            raise ParameterError(
                f"[vary] {name} is a table. Only single numbers and choices can vary",
                name=f"[vary] {name}",
            )
        leaf = varied_leaf(bench, name)
        nominal = float(values[name])
        if not choices.keys() & section.keys():  # a varied choice may switch it on
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
    """Return all numbers [SI], tables and choices of a bench by name, including options."""
    options = bench.chosen_options.flat()
    return {**bench.par.flat(), **{f"{OPTION}{name}": value for name, value in options.items()}}


def _require_alike(bench: Bench, name: str, values: Sequence[str]) -> None:
    """Reject values of an option that change the experiment.

    The driven signal could have another unit, or the key figures could be different. A stimulus or
    a requirement would then not have the same meaning in all cases.
    """
    if not name.startswith(OPTION):
        return
    figures = bench.definition.kpis_with(bench.chosen_options)
    for value in values:
        options = {**bench.options, name.removeprefix(OPTION): value}
        try:
            other = replace(bench, options=options, requirements={})
        except InputError as error:
            raise error.reworded(f"[vary] {name} = {value!r}: {error}") from None
        given = other.definition.kpis_with(other.chosen_options)
        if given != figures:
            differing = sorted(given.keys() ^ figures.keys()) or sorted(figures)
            raise ParameterError(
                f"[vary] {name} = {value!r}: with this value, {bench.experiment!r} has different "
                f"key figures than with the bench's value ({', '.join(differing)}). List only "
                "values with the same key figures, or run a study for each value",
                name=f"[vary] {name}",
                value=repr(value),
            )


def entries_of(section: Mapping[str, Any], known: Collection[str]) -> dict[str, Any]:
    """Return the entries of ``[vary]`` by dotted name, for any nesting in the file.

    Parameters
    ----------
    section
        Content of the section.
    known
        Names that may vary; a table under such a name is an entry, regardless of its content.

    Raises
    ------
    ParameterError
        For a name in two spellings, ``motor.R_m`` and ``"motor.R_m"``.
    """
    entries: dict[str, Any] = {}
    for name, entry in _spread(section, known):
        if name in entries:
            raise ParameterError(
                f'[vary] {name} varies twice, as {name} and as "{name}" in quotation marks. Remove '
                "one of them",
                name=f"[vary] {name}",
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
    """Return whether a table is the distribution of a quantity, and not a group of quantities."""
    if name in known or any(each.startswith(f"{name}.") for each in known):
        return name in known
    return "kind" in value or value.keys() <= ENTRY_KEYS  # of a name that does not exist


def _together(name: str, entry: Any, bench: Bench, values: Mapping[str, Any]) -> tuple[str, ...]:
    given = entry.get("together", []) if isinstance(entry, Mapping) else []
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise not_valid(f"[vary] {name}.together", quoted(given), "a list of names")
    leaves = leaf_fields(type(bench.par))
    for each in given:
        if not isinstance(each, str) or each not in leaves:
            kind = f"parameter that varies together with {name}"
            raise unknown_name(kind, choice_text(each), leaves)
        if isinstance(values[each], tuple):
            raise ParameterError(
                f"[vary] {name}.together {each} is a table. Only single numbers can vary",
                name=f"[vary] {name}.together",
                value=each,
            )
        if leaves[each].is_whole:
            raise ParameterError(
                f"[vary] {name}.together {each} is a whole number, which cannot stay in "
                "proportion. Vary it separately, or remove it",
                name=f"[vary] {name}.together",
                value=each,
            )
    if given and not values.get(name):
        raise ParameterError(
            f"[vary] {name} is zero in the bench, so no parameter can stay in proportion to it. "
            "Remove 'together'",
            name=f"[vary] {name}",
        )
    return tuple(given)
