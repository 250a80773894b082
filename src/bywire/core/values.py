"""Conversion of users' values: strings with units become SI numbers, tables, or choices."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, get_origin

from bywire.core import units
from bywire.core.errors import ParameterError, UnitError, quoted, unknown_name
from bywire.core.parameters import ParameterSet, choice_fields, leaf_fields

_ZERO = re.compile(r"\s*[+-]?(?:0+\.?0*|\.0+)\s*")


def parsed(
    cls: type[ParameterSet], values: Mapping[str, Any], kind: str, listed: str = ""
) -> dict[str, Any]:
    """Return values by dotted name, with numbers in SI units.

    ``cls``: the parameter class. ``values``: numbers (SI), strings with units, sequences of these
    for tables, or choices. ``kind``: the kind of the names in errors. ``listed``: the command that
    lists these names.

    Raises
    ------
    UnknownNameError
        When a name is unknown; the message contains the nearest valid names.
    UnitError
        When a string is not a quantity, or its unit has another dimension.
    ParameterError
        When a single number has several values, or a number is not finite.
    """
    leaves, choices = leaf_fields(cls), choice_fields(cls)
    accepted: dict[str, Any] = {}
    for name, value in values.items():
        if name in leaves:
            read = nodes if _is_table(cls, name) else number
            unit = leaves[name].unit
            accepted[name] = read(value, unit.symbol, name, unit.nominal)
        elif name in choices:
            accepted[name] = value
        else:
            raise unknown_name(kind, name, (*leaves, *choices), listed=listed)
    return accepted


def number(value: Any, symbol: str, name: str, nominal: float = 1.0) -> float:
    """Return one value in an SI unit; see `bywire.core.units.parse`. Zero needs no unit."""
    if isinstance(value, (Mapping, Sequence)) and not isinstance(value, str):
        raise ParameterError(
            f"{name} = {quoted(value)} must be one value, not several",
            name=name,
            value=quoted(value),
            valid="one value",
        )
    return _quantity(value, symbol, name, nominal)


def written(value: Any, symbol: str, name: str, nominal: float = 1.0) -> float:
    """Return one value of a file; reject a plain number if a unit is required."""
    require_unit(value, symbol, name, nominal)
    return number(value, symbol, name, nominal)


def nodes(value: Any, symbol: str, name: str, nominal: float = 1.0) -> tuple[float, ...]:
    """Return a table's nodes from a sequence, or from a string with commas, each with its unit.

    Examples
    --------
    >>> nodes("0 s, 200 ms", "s", "times")
    (0.0, 0.2)
    """
    if isinstance(value, str):
        return _listed(value, symbol, name, nominal)
    several = isinstance(value, Sequence)
    entries = value if several else (value,)
    return tuple(
        _quantity(node, symbol, f"{name}.{k}" if several else name, nominal)
        for k, node in enumerate(entries)
    )


def _listed(text: str, symbol: str, name: str, nominal: float) -> tuple[float, ...]:
    """Return a table's nodes from a single string."""
    parts = [part.strip() for part in text.split(",")]
    try:
        return tuple(
            _quantity(part, symbol, f"{name}.{k}" if len(parts) > 1 else name, nominal)
            for k, part in enumerate(parts)
        )
    except UnitError as error:
        raise error.reworded(f"{error}. Separate several values with commas") from None


def require_units(cls: type[ParameterSet], values: Mapping[str, Any], level_unit: str = "") -> None:
    """Reject plain numbers in a file if a unit is required; zero needs no unit.

    Parameters
    ----------
    cls
        The parameter class of the values.
    values
        Values by dotted name. The function skips unknown names and values that are not numbers.
    level_unit
        Unit that replaces ``level`` in the unit of a stimulus.

    Raises
    ------
    UnitError
        When a number has no unit, with the same message as for the number as a string.
    """
    leaves = leaf_fields(cls)
    for name in values.keys() & leaves.keys():
        value, unit = values[name], leaves[name].unit
        symbol = unit.symbol.replace("level", level_unit)
        if isinstance(value, list) and _is_table(cls, name):
            for k, node in enumerate(value):
                require_unit(node, symbol, f"{name}.{k}", unit.nominal)
        else:
            require_unit(value, symbol, name, unit.nominal)


def require_unit(value: Any, symbol: str, name: str, nominal: float = 1.0) -> None:
    """Reject a plain number if a unit is required; see `require_units`."""
    if isinstance(value, (bool, units.Written)) or not isinstance(value, (int, float)):
        return
    try:
        is_plain = math.isfinite(value) and value != 0
    except OverflowError:  # a whole number of 309 digits or more
        return
    if is_plain:
        units.parse(_plain_text(value), symbol, name, nominal)


class _Unquoted(str):
    """String that errors quote without quotation marks."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


def _plain_text(value: float) -> str:
    """Return a file's plain number as a string that errors quote without quotation marks.

    A string without its required unit is an error, whereas a number would be treated as SI.

    Examples
    --------
    >>> quoted(_plain_text(37)), quoted("37")
    ('37', "'37'")
    """
    return _Unquoted(repr(value))


def _quantity(value: Any, symbol: str, name: str, nominal: float = 1.0) -> float:
    if isinstance(value, str) and _ZERO.fullmatch(value):
        return 0.0
    if isinstance(value, units.Written):
        return value
    number = units.parse(value, symbol, name, nominal)
    if not isinstance(value, str):
        return number
    return units.Written(number, value)


def _is_table(cls: type[ParameterSet], name: str) -> bool:
    owner: type[ParameterSet] = cls
    *groups, last = name.split(".")
    for group in groups:
        owner = owner.model_fields[group].annotation  # type: ignore[assignment]
    return get_origin(owner.model_fields[last].annotation) is tuple
