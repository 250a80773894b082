"""Failure modes of a model: of its elements, signals and tasks, and of its brake."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from bywire.bench.stimulus import TOLERANCE
from bywire.core.errors import ModelError
from bywire.core.faults import CHANNELS, FAULTS, Channel, Fault, ParameterFault
from bywire.core.model import ASSEMBLIES, Model
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.simulation.tapped import DEAD, Tap

Changes = Callable[[Any, float], Mapping[str, Any]]


@dataclass(frozen=True)
class Mode:
    """Failure mode.

    Parameters
    ----------
    name
        Place and mode, for example ``"pressure.stuck"``.
    summary
        The effect, in one line.
    unit, value
        SI unit and default of its value; an empty unit if the mode has no value.
    changes
        ``changes(par, value)``: changed parameters by dotted name; None for other kinds of modes.
    channel
        Corrupted signal.
    corrupted
        Kind of corruption (see `corrupt` and `missed`).
    task
        Controller that misses its ticks.
    needs
        Choices among the parameters without which the mode does not exist.
    """

    name: str
    summary: str
    unit: str = ""
    value: float = 0.0
    changes: Changes | None = field(default=None, compare=False)
    channel: Channel | None = None
    corrupted: str = ""
    task: str = ""
    needs: Mapping[str, Any] = field(default_factory=dict, compare=False)

    @property
    def place(self) -> str:
        """Place of the failure: the name up to the last dot."""
        return self.name.rpartition(".")[0]

    def lacks(self, par: ParameterSet) -> dict[str, Any]:
        """Return the choices that the mode needs but the parameters lack, by dotted name."""
        return {name: wanted for name, wanted in self.needs.items() if par.value(name) != wanted}

    def tap(self, value: float) -> Tap | None:
        """Return the tap that the mode needs; None if the mode does not corrupt a signal."""
        if self.channel is None:
            return None
        c = self.channel
        late = round(value) if self.corrupted == "late" else 0
        return Tap(_identifier(c.name), c.side, c.signal, c.task, late)


_READING = {
    "stuck": ("is stuck at a specified value", "level"),
    "stuck-at-last": ("is stuck at its last value", ""),
    "offset": ("has an offset", "offset"),
    "gain": ("is scaled by a factor", "factor"),
    "drift": ("drifts at a constant rate", "rate"),
    "noise": ("has additional noise with a specified standard deviation", "offset"),
    "dropout": ("misses samples with a specified probability", "probability"),
    "swapped": ("has reversed polarity", ""),
}
_DRIVE = {
    "stuck": ("is stuck at a specified value", "level"),
    "stuck-at-last": ("is stuck at its last value", ""),
    "gain": ("is scaled by a factor", "factor"),
    "late": ("is delayed by a number of ticks", "ticks"),
}
_DEMAND = {
    "lost": ("is lost and holds its last value", ""),
    "stuck": ("is stuck at a specified value", "level"),
    "offset": ("has an offset", "offset"),
}
_TASK = {
    "frozen": ("misses every tick, and its outputs hold their last values", "", 0.0),
    "dropped": ("runs only on every nth tick", "ticks", 2.0),
    "missed": ("misses ticks with a specified probability", "probability", 0.2),
    "dead": ("stops with its outputs at rest, and later restarts with empty memory", "", 0.0),
    "restarted": ("restarts with empty memory after a downtime", "duration", 0.05),
}
_VALUES = {"factor": 0.5, "probability": 0.2, "ticks": 5.0}


def modes_of(model: Model, par: ParameterSet) -> dict[str, Mode]:
    """Return every failure mode of a model with these parameters, by name.

    Raises
    ------
    ModelError
        When two modes have the same name, or the signal of a channel is unknown.
    """
    modes: dict[str, Mode] = {}
    for mode in _every(model, par):
        if mode.name in modes:
            raise ModelError(
                f"{model.name}: two faults have the name {mode.name!r}. Rename one of them",
                name=mode.name,
            )
        modes[mode.name] = mode
    return modes


def _every(model: Model, par: ParameterSet) -> Iterator[Mode]:
    for place, node in _groups(par):
        element = sys.modules[type(node).__module__]
        if getattr(element, "Parameters", None) is not type(node):
            continue  # the brake's own group, whose module declares the brake's faults
        for fault in getattr(element, "FAULTS", ()):
            yield _of_element(place, fault, par)
    tasks = model.tasks(par)
    declared = tuple(channels_of(model))
    for channel in (*declared, *_demands(model, {channel.signal for channel in declared})):
        yield from _of_channel(channel, [task.name for task in tasks])
    for task in tasks:
        for name, (summary, kind, value) in _TASK.items():
            yield Mode(
                f"{task.name}.{name}",
                f"task {task.name} {summary}",
                _unit(kind, ""),
                value,
                corrupted=name,
                task=task.name,
            )
    for each in failures_of(model):
        yield Mode(each.name, each.summary, each.unit, each.value, each.changes)


def _groups(par: ParameterSet, prefix: str = "") -> Iterator[tuple[str, ParameterSet]]:
    for name, value in par:
        if isinstance(value, ParameterSet):
            yield f"{prefix}{name}", value
            yield from _groups(value, f"{prefix}{name}.")


def _of_element(place: str, fault: ParameterFault, par: ParameterSet) -> Mode:
    def changes(now: Any, value: float) -> Mapping[str, Any]:
        changed = {f"{place}.{name}": each for name, each in fault.with_it.items()}
        changed |= {
            f"{place}.{name}": value * now.value(f"{place}.{name}") for name in fault.scaled
        }
        return changed | ({f"{place}.{fault.replaced}": value} if fault.replaced else {})

    unit = "1"
    if fault.replaced:
        unit = leaf_fields(type(par))[f"{place}.{fault.replaced}"].unit.symbol
    elif not fault.scaled:
        unit = ""
    name = f"{place}.{fault.name}"
    return Mode(name, fault.summary, unit, fault.value, changes, needs=fault.needs)


def _demands(model: Model, declared: Collection[str]) -> Iterator[Channel]:
    """Yield a channel for every demand without a declared channel."""
    for name, signal in signals_of(model.Stimulus).items():
        if not name.startswith("noise_") and name not in declared:
            yield Channel(name, signal.label, signal.unit, name, "demand", offset=signal.nominal)


def _of_channel(channel: Channel, tasks: Collection[str]) -> Iterator[Mode]:
    kinds = {"reading": _READING, "drive": _DRIVE, "demand": _DEMAND}[channel.side]
    for name, (summary, kind) in kinds.items():
        if name == "late" and channel.task not in tasks:
            continue
        value = {"level": channel.stuck, "offset": channel.offset, "rate": channel.offset}
        yield Mode(
            f"{channel.name}.{name}",
            f"{channel.summary} {summary}",
            _unit(kind, channel.unit),
            value.get(kind, _VALUES.get(kind, 0.0)),
            channel=channel,
            corrupted=name,
        )


def _unit(kind: str, unit: str) -> str:
    if not kind:
        return ""
    units = {"level": unit, "offset": unit, "rate": f"{unit}/s", "duration": "s"}
    return units.get(kind, "1")


def _identifier(name: str) -> str:
    return name.replace("-", "_").replace(".", "_")


def corrupt(
    mode: Mode, value: float, size: Array, since: Array, par: Any, draws: np.random.Generator
) -> dict[str, Array]:
    """Return the inputs of a corrupted signal's tap at every row of the stimulus, by kind.

    Parameters
    ----------
    mode, value
        Failure mode and its value in SI.
    size, since
        Fraction of its full size and time since its onset [s] at every row.
    par
        Parameters of the run.
    draws
        Generator of noise and missed samples.
    """
    channel = mode.channel
    assert channel is not None
    seen = channel.seen or (lambda y, _: y)
    zero = seen(0.0, par)
    slope = seen(1.0, par) - zero
    if mode.corrupted == "stuck":
        return {"gain": -size, "offset": size * seen(value, par)}
    if mode.corrupted == "gain":
        return {"gain": (value - 1.0) * size, "offset": (1.0 - value) * zero * size}
    if mode.corrupted == "swapped":
        return {"gain": -2.0 * size, "offset": 2.0 * zero * size}
    if mode.corrupted == "offset":
        return {"offset": slope * value * size}
    if mode.corrupted == "drift":
        return {"offset": slope * value * size * np.maximum(since, 0.0)}
    if mode.corrupted == "noise":
        return {"offset": slope * value * size * draws.standard_normal(size.size)}
    if mode.corrupted == "dropout":
        return {"held": np.where(draws.random(size.size) < value, size > 0, 0.0)}
    if mode.corrupted == "late":
        return {"late": np.where(size > 0, 1.0, 0.0)}
    return {"held": np.where(size > 0, 1.0, 0.0)}  # lost, stuck-at-last


def missed(
    mode: Mode, value: float, size: Array, since: Array, period: float, draws: np.random.Generator
) -> Array:
    """Return the rows of the stimulus in which a task misses its tick, or is dead.

    ``since``: time since the onset [s], at every row; ``period``: period of the task [s].
    """
    if mode.corrupted == "dropped":
        return np.where(np.mod(np.round(since / period), round(value)) != 0, size > 0, 0.0)
    if mode.corrupted == "dead":
        return np.where(size > 0, DEAD, 0.0)
    if mode.corrupted == "restarted":
        return np.where((size > 0) & (since < value - TOLERANCE), DEAD, 0.0)
    if mode.corrupted == "missed":
        return np.where(draws.random(size.size) < value, size > 0, 0.0)
    return np.where(size > 0, 1.0, 0.0)


# --- Faults and channels that brakes declare


def failures_of(model: Any) -> Iterator[Fault]:
    """Yield the declared faults of a brake, and of the assemblies within it, by their paths."""
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
    """Yield the declared channels of a model, and of the assemblies within it, by their paths.

    Raises
    ------
    ModelError
        When the signal of a channel is unknown.
    """
    yield from _own_channels(model)
    for sub in _subs(model):
        for channel in channels_of(sub.assembly):
            if channel.side == "demand" and channel.signal in sub.feeds:
                continue  # set by a task of the outer model
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
                f"{model.name}: the channel {channel.name!r} refers to {channel.signal!r}, which "
                f"is not a signal. Valid signals are {', '.join(source._fields)}",
                name=channel.name,
                value=channel.signal,
                valid=", ".join(source._fields),
            )
    return channels


def _seen_within(sub: Any, seen: Callable[[float, Any], float], value: float, par: Any) -> float:
    return seen(value, sub.parameters(par))


def _subs(model: Any) -> Iterable[Any]:
    """Return the assemblies within a model; none if it is not an assembly."""
    held: Mapping[str, Any] = getattr(model, "subs", {})
    return held.values()
