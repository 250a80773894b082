"""Common inputs of use cases for loops: loop, parameters, operating point, ranges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.analysis.linear.corners import read_sides
from bywire.analysis.loop import LOOPS, Loop, Quantity
from bywire.api.parameter_choice import parameters_for
from bywire.core.callers import option
from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.pairs import read_count
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import signals_of
from bywire.core.values import number

if TYPE_CHECKING:
    from bywire.report.subject import Subject

_MOST = 10_000


@dataclass(frozen=True)
class LoopCase:
    """Loop with the requested parameters and operating point.

    Parameters
    ----------
    loop
        The loop.
    name, par
        Name of the parameter set, and the values in use.
    value
        Operating point [SI unit of ``loop.at``].
    """

    loop: Loop
    name: str
    par: ParameterSet
    value: float

    @property
    def point(self) -> str:
        """Operating point as text, for example ``"pressure = 20 bar"``."""
        from bywire.report.wording import amount

        return f"{self.loop.at.name} = {amount(self.value, self.loop.at.unit)}"

    @property
    def input_unit(self) -> str:
        """SI unit of the excited input."""
        model = self.loop.point(self.par, self.value).model
        return signals_of(model.Stimulus)[self.loop.inputs[0]].unit

    def frequencies(self, text: str, points: int) -> list[float]:
        """Return the frequencies [Hz] in a string. Default: ``points`` over the loop's band.

        Raises
        ------
        InputError
            See `spread`.
        """
        if text:
            return spread(text, "Hz", "frequencies", logarithmic=True)
        return [float(f) for f in np.geomspace(*self.loop.band, points)]

    @property
    def subject(self) -> Subject:
        """Loop and operating point for reports."""
        from bywire.report.subject import Subject

        return Subject(self.loop.name, self.loop.summary, self.name, self.par, self.point)

    @property
    def heading(self) -> dict[str, Any]:
        """First fields of every loop's JSON object."""
        return {
            "loop": self.loop.name,
            "parameters": self.name,
            "operating_point": {self.loop.at.name: self.value, "unit": self.loop.at.unit},
        }


def loop_case(
    name: str,
    parameters: str = "",
    at: str = "",
    changes: Mapping[str, Any] = MappingProxyType({}),
    side: str = "",
) -> LoopCase:
    """Find a loop, and read its parameters and operating point.

    Parameters
    ----------
    name
        Loop.
    parameters
        Parameter set. If empty, the main set of the loop's brake.
    at
        Operating point with its unit. If empty, the loop's nominal point.
    changes
        Parameters by dotted name, with units.
    side
        Side of linear models at a kink (see `read_sides`).

    Raises
    ------
    InputError
        If a name is unknown, a value is out of range, or the parameter set is for another brake.
    """
    read_sides(side)
    loop = replace(LOOPS.find(name), side=side)
    assemblies = (loop.assembly, *loop.variants)
    name, par = parameters_for(f"loop {loop.name!r}", assemblies, parameters, changes)
    value = number(at, loop.at.unit, loop.at.name) if at else loop.at.default
    return LoopCase(loop, name, par, value)


def spread(text: str, unit: str, name: str, *, logarithmic: bool = False) -> list[float]:
    """Return the values of ``low:high:count`` or of a comma-separated list, each with its unit.

    Raises
    ------
    ParameterError
        If the string has neither form.
    UnitError
        If a value has no unit or a wrong one.
    """
    parts = [part.strip() for part in text.split(":")]
    if len(parts) == 1:
        return [number(part.strip(), unit, name) for part in text.split(",")]
    count = read_count(parts[2]) if len(parts) == 3 else None
    if count is None or not 2 <= count <= _MOST:
        raise ParameterError(
            f"{name} = {quoted(text)} is not valid. Write LOW:HIGH:COUNT with 2 to {_MOST} values, "
            "or values separated by commas",
            name=name,
            value=quoted(text),
            valid=f"2 to {_MOST} values",
        )
    low, high = (number(part, unit, name) for part in parts[:2])
    if logarithmic and low <= 0:
        raise ParameterError(
            f"{name} = {quoted(text)} is not valid: a logarithmic range must start above 0 {unit}",
            name=name,
            value=quoted(text),
            valid=f"above 0 {unit}",
        )
    if low == high:
        raise ParameterError(
            f"{name} = {quoted(text)} contains only one value. Write "
            f"{name}={quoted(parts[0])[1:-1]}",
            name=name,
            value=quoted(text),
        )
    if not low < high:
        raise ParameterError(
            f"{name} = {quoted(text)} is not valid: the first value must be below the second",
            name=name,
            value=quoted(text),
            valid="below the second",
        )
    between = np.geomspace if logarithmic else np.linspace
    return [float(value) for value in between(low, high, count)]


def over_range(text: str, chosen: LoopCase, argument: str = "over") -> tuple[str, str, list[float]]:
    """Return name, unit and values of a range for a loop (see `range_of`)."""
    return range_of(text, chosen.loop.at, chosen.par, argument)


def range_of(
    text: str, quantity: Quantity, par: ParameterSet, argument: str
) -> tuple[str, str, list[float]]:
    """Return name, unit and values of ``NAME=LOW:HIGH:COUNT``, where ``at`` is the operating point.

    Raises
    ------
    InputError
        See `spread`. Also if the name is neither a parameter nor the operating quantity.
    """
    name, equals, values = (part.strip() for part in text.partition("="))
    if not equals:
        raise ParameterError(
            f"{option(argument)} {text} is not a range. Write NAME=LOW:HIGH:COUNT",
            name=option(argument),
            value=text,
            valid="NAME=LOW:HIGH:COUNT",
        )
    if name in ("at", quantity.name):
        return quantity.name, quantity.unit, spread(values, quantity.unit, quantity.name)
    if name not in par.leaves():
        raise unknown_name("parameter", name, ["at", quantity.name, *par.leaves()])
    leaves = leaf_fields(type(par))
    unit = leaves[name if name in leaves else name.rpartition(".")[0]].unit.symbol  # of its table
    return name, unit, spread(values, unit, name)
