"""Elements and control laws, and the meaning of their annotated functions."""

from __future__ import annotations

import inspect
import sys
import typing
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from bywire.core.brake import Brake
from bywire.core.model import ASSEMBLIES
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.registry import Kind
from bywire.core.signals import signal_in


@dataclass(frozen=True)
class Number:
    """Description of a number among a function's arguments or results."""

    unit: str
    nominal: float
    low: float = -float("inf")
    high: float = float("inf")


@dataclass(frozen=True)
class Element:
    """File of equations: a physical element or a control law.

    Parameters
    ----------
    name
        Dotted name of the module, for example ``"plant.dc_motor"``.
    module
        Module with functions, ``Parameters`` and signal tuples.
    """

    name: str
    module: ModuleType

    @property
    def summary(self) -> str:
        """First line of the file's docstring."""
        return (self.module.__doc__ or "").strip().partition("\n")[0]

    @property
    def functions(self) -> dict[str, Callable[..., Any]]:
        """Public functions of the element."""
        return functions(self.module)


def _declared(module: ModuleType) -> Iterator[Element]:
    """Yield the element of a module; packages and files of whole brakes contain no element."""
    if not hasattr(module, "__path__") and not hasattr(module, "BRAKE") and functions(module):
        yield Element(module.__name__.removeprefix("bywire."), module)


ELEMENTS = Kind("element", ("elements",), _declared, "bywire.plant")
"""every physical element: general elements, and the brakes' elements"""
LAWS = Kind("control law", ("laws",), _declared, "bywire.control")
"""every control law: general laws, and the brakes' laws"""


def every_element() -> dict[str, Element]:
    """Return all elements and control laws by name."""
    return {**ELEMENTS.all(), **LAWS.all()}


def elements_by_name() -> dict[str, Element]:
    """Return all elements and control laws by every valid name, including unique last parts."""
    every = every_element()
    ends = [name.rpartition(".")[2] for name in every]
    short = {name.rpartition(".")[2]: element for name, element in every.items()}
    return {name: each for name, each in short.items() if ends.count(name) == 1} | every


def elements_of(brake: Brake) -> dict[str, Element]:
    """Return the elements and laws in a brake's package or imported by its modules."""
    ASSEMBLIES.of(brake.module)  # loads its models and the modules that they use
    known = every_element()
    bring = {**ELEMENTS.of(brake.module), **LAWS.of(brake.module)}
    files = {each.module.__name__: name for name, each in known.items()}
    waiting = [m for name, m in list(sys.modules.items()) if _belongs(name, brake.module)]
    used: set[str] = set()
    while waiting:
        for value in list(vars(waiting.pop()).values()):
            home = value.__name__ if isinstance(value, ModuleType) else _home(value)
            if home in files and home not in used:
                used.add(home)
                waiting.append(known[files[home]].module)
    return bring | {files[home]: known[files[home]] for home in sorted(used)}


def _belongs(module: str, package: str) -> bool:
    return module == package or module.startswith(f"{package}.")


def _home(value: Any) -> str:
    home = getattr(value, "__module__", "")
    return home if isinstance(home, str) else ""


def functions(module: ModuleType) -> dict[str, Callable[..., Any]]:
    """Return the public functions that a module defines."""
    return {
        name: value
        for name, value in vars(module).items()
        if inspect.isfunction(value)
        and value.__module__ == module.__name__
        and not name.startswith("_")
        and name not in ("watch", "exists")  # one reads recordings, the other reads choices
    }


def parameter_classes(module: ModuleType) -> list[type[ParameterSet]]:
    """Return the parameter sets that a module defines."""
    return [
        value
        for value in vars(module).values()
        if is_parameters(value) and value.__module__ == module.__name__
    ]


def signature_of(function: Callable[..., Any]) -> tuple[dict[str, Any], Any]:
    """Return the annotations of the arguments by name, and the annotation of the result."""
    hints = typing.get_type_hints(function, include_extras=True)
    names = list(inspect.signature(function).parameters)
    missing = [name for name in (*names, "return") if name not in hints]
    if missing:
        raise TypeError(f"{function.__module__}.{function.__name__} does not annotate {missing}")
    return {name: hints[name] for name in names}, hints["return"]


def merged(members: Iterable[Callable[..., Any]]) -> dict[str, Any]:
    """Return the arguments of an element's functions; a name must mean the same in all of them."""
    known: dict[str, Any] = {}
    for function in members:
        for name, annotation in signature_of(function)[0].items():
            if known.setdefault(name, annotation) != annotation:
                raise TypeError(f"{function.__module__}: argument {name} has two annotations")
    return known


def is_parameters(annotation: Any) -> bool:
    """Return whether an annotation is a parameter set."""
    return isinstance(annotation, type) and issubclass(annotation, ParameterSet)


def is_signals(annotation: Any) -> bool:
    """Return whether an annotation is a NamedTuple."""
    return isinstance(annotation, type) and hasattr(annotation, "_fields")


def numbers(name: str, annotation: Any) -> dict[str, Number]:
    """Return all numbers in an annotation by dotted name; a table is treated as one number.

    Raises
    ------
    TypeError
        When the annotation does not declare the units of all numbers.
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
    signal = signal_in(annotation)
    if signal is None:
        raise TypeError(f"{name}: {annotation} has no unit. Use Annotated[float, Signal(...)]")
    return Number(signal.unit, signal.nominal, signal.low, signal.high)


def flat(value: Any) -> list[Any]:
    """Return the numbers of a result, in the order of :func:`numbers`."""
    return [n for part in value for n in flat(part)] if isinstance(value, tuple) else [value]
