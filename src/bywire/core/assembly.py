"""Models by parts and wires: what follows from the elements is not written a second time.

An assembly names its elements and writes down, once and in the order of the physics, what each of
them feels. States, masses, balances, contacts, stored energies, plain losses and recorded signals
follow from the elements. Causal on purpose: acausal connections would need index reduction and
would fight the diagonal mass form of ``core.model``, which stays below this for those who want it.
"""

from __future__ import annotations

import types
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import islice, repeat
from typing import Any, ClassVar, Generic, NamedTuple, Self, TypeVar

from bywire.core.errors import ModelError, unknown_name
from bywire.core.gathering import AnyPart, contacts, gather, stores
from bywire.core.model import Bounds, Matrix, Model
from bywire.core.parts import Part
from bywire.core.watching import silent_parts, warnings_of, watched_by_elements
from bywire.core.wired import Instant, Wired, instant_of, line
from bywire.core.wires import Integral, Shown, Wire

ParT = TypeVar("ParT")
MemoryT = TypeVar("MemoryT")

_NAN = float("nan")


class Assembly(Model, Generic[ParT, MemoryT]):
    """A model made of parts; see ``docs/modeling.md``.

    A subclass declares `Part`, `Wire`, `Integral` and `Shown` objects, ``Memory``, ``Stimulus`` and
    ``records``, and defines ``wire``, ``tasks``, and as far as it has any ``friction``, ``power``
    and ``record``. Where a mode replaces an equation it overrides ``mass`` or ``balance``.
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

    def __init_subclass__(cls, *, at_an_instant: bool = False, **options: Any) -> None:
        """Gather what follows from the parts."""
        super().__init_subclass__(**options)
        if not at_an_instant and isinstance(cls.Memory, type):  # else there is more to come
            gather(cls)

    # What an assembly writes.

    def wire(self, w: Self) -> None:
        """Set every input and every wire once, in the order of the physics."""

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return (low, high) of each friction, as ``bounds`` of the protocol."""
        return ()

    def power(self, w: Self) -> Mapping[str, float]:
        """Return the rates of the integrals that no part gives."""
        return {}

    def record(self, w: Self) -> Mapping[str, float]:
        """Return what is recorded and no part gives, and what replaces what one gives."""
        return {}

    # What it reads at an instant.

    @property
    def x(self) -> Any:
        """State that enters the implicit solve."""
        return instant_of(self, "x").x

    @property
    def xe(self) -> Any:
        """State, value-only."""
        return instant_of(self, "xe").xe

    @property
    def m(self) -> MemoryT:
        """What the controllers hold."""
        return instant_of(self, "m").memory  # type: ignore[no-any-return]

    @property
    def par(self) -> ParT:
        """Parameters."""
        return instant_of(self, "par").par  # type: ignore[no-any-return]

    @property
    def reaction(self) -> tuple[float, ...]:
        """Forces of the frictions, then of the limits; in ``power`` and ``record``."""
        return instant_of(self, "reaction").reaction

    @property
    def rate(self) -> Any:
        """Derivative of the state; in ``power``."""
        return instant_of(self, "rate").rate

    @property
    def flow(self) -> Any:
        """Integrals since the start; in ``record``."""
        return instant_of(self, "flow").flow

    # What follows from the parts.

    def at(
        self,
        state: Any,
        memory: MemoryT,
        par: ParT,
        contact: tuple[float, ...] | None = None,
        **more: Any,
    ) -> Self:
        """Return the assembly at an instant, wired: its parts, typed, have values there.

        Parameters
        ----------
        contact
            Contact forces; not known by default.
        more
            Further fields of `Instant`: ``xe`` where it is not the state, for instance.
        """
        w = self._unwired(state, memory, par, contact, **more)
        self.wire(w)
        return w

    def _unwired(
        self, x: Any, memory: Any, par: Any, contact: tuple[float, ...] | None, **more: Any
    ) -> Self:
        each: dict[str, tuple[float, ...]] = {}
        left = iter(contact) if contact is not None else repeat(_NAN)
        for part in contacts(type(self)):
            count = sum(part.group_sizes(par))
            unknown = (_NAN,) * len(part.element.Forces._fields)  # where a choice leaves them out
            each[part.name] = tuple(islice(left, count)) or unknown
        fields = {"x": x, "xe": x, "memory": memory, "par": par, "shared": self.shared}
        w: Self = object.__new__(_at_an_instant(type(self)))
        vars(w).update(vars(self) | {"_instant": Instant(**fields | {"contact": each} | more)})
        return w

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
        return self.State._make(rows)

    def bounds(
        self, x: Any, xe: Any, memory: MemoryT, par: ParT, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return the limits of the dry frictions."""
        return self.friction(self.at(x, memory, par, contact, xe=xe))

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
        return tuple(groups)

    @property
    def usually_open(self) -> tuple[bool, ...]:
        """Per contact group, whether it rarely touches."""
        return tuple(
            part.rarely
            for part in contacts(type(self))
            for _ in range(1 if part.has("matrix") else len(part.element.Forces._fields))
        )

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
        values |= _known(self, "record", self.record(w), self.Output._fields)
        return _filled(self, "record", self.Output, values)

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

    @classmethod
    def state(cls, **parts: NamedTuple) -> Any:
        """Return a State from the states of parts, by their names; those left out are zero.

        Raises
        ------
        ModelError
            When there is no such part, or the state is another element's.
        """
        values: list[Any] = [0.0] * len(cls.State._fields)
        for name, given in parts.items():
            for place, value in zip(cls._places(name, type(given)), given, strict=True):
                values[place] = value
        return cls.State._make(values)

    @classmethod
    @cache  # studies begin thousands of runs a second
    def _places(cls, name: str, kind: type) -> tuple[int, ...]:
        """Return where the states of a part stand in the assembly's."""
        part = cls.parts.get(name)
        if part is None:
            raise ModelError(f"{cls.__name__}: {unknown_name('part', name, cls.parts)}")
        if not part.has("State") or not issubclass(kind, part.element.State):
            raise ModelError(f"{part.where}: {kind.__name__} is no state of {part.kind}")
        fields: tuple[str, ...] = cls.State._fields
        return tuple(fields.index(part.state_name(each)) for each in part.element.State._fields)

    def watch(self, recording: Any, par: Any) -> list[str]:
        """Return what the elements say of a recording, each of what it felt in every row.

        Of signals that are not recorded nothing is known, and nothing said.
        """
        return warnings_of(self, recording, par)

    def watched(self, par: Any) -> tuple[str, ...] | None:
        """Return the signals that ``watch`` looks at; None where it is written by hand."""
        return watched_by_elements(self, par) if type(self).watch is Assembly.watch else None

    def silent(self, rows: Any, pars: Sequence[Any]) -> frozenset[str]:
        """Return the parts whose elements say nothing of any of several cases, by name.

        ``rows``: signals of shape (cases, rows); ``pars``: parameters of each case.
        """
        return silent_parts(self, rows, pars)

    def may_warn(self, rows: Any, pars: Sequence[Any]) -> Sequence[int]:
        """Return the cases of which ``watch`` may say something: none where all parts are silent.

        All where ``watch`` is written by hand, unless this is too.
        """
        is_own = type(self).watch is not Assembly.watch
        return range(len(pars)) if is_own or not self.are_silent(rows) else ()

    def are_silent(self, rows: Any) -> bool:
        """Return whether no part has anything to say of cases of which ``rows.silent`` is known."""
        watching = (part.name for part in self.parts.values() if part.has("watch"))
        return all(name in rows.silent for name in watching)

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


def _known(
    model: Assembly[Any, Any], method: str, values: Mapping[str, Any], names: tuple[str, ...]
) -> dict[str, Any]:
    for name in values:
        if name not in names:
            raise ModelError(
                f"{type(model).__name__}.{method}: {unknown_name('signal', name, names)}"
            )
    return dict(values)


def _filled(model: Assembly[Any, Any], method: str, kind: Any, values: Mapping[str, Any]) -> Any:
    for name in kind._fields:
        if name not in values:
            raise ModelError(
                f"{type(model).__name__}.{method} does not return {name!r}, and no part gives it: "
                f"add it to what {method} returns"
            )
    return kind(**{name: values[name] for name in kind._fields})


@cache
def _at_an_instant(cls: type[Any]) -> type[Any]:
    """Return what stands for an assembly at an instant: it takes wires and no other names."""
    kinds = (Part, Wire, Integral, Shown)
    every = {k: v for base in cls.__mro__ for k, v in vars(base).items()}
    known = frozenset(name for name, value in every.items() if isinstance(value, kinds))

    def refuse(self: Any, name: str) -> Any:
        there = known | {n for n, v in vars(Assembly).items() if isinstance(v, property)}
        error = unknown_name("part or wire", name, there)
        raise ModelError(f"{cls.__name__}: {line()} names an {error}")

    def assign(self: Any, name: str, value: Any) -> None:
        if name not in known:
            refuse(self, name)
        object.__setattr__(self, name, value)

    body = {"__getattr__": refuse, "__setattr__": assign, "__module__": cls.__module__}
    return types.new_class(
        cls.__name__, (cls,), {"at_an_instant": True}, lambda names: names.update(body)
    )
