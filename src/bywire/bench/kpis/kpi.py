"""Key figures: values with unit, definition and, where undefined, the reason.

A family (one file) has a data class ``Setting`` with the inputs of its figures, and one function
per figure, declared with `measure`. A figure that is undefined for a recording is NaN with a reason
in its note, never an exception, and never a number with another meaning. If the recording does not
determine the figure (nothing moves, or the signal still moves at the end), the figure is *open*. A
requirement on an open figure is undecided, neither met nor missed.

The functions either accept samples (`bywire.bench.kpis.loop_family`), and are then also translated
to C for the many cases of a study and for pages. Or the family has a function ``select(recording,
setting)``, and its functions accept the resulting `Data`, for figures that need NumPy or SciPy.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, SupportsFloat

from bywire.core.errors import unknown_name
from bywire.core.typing import Array
from bywire.core.undefined import EqualWhereUndefined

BOUND = 3.0
"""factor for errors without convergence: contains 95 % of the true errors"""


@dataclass(frozen=True, eq=False)
class Kpi(EqualWhereUndefined):
    """Key figure of a recording.

    Parameters
    ----------
    name
        Name in requirements and reports.
    value
        Its value in ``unit``; NaN where undefined.
    unit
        SI unit, or ``"%"``.
    definition
        One line for listings.
    note
        Reason why the figure is undefined, or treatment of the data.
    error
        Estimated numerical error in ``unit``; infinite if runs with other steps do not determine
        the error, NaN if it was not estimated.
    is_open
        Whether the figure is undefined because the recording does not determine it.
    converges
        Whether runs with several steps show the order of the scheme. Otherwise, ``error`` is only a
        scale.
    """

    name: str
    value: float
    unit: str
    definition: str
    note: str = ""
    error: float = math.nan
    is_open: bool = False
    converges: bool = True

    @property
    def bound(self) -> float:
        """Bound of the numerical error in ``unit``: three times the error without convergence."""
        return self.error if self.converges else BOUND * self.error


@dataclass(frozen=True)
class Undefined:
    """Undefined key figure: the reason, and whether the data leave it open."""

    reason: str
    is_open: bool = False


class Figures:
    """Key figures of an experiment, each declared once by name, unit and definition.

    Parameters
    ----------
    undefined
        Reason for figures whose value is not a number.
    declared
        SI unit (or ``"%"``) and definition by name.

    Examples
    --------
    >>> figures = Figures(force=("N", "Maximum force."), undefined="nothing presses")
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
        self, ending: str = "", /, **values: SupportsFloat | tuple[float, str] | Undefined
    ) -> tuple[Kpi, ...]:
        """Return the figures that have a value, in the order of their declaration.

        Parameters
        ----------
        ending
            Suffix of their names.
        values
            Value by name, in the declared unit, NaN where undefined; or value and note; or an
            `Undefined`.
        """
        unknown = values.keys() - self.declared.keys()
        if unknown:
            raise unknown_name("key figure", min(unknown), self.declared)
        kpis = []
        for name in (name for name in self.declared if name in values):
            unit, definition = self.declared[name]
            given, is_open = values[name], False
            if isinstance(given, Undefined):
                value, note, is_open = math.nan, given.reason, given.is_open
            elif isinstance(given, tuple):
                value, note = given
            else:
                value = float(given)
                note = "" if math.isfinite(value) else self.undefined
            kpis.append(Kpi(name + ending, float(value), unit, definition, note, is_open=is_open))
        return tuple(kpis)


@dataclass(frozen=True)
class KpiOfCases:
    """Key figure of many cases; fields as in `Kpi`.

    ``values``: shape ``(cases,)``; ``note_of``: ``note_of(case)``, the note of a case;
    ``is_open_in``: ``is_open_in(case)``, whether its figure is open.
    """

    name: str
    values: Array
    unit: str
    definition: str
    note_of: Callable[[Any], str]
    is_open_in: Callable[[Any], bool] = lambda case: False

    def case(self, k: Any) -> Kpi:
        """Return the figure of one case."""
        return Kpi(
            self.name,
            float(self.values[k]),
            self.unit,
            self.definition,
            self.note_of(k),
            is_open=self.is_open_in(k),
        )


class Data(Protocol):
    """Data from which a family computes its figures.

    A family's data may also have an attribute ``is_open``: whether figures that ``defect`` leaves
    undefined are open.
    """

    @property
    def units(self) -> Mapping[str, str]:
        """SI unit of every placeholder that the family's figures declare as unit."""
        ...

    @property
    def defect(self) -> str:
        """Reason why all figures are undefined; empty for valid data."""
        ...

    @property
    def note(self) -> str:
        """Note on the treatment of the data; empty for raw data."""
        ...


Value = float | Undefined | Array
"""result of the function of a key figure"""


class Measure:
    """Declared key figure.

    Parameters
    ----------
    unit
        SI unit, ``"%"``, or a placeholder that the data resolve, for example ``"level"``.
    function
        Returns the value, or an `Undefined`. Its name and the first line of its docstring are the
        figure's name and definition.
    needs
        Fields of the family's setting that specify signals, of which the figure needs at least one;
        empty if the family needs all of them. For a loop over samples, its signature determines
        them: ``Samples | None``.
    """

    def __init__(
        self, unit: str, function: Callable[..., Value], needs: tuple[str, ...] = ()
    ) -> None:
        self.name = function.__name__
        self.unit = unit
        self.needs = needs
        self.definition = inspect.cleandoc(function.__doc__ or "").splitlines()[0]
        self.__doc__ = function.__doc__
        self.__wrapped__ = function

    def __call__(self, data: Data) -> Kpi:
        """Return the figure of a family's data; NaN with a reason where undefined."""
        value = (
            Undefined(data.defect, getattr(data, "is_open", False))
            if data.defect
            else self.__wrapped__(data)
        )
        return self.kpi(value, data.units, data.note)

    def kpi(self, value: Any, units: Mapping[str, str], note: str) -> Kpi:
        """Return the figure for a value or an `Undefined`.

        Parameters
        ----------
        value
            Result of the function.
        units
            SI unit of every placeholder.
        note
            Note on the treatment of the data.
        """
        unit, is_open = units.get(self.unit, self.unit), False
        if isinstance(value, Undefined):
            value, note, is_open = math.nan, value.reason, value.is_open
        return Kpi(self.name, float(value), unit, self.definition, note, is_open=is_open)


def measure(unit: str, needs: tuple[str, ...] = ()) -> Callable[[Callable[..., Value]], Measure]:
    """Declare a function as a key figure with a unit and the signals that it needs."""

    def declare(function: Callable[..., Value]) -> Measure:
        return Measure(unit, function, needs)

    return declare
