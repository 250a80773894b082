"""Warnings of elements about a recording: the exceeded range, and the first time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from bywire.core.typing import Array

F = TypeVar("F", bound=Callable[..., list[str]])


def row_by_row(watch: F) -> F:
    """Declare that an element's ``watch`` judges each row separately.

    It warns if and only if it would warn about at least one row alone. Studies then call it once
    with the rows of many cases, shape (cases, rows), because most cases have no warnings.
    """
    watch.row_by_row = True  # type: ignore[attr-defined]
    return watch


def within_limits(watch: F) -> F:
    """Declare that an element's ``watch`` compares each input with limits, as `row_by_row`.

    The limits follow from parameters alone. So it warns if and only if it would warn about the
    lowest and highest values of its inputs, and studies on a graphics processor fetch no rows.
    """
    watch.within_limits = True  # type: ignore[attr-defined]
    return row_by_row(watch)


def outline(rows: Any, name: str) -> Any:
    """Return the first, lowest, highest and last values of a signal, or all if these are unknown.

    ``rows``: signals of shape (cases, rows). A limit is exceeded by all values if it is exceeded by
    one of these.
    """
    known = rows.outline(name) if hasattr(type(rows), "outline") else None
    return rows[name].values if known is None else known


def outside(values: Any, low: float, high: float) -> Any:
    """Return which values are outside a range; NaN is treated as inside."""
    return np.logical_or(np.less(values, low), np.greater(values, high))


def highest(values: Any) -> float:
    """Return the largest value, or NaN if a value is NaN."""
    return float(np.max(values))


def largest(values: Any) -> Any:
    """Return the largest magnitude in the rows of each case, shape (..., 1); NaN if one is NaN."""
    rows = np.atleast_1d(values)
    return np.maximum(rows.max(axis=-1, keepdims=True), -rows.min(axis=-1, keepdims=True))


def first(t: Array, happens: Any, text: str, after: str = "") -> list[str]:
    """Return a warning with the time of the first row in which an event occurs, if any.

    Parameters
    ----------
    t
        Times of the rows [s], shape (n,).
    happens
        Whether the event occurs in each row, shape (n,), or a single value; shape (cases, n) for
        several cases.
    text, after
        Text of the warning before and after the time.
    """
    if not np.any(happens):
        return []
    there = np.asarray(happens, dtype=bool)
    each = np.broadcast_to(there, np.broadcast_shapes(there.shape, t.shape))
    rows = each.reshape(-1, t.size).any(axis=0)
    return [f"{text} at t = {float(t[int(np.argmax(rows))]):.4g} s{after}"]
