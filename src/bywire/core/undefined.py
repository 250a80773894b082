"""Data classes in which NaN says that a number is not defined: equal where both are not.

Plain ones compared tuples up to Python 3.12, in which the same NaN object is equal to itself; from
3.13 on they compare numbers, and no NaN is equal to any.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any


class EqualWhereUndefined:
    """Base of such a data class, which is declared with ``eq=False``."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return _values(self) == _values(other)

    def __hash__(self) -> int:
        return hash(_values(self))


def _values(thing: Any) -> tuple[Any, ...]:
    """Return the values of the fields, with this class in place of each NaN."""
    values = (getattr(thing, field.name) for field in fields(thing))
    return tuple(
        EqualWhereUndefined if isinstance(value, float) and value != value else value
        for value in values
    )
