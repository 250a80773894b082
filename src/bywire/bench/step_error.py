"""Numerical error due to the step, estimated from the same run with other steps.

The scheme is of second order: a figure with step h has an error of c h^2. It differs from the
figure with step f h by c h^2 |1 - f^2|. Half and double steps show whether a figure converges in
this way: both differences then have the same sign, and one is four times the other. Each difference
then gives an estimate of the error, and the larger estimate counts.

If friction, contacts or chaos dominate, the differences show no order, and any of them may be small
by chance. The figures with all steps are then samples of one distribution, and their spread
measures the error. An additional step close to the bench's own makes a spread that is small by
chance less likely. The error is then a scale: 95 % of the true errors are below three times it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.kpis.kpi import Kpi
from bywire.core.errors import RunError, StepError, WorkLimitError
from bywire.core.typing import Array
from bywire.simulation.run import Run

if TYPE_CHECKING:
    import xarray as xr

OTHER_STEPS = (0.5, 2.0)
"""ratios of other steps to the run's step, which show the order"""
MOST_WORK = 5.0
"""work relative to the original run, above which a run with another step is abandoned"""
NO_ESTIMATE = (StepError, RunError)
"""errors of runs with other steps: the step does not divide a sample time, or is too coarse"""
ROUNDING = 1e-11
"""accumulated rounding error, relative to the maximum of a signal"""
_STEPS = {0.5: "half the step", 2.0: "twice the step"}
_ORDER, _OFF = 2.0, 0.3  # order of the scheme, and maximum deviation of an observed order
SPREAD = {3: 1.72, 4: 1.29}
"""number of samples n -> a third of the 0.95 quantile of |x_1 - x| / s, where x_1 ... x_n and x are
independent samples of one normal distribution, and s is the standard deviation of x_1 ... x_n"""
_SAME = 1e-10  # s, maximum difference between a time and that of its row


def of_difference(factor: float, order: int = 2) -> float:
    """Return the ratio of the error with step h to the difference to step ``factor`` h.

    Examples
    --------
    >>> round(of_difference(0.5), 4), round(of_difference(2.0), 4)
    (1.3333, 0.3333)
    """
    return 1.0 / abs(1.0 - factor**order)


def unestimated(failures: Mapping[float, Exception]) -> str:
    """Return the warning that the bench runs with no other step, and the reason for each ratio."""
    reasons = ", ".join(f"{_share(factor)}: {error}" for factor, error in failures.items())
    return (
        "the numerical error of the key figures is unknown because the bench runs neither with "
        "half "
        f"the step nor with twice the step ({reasons})"
    )


def abandoned(failures: Mapping[float, Exception]) -> str:
    """Return the note on runs with other steps that were abandoned; empty if there are none."""
    steps = [
        _share(factor) for factor, error in failures.items() if isinstance(error, WorkLimitError)
    ]
    if not steps:
        return ""
    return (
        f"bywire abandoned the error estimate from {' and '.join(steps)}, which needed more than "
        f"{MOST_WORK:g} times the work of the run itself"
    )


def _share(factor: float) -> str:
    return _STEPS.get(factor, f"{factor:.3g} of the step")


def are_distinct(values: Sequence[float], errors: Sequence[float]) -> bool:
    """Return whether any two values differ by more than their errors.

    Errors that were not estimated (NaN) are treated as zero. An undefined value (NaN) differs from
    a defined one, unless an error is infinite.

    Examples
    --------
    >>> are_distinct([1.0, 1.1], [0.06, 0.06]), are_distinct([1.0, 1.1], [0.06, 0.01])
    (False, True)
    """
    each = np.asarray(values, dtype=float)
    off = np.nan_to_num(np.asarray(errors, dtype=float), nan=0.0, posinf=np.inf)
    if np.isnan(each).any():
        return not np.isnan(each).all() and bool(np.isfinite(off).all())
    return bool(np.max(each - off) > np.min(each + off))


def with_step_errors(
    kpis: Sequence[Kpi],
    others: Mapping[float, Sequence[Kpi]],
    recordings: Mapping[str, xr.Dataset],
) -> tuple[Kpi, ...]:
    """Return key figures with their numerical error.

    Parameters
    ----------
    kpis
        Figures of the runs.
    others
        The same figures with other steps, by the ratio of the steps.
    recordings
        Recordings of the runs. They determine the rounding error of figures that are small
        differences of large values, and the error of times that were read at a row.

    Returns
    -------
    tuple of Kpi
        Figures with ``error`` in their unit, infinite if a figure is undefined with another step.
    """
    intervals = _intervals(recordings)
    rounding = {unit: ROUNDING * peak for unit, peak in peaks_of(recordings).items()}
    by_name = {factor: {each.name: each.value for each in made} for factor, made in others.items()}

    def estimated(kpi: Kpi) -> Kpi:
        values = {factor: known[kpi.name] for factor, known in by_name.items()}
        least = rounding.get(kpi.unit, 0.0)
        error, converges = estimate(kpi.value, values, max(least, ROUNDING * abs(kpi.value)))
        reading = reading_error(kpi.value, intervals) if kpi.unit == "s" else 0.0
        return replace(kpi, error=error + least + reading, converges=converges)

    return tuple(map(estimated, kpis))


def steps_of(runs: Iterable[Run]) -> tuple[float, ...]:
    """Return the ratios of other steps to that of some runs: `OTHER_STEPS`, and one close to 1.

    The latter has one more substep in the longest interval that divides all sample times. It is
    left out if that interval has a single substep.
    """
    count = math.gcd(*(run.schedule().substeps for run in runs))
    return (*OTHER_STEPS, count / (count + 1)) if count > 1 else OTHER_STEPS


def note_step_errors(
    recordings: Mapping[str, xr.Dataset], others: Mapping[float, Mapping[str, xr.Dataset]]
) -> None:
    """Write the numerical error of each recorded signal into its attributes.

    The attributes ``step_error_rms`` and ``step_error_max`` [the signal's unit] cover all rows of
    the recording. A signal that jumps, such as a duty cycle, may be correct on average although a
    single row has a large error, because the jump falls into another row.

    Parameters
    ----------
    recordings
        Recordings by label; the attributes of their signals are set.
    others
        The same recordings with other steps, by the ratio of the steps. Ratios close to 1 are not
        used.
    """
    for label, recording in recordings.items():
        for name, signal in recording.items():
            if signal.dims != ("time",):
                continue
            y = signal.values.astype(float)
            errors = [
                of_difference(factor) * (y - made[label][name].values)
                for factor, made in others.items()
                if factor in OTHER_STEPS
            ]
            signal.attrs["step_error_rms"] = max(map(_rms, errors))
            signal.attrs["step_error_max"] = max(float(np.max(np.abs(e))) for e in errors)


def estimate(value: float, others: Mapping[float, float], rounding: float) -> tuple[float, bool]:
    """Return the error of a figure due to the step, and whether it converges.

    Parameters
    ----------
    value
        The figure.
    others
        The figure with other steps, by the ratio of the steps.
    rounding
        Maximum difference that rounding alone explains.
    """
    apart = {factor: _apart(value, other) for factor, other in others.items()}
    if any(not math.isfinite(each) for each in apart.values()):
        return (math.inf if math.inf in apart.values() else math.nan), True
    ordered = [of_difference(factor) * apart[factor] for factor in OTHER_STEPS if factor in apart]
    if max(apart.values()) <= rounding or _shows_order(value, others):
        return max(ordered, default=0.0), True
    draws = [value, *others.values()]
    if len(draws) not in SPREAD:
        return max(of_difference(factor) * each for factor, each in apart.items()), False
    return SPREAD[len(draws)] * float(np.std(draws, ddof=1)), False


def _shows_order(value: float, others: Mapping[float, float]) -> bool:
    """Return whether the differences to half and double steps have the scheme's order."""
    if not all(factor in others for factor in OTHER_STEPS):
        return False
    fine, coarse = others[0.5] - value, value - others[2.0]
    return fine * coarse > 0.0 and abs(math.log2(coarse / fine) - _ORDER) <= _OFF


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def peaks_of(recordings: Mapping[str, xr.Dataset]) -> dict[str, float]:
    """Return the maximum magnitude of all signals of each unit, without pure numbers."""
    peaks: dict[str, float] = {}
    for recording in recordings.values():
        for signal in recording.values():
            unit = str(signal.attrs.get("units", "1"))
            if signal.size and unit != "1":
                peaks[unit] = max(float(np.max(np.abs(signal.values))), peaks.get(unit, 0.0))
    return peaks


def _intervals(recordings: Mapping[str, xr.Dataset]) -> set[float]:
    """Return the recording intervals [s]."""
    times = [r["time"].values for r in recordings.values() if r.sizes.get("time", 0) > 1]
    return {float(t[-1] - t[0]) / (t.size - 1) for t in times}


def reading_error(time: float, intervals: Iterable[float]) -> float:
    """Return the error of a time [s]: the interval if it was read at a row, else zero."""
    if not math.isfinite(time) or abs(time) < _SAME:  # the start of the run is exact
        return 0.0
    at_rows = (each for each in intervals if abs(math.remainder(time, each)) < _SAME)
    return max(at_rows, default=0.0)


def _apart(value: float, other: float) -> float:
    if math.isnan(value) or math.isnan(other):
        return math.nan if math.isnan(value) and math.isnan(other) else math.inf
    return abs(value - other)
