"""What a key figure is: a value with unit, definition and, where it is not defined, the reason.

A family (one file) has a data class ``Setting`` with what its figures need to know, and one
function per figure, declared with `measure`. A figure that is not defined for a recording is NaN
with a reason in its note, never an exception and never a number that stands for something else.
Where the recording leaves open what the figure is (nothing moved, or it still moves at the end),
the figure is *open*: a requirement on it is undecided, neither met nor missed.

A function takes samples (`bywire.bench.kpis.loop_family`), and then is the figure in C as well, for
the many cases of a study and for pages. Or the family has a function ``select(recording,
setting)``, whose `Data` the functions take: for figures that need NumPy or SciPy.
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

_BOUND = 3.0  # of errors that do not converge: 95 % of the true ones lie within


@dataclass(frozen=True, eq=False)
class Kpi(EqualWhereUndefined):
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
    is_open
        Whether it is not defined because the recording leaves open what it is.
    converges
        Whether runs in several steps show the order of the scheme; else ``error`` is no more than
        a scale.
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
        """How far it may be off by the step, in ``unit``: three times the error of no order."""
        return self.error if self.converges else _BOUND * self.error


@dataclass(frozen=True)
class Undefined:
    """A key figure that these data do not define, why, and whether they leave it open."""

    reason: str
    is_open: bool = False


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
        self, ending: str = "", /, **values: SupportsFloat | tuple[float, str] | Undefined
    ) -> tuple[Kpi, ...]:
        """Return those figures that have a value, in the order of their declaration.

        Parameters
        ----------
        ending
            What follows their names.
        values
            Value by name, in the declared unit, NaN where it is not defined; or value and note;
            or why there is none.
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
    """A key figure of many cases; fields as of `Kpi`.

    ``values``: shape ``(cases,)``; ``told``: ``told(case)``, the note of a case; ``opened``:
    ``opened(case)``, whether its figure is open.
    """

    name: str
    values: Array
    unit: str
    definition: str
    told: Callable[[Any], str]
    opened: Callable[[Any], bool] = lambda case: False

    def case(self, k: Any) -> Kpi:
        """Return the figure of one case."""
        return Kpi(
            self.name,
            float(self.values[k]),
            self.unit,
            self.definition,
            self.told(k),
            is_open=self.opened(k),
        )


class Data(Protocol):
    """What a family computes its figures from."""

    @property
    def units(self) -> Mapping[str, str]:
        """SI unit of every placeholder that the family's figures declare as unit."""
        ...

    @property
    def defect(self) -> str:
        """Why no figure at all is defined; empty for sound data.

        Data with an attribute ``is_open`` say by it whether that leaves the figures open.
        """
        ...

    @property
    def note(self) -> str:
        """How the data were treated; empty for raw data."""
        ...


Value = float | Undefined | Array
"""what the function of a key figure gives"""


class Measure:
    """A declared key figure.

    Parameters
    ----------
    unit
        SI unit, ``"%"``, or a placeholder that the data resolve, for instance ``"level"``.
    function
        Returns the value, or why there is none. Its name and its docstring's first line are the
        figure's name and definition.
    needs
        Fields of the family's setting that name signals, one of which at least it needs; none
        where the family cannot do without any of them. Of a loop over samples its signature says
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
        """Return the figure of what a family selects; NaN with a reason where it has none."""
        value = (
            Undefined(data.defect, getattr(data, "is_open", False))
            if data.defect
            else self.__wrapped__(data)
        )
        return self.kpi(value, data.units, data.note)

    def kpi(self, value: Any, units: Mapping[str, str], note: str) -> Kpi:
        """Return the figure of a value, or of why there is none.

        Parameters
        ----------
        value
            What the function gave.
        units
            SI unit of every placeholder.
        note
            How the data were treated.
        """
        unit, is_open = units.get(self.unit, self.unit), False
        if isinstance(value, Undefined):
            value, note, is_open = math.nan, value.reason, value.is_open
        return Kpi(self.name, float(value), unit, self.definition, note, is_open=is_open)


def measure(unit: str, needs: tuple[str, ...] = ()) -> Callable[[Callable[..., Value]], Measure]:
    """Declare a function as a key figure with a unit, and what it needs; see `Measure`."""

    def declare(function: Callable[..., Value]) -> Measure:
        return Measure(unit, function, needs)

    return declare
