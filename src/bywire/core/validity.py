"""What elements say of a recording: where their range was left, and when first."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from bywire.core.typing import Array

F = TypeVar("F", bound=Callable[..., list[str]])


def row_by_row(watch: F) -> F:
    """Declare that an element's ``watch`` judges each row alone.

    It warns exactly if at least one row alone would make it warn. It is then asked once of the
    rows of many cases, (cases, rows) each: they are silent mostly.
    """
    watch.row_by_row = True  # type: ignore[attr-defined]
    return watch


def outside(values: Any, low: float, high: float) -> Any:
    """Return where values leave a range; what is not known lies in it."""
    return np.logical_or(np.less(values, low), np.greater(values, high))


def highest(values: Any) -> float:
    """Return the largest of some values; NaN where one is not known."""
    return float(np.max(values))


def first(t: Array, happens: Any, text: str, after: str = "") -> list[str]:
    """Return a warning with the time of the first row in which something happens, if in one.

    Parameters
    ----------
    t
        Times of the rows [s], shape (n,).
    happens
        Whether it happens in each row, shape (n,), or one for all; of many cases (cases, n).
    text, after
        What is said before and behind the time.
    """
    if not np.any(happens):
        return []
    there = np.asarray(happens, dtype=bool)
    each = np.broadcast_to(there, np.broadcast_shapes(there.shape, t.shape))
    rows = each.reshape(-1, t.size).any(axis=0)
    return [f"{text} at t = {float(t[int(np.argmax(rows))]):.4g} s{after}"]
