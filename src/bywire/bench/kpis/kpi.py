"""What a key figure is: a value with unit, definition and, where it is not defined, the reason.

A family (one file) has a data class with what its figures need and one function per figure,
declared with `measure`. A figure that is not defined for a recording is NaN with a reason in
its note, never an exception and never a number that stands for something else.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Generic, Protocol, SupportsFloat, TypeVar

import numpy as np
import xarray as xr

from bywire.core.errors import ParameterError, unknown_name
from bywire.core.typing import Array


@dataclass(frozen=True)
class Kpi:
    """A key figure of a recording.

    Parameters
    ----------
    name
        What requirements and reports call it.
    value
        Its value in ``unit``; NaN where it is not defined.
    unit
        SI unit, or ``"%"``.
    definition
        One line for listings.
    note
        Why it is not defined, or how the data were treated.
    error
        Estimated error from the step, in ``unit``; infinite where not even half the step shows
        how large it is, NaN where it was not estimated.
    """

    name: str
    value: float
    unit: str
    definition: str
    note: str = ""
    error: float = math.nan


class Figures:
    """Key figures of an experiment, each declared once by name, unit and definition.

    Parameters
    ----------
    undefined
        Why a figure whose value is no number is not defined.
    declared
        SI unit (or ``"%"``) and definition by name.

    Examples
    --------
    >>> figures = Figures(force=("N", "Largest force."), undefined="nothing presses")
    >>> figures.units
    {'force': 'N'}
    >>> figures(force=math.nan)[0].note
    'nothing presses'
    """

    def __init__(self, *, undefined: str = "", **declared: tuple[str, str]) -> None:
        self.undefined = undefined
        self.declared = declared

    @property
    def units(self) -> dict[str, str]:
        """Unit of every figure by name."""
        return self.ending("")

    def ending(self, *endings: str) -> dict[str, str]:
        """Return the unit of every figure by its name with each of several endings."""
        return {f"{name}{e}": unit for e in endings for name, (unit, _) in self.declared.items()}

    def __call__(
        self, ending: str = "", /, **values: SupportsFloat | tuple[float, str]
    ) -> tuple[Kpi, ...]:
        """Return those figures that have a value, in the order of their declaration.

        Parameters
        ----------
        ending
            What follows their names.
        values
            Value by name, in the declared unit, NaN where it is not defined; or value and note.
        """
        unknown = values.keys() - self.declared.keys()
        if unknown:
            raise unknown_name("key figure", min(unknown), self.declared)
        kpis = []
        for name in (name for name in self.declared if name in values):
            unit, definition = self.declared[name]
            given = values[name]
            if isinstance(given, tuple):
                value, note = given
            else:
                value = float(given)
                note = "" if math.isfinite(value) else self.undefined
            kpis.append(Kpi(name + ending, float(value), unit, definition, note))
        return tuple(kpis)


@dataclass(frozen=True)
class Undefined:
    """A key figure that these data do not define, and why."""

    reason: str


class Data(Protocol):
    """What a family computes its figures from."""

    @property
    def units(self) -> Mapping[str, str]:
        """SI unit of every placeholder that the family's figures declare as unit."""
        ...

    @property
    def defect(self) -> str:
        """Why no figure at all is defined; empty for sound data."""
        ...

    @property
    def note(self) -> str:
        """How the data were treated; empty for raw data."""
        ...


D = TypeVar("D", bound=Data)


class Measure(Generic[D]):
    """A declared key figure; call it with its family's data to get a `Kpi`.

    Parameters
    ----------
    unit
        SI unit, ``"%"``, or a placeholder that the data resolve, for instance ``"level"``.
    function
        Returns the value, or why there is none. Its name and its docstring's first line are
        the figure's name and definition.
    needs
        Fields of the family's setting that name signals, one of which at least it needs; none
        where the family cannot do without any of them.
    """

    def __init__(
        self, unit: str, function: Callable[[D], float | Undefined], needs: tuple[str, ...] = ()
    ) -> None:
        self.name = function.__name__
        self.unit = unit
        self.needs = needs
        self.definition = inspect.cleandoc(function.__doc__ or "").splitlines()[0]
        self.__doc__ = function.__doc__
        self.__wrapped__ = function

    def __call__(self, data: D) -> Kpi:
        """Return the figure; NaN with a reason where the data do not define it."""
        unit = data.units.get(self.unit, self.unit)
        value = Undefined(data.defect) if data.defect else self.__wrapped__(data)
        if isinstance(value, Undefined):
            return Kpi(self.name, math.nan, unit, self.definition, value.reason)
        return Kpi(self.name, float(value), unit, self.definition, data.note)


def measure(
    unit: str, needs: tuple[str, ...] = ()
) -> Callable[[Callable[[D], float | Undefined]], Measure[D]]:
    """Declare a function as a key figure with a unit, and what it needs; see `Measure`."""

    def declare(function: Callable[[D], float | Undefined]) -> Measure[D]:
        return Measure(unit, function, needs)

    return declare


def signal(recording: xr.Dataset, name: str) -> tuple[Array, str]:
    """Return one signal of a recording and its unit.

    Returns
    -------
    values
        Shape ``(time,)``.
    unit
        SI unit, ``"1"`` where none is recorded.

    Raises
    ------
    UnknownNameError
        When the recording does not hold the signal.
    ParameterError
        When the signal has other dimensions than time.
    """
    if name not in recording:
        raise unknown_name("signal of the recording", name, map(str, recording.variables))
    variable = recording[name]
    if variable.dims != ("time",):
        raise ParameterError(
            f"signal {name!r} has the dimensions {variable.dims}: key figures need time alone; "
            "select one case first, for instance recording.isel(case=0)"
        )
    return np.asarray(variable.values, dtype=np.float64), str(variable.attrs.get("units", "1"))


def defect(t: Array, *signals: Array) -> str:
    """Return why samples are unusable, or an empty text.

    Parameters
    ----------
    t
        Times [s], shape ``(n,)``.
    signals
        Signals over these times, shape ``(n,)`` each.
    """
    if t.size < 2:
        return f"{t.size} samples are too few: two at least are needed"
    if not np.all(np.isfinite(t)) or np.any(np.diff(t) <= 0):
        return "the times do not increase"
    for values in signals:
        if values.shape != t.shape:
            return f"{values.size} values do not fit {t.size} times"
        bad = ~np.isfinite(values)
        if np.any(bad):
            return f"not a number at {t[np.argmax(bad)]:g} s"
    return ""


def integral(t: Array, y: Array) -> float:
    """Return the integral over time by the trapezoidal rule, exact for straight pieces."""
    return float(np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(t)))
