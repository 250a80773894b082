"""The sections ``[vary]`` and ``[[correlation]]``: what varies of a bench, and what with what."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from bywire.bench.bench import Bench
from bywire.bench.ensemble import varied_leaf
from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.parameters import choice_fields, choices_of, leaf_fields
from bywire.studies.correlation import correlation_factor
from bywire.studies.distribution_section import read_distribution
from bywire.studies.measured import varied_as_measured
from bywire.studies.plan import Varied
from bywire.studies.single_values import read_choice

_OPTION = "options."


def read_all_varied(
    bench: Bench, content: Mapping[str, Any], folder: Path
) -> tuple[tuple[Varied, ...], Mapping[tuple[str, str], float]]:
    """Return what varies, as the file says or as it was measured, and what goes together so.

    Parameters
    ----------
    bench
        What is tested.
    content
        What the file holds.
    folder
        Where its paths start.

    Raises
    ------
    InputError
        For sections that do not fit, and what varies twice.
    """
    measured: tuple[Varied, ...] = ()
    correlations: Mapping[tuple[str, str], float] = {}
    if "measured" in content:
        measured, correlations = varied_as_measured(bench, content["measured"], folder)
    varied = (*measured, *read_varied(bench, content.get("vary", {})))
    names = [name for each in varied for name in (each.name, *each.together)]
    for name in names:
        if names.count(name) > 1:
            raise ParameterError(f"[vary] {name} varies twice: leave one of both out")
    return varied, correlations


def read_varied(bench: Bench, section: Mapping[str, Any]) -> Iterator[Varied]:
    """Yield what a section ``[vary]`` varies of a bench.

    Raises
    ------
    InputError
        For names that are no numbers or choices of the bench, and values that do not fit.
    """
    entries = dict(entries_of(section))
    values = {
        **bench.par.flat(),
        **{f"{_OPTION}{k}": v for k, v in bench.chosen_options.flat().items()},
    }
    choices = choice_fields(type(bench.par))
    for name, entry in entries.items():
        together = _together(name, entry, bench, values)
        if name in choices:
            if together:
                raise ParameterError(f"[vary] {name} is a choice: nothing varies by its ratio")
            law = read_choice(name, entry, choices_of(type(bench.par), name))
            yield Varied(name, "", values[name], law)
            continue
        leaf = varied_leaf(bench, name)
        if isinstance(values[name], tuple):
            raise ParameterError(f"[vary] {name} is a table: single numbers vary, and choices")
        law = read_distribution(name, entry, leaf, float(values[name]))
        yield Varied(name, leaf.unit.symbol, float(values[name]), law, together)


def entries_of(section: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the entries of ``[vary]`` by dotted name, however the file nests them."""
    for key, value in section.items():
        is_group = isinstance(value, Mapping) and value and "kind" not in value and all(
            isinstance(each, (Mapping, str)) for each in value.values()
        )  # fmt: skip
        if is_group:
            yield from entries_of(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _together(
    name: str, entry: Any, bench: Bench, values: Mapping[str, Any]
) -> tuple[str, ...]:
    given = entry.get("together", []) if isinstance(entry, Mapping) else []
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise ParameterError(f"[vary] {name}.together = {quoted(given)}: a list of names is wanted")
    leaves = leaf_fields(type(bench.par))
    for each in given:
        if each not in leaves:
            raise unknown_name(f"parameter that varies together with {name}", str(each), leaves)
    if given and not values.get(name):
        raise ParameterError(f"[vary] {name} is zero in the bench: nothing can keep its ratio")
    return tuple(given)


def read_correlations(
    entries: Any, varied: Sequence[Varied], known: Mapping[tuple[str, str], float]
) -> dict[tuple[str, str], float]:
    """Return the correlations of ``[[correlation]]`` by pairs of names in alphabetical order.

    Parameters
    ----------
    entries
        What the file holds.
    varied
        What varies.
    known
        Correlations that are known already.

    Raises
    ------
    InputError
        For entries that do not fit, and correlations that no quantities can have.
    """
    if not isinstance(entries, list) or not all(isinstance(each, Mapping) for each in entries):
        raise ParameterError("write [[correlation]] with two brackets, once for each pair")
    names = {each.name: each for each in varied}
    pairs: dict[tuple[str, str], float] = {}
    for entry in entries:
        for key in entry:
            if key not in ("of", "value"):
                raise unknown_name("key of [[correlation]]", key, ("of", "value"))
        pair, value = entry.get("of"), entry.get("value")
        if not isinstance(pair, list) or len(pair) != 2 or pair[0] == pair[1]:
            raise ParameterError(f"[[correlation]] of = {quoted(pair)}: two names are wanted")
        for name in pair:
            if name not in names:
                raise unknown_name("quantity of [[correlation]]", str(name), names)
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not is_number or not -1.0 < value < 1.0:
            raise ParameterError(
                f"[[correlation]] of {pair[0]} and {pair[1]}: value = {quoted(value)} must be a "
                "number between -1 and 1"
            )
        first, second = sorted(pair)
        if (first, second) in {**known, **pairs}:
            raise ParameterError(f"[[correlation]] of {first} and {second} stands there twice")
        pairs[first, second] = float(value)
    correlation_factor(list(names), {**known, **pairs})
    return pairs
