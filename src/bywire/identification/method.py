"""An identification method: measured experiment in, parameters with their confidence out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import xarray as xr

from bywire.bench.bench import Bench
from bywire.core.parameters import ParameterSet
from bywire.core.registry import Kind, instances
from bywire.core.typing import Progress
from bywire.identification.estimate import Estimate


@dataclass(frozen=True)
class Effort:
    """How hard to search, and who watches.

    Parameters
    ----------
    starts
        Number of starts; the first is the parameter set's own.
    spread
        How far the others are away, as a share.
    seed
        Of their random numbers.
    threads
        All cores by default.
    store
        File in which finished starts survive an interrupt.
    progress
        Called with a label and the finished share.
    """

    starts: int = 16
    spread: float = 0.3
    seed: int = 1
    threads: int | None = None
    store: Path | None = None
    progress: Progress | None = None


@dataclass(frozen=True)
class Check:
    """A figure that says whether to believe an identification.

    Parameters
    ----------
    name
        What is checked.
    value, unit
        The figure, SI.
    limit
        What it must not exceed (or fall below, see ``at_least``); None for information.
    at_least
        Whether the limit is a lower one.
    note
        What it means.
    next_step
        What to try next where it fails, with the words to type.
    """

    name: str
    value: float
    unit: str = "1"
    limit: float | None = None
    at_least: bool = False
    note: str = ""
    next_step: str = ""

    @property
    def holds(self) -> bool:
        """Whether the limit is kept."""
        if self.limit is None:
            return True
        return self.value >= self.limit if self.at_least else self.value <= self.limit


@dataclass(frozen=True)
class Curve:
    """Measured beside modeled, or a characteristic with its band.

    Parameters
    ----------
    name
        File name of the figure.
    caption
        What it shows, one sentence.
    data
        Over ``x``: ``measured`` and ``modeled``; or ``value``, ``low`` and ``high``; each may
        have a second dimension that tells several curves.
    x
        Name of the coordinate along the horizontal axis.
    """

    name: str
    caption: str
    data: xr.Dataset
    x: str


@dataclass(frozen=True)
class Identified:
    """What a method found.

    Parameters
    ----------
    estimates
        By what they are of; one entry unless a method estimates in groups.
    parameters
        Dotted name -> value [SI], what a bench file's ``[set]`` takes; empty where a method
        gives no parameters of the assembly.
    figures
        Further results: name -> (value [SI], unit).
    checks
        Whether to believe it.
    curves
        What to look at.
    notes
        What the user should know: data left out, assumptions.
    """

    estimates: Mapping[str, Estimate]
    parameters: Mapping[str, float]
    figures: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    checks: tuple[Check, ...] = ()
    curves: tuple[Curve, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Method:
    """A named method.

    Parameters
    ----------
    name
        What the command line calls it.
    assembly
        Whose parameters it finds; any assembly where empty.
    summary
        One line for listings, with the equations' numbers.
    experiment
        The bench's experiment that gives such a measurement.
    signals
        What must be measured: name -> SI unit; an empty one admits any.
    options, defaults
        Settings with units and ranges.
    identify
        ``identify(data, par, options, effort) -> Identified``; data has the signals over
        ``time`` [s], evenly spaced. ``par`` is None for a method of any assembly.
    synthetic
        ``synthetic(par, options, seed) -> data``: the experiment simulated, with the sensors'
        noise; what stands in for a measurement.
    unknowns
        Names of the parameters that it can find.
    several
        Whether data may hold several records, see ``bywire.identification.measured``: each is
        evenly spaced, and the method splits them.
    gaps
        Whether it takes data in which samples are missing (NaN).
    optional
        What it uses where it is measured: name -> SI unit.
    truth
        ``truth(par, options) -> {label: value}``: what ``synthetic`` puts in, of estimates that
        are no parameters of the assembly.
    further
        Estimates that are no parameters of the assembly: name -> SI unit (empty where it is the
        data's) and meaning, for listings.
    simulated
        Options that nothing but ``synthetic`` uses.
    bench_note
        What a bench with the identified values cannot do.
    bench
        The bench whose parameters it finds, where it was made for one.
    key
        What else tells its simulated experiments from those of other methods.
    """

    name: str
    assembly: str
    summary: str
    experiment: str
    signals: Mapping[str, str]
    options: type[ParameterSet]
    defaults: ParameterSet
    identify: Callable[[xr.Dataset, Any, Any, Effort], Identified]
    synthetic: Callable[[Any, Any, int], xr.Dataset]
    unknowns: tuple[str, ...] = ()
    several: bool = False
    gaps: bool = False
    optional: Mapping[str, str] = field(default_factory=dict)
    truth: Callable[[Any, Any], Mapping[str, float]] | None = None
    further: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    simulated: tuple[str, ...] = ()
    bench_note: str = ""
    bench: Bench | None = None
    key: str = ""


METHODS = Kind(
    "method", ("methods",), instances(Method), "bywire.identification.methods", declared="a Method"
)
"""every method that needs no bench"""
