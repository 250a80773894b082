"""Noise of a bench's measured outputs: given with its unit, or of the record itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.quantities import display_unit
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.core.units import difference_unit, shown
from bywire.core.values import number
from bywire.identification.measured import NOISE_OF_SAMPLES
from bywire.identification.noise import is_told, noise_of, robust_scale
from bywire.identification.output_error import Trial
from bywire.identification.replaying.measured_run import MeasuredRun
from bywire.identification.residuals import by_output

_FINEST = 1.0 / 65536.0  # of a signal's range: what a converter of 16 bits resolves
_FEWEST = 10  # samples
_LEFT = 0.5  # of the noise: a model that leaves less was given too much


def noise_given(name: str, text: str, unit: str) -> float:
    """Return the standard deviation of an output's noise, written with its unit.

    Raises
    ------
    UnitError, ParameterError
        When it is no quantity of that unit, or not > 0.
    """
    noise = number(text, unit, f"noise of {name}")
    if not noise > 0.0:
        raise ParameterError(f"noise of {name} = {text} is not admissible: it must be > 0 {unit}")
    return noise


def output_noise(measured: MeasuredRun, name: str, text: str) -> float:
    """Return the standard deviation of an output's noise, as given or of the record.

    Parameters
    ----------
    measured
        The record.
    name
        Output.
    text
        Its noise; empty for the record's own.

    Raises
    ------
    ParameterError
        When the record does not tell it: too short, or at rest.
    """
    if text:
        return noise_given(name, text, signals_of(measured.case.model.Output)[name].unit)
    there = _finite(measured.data[name])
    if there.size < _FEWEST:
        raise ParameterError(
            f"{name} has {there.size} samples: {_FEWEST} at least are needed to tell its noise"
        )
    span = float(np.ptp(there))
    if not span > 0.0:
        raise ParameterError(
            f"{name} does not move: an output that rests tells nothing; leave it out, or "
            "excite the system"
        )
    # Between uneven samples lie means of two, whose noise is smaller and no longer white.
    before = measured.data[name].attrs.get(NOISE_OF_SAMPLES)
    return max(noise_of(there) if before is None else float(before), _FINEST * span)


def resampled(measured: MeasuredRun) -> bool:
    """Return whether a record's outputs lie between the samples that were measured."""
    return any(NOISE_OF_SAMPLES in measured.data[name].attrs for name in measured.compared)


def overestimated(
    records: Sequence[MeasuredRun],
    trials: Sequence[Trial],
    residuals: Array,
    given: Mapping[str, str],
) -> dict[str, str]:
    """Return the outputs whose noise is not told by their record, with the reason.

    Any model passes beside a noise that is too large.

    Parameters
    ----------
    records, trials
        Records, in the order of the residuals.
    residuals
        What the model leaves, over the noise.
    given
        Noise by output, where it was given.
    """
    runs = {trial.label: measured for measured, trial in zip(records, trials, strict=True)}
    doubtful = {}
    for trial, name, r in by_output(trials, residuals):
        values = _finite(runs[trial.label].data[name])
        if given[name] or trial.noise[name] <= 1.01 * _FINEST * float(np.ptp(values)):
            continue
        left = robust_scale(r)
        even = NOISE_OF_SAMPLES not in runs[trial.label].data[name].attrs
        if even and not is_told(values):
            why = "changes itself from sample to sample"
        elif left < _LEFT:
            why = f"is met by the model within {left:.2g} of that"
        else:
            continue
        unit = difference_unit(signals_of(runs[trial.label].case.model.Output)[name].unit)
        size = shown(float(f"{trial.noise[name]:.3g}"), unit)
        key = f"{trial.label}:{name}" if trial.label else name
        doubtful[key] = (
            f"{key} {why}, {size} is not its noise alone: give it, "
            f'{option("outputs")} "{name}=NOISE {display_unit(unit)}"'
        )
    return doubtful


def _finite(signal: xr.DataArray) -> Array:
    values = np.asarray(signal.values, dtype=float)
    return np.asarray(values[np.isfinite(values)])
