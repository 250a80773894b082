"""Numbers that note what they are compared with, and how far the sides are apart."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

import numpy as np

from bywire.core import ops

Place = tuple[Any, ...]
"""places in the code that lead to a comparison, innermost first; those of ``core.ops`` as one"""
Margins = dict[Place, float]
"""how far the sides of comparisons are apart"""
_LESS = ("__lt__", "__ge__")

_now = threading.local()
"""``margins``: of the tick that this thread is in"""


class Traced(float):
    """A float that notes what it is compared with; what is computed of it does so, too."""

    __slots__ = ()
    __hash__ = float.__hash__


def _comparing(name: str) -> Callable[[Traced, Any], Any]:
    plain = getattr(float, name)

    def compare(self: Traced, other: Any) -> Any:
        if isinstance(other, (float, int)):
            # Equal sides count with those that are not apart: where the comparison turns.
            apart = float(self) - float(other)
            _now.margins[_place(sys._getframe(1))] = -apart if name in _LESS else apart
        return plain(self, other)

    return compare


def _place(frame: FrameType | None) -> Place:
    inside: list[int] = []
    while frame is not None and frame.f_code.co_filename == ops.__file__:
        inside.append(frame.f_lasti)
        frame = frame.f_back
    places: list[Any] = [tuple(inside)]
    while frame is not None and frame.f_code is not _BEGIN:
        places.append(frame.f_lasti)
        frame = frame.f_back
    return tuple(places)


def _computing(name: str) -> Callable[..., Any]:
    plain = getattr(float, name)

    def compute(self: Traced, *others: Any) -> Any:
        result = plain(self, *others)
        return Traced(result) if isinstance(result, float) else result

    return compute


for _name in ("lt", "le", "gt", "ge", "eq", "ne"):
    setattr(Traced, f"__{_name}__", _comparing(f"__{_name}__"))
for _name in (
    "add",
    "radd",
    "sub",
    "rsub",
    "mul",
    "rmul",
    "truediv",
    "rtruediv",
    "neg",
    "pos",
    "abs",
    "pow",
):
    setattr(Traced, f"__{_name}__", _computing(f"__{_name}__"))


def margins(tick: Callable[..., Any], inputs: tuple[Any, Any, Any], par: Any) -> Margins:
    """Return how far the sides of every comparison of a tick are apart; none where it fails.

    Parameters
    ----------
    tick
        ``tick(x, m, u, par) -> memory``.
    inputs
        Plant, stimulus and memory.
    """
    x, u, m = (type(each)(*map(Traced, each)) for each in inputs)
    _now.margins = {}
    try:
        with np.errstate(all="ignore"):  # numbers of single precision warn where others raise
            tick(x, m, u, par)
    except (ArithmeticError, ValueError):
        return {}
    noted: Margins = _now.margins
    return noted


_BEGIN = margins.__code__
"""above it there is no law any more"""
