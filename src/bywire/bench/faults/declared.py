"""What brakes declare that may fail: of a model, and of the assemblies within it by their paths."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from bywire.core.errors import ModelError
from bywire.core.faults import CHANNELS, FAULTS, Channel, Fault
from bywire.core.model import ASSEMBLIES


def failures_of(model: Any) -> Iterator[Fault]:
    """Yield what may fail in a brake, and in those of the assemblies within."""
    for each in FAULTS.of(ASSEMBLIES.owner(model.name)).values():
        if each.is_of(model.name):
            yield each
    for sub in _subs(model):
        for each in failures_of(sub.assembly):
            changes = partial(_changes_within, sub, each.changes)
            summary = f"{sub.label}: {each.summary}"
            yield replace(each, name=f"{sub.path}.{each.name}", summary=summary, changes=changes)


def _changes_within(
    sub: Any, changes: Callable[[Any, float], Mapping[str, Any]], par: Any, value: float
) -> Mapping[str, Any]:
    changed = changes(sub.parameters(par), value)
    return {f"{sub.path}.{name}": each for name, each in changed.items()}


def channels_of(model: Any) -> Iterator[Channel]:
    """Yield the channels that a model's brake declares, and those of the assemblies within.

    Raises
    ------
    ModelError
        When one names no signal of its model.
    """
    yield from _own_channels(model)
    for sub in _subs(model):
        for channel in channels_of(sub.assembly):
            if channel.side == "demand" and channel.signal in sub.feeds:
                continue  # what the holder's tasks give
            seen = None if channel.seen is None else partial(_seen_within, sub, channel.seen)
            yield replace(
                channel,
                name=f"{sub.path}.{channel.name}",
                summary=f"{sub.label}: {channel.summary}",
                signal=sub.named(channel.signal),
                seen=seen,
                task=sub.named(channel.task) if channel.task else "",
            )


def _own_channels(model: Any) -> tuple[Channel, ...]:
    known = CHANNELS.of(ASSEMBLIES.owner(model.name)).get(model.name)
    channels = () if known is None else known.channels
    for channel in channels:
        sources = {"reading": model.State, "drive": model.Memory, "demand": model.Stimulus}
        source = sources[channel.side]
        if channel.signal not in source._fields:
            raise ModelError(
                f"{model.name}: the channel {channel.name!r} names no signal: {channel.signal!r} "
                f"is none of {', '.join(source._fields)}"
            )
    return channels


def _seen_within(sub: Any, seen: Callable[[float, Any], float], value: float, par: Any) -> float:
    return seen(value, sub.parameters(par))


def _subs(model: Any) -> Iterable[Any]:
    """Return the assemblies within a model: none in one that is no assembly."""
    held: Mapping[str, Any] = getattr(model, "subs", {})
    return held.values()
