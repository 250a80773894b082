"""Fault modes: what may fail, as elements and brakes declare it.

There are three mechanisms and nothing else in the equations: parameters that change at an instant,
signals between plant and controllers that are falsified, and controllers that miss their ticks.
An element names the parameters that a failure of it changes; a brake names the signals, in a module
``faults`` of its package, and what takes several changes together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from bywire.core.registry import Kind, instances

Side = Literal["reading", "demand", "drive"]


@dataclass(frozen=True)
class ParameterFault:
    """A failure of an element that changes parameters of it; in its module, in ``FAULTS``.

    Parameters
    ----------
    name
        Of the mode, for instance ``"demagnetized"``.
    summary
        What happens, in one line.
    scaled
        Parameters that are multiplied by the fault's value.
    value
        That factor, as it is unless given.
    replaced
        Parameter that takes the fault's value; instead of ``scaled``.
    with_it
        Choices and further parameters that change as well.
    needs
        Choices of the assembly without which there is nothing to fail, by dotted name.
    """

    name: str
    summary: str
    scaled: tuple[str, ...] = ()
    value: float = 1.0
    replaced: str = ""
    with_it: Mapping[str, Any] = field(default_factory=dict)
    needs: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Channel:
    """A signal between plant and controllers, which may be falsified.

    Parameters
    ----------
    name
        What faults of it are called after: ``"pressure"`` has ``pressure.stuck``.
    summary
        What it carries.
    unit
        SI unit in which values and offsets are given.
    signal
        State that controllers read, field of their memory that the plant feels, or stimulus.
    side
        ``"reading"`` of a sensor, ``"drive"`` from controller to actuator, or ``"demand"``: a field
        of the stimulus, of which those that are not declared are channels under their own names.
    seen
        ``seen(value, par)``: the signal at a value; affine in it. The value itself by default.
    stuck
        Value of ``stuck`` unless given, in ``unit``.
    offset
        Value of ``offset``, per second of ``drift``, standard deviation of ``noise``.
    task
        Of a drive: the task that renews it, where that may be late.
    """

    name: str
    summary: str
    unit: str
    signal: str
    side: Side = "reading"
    seen: Callable[[float, Any], float] | None = None
    stuck: float = 0.0
    offset: float = 0.0
    task: str = ""


@dataclass(frozen=True)
class Fault:
    """A failure that takes several changes of parameters together; of a brake.

    Parameters
    ----------
    name
        Place and mode, for instance ``"battery.lost"``.
    summary
        What happens, in one line.
    changes
        ``changes(par, value)``: parameters and choices that change, by dotted name.
    assembly
        Name of the assembly that has it, or of several.
    unit
        SI unit of its value; empty where it has none.
    value
        Its value unless given.
    """

    name: str
    summary: str
    changes: Callable[[Any, float], Mapping[str, Any]]
    assembly: str | tuple[str, ...]
    unit: str = ""
    value: float = 0.0

    def is_of(self, assembly: str) -> bool:
        """Return whether an assembly of a name has it."""
        return assembly in ((self.assembly,) if isinstance(self.assembly, str) else self.assembly)


@dataclass(frozen=True)
class Channels:
    """The channels of an assembly.

    Parameters
    ----------
    name
        Of the assembly.
    channels
        Those of its signals that may be falsified, beside its demands.
    """

    name: str
    channels: tuple[Channel, ...]


CHANNELS = Kind("channel", ("faults",), instances(Channels))
"""the channels of every assembly, by its name"""
FAULTS = Kind("fault", ("faults",), instances(Fault))
"""failures of brakes that take several changes"""
