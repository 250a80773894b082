"""Signals: unit, label and role of each field in State, Input, Output and Memory tuples."""

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
_NOISE = "noise_"  # prefix of noise stimuli


@dataclass(frozen=True)
class Role:
    """Role of an energy in a run's energy balance.

    Parameters
    ----------
    side
        ``"source"`` of energy, or ``"sink"`` (losses and stores). A time at standstill has
        ``"standstill"``.
    returns
        For a sink, the energy that it may return. A loss returns no energy, and bywire warns if it
        does. ``"taken"``: at most the absorbed energy, like a spring that is initially slack.
        ``"any"``: like a store that is initially full, or air that may be warmer.
    label
        Name in the balance.
    split
        For a sink, whether the balance lists its energy during standstill separately, as holding.
    whole
        For a source, the source that it replaces if it is recorded.
    rest, rest_label
        Sink that absorbs the difference between the two sources, and its label.
    book
        Name of the separate balance that contains the energy; empty for the actuator's balance.
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
    """Meaning of a field in a signal tuple.

    Parameters
    ----------
    unit
        SI unit; ``"1"`` for a pure number.
    label
        Axis label in figures.
    nominal
        Usual magnitude in this unit.
    set_point_of
        Name of the signal for which this is the set point, for figures; may be empty.
    role
        Role of an energy in the energy balance, or of a power whose integral is an energy.
    low, high
        Bounds of the valid range, in the signal's unit. For example, a gauge pressure cannot be
        below vacuum, and an opening cannot be negative. `bywire.check` uses only values inside the
        range. ``Ge(0)`` after an annotation's Signal has the same effect.
    """

    unit: str
    label: str
    nominal: float = 1.0
    set_point_of: str = ""
    role: Role | None = None
    low: float = -math.inf
    high: float = math.inf

    def within(self, value: float) -> float:
        """Clip a value to the range."""
        return min(max(value, self.low), self.high)


@dataclass(frozen=True)
class Limited:
    """Limit of a command, next to the Signal of a memory field.

    Parameters
    ----------
    by
        Dotted name of the parameter that the command's magnitude never exceeds, or name of the
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

    Each field must have the annotation ``Annotated[float, Signal(...)]``.
    """
    hints = typing.get_type_hints(tuple_type, include_extras=True)
    signals: dict[str, Signal] = {}
    for name in tuple_type._fields:
        signal = signal_in(hints[name])
        if signal is None:
            raise ModelError(
                f"{place_of(tuple_type)}: {tuple_type.__qualname__}.{name} has no Signal annotation"
                f'. Write {name}: Annotated[float, Signal("m", "what it is")]',
                name=f"{tuple_type.__qualname__}.{name}",
                valid='Annotated[float, Signal("m", "what it is")]',
            )
        signals[name] = signal
    return signals


def signal_in(annotation: Any) -> Signal | None:
    """Return an annotation's Signal with the bounds that follow it, or None."""
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
    """Return the ranges that are declared next to Signals; the bounds are valid.

    Controllers and runs reject values outside these ranges.
    ``Annotated[float, Signal(...), Ge(0), Le(1)]`` declares a range. The result does not contain
    bounds that follow from the unit alone, such as vacuum for a gauge pressure.
    """
    hints = typing.get_type_hints(tuple_type, include_extras=True)
    ends = {name: _ends(hint) for name, hint in hints.items()}
    return {name: each for name, each in ends.items() if each != (-math.inf, math.inf)}


def _notes(annotation: Any) -> tuple[Any, ...]:
    return getattr(annotation, "__metadata__", ())


def _ends(annotation: Any) -> tuple[float, float]:
    """Return the bounds in an annotation, which are both valid."""
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
    """Return the limits of those signals of a NamedTuple class that are commands."""
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
    """Return the names of the stimuli that a user can drive, which are all except random noise.

    Examples
    --------
    >>> without_noise(["p_set", "noise_p"])
    ['p_set']
    """
    return [name for name in stimuli if not name.startswith(_NOISE)]


def places_of(model: Any) -> dict[str, type[NamedTuple]]:
    """Return a model's signal tuples by their role."""
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
    """Return one row per name, unit and label, with all places of that signal.

    Parameters
    ----------
    tuples
        Places and signal tuples, from :func:`places_of`.
    """
    places: dict[tuple[str, Signal], list[str]] = {}
    for place, each in tuples:
        for name, signal in signals_of(each).items():
            where = places.setdefault((name, Signal(signal.unit, signal.label)), [])
            if place not in where:
                where.append(place)
    return [(name, signal, tuple(where)) for (name, signal), where in places.items()]


@checked
def joined(module: str, name: str, *tuples: type[Any]) -> Any:
    """Join signal tuples into a single tuple that the module exports under this name.

    The result serves as the common memory of several controllers.

    Raises
    ------
    ModelError
        When two tuples have a field with the same name.
    """
    fields: list[tuple[str, Any]] = []
    for each in tuples:
        hints = typing.get_type_hints(each, include_extras=True)
        for field in each._fields:
            if field in dict(fields):
                raise ModelError(
                    f"{place_of(each)}: another joined tuple also has a field "
                    f"{each.__qualname__}.{field}. Rename one of them",
                    name=f"{each.__qualname__}.{field}",
                )
            fields.append((field, hints[field]))
    make: Callable[..., Any] = NamedTuple
    merged = make(name, fields)
    merged.__module__ = module
    return merged


@checked
def zeros(tuple_type: type[T]) -> T:
    """Return a signal tuple with 0.0 in every field."""
    return tuple_type(*(0.0 for _ in tuple_type._fields))  # type: ignore[attr-defined,arg-type]
