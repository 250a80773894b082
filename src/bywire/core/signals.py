"""Signals: what the fields of a State, Input, Output or Memory tuple mean."""

from __future__ import annotations

import math
import typing
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

from annotated_types import Ge, Gt, Le, Lt

from bywire.core.arguments import checked
from bywire.core.errors import ModelError, place_of

T = TypeVar("T", bound=tuple[Any, ...])
_NOISE = "noise_"  # what the name of a stimulus that is noise begins with


@dataclass(frozen=True)
class Role:
    """What an energy is in the books of a run.

    Parameters
    ----------
    side
        Whether it is given (``"source"``) or taken (``"sink"``: losses and stores). A time in which
        all stands still is ``"standstill"``.
    returns
        Of a sink: what it may give back. A loss gives nothing back, and a run in which one does
        warns of it; ``"taken"``: at most what it took, like a spring that begins slack; ``"any"``:
        like a store that begins full, or air that may be warmer.
    label
        What the books call it.
    split
        Of a sink: whether what it takes during the standstill is booked apart, as holding.
    whole
        Of a source: the one in whose place it stands where it is recorded.
    rest, rest_label
        The sink that takes what it gives more than that one.
    book
        Name of the further book in which it stands; empty for the actuator's own.
    """

    side: Literal["source", "sink", "standstill"]
    label: str = ""
    split: bool = False
    returns: Literal["", "taken", "any"] = ""
    whole: str = ""
    rest: str = ""
    rest_label: str = ""
    book: str = ""


@dataclass(frozen=True)
class Signal:
    """Meaning of one field of a signal tuple.

    Parameters
    ----------
    unit
        SI unit; ``"1"`` for a pure number.
    label
        What an axis of a figure says.
    nominal
        Usual magnitude in that unit.
    set_point_of
        Name of the signal whose set point this is, for figures; empty for none.
    role
        What it is in the books, of an energy or of a power whose integral is one.
    low, high
        Ends of its admissible range, in that unit: a gauge pressure is not below the vacuum, an
        opening not negative. `bywire.check` tries nothing beyond. ``Ge(0)`` behind the Signal of
        an annotation says the same.
    """

    unit: str
    label: str
    nominal: float = 1.0
    set_point_of: str = ""
    role: Role | None = None
    low: float = -math.inf
    high: float = math.inf

    def within(self, value: float) -> float:
        """Return a value, or the end of the range that is nearest to it."""
        return min(max(value, self.low), self.high)


@dataclass(frozen=True)
class Limited:
    """Limit of a command, beside the Signal of a field of the memory.

    Parameters
    ----------
    by
        Dotted name of the parameter that the command's magnitude never exceeds; or the name of the
        stimulus that the command never exceeds.
    """

    by: str


Power = Annotated[float, Signal("W", "power")]
Energy = Annotated[float, Signal("J", "energy")]
Torque = Annotated[float, Signal("N*m", "torque", 0.01)]
Speed = Annotated[float, Signal("rad/s", "shaft speed", 10.0)]
Angle = Annotated[float, Signal("rad", "shaft angle", 20.0)]
Pressure = Annotated[float, Signal("Pa", "pressure", 2e6, low=-101_325.0)]
EnthalpyDensity = Annotated[float, Signal("J/m**3", "flow energy per volume", 2e6)]
PressureEnergy = Annotated[float, Signal("Pa**2", "integral of pressure", 4e12)]
FluidCompliance = Annotated[float, Signal("m**3/Pa", "compliance", 1e-15)]
FlowResistance = Annotated[float, Signal("Pa*s/m**3", "flow resistance", 4e9)]
ReflectedInertia = Annotated[float, Signal("kg*m**2/rad**2", "inertia", 3e-5)]
ContactCompliance = Annotated[float, Signal("m/N", "compliance", 1e-8)]
Overlap = Annotated[float, Signal("m", "overlap", 1e-4)]


@cache
def signals_of(tuple_type: type[NamedTuple]) -> dict[str, Signal]:
    """Return the signals of a NamedTuple class, in the order of its fields.

    Every field must be annotated ``Annotated[float, Signal(...)]``.
    """
    hints = typing.get_type_hints(tuple_type, include_extras=True)
    signals: dict[str, Signal] = {}
    for name in tuple_type._fields:
        signal = signal_in(hints[name])
        if signal is None:
            raise ModelError(
                f"{place_of(tuple_type)}: {tuple_type.__qualname__}.{name} has no Signal annotation"
                f': write {name}: Annotated[float, Signal("m", "what it is")]'
            )
        signals[name] = signal
    return signals


def signal_in(annotation: Any) -> Signal | None:
    """Return the Signal of an annotation, with the bounds that stand behind it; None for none."""
    signal = next((n for n in _notes(annotation) if isinstance(n, Signal)), None)
    if signal is None:
        return None
    low, high = _ends(annotation)
    ends = max(low, signal.low), min(high, signal.high)
    if ends == (signal.low, signal.high):
        return signal
    return replace(signal, low=ends[0], high=ends[1])


@cache
def ranges_of(tuple_type: type[NamedTuple]) -> dict[str, tuple[float, float]]:
    """Return the ranges that are declared beside a Signal, both ends included.

    Controllers and runs take nothing beyond them.
    ``Annotated[float, Signal(...), Ge(0), Le(1)]`` declares one. What a unit alone says, such as
    that no gauge pressure is below the vacuum, is not part of it.
    """
    hints = typing.get_type_hints(tuple_type, include_extras=True)
    ends = {name: _ends(hint) for name, hint in hints.items()}
    return {name: each for name, each in ends.items() if each != (-math.inf, math.inf)}


def _notes(annotation: Any) -> tuple[Any, ...]:
    return getattr(annotation, "__metadata__", ())


def _ends(annotation: Any) -> tuple[float, float]:
    """Return the bounds that stand in an annotation, both included."""
    low, high = -math.inf, math.inf
    for note in _notes(annotation):
        if isinstance(note, Ge):
            low = max(low, _number(note.ge))
        elif isinstance(note, Gt):
            low = max(low, math.nextafter(_number(note.gt), math.inf))
        elif isinstance(note, Le):
            high = min(high, _number(note.le))
        elif isinstance(note, Lt):
            high = min(high, math.nextafter(_number(note.lt), -math.inf))
    return low, high


@cache
def limits_of(tuple_type: type[NamedTuple]) -> dict[str, Limited]:
    """Return what limits the commands among the signals of a NamedTuple class."""
    hints = typing.get_type_hints(tuple_type, include_extras=True)
    return {
        name: note
        for name, hint in hints.items()
        for note in getattr(hint, "__metadata__", ())
        if isinstance(note, Limited)
    }


def _number(end: Any) -> float:
    return float(end)


def without_noise(stimuli: Iterable[str]) -> list[str]:
    """Return the names of stimuli that can be driven: all but the noise, which is drawn.

    Examples
    --------
    >>> without_noise(["p_set", "noise_p"])
    ['p_set']
    """
    return [name for name in stimuli if not name.startswith(_NOISE)]


def places_of(model: Any) -> dict[str, type[NamedTuple]]:
    """Return the signal tuples of a model by what they are in it."""
    return {
        "recording": model.Output,
        "state": model.State,
        "memory": model.Memory,
        "stimulus": model.Stimulus,
        "integral": model.Flow,
    }


def merged_signals(
    tuples: Iterable[tuple[str, type[NamedTuple]]],
) -> list[tuple[str, Signal, tuple[str, ...]]]:
    """Return one row per name, unit and label, with all places where such a signal stands.

    Parameters
    ----------
    tuples
        Places and signal tuples, as of :func:`places_of`.
    """
    places: dict[tuple[str, Signal], list[str]] = {}
    for place, each in tuples:
        for name, signal in signals_of(each).items():
            where = places.setdefault((name, Signal(signal.unit, signal.label)), [])
            if place not in where:
                where.append(place)
    return [(name, signal, tuple(where)) for (name, signal), where in places.items()]


def joined(module: str, name: str, *tuples: type[Any]) -> Any:
    """Return a signal tuple with the fields of several, which that module keeps under the name.

    For one memory of several controllers.

    Raises
    ------
    ModelError
        When two of them have a field of one name.
    """
    fields: list[tuple[str, Any]] = []
    for each in tuples:
        hints = typing.get_type_hints(each, include_extras=True)
        for field in each._fields:
            if field in dict(fields):
                raise ModelError(
                    f"{place_of(each)}: {each.__qualname__}.{field}: another tuple that is joined "
                    "to this one has such a field too; rename one"
                )
            fields.append((field, hints[field]))
    make: Callable[..., Any] = NamedTuple
    merged = make(name, fields)
    merged.__module__ = module
    return merged


@checked
def zeros(tuple_type: type[T]) -> T:
    """Return a signal tuple whose every field is 0.0."""
    return tuple_type(*(0.0 for _ in tuple_type._fields))  # type: ignore[attr-defined,arg-type]
