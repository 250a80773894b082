"""Models made of parts and wires, whose equations follow from their elements.

An assembly declares its elements and assigns each input once, in the order of the physics. States,
masses, balances, contacts, stored energies, simple losses and recorded signals follow from the
elements. Connections are deliberately causal, because acausal connections need index reduction,
which does not fit the diagonal mass form of ``core.model``. You can also write models in this form
without assemblies.
"""

from __future__ import annotations

import types
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from itertools import chain, islice, repeat
from typing import Annotated, Any, ClassVar, Generic, NamedTuple, Self, TypeVar, cast

from bywire.core.errors import ModelError, unknown_name
from bywire.core.model import Bounds, Matrix, Task
from bywire.core.parts import KINDS, Part, Sub
from bywire.core.signals import Role, Signal, signals_of, zeros
from bywire.core.watching import Watching
from bywire.core.wires import Instant, Integral, Port, Shown, Wire, Wired, instant_of, line

AnyPart = Part[Any, Any, Any, Any]

_STORED = Signal("J", "stored energy", role=Role("sink", "stored", returns="any"))
"""signal that each assembly can record as ``E_stored``"""
ParT = TypeVar("ParT")
MemoryT = TypeVar("MemoryT")

_NAN = float("nan")


# --- Assembly at an instant: values that its equations read, and wiring of subassemblies


class Evaluated(Generic[ParT, MemoryT]):
    """Assembly that is evaluated at an instant, on its own or within another assembly."""

    shared: ClassVar[tuple[str, ...]]
    subs: ClassVar[dict[str, Sub[Any]]]
    reaction_places: ClassVar[dict[str, tuple[int, ...]]]

    def wire(self, w: Self) -> None:
        """Set every input and every wire once, in the order of the physics."""

    # Values at an instant.

    @property
    def x(self) -> Any:
        """State that enters the implicit solve."""
        return instant_of(self, "x").x

    @property
    def xe(self) -> Any:
        """State as a value only."""
        return instant_of(self, "xe").xe

    @property
    def m(self) -> MemoryT:
        """Memory of the controllers."""
        return instant_of(self, "m").memory  # type: ignore[no-any-return]

    @property
    def par(self) -> ParT:
        """Parameters."""
        return instant_of(self, "par").par  # type: ignore[no-any-return]

    @property
    def reaction(self) -> tuple[float, ...]:
        """Forces of the assembly's frictions, then of its limits, then minus its slip speeds.

        It is available in ``power`` and ``record``.
        """
        every = instant_of(self, "reaction").reaction
        return tuple(every[k] for k in self.reaction_places[""]) if every and self.subs else every

    @property
    def rate(self) -> Any:
        """Derivative of the state; in ``power``."""
        return instant_of(self, "rate").rate

    @property
    def flow(self) -> Any:
        """Integrals since the start; in ``record``."""
        return instant_of(self, "flow").flow

    def at(
        self,
        state: Any,
        memory: MemoryT,
        par: ParT,
        contact: tuple[float, ...] | None = None,
        **more: Any,
    ) -> Self:
        """Return the wired assembly at an instant, with values in all its parts.

        Parameters
        ----------
        contact
            Contact forces. Default: unknown.
        more
            Other fields of `Instant`, such as ``xe`` if it differs from the state.
        """
        here = vars(self).get("_instant")
        if here is not None and here.is_held:
            return self._as_held(here, state)
        w = self._unwired(state, memory, par, contact, **more)
        self.wire(w)
        _settled(w)
        return w

    def _as_held(self, here: Instant, state: Any) -> Self:
        """Return the wired assembly at its holder's instant."""
        if state is not here.x:
            raise ModelError(
                f"{type(self).__name__} is evaluated at a state that is not its holder's state. "
                "Within an assembly, its equations are valid only for the holder's current state",
                name=type(self).__name__,
            )
        here.settle()
        return self

    def held_at(
        self, x: Any, memory: Any, par: Any, contact: tuple[float, ...] | None, **more: Any
    ) -> Self:
        """Return the assembly at its holder's instant; the first read wires it."""
        w = self._unwired(x, memory, par, contact, is_held=True, **more)

        def wire() -> None:
            w.wire(w)
            _settled(w)

        instant_of(w, "wire").wiring = wire
        return w

    def _unwired(
        self, x: Any, memory: Any, par: Any, contact: tuple[float, ...] | None, **more: Any
    ) -> Self:
        each: dict[str, Any] = {}
        left = iter(contact) if contact is not None else repeat(_NAN)
        for part in _contacts(type(self)):
            count = sum(part.group_sizes(par))
            unknown = (_NAN,) * len(part.element.Forces._fields)  # if a choice omits them
            each[part.name] = tuple(islice(left, count)) or unknown
        for name, sub in self.subs.items():
            count = contact_count(sub.assembly, sub.parameters(par))
            each[name] = tuple(islice(left, count)) if contact is not None else None
        fields = {"x": x, "xe": x, "memory": memory, "par": par, "shared": self.shared}
        fields |= {"contact": each, "forces": contact}
        w: Self = object.__new__(_at_an_instant(cast(Any, type(self))))
        vars(w).update(vars(self) | {"_instant": Instant(**fields | more)})
        return w


@cache
def _at_an_instant(cls: type[Any]) -> type[Any]:
    """Return the class of an assembly at an instant, whose only settable attributes are wires."""
    kinds = (Part, Wire, Integral, Shown, Sub)
    every = {k: v for base in cls.__mro__ for k, v in vars(base).items()}
    known = frozenset(name for name, value in every.items() if isinstance(value, kinds))

    def refuse(self: Any, name: str) -> Any:
        there = known | {n for n, v in vars(Evaluated).items() if isinstance(v, property)}
        error = unknown_name("part or wire", name, there)
        raise error.at(f"{cls.__name__}: {line().rstrip(',')}", ModelError)

    def assign(self: Any, name: str, value: Any) -> None:
        if name not in known:
            refuse(self, name)
        object.__setattr__(self, name, value)

    body = {"__getattr__": refuse, "__setattr__": assign, "__module__": cls.__module__}
    return types.new_class(
        cls.__name__, (cls,), {"at_an_instant": True}, lambda names: names.update(body)
    )


def _settled(w: Any) -> None:
    """Wire subassemblies that nothing has read yet, and set unset ports to their defaults."""
    cls: Any = type(w)
    for name in cls.subs:
        instant_of(getattr(w, name), name).settle()
    instant = instant_of(w, "wire")
    for port in cls.ports:
        if port.name not in instant.wires:
            port.unset(instant)


# --- Assemblies


class Assembly(Evaluated[ParT, MemoryT], Watching, Generic[ParT, MemoryT]):
    """A model made of parts; see ``docs/modeling.md``.

    A subclass declares `Part`, `Wire`, `Integral`, `Shown` and `Sub` objects, ``Memory``,
    ``Stimulus`` and ``records``. It defines ``wire``, ``tasks`` and, if needed, ``friction``,
    ``power`` and ``record``. If a mode replaces an equation, it overrides ``mass`` or
    ``balance``.
    """

    State: ClassVar[Any]
    Flow: ClassVar[Any]
    Output: ClassVar[Any]
    Memory: ClassVar[Any]
    Stimulus: ClassVar[Any]
    records: ClassVar[tuple[str, ...]] = ()
    """names of the recorded signals, in order; default: all"""
    shared: ClassVar[tuple[str, ...]] = ()
    """parameter groups that elements receive as arguments by name, such as a fluid"""
    parts: ClassVar[dict[str, AnyPart]]
    subs: ClassVar[dict[str, Sub[Any]]]
    """subassemblies"""
    ports: ClassVar[tuple[Port, ...]]
    """wires that this assembly's holder sets"""
    stops: ClassVar[tuple[str, ...]] = ()
    """states of the parts whose elements define ``slip_width``, and those of the subassemblies"""
    reaction_places: ClassVar[dict[str, tuple[int, ...]]]
    """places of each subassembly's reactions; an empty name means the assembly's own places"""

    def __init_subclass__(cls, *, at_an_instant: bool = False, **options: Any) -> None:
        """Derive signals and equations from the parts."""
        super().__init_subclass__(**options)
        holds = any(isinstance(each, Sub) for base in cls.__mro__ for each in vars(base).values())
        if not at_an_instant and (
            isinstance(cls.Memory, type) or holds
        ):  # otherwise it is an abstract base class
            _gather(cls)

    # Defined by a subclass.

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return (low, high) of each friction, like the protocol's ``bounds``."""
        return ()

    def power(self, w: Self) -> Mapping[str, float]:
        """Return the rates of the integrals that no part defines."""
        return {}

    def record(self, w: Self) -> Mapping[str, float]:
        """Return recorded signals that no part defines, and those that replace a part's signals."""
        return {}

    # Derived from the parts.

    def mass(self, xe: Any, par: ParT) -> Any:
        """Return the factors of the states' derivatives."""
        w = self.at(xe, self._nothing(), par)
        rows: list[float] = []
        for part in _stores(type(self)):
            count = len(part.element.State._fields)
            if part.has("mass"):
                rows += _row(_wired(w, part).call(part.element.mass))
            else:
                rows += (1.0,) * count
        for _, inner, here in _held(w):
            rows += inner.mass(here.xe, here.par)
        return self.State._make(rows)

    def balance(
        self, x: Any, xe: Any, memory: MemoryT, par: ParT, contact: tuple[float, ...]
    ) -> Any:
        """Return the smooth right-hand sides."""
        w = self.at(x, memory, par, contact, xe=xe)
        rows: list[float] = []
        for part in _stores(type(self)):
            name = "balance" if part.has("balance") else "rate"
            rows += _row(_wired(w, part).call(part.function(name)))
        for _, inner, here in _held(w):
            rows += inner.balance(here.x, here.xe, here.memory, here.par, here.forces)
        return self.State._make(rows)

    def bounds(
        self, x: Any, xe: Any, memory: MemoryT, par: ParT, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return the limits of the dry frictions."""
        w = self.at(x, memory, par, contact, xe=xe)
        bounds = [*self.friction(w)]
        for _, inner, here in _held(w):
            bounds += inner.bounds(here.x, here.xe, here.memory, here.par, here.forces)
        return tuple(bounds)

    def widths(
        self, x: Any, xe: Any, memory: MemoryT, par: ParT, contact: tuple[float, ...]
    ) -> tuple[float, ...]:
        """Return the widths of the stop operators."""
        if not self.stops:
            return ()
        w = self.at(x, memory, par, contact, xe=xe)
        widths: list[float] = []
        for part in _stops(type(self)):
            widths += _row(_wired(w, part).call(part.function("slip_width")))
        for _, inner, here in _held(w):
            widths += inner.widths(here.x, here.xe, here.memory, here.par, here.forces)
        return tuple(widths)

    def compliance(self, par: ParT) -> tuple[Matrix, ...]:
        """Return a compliance matrix per contact group; empty if a choice omits it."""
        state = self.State._make(_NAN for _ in self.State._fields)
        w = self._unwired(state, self._nothing(), par, None)
        groups: list[Matrix] = []
        for part in _contacts(type(self)):
            wired, sizes = _wired(w, part), part.group_sizes(par)
            if not any(sizes):
                groups += ((),) * len(sizes)
            elif part.has("matrix"):
                groups.append(wired.call(part.element.matrix))
            else:
                compliance = wired.call(part.function("compliance"))
                groups += (((compliance,),),) * len(sizes)
        for sub in self.subs.values():
            groups += sub.assembly.compliance(sub.parameters(par))
        return tuple(groups)

    def gap(self, x: Any, xe: Any, par: ParT) -> tuple[tuple[float, ...], ...]:
        """Return the damped overlaps by group."""
        w = self.at(x, self._nothing(), par, xe=xe)
        groups: list[tuple[float, ...]] = []
        for part in _contacts(type(self)):
            sizes = part.group_sizes(par)
            if not any(sizes):
                groups += ((),) * len(sizes)
                continue
            overlaps = _row(_wired(w, part).call(part.function("overlaps")))
            groups += (overlaps,) if part.has("matrix") else ((each,) for each in overlaps)
        for _, inner, here in _held(w):
            groups += inner.gap(here.x, here.xe, here.par)
        return tuple(groups)

    @property
    def usually_open(self) -> tuple[bool, ...]:
        """Whether each contact group rarely touches."""
        own = tuple(
            part.rarely
            for part in _contacts(type(self))
            for _ in range(1 if part.has("matrix") else len(part.element.Forces._fields))
        )
        return sum((sub.assembly.usually_open for sub in self.subs.values()), start=own)

    def powers(
        self,
        x: Any,
        xe: Any,
        rate: Any,
        memory: MemoryT,
        par: ParT,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
    ) -> Any:
        """Return the rates of the integrals."""
        w = self.at(x, memory, par, contact, xe=xe, rate=rate, reaction=reaction)
        values: dict[str, float] = {}
        for part in self.parts.values():
            for name in part.energies:
                function = part.function("power_in" if part.work else part.losses[name])
                value = _wired(w, part).call(function)
                values[name] = values[name] + value if name in values else value
        for sub, inner, here in _held(w):
            values |= sub.outside(
                "Flow",
                inner.powers(
                    here.x, here.xe, here.rate, here.memory, here.par, here.forces, here.reaction
                ),
            )
        values |= _known(self, "power", self.power(w), self.Flow._fields)
        return _filled(self, "power", self.Flow, values)

    def output(
        self,
        x: Any,
        memory: MemoryT,
        par: ParT,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
        flow: Any,
    ) -> Any:
        """Return the recorded signals at an instant."""
        w = self.at(x, memory, par, contact, reaction=reaction, flow=flow)
        values: dict[str, Any] = {}
        given: tuple[Any, ...] = (x, memory, flow)
        for source in given:
            values |= source._asdict()
        values |= instant_of(w, "wire").wires
        values |= dict(_part_values(w, self.Output._fields))
        if "E_stored" in self.Output._fields:
            values["E_stored"] = self.stored(w)
        for sub, inner, here in _held(w):
            values |= sub.outside(
                "Output",
                inner.output(here.x, here.memory, here.par, here.forces, here.reaction, here.flow),
            )
        values |= _known(self, "record", self.record(w), self.Output._fields)
        return _filled(self, "record", self.Output, values)

    def stored(self, w: Self) -> Any:
        """Return the energy stored in the parts at an instant [J], without contacts."""
        sums: list[Any] = []
        for wanted in (False, True):
            values = [
                _wired(w, part).call(part.element.energy)
                for part in self.parts.values()
                if part.has("energy") and not part.outside and part.has("Forces") == wanted
            ]
            if values:
                sums.append(sum(values[1:], values[0]))
        return sum(sums[1:], sums[0]) if sums else 0.0

    def tasks(self, par: ParT) -> tuple[Task, ...]:
        """Return the tasks of the subassemblies; a subclass adds its own tasks."""
        return tuple(task for sub in self.subs.values() for task in sub.tasks(par))

    def rest(self, par: ParT) -> tuple[Any, Any]:
        """Return a zero state in which the subassemblies are at rest."""
        inner = {name: sub.assembly.rest(sub.parameters(par)) for name, sub in self.subs.items()}
        return (
            self.state(**{name: state for name, (state, _) in inner.items()}),
            self.memory(**{name: memory for name, (_, memory) in inner.items()}),
        )

    @classmethod
    def state(cls, **parts: NamedTuple) -> Any:
        """Return a State from the states of parts and subassemblies, by their names.

        Missing states are zero.

        Raises
        ------
        ModelError
            When the part does not exist, or the state belongs to another element.
        """
        given = (0.0, *chain.from_iterable(parts.values()))
        kinds = tuple((name, type(each)) for name, each in parts.items())
        return cls.State._make(map(given.__getitem__, cls._sources(kinds)))

    @classmethod
    def memory(cls, own: NamedTuple | None = None, **subs: NamedTuple) -> Any:
        """Return a Memory from the assembly's own fields and the memories of subassemblies.

        Missing fields are zero.

        Raises
        ------
        ModelError
            When the subassembly does not exist.
        """
        values = {} if own is None else own._asdict()
        for name, given in subs.items():
            if name not in cls.subs:
                raise unknown_name("assembly", name, cls.subs).at(cls.__name__, ModelError)
            values |= cls.subs[name].outside("Memory", given)
        return zeros(cls.Memory)._replace(**values)

    @classmethod
    @cache  # studies start thousands of runs per second
    def _sources(cls, kinds: tuple[tuple[str, type], ...]) -> tuple[int, ...]:
        """Return the index of each State entry in the sequence of a zero and the parts' states."""
        sources, place = [0] * len(cls.State._fields), 0
        for name, kind in kinds:
            for there in cls._places(name, kind):
                sources[there] = place = place + 1
        return tuple(sources)

    @classmethod
    def _places(cls, name: str, kind: type) -> tuple[int, ...]:
        """Return the State indices of a part or a subassembly."""
        fields: tuple[str, ...] = cls.State._fields
        if name in cls.subs:
            sub = cls.subs[name]
            if not issubclass(kind, sub.assembly.State):
                raise ModelError(
                    f"{sub.where}: {kind.__name__} is not a state of {sub.label}",
                    name=sub.where,
                    value=kind.__name__,
                )
            return tuple(fields.index(each) for each in sub.signals("State"))
        part = cls.parts.get(name)
        if part is None:
            there = {**cls.parts, **cls.subs}
            raise unknown_name("part", name, there).at(cls.__name__, ModelError)
        if not part.has("State") or not issubclass(kind, part.element.State):
            raise ModelError(
                f"{part.where}: {kind.__name__} is not a state of {part.kind}",
                name=part.where,
                value=kind.__name__,
            )
        return tuple(fields.index(part.state_name(each)) for each in part.element.State._fields)

    def _nothing(self) -> Any:
        """Return a memory of NaN, for evaluations that must not depend on the memory."""
        return self.Memory._make(_NAN for _ in self.Memory._fields)


def _part_values(w: Assembly[Any, Any], wanted: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
    """Yield all parts' recorded outputs, and the contacts' losses."""
    works: dict[str, dict[str, None]] = {}  # of all contacts with this loss, each once
    stored: dict[str, Any] = {}
    for part in w.parts.values():
        for name, there in part.output.items():
            if there in wanted:
                yield there, part.output_value(name, _wired(w, part))
        for name in part.kept:
            if name in wanted:
                energy = _wired(w, part).call(part.element.energy)
                stored[name] = stored[name] + energy if name in stored else energy
                works.setdefault(name, {})[part.work] = None
    for name, energy in stored.items():
        first, *others = (getattr(w.flow, work) for work in works[name])
        yield name, sum(others, start=first) - energy


def _wired(w: Any, part: AnyPart) -> Wired[Any, Any, Any, Any]:
    value: Wired[Any, Any, Any, Any] = getattr(w, part.name)
    return value


def _row(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, tuple) else (value,)


def _held(w: Any) -> Iterator[tuple[Sub[Any], Any, Instant]]:
    """Yield each subassembly's declaration, the assembly at the instant, and its instant."""
    for name, sub in w.subs.items():
        inner = getattr(w, name)
        yield sub, inner, instant_of(inner, name)


def _known(
    model: Any, method: str, values: Mapping[str, Any], names: tuple[str, ...]
) -> dict[str, Any]:
    """Return a method's result after checking its names.

    Raises
    ------
    ModelError
        When the result has an unknown name.
    """
    for name in values:
        if name not in names:
            raise unknown_name("signal", name, names).at(
                f"{type(model).__name__}.{method}", ModelError
            )
    return dict(values)


def _filled(model: Any, method: str, kind: Any, values: Mapping[str, Any]) -> Any:
    """Return a signal tuple from a method's values and the parts' values.

    Raises
    ------
    ModelError
        When a field has no value.
    """
    for name in kind._fields:
        if name not in values:
            raise ModelError(
                f"{type(model).__name__}.{method} does not return {name!r}, and no part has it. "
                f"Add it to the return value of {method}",
                name=f"{type(model).__name__}.{method}",
                value=name,
            )
    return kind(**{name: values[name] for name in kind._fields})


# --- State, Flow and Output, from the declarations


def _gather(cls: type[Any]) -> None:
    """Derive an assembly's State, Flow and Output from its declarations."""
    declared = {k: v for base in reversed(cls.__mro__) for k, v in vars(base).items()}
    cls.parts = {k: v for k, v in declared.items() if isinstance(v, Part)}
    cls.subs = {k: v for k, v in declared.items() if isinstance(v, Sub)}
    cls.ports = tuple(v for v in declared.values() if isinstance(v, Port))
    states: dict[str, Signal] = {}
    for part in _stores(cls):
        if part.has("balance") and not part.has("mass"):
            raise ModelError(
                f"{part.where}: {part.kind} has states and a balance, but no mass. Define mass "
                "there, or rename the function to rate if it returns derivatives",
                name=part.where,
                valid="mass",
            )
        if not (part.has("balance") or part.has("rate")):
            raise ModelError(
                f"{part.where}: {part.kind} has states, but defines no balance and no rate",
                name=part.where,
                valid="balance",
            )
        if part.has("slip_width") and not part.has("rate"):
            raise ModelError(
                f"{part.where}: {part.kind} has slip_width, but no rate. Its states are stop "
                "operators, so define rate, which returns the speed of their motion",
                name=part.where,
                valid="rate",
            )
        for name, signal in part.states().items():
            if name in states:
                raise ModelError(
                    f"{part.where}: another part also has a state {name!r}. Add a suffix or "
                    "another name, Part(..., suffix='_2') or Part(..., state={...})",
                    name=part.where,
                    value=name,
                    valid="Part(..., suffix='_2') or Part(..., state={...})",
                )
            states[name] = signal
    flows: dict[str, Signal] = {}
    shown: dict[str, Signal] = {}
    owners = Counter(k for part in cls.parts.values() for k in part.energies | part.kept)
    for name, value in declared.items():
        if isinstance(value, Part):
            energies, kept = (
                {k: value.told_apart(s) if owners[k] == 1 else s for k, s in each.items()}
                for each in (value.energies, value.kept)
            )
            flows |= {k: s for k, s in energies.items() if k not in flows}
            shown |= value.outputs() | kept
        elif isinstance(value, Integral):
            flows[name] = value.signal
        elif isinstance(value, (Wire, Shown)):
            shown[name] = value.signal
    _take_over(cls, states, flows, shown)
    for kind, signals in (("State", states), ("Flow", flows)):
        if _derives(declared.get(kind)):
            setattr(cls, kind, _named_tuple(cls, kind, signals))
    for name in signals_of(cls.Memory):
        if name in states or name in flows or name in shown:
            raise ModelError(
                f"{cls.__name__}.Memory has a field {name!r}, but a part or a wire already records "
                "a signal with this name. Rename the field",
                name=f"{cls.__name__}.Memory",
                value=name,
            )
    if _derives(declared.get("Output")):
        known = signals_of(cls.State) | signals_of(cls.Memory) | signals_of(cls.Flow)
        known |= {"E_stored": _STORED} | shown
        names = cls.records or tuple(known)
        for name in names:
            if name not in known:
                error = unknown_name("signal", name, known)
                raise error.at(f"{cls.__name__}.records", ModelError)
        cls.Output = _named_tuple(cls, "Output", {name: known[name] for name in names})


def _take_over(
    cls: type[Any], states: dict[str, Signal], flows: dict[str, Signal], shown: dict[str, Signal]
) -> None:
    """Add the subassemblies' signals, frictions, limits and stops, by their names in the holder."""
    own = {kind: getattr(cls, kind, None) for kind in ("Memory", "Stimulus")}
    own = {kind: getattr(each, "own", each) for kind, each in own.items()}
    own = {kind: each if isinstance(each, type) else _Nothing for kind, each in own.items()}
    known = {"State": states, "Flow": flows, "Output": shown}
    known |= {kind: dict(signals_of(each)) for kind, each in own.items()}
    for sub in cls.subs.values():
        recorded = {name for kind in _RECORDED for name in known[kind]}
        there: set[str] = set()
        for kind in KINDS:
            taken = recorded if kind in _RECORDED else set(known[kind])
            new = {name: each for name, each in sub.signals(kind).items() if name not in there}
            for name in new:
                if name in taken:
                    raise ModelError(
                        f"{sub.where}: the signal {name!r} already exists. Use another prefix",
                        name=sub.where,
                        value=name,
                    )
            known[kind].update(new)
            there |= set(new) if kind in _RECORDED else set()  # recorded once
    if cls.subs:
        for kind, each in own.items():
            joined = _named_tuple(cls, kind, known[kind])
            joined.own = each
            setattr(cls, kind, joined)
        for sub in cls.subs.values():
            for name, source in sub.feeds.items():
                fields = {**known["Memory"], **known["Stimulus"]}
                if source not in fields:
                    error = unknown_name("signal", source, fields)
                    raise error.at(f"{sub.where}: source of {name}", ModelError)
    _number_reactions(cls)


_RECORDED = ("State", "Memory", "Flow", "Output")
_REACTING = ("frictions", "limits", "stops")


class _Nothing(NamedTuple):
    """Neither memory nor stimulus."""


def _number_reactions(cls: type[Any]) -> None:
    """Append the subassemblies' frictions, limits and stop operators, and store their places."""
    if "stops" in vars(cls):
        raise ModelError(
            f"{cls.__name__}.stops follows from the elements that define slip_width. Delete stops",
            name=f"{cls.__name__}.stops",
            valid="elements with the function slip_width",
        )
    inner = {
        name: [tuple(map(sub.named, _names(type(sub.assembly), kind))) for kind in _REACTING]
        for name, sub in cls.subs.items()
    }
    taken = {name for kinds in inner.values() for names in kinds for name in names}
    own = [tuple(each for each in _names(cls, kind) if each not in taken) for kind in _REACTING]
    own[-1] = tuple(part.state_name(k) for part in _stops(cls) for k in part.element.State._fields)
    every = [
        sum((kinds[k] for kinds in inner.values()), start=own[k]) for k in range(len(_REACTING))
    ]
    if cls.subs:
        cls.frictions, cls.limits, _ = every
    cls.stops = every[-1]
    places = {name: k for k, name in enumerate(chain(*every))}
    cls.reaction_places = {
        name: tuple(places[each] for each in chain(*kinds))
        for name, kinds in {"": own, **inner}.items()
    }


def _names(cls: type[Any], kind: str) -> tuple[str, ...]:
    """Return the states that a class lists as a kind, such as frictions. Default: none."""
    names = getattr(cls, kind)
    return names if isinstance(names, tuple) else ()


def _derives(kind: Any) -> bool:
    """Return whether a signal tuple follows from the parts because no class declares it."""
    return not isinstance(kind, type) or hasattr(kind, "derived")


def _named_tuple(owner: type, kind: str, signals: Mapping[str, Signal]) -> Any:
    """Return a signal tuple that pickle can find as an attribute of its assembly."""
    make: Callable[..., Any] = NamedTuple
    gathered = make(kind, [(name, Annotated[float, signal]) for name, signal in signals.items()])
    gathered.__module__, gathered.__qualname__ = owner.__module__, f"{owner.__qualname__}.{kind}"
    gathered.__doc__ = f"{kind} of {owner.__name__}, gathered from its parts."
    gathered.derived = True
    return gathered


def _stores(cls: type[Any]) -> Iterator[AnyPart]:
    """Yield an assembly's parts with states."""
    yield from (part for part in cls.parts.values() if part.has("State"))


def _stops(cls: type[Any]) -> Iterator[AnyPart]:
    """Yield an assembly's parts whose states are stop operators."""
    yield from (part for part in _stores(cls) if part.has("slip_width"))


def _contacts(cls: type[Any]) -> Iterator[AnyPart]:
    """Yield an assembly's parts with contact forces."""
    yield from (part for part in cls.parts.values() if part.has("Forces"))


def contact_count(model: Any, par: Any) -> int:
    """Return an assembly's number of contact forces, including its subassemblies."""
    own = sum(sum(part.group_sizes(par)) for part in _contacts(type(model)))
    return own + sum(
        contact_count(sub.assembly, sub.parameters(par)) for sub in model.subs.values()
    )
