"""Quantities of single values: structural choices, and numbers of the kind ``discrete``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.typing import Array
from bywire.studies.distribution import Distribution


def read_choice(name: str, entry: Any, admitted: Sequence[Any]) -> Distribution:
    """Return how a structural choice varies: among values, each with a weight.

    Raises
    ------
    InputError
        For what is no list of choices.
    """
    values = entry.get("values") if isinstance(entry, Mapping) else None
    if not isinstance(values, Sequence) or isinstance(values, str) or not values:
        raise ParameterError(
            f"[vary] {name} = {quoted(entry)}: a choice varies among values, "
            "{ kind = 'discrete', values = [...] }"
            + (f", of {', '.join(map(repr, admitted))}" if admitted else "")
        )
    for value in values:
        if admitted and value not in admitted:
            raise unknown_name(f"value of {name}", str(value), map(str, admitted))
    return among(list(map(str, values)), weights_of(name, entry, len(values)), ", ".join(values))


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
        "discrete", f"one of {text}{shares}", partial(_picked, each, edges), is_discrete=True
    )


def _picked(values: NDArray[Any], edges: Array, u: Array) -> NDArray[Any]:
    return values[np.searchsorted(edges, u, side="right")]


def weights_of(name: str, section: Mapping[str, Any], count: int) -> Array:
    """Return the probabilities of single values, shape (count,), alike by default.

    Raises
    ------
    ParameterError
        For what is no list of so many numbers > 0.
    """
    given = section.get("weights", [1.0] * count)
    try:
        weights = np.array(given, dtype=float)
    except (TypeError, ValueError):
        weights = np.array([])
    if weights.shape != (count,) or not (weights > 0).all() or not np.isfinite(weights).all():
        raise ParameterError(
            f"[vary] {name}.weights = {quoted(given)}: {count} numbers > 0 are wanted, one a value"
        )
    return np.asarray(weights / weights.sum())
