"""The line on an experiment, with the values of its options in it: those of the bench at hand."""

from __future__ import annotations

from collections.abc import Collection
from string import Formatter
from typing import Any, Self

from bywire.core.errors import ModelError, quoted
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.quantities import display_unit
from bywire.core.units import convert, unit_text


class Summary(str):
    """A line on an experiment that remembers where options stand in it.

    Parameters
    ----------
    text
        The line.
    template
        The same with names of options in braces.
    """

    template: str

    def __new__(cls, text: str, template: str) -> Self:
        """Return the line with its template."""
        made = super().__new__(cls, text)
        made.template = template
        return made

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]
        """Return what a copy is made of."""
        return str(self), self.template


def summary_of(template: str, options: ParameterSet, varied: Collection[str] = ()) -> Summary:
    """Return a summary with the values of options in place of their names.

    Parameters
    ----------
    template
        A line with names of options in braces, if need be with the unit that reads best after a
        colon: ``"stop from {v_0:km/h} on {surface}"``. Of a table of values the ends are told.
    options
        The options.
    varied
        Names of those that take several values: what is told is marked.

    Raises
    ------
    ModelError
        For names in braces that are no options, and braces that do not match.
    """
    known, pieces = options.flat(), []
    try:
        for text, name, unit, _ in Formatter().parse(template):
            pieces.append(text)
            if name is not None:
                told = _told(known[name], _symbol(options, name), unit or "")
                pieces.append(f"{told} (varied)" if name in varied else told)
    except (KeyError, TypeError, ValueError) as error:
        raise ModelError(
            f"summary {quoted(template)}: names of options are wanted in braces ({error})"
        ) from None
    return Summary("".join(pieces), template)


def _symbol(options: ParameterSet, name: str) -> str:
    """Return the SI unit of an option; that of a pure number for a choice."""
    leaf = leaf_fields(type(options)).get(name)
    return "1" if leaf is None else leaf.unit.symbol


def _told(value: Any, symbol: str, unit: str) -> str:
    """Return a value as a sentence has it: with its unit, words for a choice."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return value.replace("-", " ")
    several = value if isinstance(value, tuple) else (value,)
    unit = unit or display_unit(symbol)
    ends = dict.fromkeys((min(several), max(several)))  # 2 to 100 Hz
    numbers = " to ".join(f"{convert(float(each), symbol, unit):.6g}" for each in ends)
    return f"{numbers} {unit_text(unit)}".rstrip()
