"""Values as users write them: texts with units become SI numbers, tables, or choices."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_origin

from bywire.core import units
from bywire.core.errors import UnitError, unknown_name
from bywire.core.parameters import ParameterSet, choice_fields, leaf_fields


def parsed(cls: type[ParameterSet], values: Mapping[str, Any], kind: str) -> dict[str, Any]:
    """Return values by dotted name, numbers in SI.

    Parameters
    ----------
    cls
        Class of the parameter set that they are for.
    values
        Numbers (SI), texts with units, sequences of these for tables, or choices.
    kind
        What the names are called in errors.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    UnitError
        When a text is no quantity or its unit measures something else.
    """
    leaves, choices = leaf_fields(cls), choice_fields(cls)
    found: dict[str, Any] = {}
    for name, value in values.items():
        if name in leaves:
            found[name] = _number(cls, name, value, leaves[name].unit.symbol)
        elif name in choices:
            found[name] = value
        else:
            raise unknown_name(kind, name, leaves.keys() | choices.keys())
    return found


def _number(cls: type[ParameterSet], name: str, value: Any, symbol: str) -> Any:
    symbol = "A/s" if symbol == "level/s" else symbol
    if not _is_table(cls, name):
        if not isinstance(value, (str, int, float)):
            raise UnitError(f"{name} = {value!r}: one value is wanted")
        return units.parse(value, symbol, name)
    nodes = value.split(",") if isinstance(value, str) else value
    if isinstance(nodes, (int, float)):
        nodes = (nodes,)
    return tuple(units.parse(node, symbol, f"{name}.{k}") for k, node in enumerate(nodes))


def _is_table(cls: type[ParameterSet], name: str) -> bool:
    owner: type[ParameterSet] = cls
    *groups, last = name.split(".")
    for group in groups:
        owner = owner.model_fields[group].annotation  # type: ignore[assignment]
    return get_origin(owner.model_fields[last].annotation) is tuple
