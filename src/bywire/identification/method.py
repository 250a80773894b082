"""Identification methods: from a measured experiment to parameters with confidence intervals."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.bench.bench import Bench
from bywire.core.parameters import ParameterSet
from bywire.core.registry import Kind, instances
from bywire.core.typing import Progress
from bywire.identification.estimate import Estimate

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Effort:
    """Effort of a search, and its progress report.

    Parameters
    ----------
    starts
        Number of starts; the first is the parameter set's own.
    spread
        Distance of the others from the first, as a fraction.
    seed
        Seed of their random numbers.
    threads
        Number of threads; all cores by default.
    store
        File that saves finished starts, so that an interrupted search can continue.
    progress
        Callback with a label and the finished share.
    """

    starts: int = 16
    spread: float = 0.3
    seed: int = 1
    threads: int | None = None
    store: Path | None = None
    progress: Progress | None = None


@dataclass(frozen=True)
class Check:
    """A figure of merit that qualifies an identification.

    Parameters
    ----------
    name
        Name of the check.
    value, unit
        The figure, SI.
    limit
        Upper limit (lower, see ``at_least``); None for information only.
    at_least
        Whether the limit is a lower one.
    note
        Meaning of the figure.
    next_step
        Next step if it fails, with the option to type.
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
        """Whether the figure meets the limit."""
        if self.limit is None:
            return True
        return self.value >= self.limit if self.at_least else self.value <= self.limit


@dataclass(frozen=True)
class Curve:
    """Measured and modeled signal, or a characteristic with its band.

    Parameters
    ----------
    name
        File name of the figure.
    caption
        Caption of one sentence.
    data
        Over ``x``: ``measured`` and ``modeled``; or ``value``, ``low`` and ``high``; each may
        have a second dimension with several curves.
    x
        Name of the coordinate along the horizontal axis.
    """

    name: str
    caption: str
    data: xr.Dataset
    x: str


@dataclass(frozen=True)
class Identified:
    """Result of a method.

    Parameters
    ----------
    estimates
        Estimates by group; one entry unless a method estimates in groups.
    parameters
        Dotted name -> value [SI], for ``[set]`` of a bench file; empty if the method's estimates
        are not parameters of the assembly.
    figures
        Further results: name -> (value [SI], unit).
    checks
        Figures that qualify the result.
    curves
        Curves for the report.
    notes
        Notes for the user, such as unused data and assumptions.
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
        Name on the command line.
    assembly
        Assembly whose parameters it estimates; any if empty.
    summary
        One line for listings, with the equations' numbers.
    experiment
        Experiment of the bench that produces such a measurement.
    signals
        Required signals: name -> SI unit; an empty unit allows any.
    options, defaults
        Settings with units and ranges.
    identify
        ``identify(data, par, options, effort) -> Identified``; data has the signals over
        ``time`` [s], evenly spaced. ``par`` is None for a method of any assembly.
    synthetic
        ``synthetic(par, options, seed) -> data``: the experiment simulated, with the sensors'
        noise, in place of a measurement.
    unknowns
        Names of the parameters that it can estimate.
    several
        Whether data may contain several records (see ``bywire.identification.measured``). Each is
        evenly spaced, and the method splits them.
    gaps
        Whether it accepts missing samples (NaN).
    optional
        Signals that it uses if they are measured: name -> SI unit.
    truth
        ``truth(par, options) -> {label: value}``: true values in ``synthetic`` for estimates that
        are not parameters of the assembly.
    further
        Estimates that are not parameters of the assembly: name -> SI unit (empty if it is that of
        the data) and meaning, for listings.
    simulated
        Options that only ``synthetic`` uses.
    bench_note
        Limitation of a bench with the identified values.
    bench
        Bench whose parameters it estimates, if it is for a particular bench.
    key
        Additional text that distinguishes its simulated experiments from those of other methods.
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
"""all methods that do not need a bench"""
