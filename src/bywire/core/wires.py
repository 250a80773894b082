"""Wires: signals that an assembly declares, and the values of its equations at an instant."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Generic, Self, TypeVar, overload

from bywire.core.errors import ModelError, unknown_name
from bywire.core.signals import Role, Signal

X = TypeVar("X")
U = TypeVar("U")
F = TypeVar("F")
P = TypeVar("P")


class Wired(Generic[X, U, F, P]):
    """Part at an instant, with its state, input, contact forces and parameters.

    Parameters
    ----------
    part
        The declared part.
    instant
        Instant of the evaluation.
    model
        Class of the assembly.
    """

    def __init__(self, part: Any, instant: Instant, model: Any) -> None:
        self._part, self._instant, self._model = part, instant, model
        self._input: Any = None
        self._varied: Any = None

    @property
    def x(self) -> X:
        """State."""
        return self._part.state_at(self._instant, ())  # type: ignore[no-any-return]

    @property
    def xe(self) -> X:
        """State as a value only; see `bywire.core.model`."""
        return self._part.state_at(self._instant, None)  # type: ignore[no-any-return]

    @property
    def par(self) -> P:
        """Parameters."""
        if self._varied is not None:
            return self._varied  # type: ignore[no-any-return]
        return self._part.parameters(self._instant.par)  # type: ignore[no-any-return]

    def vary(self, **values: Any) -> None:
        """Set parameters of the part that depend on the state, to their values at this instant.

        Call this method in ``wire`` before any read of the parameters. The values may depend on
        value-only states (``xe``). ``mass`` and ``matrix`` still use the original values.

        Raises
        ------
        ModelError
            When the element does not have the parameter.
        """
        given: Any = self.par
        for name in values:
            if name not in type(given).model_fields:
                error = unknown_name("parameter", name, dict(given))
                raise error.at(f"{self._part.where}: {line()} vary", ModelError)
        # Do not validate, because the values may be symbols.
        self._varied = type(given).model_construct(**{**dict(given), **values})

    @property
    def f(self) -> F:
        """Contact forces."""
        return self._part.forces_at(self._instant, self.par)  # type: ignore[no-any-return]

    @property
    def slip(self) -> X:
        """Slip speeds of its stop operators; in ``power`` and ``record``."""
        return self._part.slip_at(self._instant, self._model)  # type: ignore[no-any-return]

    @property
    def u(self) -> U:
        """Wired input."""
        if self._input is None:
            self._instant.settle()
        if self._input is None:
            raise ModelError(
                f"{self._part.where}: the equations read its input before it is wired. Assign "
                f"w.{self._part.name}.u = {self._part.kind}.Input(...) earlier in wire",
                name=self._part.where,
                valid=f"w.{self._part.name}.u = {self._part.kind}.Input(...)",
            )
        return self._input  # type: ignore[no-any-return]

    @u.setter
    def u(self, value: U) -> None:
        expected = getattr(self._part.element, "Input", None)
        if expected is None or not isinstance(value, expected):
            valid = "no input" if expected is None else f"a {self._part.kind}.Input"
            actual = f"{type(value).__module__}.{type(value).__name__}"
            raise ModelError(
                f"{self._part.where}: {line()} assigns a {actual} as input, but the part accepts "
                f"{valid}",
                name=self._part.where,
                value=actual,
                valid=valid,
            )
        if self._input is not None:
            raise ModelError(
                f"{self._part.where}: {line()} assigns its input a second time. Wire it once",
                name=self._part.where,
            )
        self._input = self._instant.marked(f"{self._part.name}.u", value)
        self._instant.note(f"{self._part.name}.u")

    def call(self, function: Callable[..., Any], **more: Any) -> Any:
        """Call an element's function with the arguments that its signature names."""
        return function(
            *(
                more[name] if name in more else self._argument(name, function)
                for name in arguments(function)
            )
        )

    def felt(self, function: Callable[..., Any]) -> dict[str, Any]:
        """Return the arguments of an element's function by name, without parameters."""
        expected = [name for name in arguments(function) if name in ("x", "xe", "u", "f")]
        return {name: self._argument(name, function) for name in expected}

    def _argument(self, name: str, function: Callable[..., Any]) -> Any:
        if name == "x":
            return self._part.state_at(self._instant, self._part.fixed)
        if name in ("xe", "u", "f", "slip", "par"):
            return getattr(self, name)
        if name in self._instant.shared:
            return getattr(self._instant.par, name)
        valid = "x, u, f, slip, par"
        raise ModelError(
            f"{self._part.where}: {self._part.kind}.{function.__name__} has an argument {name!r}, "
            f"which is not available. Use {valid}, or a group that the assembly lists in shared "
            f"({', '.join(self._instant.shared) or 'currently none'})",
            name=f"{self._part.kind}.{function.__name__}",
            value=name,
            valid=valid,
        )


@dataclass
class Instant:
    """Values of a model's evaluation at an instant.

    Parameters
    ----------
    x, xe
        State, and the same state as a value only.
    shared
        Parameter groups that elements receive as arguments by name.
    contact
        Contact forces by part and by subassembly.
    lines
        File and line of each assignment of a wire or input, if requested.
    mark
        ``mark(name, value)``: replacement for each assigned wire and input, which traces
        connections.
    held
        Subassemblies at the same instant.
    forces
        Contact forces in the order of the protocol; None if unknown.
    wiring
        Function that wires the assembly once, at the first read; None afterward.
    is_held
        Whether another assembly contains this assembly and sets its ports.
    ports
        Values of ports that are not set. Default: 0.
    """

    x: Any
    xe: Any
    memory: Any
    par: Any
    shared: tuple[str, ...]
    contact: Mapping[str, Any] = field(default_factory=dict)
    reaction: tuple[float, ...] = ()
    rate: Any = None
    flow: Any = None
    wires: dict[str, Any] = field(default_factory=dict)
    parts: dict[str, Wired[Any, Any, Any, Any]] = field(default_factory=dict)
    lines: dict[str, str] | None = None
    mark: Callable[[str, Any], Any] | None = None
    held: dict[str, Any] = field(default_factory=dict)
    forces: tuple[float, ...] | None = None
    wiring: Callable[[], None] | None = None
    is_held: bool = False
    ports: Mapping[str, Any] = field(default_factory=dict)

    def settle(self) -> None:
        """Wire the assembly unless it is wired or being wired."""
        wiring, self.wiring = self.wiring, None
        if wiring is not None:
            wiring()

    def marked(self, name: str, value: Any) -> Any:
        """Return the value of a wire or an input with its mark, if any."""
        return value if self.mark is None else self.mark(name, value)

    def note(self, name: str) -> None:
        """Store the line that sets a signal."""
        if self.lines is not None:
            self.lines[name] = line()


def instant_of(instance: Any, where: str) -> Instant:
    """Return the instant at which an assembly is evaluated.

    Raises
    ------
    ModelError
        When the assembly is not evaluated, because parts have values only at an instant.
    """
    instant = vars(instance).get("_instant")
    if instant is None:
        raise ModelError(
            f"{where} has no value here. In wire, power or record, read it from w. Elsewhere, read "
            "it from model.at(state, memory, par)",
            name=where,
            valid="model.at(state, memory, par)",
        )
    return typing.cast(Instant, instant)


@cache
def arguments(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return the names of a function's arguments."""
    return tuple(inspect.signature(function).parameters)


def line() -> str:
    """Return file and line of the current equation, the first frame outside this package."""
    frame = inspect.currentframe()
    while frame is not None and frame.f_globals.get("__package__") == __package__:
        frame = frame.f_back
    return f"{frame.f_code.co_filename}, line {frame.f_lineno}," if frame else ""


# --- Declarations of an assembly: wires, integrals, and recorded signals


class _Named:
    """Signal that the class of an assembly declares."""

    name: str
    where: str

    def __init__(
        self, unit: str, label: str, nominal: float = 1.0, role: Role | None = None
    ) -> None:
        self.signal = Signal(unit, label, nominal, role=role)

    def __set_name__(self, owner: type, name: str) -> None:
        self.name, self.where = name, f"{owner.__name__}.{name}"


class Wire(_Named):
    """Signal between parts, which ``wire`` sets once and which can be recorded."""

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: Any, owner: type) -> float: ...
    def __get__(self, instance: Any, owner: type) -> Any:
        """Return the wire; for an assembly at an instant, its value."""
        if instance is None:
            return self
        instant = instant_of(instance, self.where)
        wires = instant.wires
        if self.name not in wires:
            instant.settle()
        if self.name not in wires:
            self.unset(instant)
        return wires[self.name]

    def unset(self, instant: Instant) -> None:
        """Raise the error for a read before the assignment."""
        raise ModelError(
            f"{self.where} is read before it is set. Assign w.{self.name} = ... in wire before "
            "that",
            name=self.where,
            valid=f"w.{self.name} = ...",
        )

    def __set__(self, instance: Any, value: float) -> None:
        instant = instant_of(instance, self.where)
        if self.name in instant.wires:
            raise ModelError(
                f"{self.where}: {line()} sets this wire a second time. Set a wire only once",
                name=self.where,
            )
        instant.wires[self.name] = instant.marked(self.name, value)
        instant.note(self.name)


class Port(Wire):
    """Wire that an assembly's holder sets; without a holder, 0 or the value from ``wire``.

    The holder sets it with ``w.brake.PORT = ...`` before any read of the assembly's wires.
    """

    def unset(self, instant: Instant) -> None:
        """Use the default if there is no holder; raise the error if there is one."""
        if instant.is_held:
            raise ModelError(
                f"the equations read {self.where} before the holder sets it. Assign "
                f"w.NAME.{self.name} = ... in the holder's wire before any read of wires or inputs "
                "of w.NAME",
                name=self.where,
                valid=f"w.NAME.{self.name} = ...",
            )
        instant.wires[self.name] = instant.marked(self.name, instant.ports.get(self.name, 0.0))


class Integral(_Named):
    """Quantity that is integrated along with the states; ``power`` returns its rate."""


class Shown(_Named):
    """Recorded signal that is not a state, wire or integral; ``record`` returns it."""
