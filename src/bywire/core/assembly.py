"""Models by parts and wires: what follows from the elements is not written a second time.

An assembly names its elements and writes down, once and in the order of the physics, what each
of them feels. States, masses, balances, contacts, stored energies, plain losses and recorded
signals follow from the elements. Causal on purpose: acausal connections would need index
reduction and would fight the diagonal mass form of ``core.model``, which stays below this for
those who want it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from itertools import chain
from typing import Any, ClassVar, Generic, NamedTuple, Self, TypeVar

from bywire.core.errors import ModelError, unknown_name
from bywire.core.gathering import AnyPart, contacts, gather, stores
from bywire.core.instants import Evaluated
from bywire.core.model import Bounds, Matrix, Task
from bywire.core.signals import zeros
from bywire.core.subassembly import Sub
from bywire.core.watching import Watching
from bywire.core.wires import Instant, Port, Wired, instant_of


def known(
    model: Any, method: str, values: Mapping[str, Any], names: tuple[str, ...]
) -> dict[str, Any]:
    """Return what a method gives.

    Raises
    ------
    ModelError
        When it gives what is none of the names.
    """
    for name in values:
        if name not in names:
            raise ModelError(
                f"{type(model).__name__}.{method}: {unknown_name('signal', name, names)}"
            )
    return dict(values)


def filled(model: Any, method: str, kind: Any, values: Mapping[str, Any]) -> Any:
    """Return a signal tuple of what a method and the parts give.

    Raises
    ------
    ModelError
        When a field is given by neither.
    """
    for name in kind._fields:
        if name not in values:
            raise ModelError(
                f"{type(model).__name__}.{method} does not return {name!r}, and no part gives it: "
                f"add it to what {method} returns"
            )
    return kind(**{name: values[name] for name in kind._fields})


# --- Assemblies

ParT = TypeVar("ParT")
MemoryT = TypeVar("MemoryT")

_NAN = float("nan")


class Assembly(Evaluated[ParT, MemoryT], Watching, Generic[ParT, MemoryT]):
    """A model made of parts; see ``docs/modeling.md``.

    A subclass declares `Part`, `Wire`, `Integral`, `Shown` and `Sub` objects, ``Memory``,
    ``Stimulus`` and ``records``, and defines ``wire``, ``tasks``, and as far as it has any
    ``friction``, ``power`` and ``record``. Where a mode replaces an equation it overrides ``mass``
    or ``balance``.
    """

    State: ClassVar[Any]
    Flow: ClassVar[Any]
    Output: ClassVar[Any]
    Memory: ClassVar[Any]
    Stimulus: ClassVar[Any]
    records: ClassVar[tuple[str, ...]] = ()
    """names of what is recorded, in order; everything by default"""
    shared: ClassVar[tuple[str, ...]] = ()
    """groups of parameters that several elements take by name, such as a fluid"""
    parts: ClassVar[dict[str, AnyPart]]
    subs: ClassVar[dict[str, Sub[Any]]]
    """the assemblies within"""
    ports: ClassVar[tuple[Port, ...]]
    """the wires that an assembly sets that holds this one"""
    reaction_places: ClassVar[dict[str, tuple[int, ...]]]
    """where the reactions of each assembly within stand, and its own under an empty name"""

    def __init_subclass__(cls, *, at_an_instant: bool = False, **options: Any) -> None:
        """Gather what follows from the parts."""
        super().__init_subclass__(**options)
        holds = any(isinstance(each, Sub) for base in cls.__mro__ for each in vars(base).values())
        if not at_an_instant and (isinstance(cls.Memory, type) or holds):  # else more is to come
            gather(cls)

    # What an assembly writes.

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return (low, high) of each friction, as ``bounds`` of the protocol."""
        return ()

    def power(self, w: Self) -> Mapping[str, float]:
        """Return the rates of the integrals that no part gives."""
        return {}

    def record(self, w: Self) -> Mapping[str, float]:
        """Return what is recorded and no part gives, and what replaces what one gives."""
        return {}

    # What follows from the parts.

    def mass(self, xe: Any, par: ParT) -> Any:
        """Return the factor of each state's derivative."""
        w = self.at(xe, self._nothing(), par)
        rows: list[float] = []
        for part in stores(type(self)):
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
        for part in stores(type(self)):
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

    def compliance(self, par: ParT) -> tuple[Matrix, ...]:
        """Return a compliance matrix per contact group, an empty one where it is left out."""
        state = self.State._make(_NAN for _ in self.State._fields)
        w = self._unwired(state, self._nothing(), par, None)
        groups: list[Matrix] = []
        for part in contacts(type(self)):
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
        """Return the damped overlaps, group by group."""
        w = self.at(x, self._nothing(), par, xe=xe)
        groups: list[tuple[float, ...]] = []
        for part in contacts(type(self)):
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
        """Per contact group, whether it rarely touches."""
        own = tuple(
            part.rarely
            for part in contacts(type(self))
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
        values |= known(self, "power", self.power(w), self.Flow._fields)
        return filled(self, "power", self.Flow, values)

    def output(
        self,
        x: Any,
        memory: MemoryT,
        par: ParT,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
        flow: Any,
    ) -> Any:
        """Return what is recorded at an instant."""
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
        values |= known(self, "record", self.record(w), self.Output._fields)
        return filled(self, "record", self.Output, values)

    def stored(self, w: Self) -> Any:
        """Return the energy that the parts store at an instant [J]; contacts are added up apart."""
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
        """Return the tasks of the assemblies within; those of its own are added by a subclass."""
        return tuple(task for sub in self.subs.values() for task in sub.tasks(par))

    def rest(self, par: ParT) -> tuple[Any, Any]:
        """Return zeros, and where the assemblies within rest."""
        inner = {name: sub.assembly.rest(sub.parameters(par)) for name, sub in self.subs.items()}
        return (
            self.state(**{name: state for name, (state, _) in inner.items()}),
            self.memory(**{name: memory for name, (_, memory) in inner.items()}),
        )

    @classmethod
    def state(cls, **parts: NamedTuple) -> Any:
        """Return a State from the states of parts and of assemblies within, by their names.

        Those left out are zero.

        Raises
        ------
        ModelError
            When there is no such part, or the state is another element's.
        """
        given = (0.0, *chain.from_iterable(parts.values()))
        kinds = tuple((name, type(each)) for name, each in parts.items())
        return cls.State._make(map(given.__getitem__, cls._sources(kinds)))

    @classmethod
    def memory(cls, own: NamedTuple | None = None, **subs: NamedTuple) -> Any:
        """Return a Memory from its own fields and from the memories of assemblies within.

        Those left out are zero.

        Raises
        ------
        ModelError
            When no such assembly is within.
        """
        values = {} if own is None else own._asdict()
        for name, given in subs.items():
            if name not in cls.subs:
                raise ModelError(f"{cls.__name__}: {unknown_name('assembly', name, cls.subs)}")
            values |= cls.subs[name].outside("Memory", given)
        return zeros(cls.Memory)._replace(**values)

    @classmethod
    @cache  # studies begin thousands of runs a second
    def _sources(cls, kinds: tuple[tuple[str, type], ...]) -> tuple[int, ...]:
        """Return where each entry of the State is found in a zero and the states of parts."""
        sources, place = [0] * len(cls.State._fields), 0
        for name, kind in kinds:
            for there in cls._places(name, kind):
                sources[there] = place = place + 1
        return tuple(sources)

    @classmethod
    def _places(cls, name: str, kind: type) -> tuple[int, ...]:
        """Return where the states of a part, or of an assembly within, stand in the State."""
        fields: tuple[str, ...] = cls.State._fields
        if name in cls.subs:
            sub = cls.subs[name]
            if not issubclass(kind, sub.assembly.State):
                raise ModelError(f"{sub.where}: {kind.__name__} is no state of {sub.label}")
            return tuple(fields.index(each) for each in sub.signals("State"))
        part = cls.parts.get(name)
        if part is None:
            there = {**cls.parts, **cls.subs}
            raise ModelError(f"{cls.__name__}: {unknown_name('part', name, there)}")
        if not part.has("State") or not issubclass(kind, part.element.State):
            raise ModelError(f"{part.where}: {kind.__name__} is no state of {part.kind}")
        return tuple(fields.index(part.state_name(each)) for each in part.element.State._fields)

    def _nothing(self) -> Any:
        """Return a memory that is not known: where it does not count, nobody must see it."""
        return self.Memory._make(_NAN for _ in self.Memory._fields)


def _part_values(w: Assembly[Any, Any], wanted: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
    """Yield the recorded outputs of all parts, and the losses of contacts."""
    for part in w.parts.values():
        for name, there in part.output.items():
            if there in wanted:
                yield there, part.output_value(name, _wired(w, part))
        for name in part.kept:
            if name in wanted:
                stored = _wired(w, part).call(part.element.energy)
                yield name, getattr(w.flow, part.work) - stored


def _wired(w: Any, part: AnyPart) -> Wired[Any, Any, Any, Any]:
    value: Wired[Any, Any, Any, Any] = getattr(w, part.name)
    return value


def _row(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, tuple) else (value,)


def _held(w: Any) -> Iterator[tuple[Sub[Any], Any, Instant]]:
    """Yield the assemblies within one at an instant: as declared, there, and its own instant."""
    for name, sub in w.subs.items():
        inner = getattr(w, name)
        yield sub, inner, instant_of(inner, name)
