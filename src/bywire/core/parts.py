"""Parts of an assembly: elements, which are modules, and subassemblies."""

from __future__ import annotations

import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, Generic, Protocol, Self, TypedDict, TypeVar, Unpack, overload

from bywire.core.errors import ModelError, unknown_name
from bywire.core.model import Task
from bywire.core.signals import Role, Signal, signal_in, signals_of
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
    """Options of a part.

    Parameters
    ----------
    par
        Place of the part's parameters among the assembly's parameters. Default: the part's name.
    suffix
        Suffix of the state names, for a second part of the same kind, such as ``"_2"``.
    which
        Words for this part in labels, such as ``"front"``. Default: the suffix. An energy of this
        part alone also has them in the energy balance.
    state
        Names of the states in the assembly, if they differ from the element's names.
    labels
        Labels of states and outputs, if they differ from the element's labels.
    fixed
        States that enter the element's own equations as values only, for periodic terms and slowly
        varying geometry.
    output
        Outputs and contact forces that become signals of the assembly, by their names there. A
        tuple of names is sufficient if the names are the same.
    loss
        Name of the energy that is the integral of ``power_loss``, or names by function of the
        element. For a contact, the loss is its work minus its stored energy.
    work
        For a contact, the name of the energy that is the integral of ``power_in``.
    rarely
        For a contact, whether it rarely touches, like an end stop. This affects only speed.
    outside
        Whether the energy balance excludes the part's stored energy.
    """

    par: str
    suffix: str
    which: str
    state: Mapping[str, str]
    labels: Mapping[str, str]
    fixed: Iterable[str]
    output: Mapping[str, str] | Iterable[str]
    loss: str | Mapping[str, str]
    work: str
    rarely: bool
    outside: bool


OPTIONS = tuple(PartOptions.__annotations__)


def _parameters_at(path: str, par: Any, where: str, declaration: str) -> Any:
    """Return the group of an assembly's parameters at a dotted path.

    ``where``: the group's owner; ``declaration``: how to declare the path.

    Raises
    ------
    ModelError
        When there is no such group.
    """
    value = par
    for name in path.split("."):
        value = getattr(value, name, None)
    if value is None:
        raise ModelError(
            f"{where}: the parameters have no group {path!r}. Specify it with {declaration}",
            name=where,
            value=path,
        )
    return value


class Part(Generic[X, U, F, P]):
    """An element of an assembly.

    Parameters
    ----------
    element
        Module of the element, which contains State, Input, Output, Parameters and functions with
        their usual names.
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
        self.which = options.get("which", "")
        self.ending = f", {self.which}" if self.which else self.suffix.replace("_", " ")
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
            raise unknown_name("option", name, OPTIONS).at(f"Part({self.kind})", ModelError)

    def __set_name__(self, owner: type, name: str) -> None:
        self.name, self.where = name, f"{owner.__name__}.{name}"
        self.path = self.path or name

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: Any, owner: type) -> Wired[X, U, F, P]: ...
    def __get__(self, instance: Any, owner: type) -> Any:
        """Return the part; for an assembly at an instant, its values in the equations."""
        if instance is None:
            return self
        instant = instant_of(instance, self.where)
        if self.name not in instant.parts:
            instant.parts[self.name] = Wired(self, instant, type(instance))
        return instant.parts[self.name]

    def __set__(self, instance: Any, value: Any) -> None:
        valid = f"w.{self.name}.u"
        raise ModelError(
            f"{self.where} is a part. Assign its input, {valid}", name=self.where, valid=valid
        )

    def has(self, function: str) -> bool:
        """Return whether the element defines a function."""
        return hasattr(self.element, function)

    def function(self, name: str) -> Callable[..., Any]:
        """Return a function of the element.

        Raises
        ------
        ModelError
            When the element has no function with this name.
        """
        value = getattr(self.element, name, None)
        if not callable(value):
            raise ModelError(
                f"{self.where}: {self.kind} has no function {name}. Define it in the element",
                name=name,
            )
        return typing.cast(Callable[..., Any], value)

    def states(self) -> dict[str, Signal]:
        """Return the part's states by their names in the assembly."""
        if not self.has("State"):
            return {}
        signals = signals_of(self.element.State)
        labels = [name for name in self.labels if name not in self.output]
        for name in (*self.renamed, *labels, *self.fixed):
            if name not in signals:
                raise unknown_name("state", name, signals).at(self.where, ModelError)
        return {
            self.state_name(name): replace(s, label=self.labels.get(name, s.label) + self.ending)
            for name, s in signals.items()
        }

    def state_name(self, name: str) -> str:
        """Return a state's name in the assembly."""
        return self.renamed.get(name, name) + self.suffix

    def outputs(self) -> dict[str, Signal]:
        """Return the recorded outputs and contact forces, by their names in the assembly."""
        known: dict[str, Signal] = {}
        for kind in ("Output", "Forces"):
            if self.has(kind):
                known |= signals_of(getattr(self.element, kind))
        for name in self.output:
            if name not in known:
                raise unknown_name("output", name, known).at(self.where, ModelError)
        return {
            there: replace(
                known[name], label=self.labels.get(name, known[name].label) + self.ending
            )
            for name, there in self.output.items()
        }

    def output_value(self, name: str, wired: Wired[Any, Any, Any, Any]) -> Any:
        """Return one of the part's outputs or contact forces at an instant."""
        if self.has("Forces") and name in self.element.Forces._fields:
            return getattr(wired.f, name)
        return getattr(wired.call(self.function("output")), name)

    @cached_property
    def energies(self) -> dict[str, Signal]:
        """Return the integrals of the part's powers, by name."""
        if self.work:
            return {self.work: self._energy("power_in", self.work)}
        if self.has("Forces"):
            return {}
        return {name: self._energy(function, name) for name, function in self.losses.items()}

    @cached_property
    def kept(self) -> dict[str, Signal]:
        """Return a contact's loss, which follows from its work and its stored energy."""
        if not self.has("Forces"):
            return {}
        return {name: self._energy(function, name) for name, function in self.losses.items()}

    def _energy(self, function: str, name: str) -> Signal:
        """Return the integral of a power, with the element's label and role."""
        hints = typing.get_type_hints(self.function(function), include_extras=True)
        power = signal_in(hints.get("return"))
        if power is None:
            raise ModelError(
                f"{self.where}: {self.kind}.{function} has no unit. Annotate its result with "
                "Annotated[float, Signal('W', label)]",
                name=f"{self.kind}.{function}",
                valid="Annotated[float, Signal('W', label)]",
            )
        return Signal("J", power.label, role=power.role)

    def told_apart(self, energy: Signal) -> Signal:
        """Return an energy of this part alone, with the part's words in its labels."""
        if not self.which:
            return energy
        role = energy.role
        if role is not None and role.label:
            role = replace(role, label=f"{role.label}, {self.which}")
        return replace(energy, label=f"{energy.label}, {self.which}", role=role)

    def group_sizes(self, par: Any) -> tuple[int, ...]:
        """Return the number of forces in each contact group; 0 if a choice omits the group.

        If an element defines ``exists(par)``, its groups exist only if that function returns true.
        """
        if not self.has("Forces"):
            return ()
        count = len(self.element.Forces._fields)
        sizes = (count,) if self.has("matrix") else (1,) * count
        there = not self.has("exists") or self.element.exists(self.parameters(par))
        return sizes if there else (0,) * len(sizes)

    def parameters(self, par: Any) -> Any:
        """Return the part's group of the assembly's parameters.

        Raises
        ------
        ModelError
            When there is no group at this path.
        """
        return _parameters_at(self.path, par, self.where, f"Part({self.kind}, par='...')")

    def state_at(self, instant: Instant, fixed: tuple[str, ...] | None) -> Any:
        """Return the part's state; ``fixed`` lists the value-only states (None: all states)."""
        if not self.has("State"):
            raise ModelError(f"{self.where}: {self.kind} has no state", name=self.where)
        state_class: type[Any] = self.element.State
        return state_class._make(
            getattr(instant.xe if fixed is None or k in fixed else instant.x, self.state_name(k))
            for k in state_class._fields
        )

    def slip_at(self, instant: Instant, model: Any) -> Any:
        """Return the slip speeds of its stop operators in the class of an assembly."""
        if not self.has("slip_width"):
            raise ModelError(
                f"{self.where}: {self.kind} has no slip, because it does not define slip_width",
                name=self.where,
                valid="slip_width",
            )
        if not instant.reaction:
            raise ModelError(
                f"{self.where}: slip has no value here. Read it only in functions for losses and "
                "recorded signals",
                name=self.where,
            )
        first = len(instant.reaction) - len(model.stops)
        state_class: type[Any] = self.element.State
        return state_class._make(
            -instant.reaction[first + model.stops.index(self.state_name(k))]
            for k in state_class._fields
        )

    def forces_at(self, instant: Instant, par: Any) -> Any:
        """Return the part's contact forces, which the element may modify."""
        if not self.has("Forces"):
            raise ModelError(f"{self.where}: {self.kind} has no contact forces", name=self.where)
        forces = self.element.Forces(*instant.contact[self.name])
        return self.element.bent(forces, par) if self.has("bent") else forces


# --- Subassemblies: their names have a prefix in the holder but not in their own equations
# A subassembly is evaluated with slices of its holder's state, memory and forces. Its parameters
# are a group of the holder's parameters, so a holder can contain the same assembly twice.


class Seen:
    """Recording of a subassembly by its own names.

    Parameters
    ----------
    recording
        Recording of the holder: an xarray.Dataset, or a similar object.
    names
        Names in the recording, by the subassembly's own names.
    place
        Prefix of the subassembly's parts in the names of silent parts.
    """

    def __init__(self, recording: Any, names: Mapping[str, str], place: str) -> None:
        self._recording = recording
        self._names = {own: there for own, there in names.items() if there in recording}
        every: Iterable[str] = getattr(recording, "silent", ())
        self.silent = frozenset(
            name.removeprefix(place) for name in every if name.startswith(place)
        )

    def __contains__(self, name: str) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __getitem__(self, name: str) -> Any:
        return self._recording[self._names.get(name, name)]

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the renamed Dataset, which is created on first use."""
        if name.startswith("_"):
            raise AttributeError(name)
        there = self._recording[list(self._names.values())]
        return getattr(there.rename({there: own for own, there in self._names.items()}), name)


A = TypeVar("A")
KINDS = ("State", "Memory", "Flow", "Output", "Stimulus")
"""signal tuples of an assembly that its holder includes"""
_HEADS = ("E_", "W_", "t_", "noise_")  # kinds of signals, which come before the prefix


class Sub(Generic[A]):
    """Subassembly, which is an assembly within another assembly, including its tasks.

    Parameters
    ----------
    assembly
        Class of the assembly, or a function that builds it with options, such as
        ``partial(Rig, side=2)``.
    prefix
        Prefix of its signals and tasks. With ``"rear_"``, ``i`` becomes ``rear_i``. Kinds of
        signals come first: ``E_rear_copper``, ``noise_rear_p``.
    par
        Place of its parameters among the holder's parameters. Default: the attribute's name.
    label
        Name in labels, energy balances and warnings. Default: the prefix in words.
    feeds
        Source of each field of its stimulus: a field of the holder's memory or stimulus. Fields
        without a source become fields of the holder's stimulus.

    Raises
    ------
    ModelError
        When the class is not an assembly, for an invalid prefix, and for unknown fields.
    """

    name: str
    where: str

    def __init__(
        self,
        assembly: Callable[[], A],
        *,
        prefix: str,
        par: str = "",
        label: str = "",
        feeds: Mapping[str, str] | None = None,
    ) -> None:
        made: Any = assembly if isinstance(assembly, type) else assembly()
        kind: Any = made if isinstance(made, type) else type(made)
        self.path, self.prefix = par, prefix
        self.label = label or prefix.replace("_", " ").strip()
        self.feeds = dict(feeds or {})
        if not hasattr(kind, "parts"):
            raise ModelError(
                f"Sub({kind.__name__}): {kind.__name__} is not an assembly with a memory. Use a "
                "class that inherits from Assembly and declares Memory",
                name=f"Sub({kind.__name__})",
                valid="a class that inherits from Assembly and declares Memory",
            )
        if not f"{prefix}x".isidentifier() or prefix.startswith("_"):
            raise ModelError(
                f"Sub({kind.__name__}): the prefix {prefix!r} is not valid. Use a word and an "
                "underscore, such as 'rear_'",
                name="prefix",
                value=prefix,
                valid="a word and an underscore, such as 'rear_'",
            )
        for name in self.feeds:
            if name not in kind.Stimulus._fields:
                error = unknown_name("stimulus", name, kind.Stimulus._fields)
                raise error.at(f"Sub({kind.__name__}): feeds", ModelError)
        self.assembly: Any = kind() if made is kind else made

    def __set_name__(self, owner: type, name: str) -> None:
        self.name, self.where = name, f"{owner.__name__}.{name}"
        self.path = self.path or name

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: Any, owner: type) -> A: ...
    def __get__(self, instance: Any, owner: type) -> Any:
        """Return the declaration or, for a holder at an instant, the assembly at that instant."""
        if instance is None:
            return self
        instant = instant_of(instance, self.where)
        if self.name not in instant.held:
            instant.held[self.name] = self._at(instant, type(instance))
        return instant.held[self.name]

    def __set__(self, instance: Any, value: Any) -> None:
        valid = f"w.{self.name}.PORT = ..."
        raise ModelError(
            f"{self.where} is an assembly. Set its ports, {valid}", name=self.where, valid=valid
        )

    def _at(self, instant: Instant, holder: Any) -> Any:
        """Return the assembly at the holder's instant before it is wired."""
        reaction = instant.reaction
        places = holder.reaction_places[self.name] if reaction else ()
        x = self.inside("State", instant.x)
        return self.assembly.held_at(
            x,
            self.inside("Memory", instant.memory),
            self.parameters(instant.par),
            instant.contact[self.name],
            xe=x if instant.xe is instant.x else self.inside("State", instant.xe),
            rate=self.inside("State", instant.rate),
            flow=self.inside("Flow", instant.flow),
            reaction=tuple(reaction[k] for k in places),
            lines=None if instant.lines is None else {},
            mark=None if instant.mark is None else partial(self._marked, instant.mark),
        )

    def _marked(self, mark: Callable[[str, Any], Any], name: str, value: Any) -> Any:
        return mark(f"{self.name}/{name}", value)

    # Names.

    def named(self, name: str) -> str:
        """Return the holder's name for a signal or a task."""
        head = next((each for each in _HEADS if name.startswith(each)), "")
        return f"{head}{self.prefix}{name.removeprefix(head)}"

    def signals(self, kind: str) -> dict[str, Signal]:
        """Return the signals of one of `KINDS` by their names in the holder."""
        every = signals_of(getattr(type(self.assembly), kind))
        if kind == "Stimulus":
            every = {name: each for name, each in every.items() if name not in self.feeds}
        return {self.named(name): self._signal(name, each) for name, each in every.items()}

    @property
    def records(self) -> tuple[str, ...]:
        """Recorded signals, by their names in the holder."""
        return tuple(map(self.named, type(self.assembly).Output._fields))

    def _signal(self, name: str, signal: Signal) -> Signal:
        role = self._role(name, signal)
        if role is not None:
            whole, rest = (self.named(each) if each else "" for each in (role.whole, role.rest))
            book = f"{self.label}: {role.book}" if role.book else self.label
            role = replace(role, book=book, whole=whole, rest=rest)
        target = signal.set_point_of
        return replace(
            signal,
            label=f"{self.label}: {signal.label}",
            role=role,
            set_point_of=self.named(target) if target else "",
        )

    def _role(self, name: str, signal: Signal) -> Role | None:
        """Return the role of a signal, which is derived from its name if balances use names."""
        if signal.role is not None or not name.startswith("E_"):
            return signal.role
        others = signals_of(type(self.assembly).Output).values()
        if name == "E_source":
            is_said = any(each.role and each.role.side == "source" for each in others)
            return None if is_said else Role("source", "source")
        return Role("sink", signal.label)

    # Tuples of the subassembly and of the holder.

    @cached_property
    def _places(self) -> dict[str, tuple[str, ...]]:
        kinds = {kind: getattr(type(self.assembly), kind)._fields for kind in KINDS}
        return {kind: tuple(map(self.named, names)) for kind, names in kinds.items()}

    def inside(self, kind: str, values: Any) -> Any:
        """Return the subassembly's tuple of one of `KINDS`, from the holder's tuple or None."""
        if values is None:
            return None
        tuple_type = getattr(type(self.assembly), kind)
        return tuple_type._make(getattr(values, name) for name in self._places[kind])

    def outside(self, kind: str, values: Any) -> dict[str, Any]:
        """Return the subassembly's values of one of `KINDS` by their names in the holder."""
        return dict(zip(self._places[kind], values, strict=True))

    def parameters(self, par: Any) -> Any:
        """Return the subassembly's group of the holder's parameters.

        Raises
        ------
        ModelError
            When there is no group at this path.
        """
        declaration = f"Sub({type(self.assembly).__name__}, par='...')"
        return _parameters_at(self.path, par, self.where, declaration)

    # Tasks.

    def tasks(self, par: Any) -> Iterator[Task]:
        """Yield the tasks as tasks of the holder; ``par``: the holder's parameters."""
        for task in self.assembly.tasks(self.parameters(par)):
            yield Task(self.named(task.name), task.period, partial(self._tick, task.tick))

    def _tick(self, tick: Callable[..., Any], x: Any, m: Any, u: Any, par: Any) -> Any:
        after = tick(
            self.inside("State", x),
            self.inside("Memory", m),
            self._stimulus(m, u),
            self.parameters(par),
        )
        return m._replace(**self.outside("Memory", after))

    def _stimulus(self, m: Any, u: Any) -> Any:
        kind = type(self.assembly).Stimulus
        given: list[Any] = []
        for name in kind._fields:
            source = self.feeds.get(name, self.named(name))
            given.append(getattr(m if name in self.feeds and source in m._fields else u, source))
        return kind._make(given)

    # Recordings.

    def seen(self, recording: Any) -> Seen:
        """Return a recording, or some of its rows, by the assembly's own names."""
        names = dict(zip(type(self.assembly).Output._fields, self.records, strict=True))
        return Seen(recording, names, f"{self.name}.")
