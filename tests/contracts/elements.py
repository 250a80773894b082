"""Find every element and read the meaning of its functions off their annotations."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import typing
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from annotated_types import Ge, Gt, Le, Lt

from bywire import control, plant
from bywire.brakes.wedge import elements, laws
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import Signal

PACKAGES = (plant, control, elements, laws)


@dataclass(frozen=True)
class Number:
    """What is known of one number that goes into or comes out of a function."""

    unit: str
    nominal: float
    low: float = -float("inf")
    high: float = float("inf")


def modules(packages: Iterable[ModuleType] = PACKAGES) -> list[ModuleType]:
    """Return the modules of all elements."""
    return [
        importlib.import_module(f"{package.__name__}.{found.name}")
        for package in packages
        for found in pkgutil.iter_modules(package.__path__)
    ]


def all_functions() -> dict[str, Callable[..., Any]]:
    """Return the public functions of all elements, by name as ``plant.caliper.mass``."""
    return {
        f"{label(module)}.{name}": function
        for module in modules()
        for name, function in functions(module).items()
    }


def label(module: ModuleType) -> str:
    """Return the name of an element as a test shows it."""
    return module.__name__.removeprefix("bywire.")


def functions(module: ModuleType) -> dict[str, Callable[..., Any]]:
    """Return the public functions that a module defines."""
    return {
        name: value
        for name, value in vars(module).items()
        if inspect.isfunction(value)
        and value.__module__ == module.__name__
        and not name.startswith("_")
    }


def parameter_classes(module: ModuleType) -> list[type[ParameterSet]]:
    """Return the parameter sets that a module defines."""
    return [
        value
        for value in vars(module).values()
        if is_parameters(value) and value.__module__ == module.__name__
    ]


def annotations(function: Callable[..., Any]) -> tuple[dict[str, Any], Any]:
    """Return the annotations of the arguments, by name, and that of the result."""
    hints = typing.get_type_hints(function, include_extras=True)
    names = list(inspect.signature(function).parameters)
    missing = [name for name in (*names, "return") if name not in hints]
    if missing:
        raise TypeError(f"{function.__module__}.{function.__name__}: no type for {missing}")
    return {name: hints[name] for name in names}, hints["return"]


def merged(members: Iterable[Callable[..., Any]]) -> dict[str, Any]:
    """Return the arguments of several functions of an element: one name, one meaning."""
    found: dict[str, Any] = {}
    for function in members:
        for name, annotation in annotations(function)[0].items():
            if found.setdefault(name, annotation) != annotation:
                raise TypeError(f"{function.__module__}: argument {name} has two meanings")
    return found


def is_parameters(annotation: Any) -> bool:
    """Tell whether an annotation is a parameter set."""
    return isinstance(annotation, type) and issubclass(annotation, ParameterSet)


def is_signals(annotation: Any) -> bool:
    """Tell whether an annotation is a NamedTuple."""
    return isinstance(annotation, type) and hasattr(annotation, "_fields")


def numbers(name: str, annotation: Any) -> dict[str, Number]:
    """Return all numbers below an annotation, by dotted name; tables under the name of the table.

    Raises
    ------
    TypeError
        When the annotation does not say the unit of all of its numbers.
    """
    if is_parameters(annotation):
        leaves = leaf_fields(annotation, f"{name}.")
        return {k: Number(v.unit.symbol, v.unit.nominal, v.low, v.high) for k, v in leaves.items()}
    if is_signals(annotation):
        hints = typing.get_type_hints(annotation, include_extras=True)
        parts = {f"{name}.{field}": hints[field] for field in annotation._fields}
    elif typing.get_origin(annotation) is tuple:
        parts = {f"{name}.{k}": part for k, part in enumerate(typing.get_args(annotation))}
    else:
        return {name: _signal(name, annotation)}
    return {k: v for part in parts for k, v in numbers(part, parts[part]).items()}


def _signal(name: str, annotation: Any) -> Number:
    notes = getattr(annotation, "__metadata__", ())
    signal = next((note for note in notes if isinstance(note, Signal)), None)
    if signal is None:
        raise TypeError(f"{name}: {annotation} says no unit: Annotated[float, Signal(...)] does")
    bounds: dict[str, Any] = {}
    for note in notes:
        if isinstance(note, (Gt, Ge)):
            bounds["low"] = note.gt if isinstance(note, Gt) else note.ge
        elif isinstance(note, (Lt, Le)):
            bounds["high"] = note.lt if isinstance(note, Lt) else note.le
    return Number(signal.unit, signal.nominal, **bounds)


def flat(value: Any) -> list[Any]:
    """Return the numbers of a result, in the order of :func:`numbers`."""
    return [n for part in value for n in flat(part)] if isinstance(value, tuple) else [value]
