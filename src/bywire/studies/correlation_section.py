"""The sections ``[[correlation]]``: what varies with what."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.studies.correlation import correlation_factor
from bywire.studies.plan import Varied
from bywire.studies.single_values import choice_text, rising


def in_order(
    varied: Sequence[Varied], correlations: Mapping[tuple[str, str], float]
) -> tuple[Varied, ...]:
    """Return what varies; single values that are correlated rise, however the file lists them."""
    correlated = {name for pair in correlations for name in pair}
    return tuple(
        replace(each, distribution=rising(each.distribution))
        if each.name in correlated and each.distribution.is_discrete
        else each
        for each in varied
    )


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
        for key in ("of", "value"):
            if key not in entry:
                raise ParameterError(
                    f"[[correlation]] {key} is missing: write for instance of = ['motor.R_m', "
                    "'motor.K_e'] and value = 0.5"
                )
        if not isinstance(pair, list) or len(pair) != 2 or pair[0] == pair[1]:
            raise ParameterError(f"[[correlation]] of = {quoted(pair)}: two names are wanted")
        for name in pair:
            if not isinstance(name, str) or name not in names:
                raise unknown_name("quantity of [[correlation]]", choice_text(name), names)
            if not names[name].unit:
                raise ParameterError(
                    f"[[correlation]] of {pair[0]} and {pair[1]}: {name} is a choice, and what has "
                    "no order neither rises nor falls with another: leave it out, or make a study "
                    "for each of its values"
                )
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
