"""Data classes in which NaN means "undefined": two undefined numbers are equal.

Up to Python 3.12, plain data classes compare tuples, in which a NaN object equals itself. From
3.13, they compare the numbers, and a NaN equals no NaN.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any


class EqualWhereUndefined:
    """Base of such data classes, which must be declared with ``eq=False``."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return _values(self) == _values(other)

    def __hash__(self) -> int:
        return hash(_values(self))


def _values(thing: Any) -> tuple[Any, ...]:
    """Return the values of the fields, with this class instead of each NaN."""
    values = (getattr(thing, field.name) for field in fields(thing))
    return tuple(
        EqualWhereUndefined if isinstance(value, float) and value != value else value
        for value in values
    )
