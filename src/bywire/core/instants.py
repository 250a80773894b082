"""Assemblies at an instant: what their equations read there, and how those within are wired."""

from __future__ import annotations

import types
from functools import cache
from itertools import islice, repeat
from typing import Any, ClassVar, Generic, Self, TypeVar, cast

from bywire.core.errors import ModelError, unknown_name
from bywire.core.gathering import contact_count, contacts
from bywire.core.parts import Part
from bywire.core.subassembly import Sub
from bywire.core.wires import Instant, Integral, Shown, Wire, instant_of, line

ParT = TypeVar("ParT")
MemoryT = TypeVar("MemoryT")

_NAN = float("nan")


class Evaluated(Generic[ParT, MemoryT]):
    """An assembly as it is evaluated at an instant, alone or within another one."""

    shared: ClassVar[tuple[str, ...]]
    subs: ClassVar[dict[str, Sub[Any]]]
    reaction_places: ClassVar[dict[str, tuple[int, ...]]]

    def wire(self, w: Self) -> None:
        """Set every input and every wire once, in the order of the physics."""

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
        """Forces of its own frictions, then of its limits; in ``power`` and ``record``."""
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
        """Return the assembly at an instant, wired: its parts, typed, have values there.

        Parameters
        ----------
        contact
            Contact forces; not known by default.
        more
            Further fields of `Instant`: ``xe`` where it is not the state, for instance.
        """
        here = vars(self).get("_instant")
        if here is not None and here.is_held:
            return self._as_held(here, state)
        w = self._unwired(state, memory, par, contact, **more)
        self.wire(w)
        settled(w)
        return w

    def _as_held(self, here: Instant, state: Any) -> Self:
        """Return itself at the instant where its holder is evaluated, wired."""
        if state is not here.x:
            raise ModelError(
                f"{type(self).__name__} is asked for another state than its holder's: within an "
                "assembly its equations hold at that instant alone"
            )
        here.settle()
        return self

    def held_at(
        self, x: Any, memory: Any, par: Any, contact: tuple[float, ...] | None, **more: Any
    ) -> Self:
        """Return the assembly at the instant of one that holds it; it is wired once it is read."""
        w = self._unwired(x, memory, par, contact, is_held=True, **more)

        def wire() -> None:
            w.wire(w)
            settled(w)

        instant_of(w, "wire").wiring = wire
        return w

    def _unwired(
        self, x: Any, memory: Any, par: Any, contact: tuple[float, ...] | None, **more: Any
    ) -> Self:
        each: dict[str, Any] = {}
        left = iter(contact) if contact is not None else repeat(_NAN)
        for part in contacts(type(self)):
            count = sum(part.group_sizes(par))
            unknown = (_NAN,) * len(part.element.Forces._fields)  # where a choice leaves them out
            each[part.name] = tuple(islice(left, count)) or unknown
        for name, sub in self.subs.items():
            count = contact_count(sub.assembly, sub.parameters(par))
            each[name] = tuple(islice(left, count)) if contact is not None else None
        fields = {"x": x, "xe": x, "memory": memory, "par": par, "shared": self.shared}
        fields |= {"contact": each, "forces": contact}
        w: Self = object.__new__(at_an_instant(cast(Any, type(self))))
        vars(w).update(vars(self) | {"_instant": Instant(**fields | more)})
        return w


@cache
def at_an_instant(cls: type[Any]) -> type[Any]:
    """Return what stands for an assembly at an instant: it takes wires and no other names."""
    kinds = (Part, Wire, Integral, Shown, Sub)
    every = {k: v for base in cls.__mro__ for k, v in vars(base).items()}
    known = frozenset(name for name, value in every.items() if isinstance(value, kinds))

    def refuse(self: Any, name: str) -> Any:
        there = known | {n for n, v in vars(Evaluated).items() if isinstance(v, property)}
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


def settled(w: Any) -> None:
    """Wire what an assembly holds, as far as nothing has read it yet, and what nobody has set."""
    cls: Any = type(w)
    for name in cls.subs:
        instant_of(getattr(w, name), name).settle()
    instant = instant_of(w, "wire")
    for port in cls.ports:
        if port.name not in instant.wires:
            port.unset(instant)
