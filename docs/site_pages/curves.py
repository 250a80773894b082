"""Characteristic figure of an element, evaluated from the element's own functions.

A `Curve` evaluates a function over one of its arguments. A `Course` integrates the element's states
for a given motion or signal. Arguments are named like ``u.p_a`` (a field of the input), ``x.z``,
``par.mu``, or ``T`` (a number). Parameters come from the first parameter set that contains the
element, and the declaration may replace some of them.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import sys
import typing
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from bywire.core.catalog import PARAMETER_SETS, CitedSet
from bywire.core.parameters import ParameterSet, field_notes, leaf_fields
from bywire.core.quantities import BY_SIZE, display_unit
from bywire.core.signals import Signal, signal_in, signals_of
from bywire.core.typing import Array
from bywire.core.units import convert
from bywire.report import style
from bywire.report.wording import amount

EXAMPLES = Path(__file__).parents[2] / "examples"
_HEIGHT = 2.9  # inch
_STEPS = 700  # of a course
_TIME = Signal("s", "time")
_RATES = {"m**3/s": "ml/s"}  # as volumes are shown in ml
_KINDS = {"x": "State", "u": "Input", "f": "Forces", "par": "Parameters"}

Values = Mapping[str, Any]
Lines = tuple[str, tuple[Any, ...]]


@dataclass(frozen=True)
class Curve:
    """A function over one of its arguments.

    Parameters
    ----------
    of
        Function, or ``function.field`` if it returns several values.
    over
        Argument on the abscissa.
    span
        First and last value of this argument [SI].
    at
        Values of other arguments. Inputs, states and forces are 0 by default.
    lines
        Argument and values, one line each.
    """

    of: str
    over: str
    span: tuple[float, float]
    at: Values = field(default_factory=dict)
    lines: Lines | None = None


@dataclass(frozen=True)
class Course:
    """States of an element over time.

    Parameters
    ----------
    of
        What is shown: a state ``x.p``, or a function as in a `Curve`.
    duration
        Time [s].
    at
        Values of arguments, which may be functions of time; ``x.p`` sets the start of a state.
    over
        Argument whose integral, or state, is on the abscissa. Default: time.
    lines
        Argument and values, one line each.
    """

    of: str
    duration: float
    at: Values = field(default_factory=dict)
    over: str = ""
    lines: Lines | None = None


Declared = Curve | Course


@dataclass(frozen=True)
class Line:
    """Values of a line, with the label in its legend."""

    x: Array
    y: Array
    label: str


def lines_of(element: ModuleType, declared: Declared, values: Values) -> list[Line]:
    """Return the lines of an element's figure.

    ``values``: its parameters by name, for an element that no parameter set contains.
    """
    name, steps = declared.lines or ("", (None,))
    shown = []
    for step in steps:
        at = {**declared.at, **({name: step} if name else {})}
        label = _label(element, declared, name, step, values) if name else ""
        shown.append(Line(*_samples(element, declared, at, values), label))
    return shown


def _samples(
    element: ModuleType, declared: Declared, at: Values, values: Values
) -> tuple[Array, Array]:
    if isinstance(declared, Course):
        return _course(element, declared, at, values)
    place = declared.over
    count = 81 if place.partition(".")[0] in ("par", "fluid") else 401
    x = np.linspace(*declared.span, count)
    y = [_evaluated(element, declared.of, {**at, place: float(each)}, values) for each in x]
    return x, np.array(y)


def _evaluated(element: ModuleType, of: str, at: Values, values: Values, x: Any = None) -> float:
    name, _, result = of.partition(".")
    value = _called(getattr(element, name), at, values, x)
    return float(getattr(value, result) if result else value)


def _called(function: Callable[..., Any], at: Values, values: Values, x: Any = None) -> Any:
    """Return the result of an element's function; ``x``: its state, if known."""
    hints = _hints(function)
    return function(
        **{
            name: x if name == "x" and x is not None else _argument(name, hints[name], at, values)
            for name in inspect.signature(function).parameters
        }
    )


@cache
def _hints(function: Callable[..., Any]) -> dict[str, Any]:
    return typing.get_type_hints(function, include_extras=True)


def _argument(name: str, hint: Any, at: Values, values: Values) -> Any:
    inside = {
        key.removeprefix(f"{name}."): value
        for key, value in at.items()
        if key.startswith(f"{name}.")
    }
    if isinstance(hint, type) and issubclass(hint, ParameterSet):
        return parameters(
            hint, tuple(inside.items()), tuple(values.items()) if name == "par" else ()
        )
    if isinstance(hint, type) and issubclass(hint, tuple):
        fields = hint._fields  # type: ignore[attr-defined]
        return hint(**{each: inside.get(each, 0.0) for each in fields})
    return at[name]


@cache
def parameters(
    kind: type[ParameterSet],
    changes: tuple[tuple[str, Any], ...],
    values: tuple[tuple[str, Any], ...],
) -> ParameterSet:
    """Return parameters of a class: from values by name or the first set, with changes."""
    base = kind.create(dict(values)) if values else examples()[kind][0]
    return base.replace(dict(changes)) if changes else base


Groups = dict[type[ParameterSet], tuple[ParameterSet, str]]


@cache
def examples() -> Groups:
    """Return the first parameters of each class, and the set of bywire or an example with them."""
    groups: Groups = {}
    for cited in (*PARAMETER_SETS.all().values(), *_sets_of_examples()):
        _gather(cited.parameters(), cited.name, groups)
    return groups


def _gather(par: ParameterSet, name: str, groups: Groups) -> None:
    for _, value in par:
        if isinstance(value, ParameterSet):
            groups.setdefault(type(value), (value, name))
            _gather(value, name, groups)


def _sets_of_examples() -> Iterator[CitedSet]:
    """Yield the parameter sets of the examples, without loading their brakes."""
    sys.path.insert(0, str(EXAMPLES))
    try:
        for file in sorted(EXAMPLES.glob("*/sets")):
            package = importlib.import_module(f"{file.parent.name}.sets")
            for each in pkgutil.iter_modules(package.__path__):
                module = importlib.import_module(f"{package.__name__}.{each.name}")
                for value in vars(module).values():
                    known = value if isinstance(value, tuple | list) else (value,)
                    yield from (each for each in known if isinstance(each, CitedSet))
    finally:
        sys.path.remove(str(EXAMPLES))


# --- An element alone over time


def _course(element: ModuleType, course: Course, at: Values, values: Values) -> tuple[Array, Array]:
    """Return abscissa and ordinate of a course, by the midpoint rule."""
    h = course.duration / _STEPS
    t = np.linspace(0.0, course.duration, _STEPS + 1)
    kind = element.State
    x = np.array([at.get(f"x.{name}", 0.0) for name in kind._fields])
    over, place = [], 0.0
    y = np.empty(_STEPS + 1)
    for k, now in enumerate(t):
        given = _at_time(at, now)
        known = dict(zip(kind._fields, x, strict=True))
        head, _, name = course.of.partition(".")
        state = kind(*x)
        y[k] = known[name] if head == "x" else _evaluated(element, course.of, given, values, state)
        over.append(known[course.over[2:]] if course.over.startswith("x.") else place)
        if k < _STEPS:
            half = _at_time(at, now + 0.5 * h)
            middle = x + 0.5 * h * _slope(element, kind(*x), given, values)
            x = x + h * _slope(element, kind(*middle), half, values)
            x = _within(element, x, half, values)
            place += h * half.get(course.over, 0.0)
    return (np.array(over) if course.over else t), y


def _at_time(at: Values, t: float) -> dict[str, Any]:
    return {name: float(v(t)) if callable(v) else v for name, v in at.items()}


def _slope(element: ModuleType, x: Any, at: Values, values: Values) -> Array:
    """Return the derivatives of the states."""
    if hasattr(element, "rate"):
        return _row(_called(element.rate, at, values, x))
    force = _row(_called(element.balance, at, values, x))
    return force / _row(_called(element.mass, at, values, x))


def _within(element: ModuleType, x: Array, at: Values, values: Values) -> Array:
    """Return stop operators within their width."""
    if not hasattr(element, "slip_width"):
        return x
    width = _row(_called(element.slip_width, at, values))
    return np.clip(x, -width, width)


def _row(value: Any) -> Array:
    return np.array(value if isinstance(value, tuple) else (value,), dtype=float)


# --- Labels, and the figure


def _signal(element: ModuleType, of: str) -> Signal:
    """Return unit and label of a function's result."""
    name, _, result = of.partition(".")
    if name == "x":
        return signals_of(element.State)[result]
    hint = _hints(getattr(element, name))["return"]
    found = signals_of(hint)[result] if result else signal_in(hint)
    assert found is not None, of
    return found


def _argument_signal(element: ModuleType, declared: Declared, place: str) -> Signal:
    """Return unit and label of an argument."""
    head, _, name = place.partition(".")
    function = getattr(element, declared.of.partition(".")[0], None)
    hints = _hints(function) if function else {}
    kind = hints.get(head) or getattr(element, _KINDS[head])
    if not name:
        found = signal_in(kind)
        assert found is not None, place
        return found
    if not issubclass(kind, ParameterSet):
        return signals_of(kind)[name]
    return Signal(leaf_fields(kind)[name].unit.symbol, field_notes(kind)[name])


def _label(element: ModuleType, declared: Declared, name: str, value: Any, values: Values) -> str:
    short = name.rpartition(".")[2]
    if isinstance(value, str):
        return f"{short} = {value}"
    signal = _argument_signal(element, declared, name)
    return f"{short} = {amount(value, signal.unit, 3)}"


def abscissa(element: ModuleType, declared: Declared) -> Signal:
    """Return unit and label of the abscissa."""
    if isinstance(declared, Curve) or declared.over.startswith("x."):
        return _argument_signal(element, declared, declared.over)
    if not declared.over:
        return _TIME
    rate = _argument_signal(element, declared, declared.over)
    return Signal(rate.unit.removesuffix("/s"), f"integral of the {rate.label}")


def caption(element: ModuleType, declared: Declared, values: Values) -> str:
    """Return what a figure shows, as reStructuredText."""
    over = declared.over or "time"
    fixed = []
    for name, value in declared.at.items():
        if callable(value) or (declared.lines and name == declared.lines[0]):
            continue
        if isinstance(value, str):
            fixed.append(f"``{name}`` = {value}")
        else:
            unit = _argument_signal(element, declared, name).unit
            fixed.append(f"``{name}`` = {amount(value, unit, 3)}")
    given = f", with {', '.join(fixed)}" if fixed else ""
    kind = getattr(element, "Parameters", None)
    source = " Parameters: chosen for this figure." if values or kind not in examples() else ""
    if kind is not None and not source:
        source = f" Parameters: ``{examples()[kind][1]}``."
    return f"``{declared.of}`` versus ``{over}``{given}.{source}"


def _unit_for(symbol: str, largest: float) -> str:
    """Return the unit of an axis for the largest magnitude on it."""
    if symbol not in BY_SIZE:
        return _RATES.get(symbol, display_unit(symbol))
    return [unit for least, unit in BY_SIZE[symbol] if largest >= least][-1]


def draw(element: ModuleType, declared: Declared, values: Values, file: Path) -> None:
    """Draw an element's figure into a file."""
    figure, (axes,) = style.new_figure(_HEIGHT)
    over, shown = abscissa(element, declared), _signal(element, declared.of)
    drawn = lines_of(element, declared, values)
    units = [
        _unit_for(signal.unit, max(np.abs(each).max() for each in sides))
        for signal, sides in zip(
            (over, shown), zip(*((d.x, d.y) for d in drawn), strict=True), strict=True
        )
    ]
    for k, line in enumerate(drawn):
        x, y = convert(line.x, over.unit, units[0]), convert(line.y, shown.unit, units[1])
        axes.plot(x, y, color=style.SEQUENCE[k], linewidth=1.4, label=style.plain(line.label))
    axes.set_xlabel(style.unit_label(over.label, units[0]))
    axes.set_ylabel(style.unit_label(shown.label, units[1]))
    if declared.lines:
        style.legend_above(axes)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, metadata={"Date": None})
