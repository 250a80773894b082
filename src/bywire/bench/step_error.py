"""How far a run's results are from those of ever shorter steps: the same runs in other steps.

The scheme is of second order: a figure of steps h is off by c h^2, and differs from that of steps
f h by c h^2 |1 - f^2|. Half and double steps show whether a figure does converge so: both
differences then have the same sign, and one is four times the other. Then each tells the error, and
the larger estimate counts.

Where friction, contacts and chaos decide, the differences show no order, and any of them may be
small by chance. The figures of all steps are then draws of one scatter: about as far as they are
apart, the run is off. So that chance needs more draws to deceive, the bench also runs in a step
close to its own. The error is the scale of which 95 % of the true errors are within three.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from bywire.bench.kpis.kpi import Kpi
from bywire.core.errors import RunError, StepError, WorkLimitError
from bywire.core.typing import Array
from bywire.simulation.run import Run

OTHER_STEPS = (0.5, 2.0)
"""other steps over that of the run, which show an order"""
MOST_WORK = 5.0
"""work of a run in other steps, over that of the run, at which its estimate is abandoned"""
NO_ESTIMATE = (StepError, RunError)
"""what runs in other steps may end with: no divisor of a sample time, or too coarse"""
ROUNDING = 1e-11
"""rounding of many steps, over the largest value of a signal"""
_STEPS = {0.5: "half the step", 2.0: "twice the step"}
_ORDER, _OFF = 2.0, 0.3  # of the scheme; what an observed order may differ by
SPREAD = {3: 1.72, 4: 1.29}
"""draws -> a third of the 0.95 quantile of |x_1 - x| / s, of equal normal draws x_1 ... x_n with
standard deviation s, and one more, x"""
_SAME = 1e-10  # s, between a time and that of the row where it was read


def of_difference(factor: float, order: int = 2) -> float:
    """Return the error of steps h over the difference to steps ``factor`` h.

    Examples
    --------
    >>> round(of_difference(0.5), 4), round(of_difference(2.0), 4)
    (1.3333, 0.3333)
    """
    return 1.0 / abs(1.0 - factor**order)


def unestimated(failures: Mapping[float, Exception]) -> str:
    """Return the warning that no other step ran, by why each, over that of the run, did not."""
    because = "; ".join(f"{factor:g} of the step: {e}" for factor, e in failures.items())
    return (
        "how far the figures are off by the step is not known: the bench runs in neither half nor "
        f"double steps ({because})"
    )


def abandoned(failures: Mapping[float, Exception]) -> str:
    """Return the note that the run in some other step was given up; empty where none was."""
    steps = [
        _STEPS.get(factor, f"{factor:.3g} of the step")
        for factor, error in failures.items()
        if isinstance(error, WorkLimitError)
    ]
    if not steps:
        return ""
    return (
        f"the error estimate from {' and '.join(steps)} was abandoned: it took more than "
        f"{MOST_WORK:g} times the work of the run itself"
    )


def are_distinct(values: Sequence[float], errors: Sequence[float]) -> bool:
    """Return whether values differ by more than they may be off: any two of them are enough.

    Errors that were not estimated (NaN) count as none. What is not defined (NaN) differs from what
    is, unless an error is infinite.

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
    """Return key figures with the error that they have from the step.

    Parameters
    ----------
    kpis
        Figures of the runs.
    others
        The same figures in other steps, by their length over that of the runs.
    recordings
        The runs: a difference of large forces, all but zero, is no better than their rounding, and
        a time that is one of a row was read there, at most an interval away from its event.

    Returns
    -------
    tuple of Kpi
        With ``error`` in the unit of each; infinite where not every step defines a figure.
    """
    intervals = _intervals(recordings)
    rounding = {unit: ROUNDING * peak for unit, peak in _peaks(recordings).items()}
    by_name = {factor: {each.name: each.value for each in made} for factor, made in others.items()}

    def estimated(kpi: Kpi) -> Kpi:
        values = {factor: known[kpi.name] for factor, known in by_name.items()}
        least = rounding.get(kpi.unit, 0.0)
        error, converges = _estimate(kpi.value, values, max(least, ROUNDING * abs(kpi.value)))
        reading = _reading(kpi.value, intervals) if kpi.unit == "s" else 0.0
        return replace(kpi, error=error + least + reading, converges=converges)

    return tuple(map(estimated, kpis))


def steps_of(runs: Iterable[Run]) -> tuple[float, ...]:
    """Return other steps over that of some runs: those that show an order, and one close to it.

    The latter has one substep more in the longest interval that divides all sample times; there is
    none where that interval has a single substep.
    """
    count = math.gcd(*(run.schedule().substeps for run in runs))
    return (*OTHER_STEPS, count / (count + 1)) if count > 1 else OTHER_STEPS


def note_step_errors(
    recordings: Mapping[str, xr.Dataset], others: Mapping[float, Mapping[str, xr.Dataset]]
) -> None:
    """Write into each recorded signal how large its error from the step is.

    The attributes ``step_error_rms`` and ``step_error_max`` [the signal's unit] are over all rows
    of the recording. A signal that jumps, such as a duty cycle, may be far off for a row where
    the jump falls into another one, and right on average.

    Parameters
    ----------
    recordings
        The runs, by label; their signals' attributes are set.
    others
        The same in other steps, by their length over that of the runs; those close to one tell
        too little.
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


def _estimate(value: float, others: Mapping[float, float], rounding: float) -> tuple[float, bool]:
    """Return the error of a figure, and whether it converges.

    ``others``: the figure in other steps, by their length over that of ``value``; ``rounding``:
    differences that mean nothing.
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
    """Return whether differences to half and double steps are those of the scheme's order."""
    if not all(factor in others for factor in OTHER_STEPS):
        return False
    fine, coarse = others[0.5] - value, value - others[2.0]
    return fine * coarse > 0.0 and abs(math.log2(coarse / fine) - _ORDER) <= _OFF


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def _peaks(recordings: Mapping[str, xr.Dataset]) -> dict[str, float]:
    """Return the largest magnitude of all signals of each unit but the pure number's."""
    peaks: dict[str, float] = {}
    for recording in recordings.values():
        for signal in recording.values():
            unit = str(signal.attrs.get("units", "1"))
            if signal.size and unit != "1":
                peaks[unit] = max(float(np.max(np.abs(signal.values))), peaks.get(unit, 0.0))
    return peaks


def _intervals(recordings: Mapping[str, xr.Dataset]) -> set[float]:
    """Return the intervals of the rows [s]."""
    times = [r["time"].values for r in recordings.values() if r.sizes.get("time", 0) > 1]
    return {float(t[-1] - t[0]) / (t.size - 1) for t in times}


def _reading(time: float, intervals: Iterable[float]) -> float:
    """Return how far an event may be from its time [s]: zero unless that is one of a row."""
    if not math.isfinite(time) or abs(time) < _SAME:  # what begins with the run is exact
        return 0.0
    at_rows = (each for each in intervals if abs(math.remainder(time, each)) < _SAME)
    return max(at_rows, default=0.0)


def _apart(value: float, other: float) -> float:
    if math.isnan(value) or math.isnan(other):
        return math.nan if math.isnan(value) and math.isnan(other) else math.inf
    return abs(value - other)
