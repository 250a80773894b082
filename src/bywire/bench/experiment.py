"""What an experiment is: the runs that it makes of a brake, and how their recordings are judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.bench.kpis import step_response
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.stimuli.registry import Stimulus
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet

Recordings = Mapping[str, xr.Dataset]


@dataclass(frozen=True)
class Case:
    """One run of an experiment.

    Parameters
    ----------
    label
        What distinguishes the runs of one experiment, for instance ``"with-dither"``.
    model, par
        The system and its parameters, drive mode included.
    state, memory
        Initial values.
    stimulus
        ``stimulus(t) -> dict``: signals of the model's Stimulus at the times t [s] of the
        recording's axis, each of shape (len(t),); what is left out is zero.
    duration
        Length of the recording after time zero [s].
    settle
        Time before zero in which the run settles [s], for instance into a periodic orbit.
    keep
        How much of the settling time the recording keeps [s].
    record
        Recording interval [s].
    """

    label: str
    model: Model
    par: ParameterSet
    state: Any
    memory: Any
    stimulus: Callable[[NDArray[np.float64]], Mapping[str, NDArray[np.float64]]]
    duration: float
    settle: float = 0.0
    keep: float = 0.0
    record: float = 1e-3


@dataclass(frozen=True)
class Experiment:
    """A named virtual test.

    Parameters
    ----------
    name
        What bench files and the command line call it.
    assembly
        Name of the assembly that it tests.
    summary
        One line for listings.
    options
        Class of its options, each with unit and range.
    defaults
        Options as in the source.
    cases
        ``cases(par, options, stimulus)``: the runs it consists of; none for a static
        characteristic. ``stimulus`` is that of the bench file, where the experiment takes one.
    judge
        ``judge(recordings, options)``: its KPIs.
    kpis
        Unit of each of these by name, so that requirements are checked before anything runs.
    figures
        Kinds of figures that show it, names of the report layer.
    finish
        ``finish(recording, options)``: adds derived signals to a recording, in place of it.
    step
        ``step(options)``: what a step response is judged by, for KPIs and figures.
    static
        ``static(par, options)``: recordings of a static characteristic, without any run.
    driven_unit
        ``driven_unit(options)``: SI unit of what a ``[stimulus]`` section drives; None where
        the experiment brings its own stimulus.
    """

    name: str
    assembly: str
    summary: str
    options: type[ParameterSet]
    defaults: ParameterSet
    cases: Callable[[Any, Any, Stimulus | None], tuple[Case, ...]]
    judge: Callable[[Recordings, Any], tuple[Kpi, ...]]
    kpis: Mapping[str, str]
    figures: tuple[str, ...]
    finish: Callable[[xr.Dataset, Any], xr.Dataset] | None = None
    step: Callable[[Any], step_response.Setting] | None = None
    static: Callable[[Any, Any], dict[str, xr.Dataset]] | None = None
    driven_unit: Callable[[Any], str] | None = None


def fixed(**levels: float) -> Callable[[NDArray[np.float64]], Mapping[str, NDArray[np.float64]]]:
    """Return a stimulus that holds constant levels [SI]."""
    return lambda t: {name: np.full(t.shape, value) for name, value in levels.items()}
