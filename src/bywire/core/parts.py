"""Parts of an assembly: elements by their modules, typed by what these define."""

from __future__ import annotations

import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, Generic, Protocol, Self, TypedDict, TypeVar, Unpack, overload

from bywire.core.errors import ModelError, unknown_name
from bywire.core.signals import Signal, signal_in, signals_of
from bywire.core.wires import F, Instant, Integral, P, Port, Shown, U, Wire, Wired, X, instant_of

__all__ = ["OPTIONS", "Integral", "Part", "PartOptions", "Port", "Shown", "Wire"]

X_co = TypeVar("X_co", covariant=True)
U_co = TypeVar("U_co", covariant=True)
F_co = TypeVar("F_co", covariant=True)
P_co = TypeVar("P_co", covariant=True)


class _Store(Protocol[X_co, U_co, P_co]):
    """A module of an element with states and inputs."""

    @property
    def State(self) -> Callable[..., X_co]: ...
    @property
    def Input(self) -> Callable[..., U_co]: ...
    @property
    def Parameters(self) -> Callable[..., P_co]: ...


class _Contact(Protocol[U_co, F_co, P_co]):
    """A module of an element with contact forces."""

    @property
    def Input(self) -> Callable[..., U_co]: ...
    @property
    def Forces(self) -> Callable[..., F_co]: ...
    @property
    def Parameters(self) -> Callable[..., P_co]: ...


class _Passive(Protocol[U_co, P_co]):
    """A module of an element with inputs."""

    @property
    def Input(self) -> Callable[..., U_co]: ...
    @property
    def Parameters(self) -> Callable[..., P_co]: ...


class _Plain(Protocol[P_co]):
    """A module of an element with parameters."""

    @property
    def Parameters(self) -> Callable[..., P_co]: ...


class PartOptions(TypedDict, total=False):
    """What may be said of a part beside its element.

    Parameters
    ----------
    par
        Where its parameters stand in those of the assembly; its own name by default.
    suffix
        Put behind the names of its states, for the second of a kind: ``"_2"``.
    state
        Names of its states in the assembly, where they are others.
    labels
        Labels of its states, where they are others.
    fixed
        States that enter the element's own equations value-only: periodic terms, slow geometry.
    output
        Its outputs and contact forces that are signals of the assembly, by their names there; or
        the names alone, where they are the same.
    loss
        Name of the energy that its ``power_loss`` adds up to; or names, by function of the element.
        Of a contact: what its work exceeds its stored energy by.
    work
        Of a contact: name of the energy that its ``power_in`` adds up to.
    rarely
        Of a contact: whether it rarely touches, as end stops do. Speed only.
    outside
        Whether what it stores stands in no book: it lies beyond the border of the balance.
    """

    par: str
    suffix: str
    state: Mapping[str, str]
    labels: Mapping[str, str]
    fixed: Iterable[str]
    output: Mapping[str, str] | Iterable[str]
    loss: str | Mapping[str, str]
    work: str
    rarely: bool
    outside: bool


OPTIONS = tuple(PartOptions.__annotations__)


def parameters_at(path: str, par: Any, where: str, declaration: str) -> Any:
    """Return the parameters at a dotted path of those of an assembly.

    ``where``: whose they are; ``declaration``: how one says where they stand.

    Raises
    ------
    ModelError
        When there are none.
    """
    value = par
    for name in path.split("."):
        value = getattr(value, name, None)
    if value is None:
        raise ModelError(
            f"{where}: the parameters have no {path!r}: say where they stand, {declaration}"
        )
    return value


class Part(Generic[X, U, F, P]):
    """An element of an assembly.

    Parameters
    ----------
    element
        Its module: State, Input, Output, Parameters and functions of them, by their usual names.
    options
        See `PartOptions`.
    """

    name: str
    where: str

    @overload
    def __init__(
        self: Part[X, U, None, P], element: _Store[X, U, P], **options: Unpack[PartOptions]
    ) -> None: ...
    @overload
    def __init__(
        self: Part[None, U, F, P], element: _Contact[U, F, P], **options: Unpack[PartOptions]
    ) -> None: ...
    @overload
    def __init__(
        self: Part[None, U, None, P], element: _Passive[U, P], **options: Unpack[PartOptions]
    ) -> None: ...
    @overload
    def __init__(
        self: Part[None, None, None, P], element: _Plain[P], **options: Unpack[PartOptions]
    ) -> None: ...
    def __init__(self, element: Any, **options: Unpack[PartOptions]) -> None:
        self.element = element
        self.path, self.suffix = options.get("par", ""), options.get("suffix", "")
        self.renamed, self.labels = options.get("state", {}), options.get("labels", {})
        self.fixed, output = tuple(options.get("fixed", ())), options.get("output", ())
        self.output = dict(output) if isinstance(output, Mapping) else {k: k for k in output}
        loss = options.get("loss", {})
        self.losses = {loss: "power_loss"} if isinstance(loss, str) else dict(loss)
        self.work, self.rarely = options.get("work", ""), options.get("rarely", False)
        self.outside = options.get("outside", False)
        self.kind = str(getattr(element, "__name__", type(element).__name__)).rpartition(".")[2]
        unknown = set(options) - set(OPTIONS)
        if unknown:
            name = min(unknown)
            raise ModelError(f"Part({self.kind}): {unknown_name('option', name, OPTIONS)}")

    def __set_name__(self, owner: type, name: str) -> None:
        self.name, self.where = name, f"{owner.__name__}.{name}"
        self.path = self.path or name

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: Any, owner: type) -> Wired[X, U, F, P]: ...
    def __get__(self, instance: Any, owner: type) -> Any:
        """Return the part, or of an assembly at an instant what its equations see of it."""
        if instance is None:
            return self
        instant = instant_of(instance, self.where)
        if self.name not in instant.parts:
            instant.parts[self.name] = Wired(self, instant)
        return instant.parts[self.name]

    def __set__(self, instance: Any, value: Any) -> None:
        raise ModelError(f"{self.where} is a part: assign its input, w.{self.name}.u")

    def has(self, function: str) -> bool:
        """Tell whether the element defines a function."""
        return hasattr(self.element, function)

    def function(self, name: str) -> Callable[..., Any]:
        """Return a function of the element.

        Raises
        ------
        ModelError
            When it has none of that name.
        """
        value = getattr(self.element, name, None)
        if not callable(value):
            raise ModelError(f"{self.where}: {self.kind} has no function {name}: define it there")
        return typing.cast(Callable[..., Any], value)

    def states(self) -> dict[str, Signal]:
        """Return its states by their names in the assembly."""
        if not self.has("State"):
            return {}
        signals = signals_of(self.element.State)
        for name in (*self.renamed, *self.labels, *self.fixed):
            if name not in signals:
                raise ModelError(f"{self.where}: {unknown_name('state', name, signals)}")
        number = self.suffix.replace("_", " ")
        return {
            self.state_name(name): replace(s, label=self.labels.get(name, s.label) + number)
            for name, s in signals.items()
        }

    def state_name(self, name: str) -> str:
        """Return the name in the assembly of one of its states."""
        return self.renamed.get(name, name) + self.suffix

    def outputs(self) -> dict[str, Signal]:
        """Return its outputs and contact forces that the assembly records, by their names there."""
        known: dict[str, Signal] = {}
        for kind in ("Output", "Forces"):
            if self.has(kind):
                known |= signals_of(getattr(self.element, kind))
        for name in self.output:
            if name not in known:
                raise ModelError(f"{self.where}: {unknown_name('output', name, known)}")
        number = self.suffix.replace("_", " ")
        return {
            there: replace(known[name], label=known[name].label + number)
            for name, there in self.output.items()
        }

    def output_value(self, name: str, wired: Wired[Any, Any, Any, Any]) -> Any:
        """Return one of its outputs or contact forces at an instant."""
        if self.has("Forces") and name in self.element.Forces._fields:
            return getattr(wired.f, name)
        return getattr(wired.call(self.function("output")), name)

    @cached_property
    def energies(self) -> dict[str, Signal]:
        """Return the energies that its powers add up to, by name."""
        if self.work:
            return {self.work: self._energy("power_in", self.work)}
        if self.has("Forces"):
            return {}
        return {name: self._energy(function, name) for name, function in self.losses.items()}

    @cached_property
    def kept(self) -> dict[str, Signal]:
        """Return the loss of a contact, which follows from its work and what it stores."""
        if not self.has("Forces"):
            return {}
        return {name: self._energy(function, name) for name, function in self.losses.items()}

    def _energy(self, function: str, name: str) -> Signal:
        """Return the integral of a power, with the label and the role that the element gives it."""
        hints = typing.get_type_hints(self.function(function), include_extras=True)
        power = signal_in(hints.get("return"))
        if power is None:
            raise ModelError(
                f"{self.where}: {self.kind}.{function} says no unit: annotate its result with "
                "Annotated[float, Signal('W', label)]"
            )
        return Signal("J", power.label, role=power.role)

    def group_sizes(self, par: Any) -> tuple[int, ...]:
        """Return how many forces each of its contact groups has, 0 where a choice leaves them out.

        Those of an element with ``exists(par)`` are there only where that says so.
        """
        if not self.has("Forces"):
            return ()
        count = len(self.element.Forces._fields)
        sizes = (count,) if self.has("matrix") else (1,) * count
        there = not self.has("exists") or self.element.exists(self.parameters(par))
        return sizes if there else (0,) * len(sizes)

    def parameters(self, par: Any) -> Any:
        """Return its parameters, of those of the assembly.

        Raises
        ------
        ModelError
            When there are none where it looks for them.
        """
        return parameters_at(self.path, par, self.where, f"Part({self.kind}, par='...')")

    def state_at(self, instant: Instant, fixed: tuple[str, ...] | None) -> Any:
        """Return its state; ``fixed`` are those taken value-only, None for all."""
        if not self.has("State"):
            raise ModelError(f"{self.where}: {self.kind} has no state")
        state_class: type[Any] = self.element.State
        return state_class._make(
            getattr(instant.xe if fixed is None or k in fixed else instant.x, self.state_name(k))
            for k in state_class._fields
        )

    def forces_at(self, instant: Instant, par: Any) -> Any:
        """Return its contact forces, as its element bends them if it does."""
        if not self.has("Forces"):
            raise ModelError(f"{self.where}: {self.kind} has no contact forces")
        forces = self.element.Forces(*instant.contact[self.name])
        return self.element.bent(forces, par) if self.has("bent") else forces
