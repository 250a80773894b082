"""Signals that the class of an assembly declares: wires, integrals, and what is only recorded."""

from __future__ import annotations

from typing import Any, Self, overload

from bywire.core.errors import ModelError
from bywire.core.signals import Role, Signal
from bywire.core.wired import instant_of, line


class _Named:
    """A signal that the class of an assembly declares."""

    name: str
    where: str

    def __init__(
        self, unit: str, label: str, nominal: float = 1.0, role: Role | None = None
    ) -> None:
        self.signal = Signal(unit, label, nominal, role=role)

    def __set_name__(self, owner: type, name: str) -> None:
        self.name, self.where = name, f"{owner.__name__}.{name}"


class Wire(_Named):
    """A signal between parts that ``wire`` sets once; it can be recorded."""

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: Any, owner: type) -> float: ...
    def __get__(self, instance: Any, owner: type) -> Any:
        """Return the wire, or of an assembly at an instant its value."""
        if instance is None:
            return self
        wires = instant_of(instance, self.where).wires
        if self.name not in wires:
            raise ModelError(
                f"{self.where} is read before it is set: assign w.{self.name} = ... in wire, "
                "above that"
            )
        return wires[self.name]

    def __set__(self, instance: Any, value: float) -> None:
        instant = instant_of(instance, self.where)
        if self.name in instant.wires:
            raise ModelError(f"{self.where}: {line()} sets it a second time: set a wire once")
        instant.wires[self.name] = instant.marked(self.name, value)
        instant.note(self.name)


class Integral(_Named):
    """What is integrated along with the states; ``power`` returns its rate."""


class Shown(_Named):
    """What is recorded and is no state, wire or integral; ``record`` returns it."""
