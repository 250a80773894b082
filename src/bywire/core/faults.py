"""Fault modes that elements and brakes declare.

The equations support three mechanisms: parameters that change at a certain time, corrupted signals
between plant and controllers, and controllers that miss their ticks. An element lists the
parameters that its failure changes. A brake declares the signals, and failures with several
changes, in a module ``faults`` of its package.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from bywire.core.registry import Kind, instances

Side = Literal["reading", "demand", "drive"]


@dataclass(frozen=True)
class ParameterFault:
    """Failure that changes parameters of an element, declared in ``FAULTS`` of its module.

    Parameters
    ----------
    name
        Name of the mode, for example ``"demagnetized"``.
    summary
        One-line description.
    scaled
        Parameters that the fault multiplies by its value.
    value
        Default value of the factor.
    replaced
        Parameter that the fault sets to its value, as an alternative to ``scaled``.
    with_it
        Choices and other parameters that also change.
    needs
        Choices of the assembly that this failure requires, by dotted name.
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
    """Signal between plant and controllers that faults can corrupt.

    Parameters
    ----------
    name
        Prefix of the names of its faults. For example, ``"pressure"`` has ``pressure.stuck``.
    summary
        Description of the signal.
    unit
        SI unit of values and offsets.
    signal
        State that controllers read, memory field that acts on the plant, or stimulus.
    side
        ``"reading"`` of a sensor, ``"drive"`` from controller to actuator, or ``"demand"``, which
        is a field of the stimulus. Undeclared demands are channels under their own names.
    seen
        ``seen(value, par)``: the signal for a value, affine in the value. Default: the value.
    stuck
        Default value of ``stuck``, in ``unit``.
    offset
        Default value of ``offset``, of ``drift`` per second, and of the standard deviation of
        ``noise``.
    task
        For a drive, the task that updates it, if the task may be late.
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
    """Failure of a brake that changes several parameters together.

    Parameters
    ----------
    name
        Place and mode, for example ``"battery.lost"``.
    summary
        One-line description.
    changes
        ``changes(par, value)``: parameters and choices that change, by dotted name.
    assembly
        Name of the assembly, or names of several assemblies.
    unit
        SI unit of the fault's value; empty if the fault has no value.
    value
        Default value.
    """

    name: str
    summary: str
    changes: Callable[[Any, float], Mapping[str, Any]]
    assembly: str | tuple[str, ...]
    unit: str = ""
    value: float = 0.0

    def is_of(self, assembly: str) -> bool:
        """Return whether the assembly with this name has the failure."""
        return assembly in ((self.assembly,) if isinstance(self.assembly, str) else self.assembly)


@dataclass(frozen=True)
class Channels:
    """An assembly's channels.

    Parameters
    ----------
    name
        Name of the assembly.
    channels
        Signals that faults can corrupt, in addition to the assembly's demands.
    """

    name: str
    channels: tuple[Channel, ...]


CHANNELS = Kind("channel", ("faults",), instances(Channels))
"""every assembly's channels, by the assembly's name"""
FAULTS = Kind("fault", ("faults",), instances(Fault))
"""failures that change several parameters of a brake"""
