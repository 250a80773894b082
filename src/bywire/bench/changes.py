"""Changes of a bench by name: parameters, options, percentages, and patterns of names."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from typing import Any, TypeVar

from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.units import Written, difference_unit

_SHARE = re.compile(r"\s*([+-]\s*(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*%\s*")
_PATTERN = re.compile(r"[*?\[]")


def is_relative(name: str, value: object) -> bool:
    """Return whether a change is relative: a percentage such as ``+50%``, or a pattern of names."""
    return bool(_PATTERN.search(name) or (isinstance(value, str) and _SHARE.fullmatch(value)))


def settled(base: ParameterSet, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return changes by plain names, with percentages as numbers [SI].

    Parameters
    ----------
    base
        Parameters before the changes.
    changes
        Values by dotted name. A text with a sign and a percentage, ``"+50%"``, changes a quantity
        by that fraction of its value. ``*``, ``?`` and ``[...]`` in a name match any characters. A
        name without a pattern takes precedence.

    Raises
    ------
    UnknownNameError
        When a pattern matches no name.
    ParameterError
        For a percentage of a choice, of zero, or of a temperature.
    """
    if not any(is_relative(name, value) for name, value in changes.items()):
        return dict(changes)
    values, leaves = base.flat(), leaf_fields(type(base))
    spread: dict[str, Any] = {}
    for pattern in filter(_PATTERN.search, changes):
        names = [name for name in values if fnmatchcase(name, pattern)]
        if not names:
            groups = {f"{name.rpartition('.')[0]}.*" for name in values if "." in name}
            raise unknown_name("parameter pattern", pattern, {*values, *groups})
        share = share_of(changes[pattern])
        if share is not None:
            names = [name for name in names if name in leaves and any(_nodes(values[name]))]
            if not names:
                raise ParameterError(
                    f"{pattern} = {quoted(changes[pattern])} changes nothing: every quantity that "
                    "matches the pattern is 0. Specify a value with its unit",
                    name=pattern,
                    value=str(changes[pattern]),
                    valid="a value with its unit",
                )
        spread |= dict.fromkeys(names, changes[pattern])
    spread |= {name: value for name, value in changes.items() if not _PATTERN.search(name)}
    for name, value in spread.items():
        if name in leaves and share_of(value) is not None:
            refuse_share_of_temperature(name, str(value), leaves[name].unit.symbol)
    return {
        name: value
        if (share := share_of(value)) is None or name not in values
        else _scaled(name, value, share, values[name], name in leaves)
        for name, value in spread.items()
    }


def share_of(value: object) -> float | None:
    """Return the fraction of a signed percentage; None for a plain value.

    Examples
    --------
    >>> share_of("+50%"), share_of("50 %")
    (0.5, None)
    """
    match = _SHARE.fullmatch(value) if isinstance(value, str) else None
    return None if match is None else float(match[1].replace(" ", "")) / 100.0


def refuse_share_of_temperature(name: str, text: str, symbol: str) -> None:
    """Reject a percentage of a temperature: 5 % of 20 degC is 1 K in degC, but 15 K in kelvin.

    Parameters
    ----------
    name, text
        Parameter and percentage.
    symbol
        Its SI unit.

    Raises
    ------
    ParameterError
        For temperatures.
    """
    if difference_unit(symbol) != symbol:
        raise ParameterError(
            f"{name} = {quoted(text)} is ambiguous because degC and K have different zero points. "
            "Specify a temperature, or a difference in K",
            name=name,
            value=text,
            valid="a temperature, or a difference in K",
        )


def _scaled(name: str, text: str, share: float, value: Any, is_quantity: bool) -> Any:
    if not is_quantity:
        raise ParameterError(
            f"{name} = {quoted(text)} is not valid: {name} is a choice (now {value}), which cannot "
            "change by a percentage. Specify another choice",
            name=name,
            value=text,
            valid="another choice",
        )
    nodes = [*_nodes(value)]
    if not any(nodes):
        raise ParameterError(
            f"{name} = {quoted(text)} changes nothing because {name} is 0. Specify a value with "
            "its unit",
            name=name,
            value=text,
            valid="a value with its unit",
        )
    scaled = tuple(Written((1.0 + share) * node, text) for node in nodes)
    return scaled if isinstance(value, tuple) else scaled[0]


def _nodes(value: Any) -> Iterator[float]:
    """Yield a number, or each number of a table."""
    yield from value if isinstance(value, tuple) else (value,)


# --- Options among parameters

T = TypeVar("T")

OPTION = "options."
"""prefix of the name of an option"""


def split_options(named: Mapping[str, T]) -> tuple[dict[str, T], dict[str, T]]:
    """Return the values of parameters, and of options by their names without the prefix.

    Examples
    --------
    >>> split_options({"motor.R_m": 0.2, "options.p_to": 25e5})
    ({'motor.R_m': 0.2}, {'p_to': 2500000.0})
    """
    parameters = {name: each for name, each in named.items() if not name.startswith(OPTION)}
    options = {
        name.removeprefix(OPTION): each for name, each in named.items() if name.startswith(OPTION)
    }
    return parameters, options
