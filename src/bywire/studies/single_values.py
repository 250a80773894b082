"""Quantities of single values: structural choices, and numbers of the kind ``discrete``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.typing import Array
from bywire.studies.distribution import Distribution

DISCRETE = "discrete"
"""the kind of single values, which choices need not name"""
KEYS = ("values", "weights")
"""keys of a section of single values"""


def read_choice(name: str, entry: Any, admitted: Sequence[Any]) -> Distribution:
    """Return how a choice varies: among values, each with a weight.

    Parameters
    ----------
    name
        Dotted name of a structural choice, or ``options.NAME`` of the experiment's.
    entry
        What the study file says.
    admitted
        What the choice may be, texts or truth values; empty where any text will do.

    Returns
    -------
    Distribution
        Its values are texts, see `choice_text`.

    Raises
    ------
    InputError
        For what is no list of choices, for a value alone, and one that stands there twice.
    """
    texts = list(map(choice_text, admitted))
    values = entry.get("values") if isinstance(entry, Mapping) else None
    if not isinstance(values, Sequence) or isinstance(values, str) or not values:
        raise ParameterError(
            f"[vary] {name} = {quoted(entry)}: a choice varies among values, "
            f"{{ kind = '{DISCRETE}', values = [...] }}"
            + (f", of {', '.join(map(repr, texts))}" if texts else "")
        )
    for key in entry.keys() - {*KEYS, "kind", "together"}:
        raise unknown_name(f"key of [vary] {name} (a choice)", key, (*KEYS, "kind"))
    if entry.get("kind", DISCRETE) != DISCRETE:
        raise ParameterError(
            f"[vary] {name} is a choice: its kind is '{DISCRETE}', not {quoted(entry['kind'])}"
        )
    given = list(map(choice_text, values))
    for text in given:
        if texts and text not in texts:
            raise unknown_name(f"value of {name}", text, texts)
    weights = weights_of(f"[vary] {name}", entry, len(given))
    require_several(f"[vary] {name}", given, given)
    return among(given, weights, ", ".join(given))


def choice_text(value: Any) -> str:
    """Return a choice as the cases of a study hold it.

    Examples
    --------
    >>> choice_text("ideal"), choice_text(True)
    ('ideal', 'true')
    """
    return value if isinstance(value, str) else quoted(value)


def require_several(where: str, values: Sequence[Any], shown: Sequence[str]) -> None:
    """Refuse single values that are one alone, or of which one stands there twice.

    Parameters
    ----------
    where
        What errors call it, for instance ``"[vary] motor.R_m"``.
    values, shown
        Its values, and how errors show them.

    Raises
    ------
    ParameterError
        Naming it.
    """
    if len(values) == 1:
        raise ParameterError(
            f"{where} has one value alone, {shown[0]}: nothing varies; name two at least, or "
            "give it this value in [set]"
        )
    for value, text in zip(values, shown, strict=True):
        if values.count(value) > 1:
            raise ParameterError(
                f"{where}: the value {text} stands there twice: name it once; weights = "
                "[...] say how often each comes"
            )


def among(values: list[Any], weights: Array, text: str) -> Distribution:
    """Return the distribution of single values.

    Parameters
    ----------
    values
        Numbers [SI], or texts.
    weights
        Their probabilities, shape (values,).
    text
        The values as they are shown.
    """
    each, edges = np.array(values), np.cumsum(weights)[:-1]
    alike = np.allclose(weights, weights[0])
    shares = "" if alike else f", with {', '.join(f'{100.0 * w:.3g} %' for w in weights)}"
    return Distribution(
        DISCRETE,
        f"one of {text}{shares}",
        partial(_picked, each, edges),
        singles=tuple(values),
        weights=tuple(weights.tolist()),
    )


def rising(made: Distribution) -> Distribution:
    """Return the distribution of single numbers whose quantiles rise, as those of any number.

    A file lists them in any order, in which probabilities go through them: what they are correlated
    with would fall with them, or neither.
    """
    order = np.argsort(np.array(made.singles))
    values = [made.singles[k] for k in order]
    ordered = among(values, np.array(made.weights)[order], "")
    return replace(
        made, quantile=ordered.quantile, singles=ordered.singles, weights=ordered.weights
    )


def _picked(values: NDArray[Any], edges: Array, u: Array) -> NDArray[Any]:
    return values[np.searchsorted(edges, u, side="right")]


def weights_of(where: str, section: Mapping[str, Any], count: int) -> Array:
    """Return the probabilities of single values, shape (count,), alike by default.

    Raises
    ------
    ParameterError
        For what is no list of so many numbers > 0.
    """
    given = section.get("weights", [1.0] * count)
    is_listed = isinstance(given, list) and all(type(each) in (int, float) for each in given)
    weights = np.array(given if is_listed else [], dtype=float)
    if weights.shape != (count,) or not (weights > 0).all() or not np.isfinite(weights).all():
        raise ParameterError(
            f"{where}.weights = {quoted(given)}: {count} numbers > 0 are wanted, one a value"
        )
    shares = weights / weights.max()  # whose sum is finite
    return np.asarray(shares / shares.sum())
