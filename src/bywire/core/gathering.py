"""What follows from the declarations of an assembly: its State, Flow and Output."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, NamedTuple

from bywire.core.errors import ModelError, unknown_name
from bywire.core.parts import Part
from bywire.core.signals import Role, Signal, signals_of
from bywire.core.subassembly import KINDS, Sub
from bywire.core.wires import Integral, Port, Shown, Wire

AnyPart = Part[Any, Any, Any, Any]

STORED = Signal("J", "stored energy", role=Role("sink", "stored", returns="any"))
"""what every assembly can record as ``E_stored``"""


def gather(cls: type[Any]) -> None:
    """Derive State, Flow and Output of an assembly from its declarations."""
    declared = {k: v for base in reversed(cls.__mro__) for k, v in vars(base).items()}
    cls.parts = {k: v for k, v in declared.items() if isinstance(v, Part)}
    cls.subs = {k: v for k, v in declared.items() if isinstance(v, Sub)}
    cls.ports = tuple(v for v in declared.values() if isinstance(v, Port))
    states: dict[str, Signal] = {}
    for part in stores(cls):
        if part.has("balance") and not part.has("mass"):
            raise ModelError(
                f"{part.where}: {part.kind} has states and a balance, but no mass: define mass "
                "there, or name the function rate where it returns derivatives"
            )
        if not (part.has("balance") or part.has("rate")):
            raise ModelError(f"{part.where}: {part.kind} has states, but no balance and no rate")
        for name, signal in part.states().items():
            if name in states:
                raise ModelError(
                    f"{part.where}: another part has a state {name!r} too: give this one a suffix "
                    "or another name, Part(..., suffix='_2') or Part(..., state={...})"
                )
            states[name] = signal
    flows: dict[str, Signal] = {}
    shown: dict[str, Signal] = {}
    for name, value in declared.items():
        if isinstance(value, Part):
            flows |= {k: s for k, s in value.energies.items() if k not in flows}
            shown |= value.outputs() | value.kept
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
                f"{cls.__name__}.Memory has a field {name!r}, and so has the recording from a part "
                "or a wire: it would show the one in place of the other; rename the field"
            )
    if _derives(declared.get("Output")):
        known = signals_of(cls.State) | signals_of(cls.Memory) | signals_of(cls.Flow)
        known |= {"E_stored": STORED} | shown
        names = cls.records or tuple(known)
        for name in names:
            if name not in known:
                raise ModelError(f"{cls.__name__}.records: {unknown_name('signal', name, known)}")
        cls.Output = _named_tuple(cls, "Output", {name: known[name] for name in names})


def _take_over(
    cls: type[Any], states: dict[str, Signal], flows: dict[str, Signal], shown: dict[str, Signal]
) -> None:
    """Add the signals, frictions and limits of the assemblies within, by their names there."""
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
                        f"{sub.where}: there is a signal {name!r} already: give it another prefix"
                    )
            known[kind].update(new)
            there |= set(new) if kind in _RECORDED else set()  # what it records of these, once
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
                    raise ModelError(f"{sub.where}: {name} is fed by an {error}")
    _number_reactions(cls)


_RECORDED = ("State", "Memory", "Flow", "Output")
_REACTING = ("frictions", "limits")


class _Nothing(NamedTuple):
    """Neither memory nor stimulus."""


def _number_reactions(cls: type[Any]) -> None:
    """Append the frictions and limits of the assemblies within, and say where whose stand."""
    inner = {
        name: [tuple(map(sub.named, _names(type(sub.assembly), kind))) for kind in _REACTING]
        for name, sub in cls.subs.items()
    }
    taken = {name for both in inner.values() for names in both for name in names}
    own = [tuple(each for each in _names(cls, kind) if each not in taken) for kind in _REACTING]
    every = [sum((both[k] for both in inner.values()), start=own[k]) for k in range(2)]
    if cls.subs:
        cls.frictions, cls.limits = every
    places = {name: k for k, name in enumerate((*every[0], *every[1]))}
    cls.reaction_places = {
        name: tuple(places[each] for each in (*frictions, *limits))
        for name, (frictions, limits) in {"": own, **inner}.items()
    }


def _names(cls: type[Any], kind: str) -> tuple[str, ...]:
    """Return the names of frictions or limits that a class declares; none by default."""
    names = getattr(cls, kind)
    return names if isinstance(names, tuple) else ()


def _derives(kind: Any) -> bool:
    """Tell whether a signal tuple follows from the parts: the class has none of its own."""
    return not isinstance(kind, type) or hasattr(kind, "derived")


def _named_tuple(owner: type, kind: str, signals: Mapping[str, Signal]) -> Any:
    """Return a signal tuple that can be pickled as an attribute of its assembly."""
    make: Callable[..., Any] = NamedTuple
    gathered = make(kind, [(name, Annotated[float, signal]) for name, signal in signals.items()])
    gathered.__module__, gathered.__qualname__ = owner.__module__, f"{owner.__qualname__}.{kind}"
    gathered.__doc__ = f"{kind} of {owner.__name__}, gathered from its parts."
    gathered.derived = True
    return gathered


def stores(cls: type[Any]) -> Iterator[AnyPart]:
    """Yield the parts of an assembly that have states."""
    yield from (part for part in cls.parts.values() if part.has("State"))


def contacts(cls: type[Any]) -> Iterator[AnyPart]:
    """Yield the parts of an assembly that have contact forces."""
    yield from (part for part in cls.parts.values() if part.has("Forces"))


def contact_count(model: Any, par: Any) -> int:
    """Return how many contact forces an assembly has, those of assemblies within included."""
    own = sum(sum(part.group_sizes(par)) for part in contacts(type(model)))
    return own + sum(
        contact_count(sub.assembly, sub.parameters(par)) for sub in model.subs.values()
    )
