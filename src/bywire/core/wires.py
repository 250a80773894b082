"""Signals that the class of an assembly declares: wires, integrals, and what is only recorded."""

from __future__ import annotations

from typing import Any, Self, overload

from bywire.core.errors import ModelError
from bywire.core.signals import Role, Signal
from bywire.core.wired import Instant, instant_of, line


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
        instant = instant_of(instance, self.where)
        wires = instant.wires
        if self.name not in wires:
            instant.settle()
        if self.name not in wires:
            self.unset(instant)
        return wires[self.name]

    def unset(self, instant: Instant) -> None:
        """Refuse to be read before it is set."""
        raise ModelError(
            f"{self.where} is read before it is set: assign w.{self.name} = ... in wire, above that"
        )

    def __set__(self, instance: Any, value: float) -> None:
        instant = instant_of(instance, self.where)
        if self.name in instant.wires:
            raise ModelError(f"{self.where}: {line()} sets it a second time: set a wire once")
        instant.wires[self.name] = instant.marked(self.name, value)
        instant.note(self.name)


class Port(Wire):
    """A wire by which an assembly feels what holds it; where nothing does, 0 or what ``wire`` sets.

    The holder sets it, ``w.brake.PORT = ...``, above what it reads of that assembly's wires.
    """

    def unset(self, instant: Instant) -> None:
        """Take what an assembly feels that nothing holds; refuse where something does."""
        if instant.is_held:
            raise ModelError(
                f"{self.where} is read before the holder sets it: assign w.NAME.{self.name} = ... "
                "in its wire, above what reads wires or inputs of w.NAME"
            )
        instant.wires[self.name] = instant.marked(self.name, instant.ports.get(self.name, 0.0))


class Integral(_Named):
    """What is integrated along with the states; ``power`` returns its rate."""


class Shown(_Named):
    """What is recorded and is no state, wire or integral; ``record`` returns it."""
