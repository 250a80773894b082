"""Fit of a replay: figures over segments of a record, compared with tolerances."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Limit, Verdict, parted, read_limit, verdict_of
from bywire.bench.step_error import with_step_errors
from bywire.core import units
from bywire.core.callers import option
from bywire.core.errors import (
    InputError,
    ParameterError,
    counted,
    not_valid,
    unknown_name,
)
from bywire.core.quantities import Unit
from bywire.core.section import Hint, Section
from bywire.core.typing import Array
from bywire.data.alignment import resample
from bywire.data.toml_file import read_toml

if TYPE_CHECKING:
    import xarray as xr

_LEAST = 8  # samples in which two shifted signals must overlap to be compared


@dataclass(frozen=True)
class Lag:
    """Lag of one signal behind another.

    Parameters
    ----------
    value
        Delay of the second signal behind the first [s].
    correlation
        Correlation coefficient at that lag, -1 to 1; negative for signals of opposite sign.
    at_limit
        Whether the lag is at the end of the search range, and is therefore not valid.
    """

    value: float
    correlation: float
    at_limit: bool


def estimate_lag(
    measurement: xr.Dataset,
    first: str,
    second: str,
    *,
    largest: str | float = 0.1,
    interval: str | float | None = None,
) -> Lag:
    """Estimate the lag of one signal behind another that measured the same event.

    bywire computes the correlation coefficient over the overlap at every whole sample, and then
    refines its maximum magnitude between samples with a cubic spline through the second signal.

    Parameters
    ----------
    measurement
        Result of `read_measurement`.
    first, second
        Names of two signals of the same event.
    largest
        Maximum lag in both directions, text with a unit or [s].
    interval
        Step of the comparison, text with a unit or [s]; by default that of the signal with fewer
        samples.

    Raises
    ------
    ParameterError
        When a signal does not move, has gaps, or the overlap is too short for such a lag.
    UnknownNameError
        For an unknown signal.

    Notes
    -----
    A difference between the sensors' time constants is also treated as lag. To remove a lag,
    specify it as ``delay`` in the mapping of the second signal.
    """
    reach = units.parse(largest, "s", "largest")
    if interval is None:
        aligned = resample(measurement, _coarsest(measurement, first, second), [first, second])
    else:
        aligned = resample(measurement, interval, [first, second])
    step = aligned.report.interval
    a, b = (aligned.dataset[name].values for name in (first, second))
    for name, values in ((first, a), (second, b)):
        if np.isnan(values).any():
            raise ParameterError(
                f"{name} has gaps or missing values. Select a part without them, for example "
                "measurement.sel(time=slice(0, 10))",
                name=name,
            )
        if np.ptp(values) == 0.0:
            raise ParameterError(f"{name} does not change, so it has no lag", name=name)
    most = int(np.ceil(reach / step))
    if not most >= 1 or a.size - most < _LEAST:
        overlap = f"leave an overlap of {_LEAST} steps in {a.size * step:g} s"
        raise not_valid("largest", f"{reach:g} s", f"at least one step, {step:g} s, and {overlap}")
    rough = _coefficients(a, b, most)
    k = int(np.argmax(np.abs(rough)))
    shift, coefficient = _refined(a, b, k - most, float(np.sign(rough[k])))
    return Lag(shift * step, coefficient, k in (0, 2 * most))


def _coarsest(measurement: xr.Dataset, first: str, second: str) -> float:
    """Return the longer of the median steps of two signals [s]."""
    steps = []
    for name in (first, second):
        if name not in measurement.data_vars:
            raise unknown_name("signal", name, map(str, measurement.data_vars))
        (dim,) = measurement[name].dims
        steps.append(float(np.median(np.diff(measurement[dim].values))))
    return max(steps)


def _coefficients(a: NDArray[np.float64], b: NDArray[np.float64], most: int) -> NDArray[np.float64]:
    """Return the correlation coefficients over the overlap at shifts of -most to most samples."""
    a, b = a - a.mean(), b - b.mean()
    n = a.size
    shifts = np.arange(-most, most + 1)

    def summed(x: NDArray[np.float64], shift: NDArray[np.intp]) -> NDArray[np.float64]:
        """Sum of x[i] over all i for which i + shift also exists."""
        up_to = np.concatenate([[0.0], np.cumsum(x)])
        return np.asarray(up_to[np.minimum(n, n - shift)] - up_to[np.maximum(0, -shift)])

    count = n - np.abs(shifts)
    sum_a, sum_b = summed(a, shifts), summed(b, -shifts)
    var_a = summed(a**2, shifts) - sum_a**2 / count
    var_b = summed(b**2, -shifts) - sum_b**2 / count
    size = _quick_length(n + most)  # long enough that no requested shift wraps around
    spectrum = np.fft.rfft(b, size) * np.fft.rfft(a, size).conj()
    both = np.fft.irfft(spectrum, size)[shifts]
    floor = 1e-12 * max(float((a**2).sum()), 1e-300) * max(float((b**2).sum()), 1e-300)
    product = np.maximum(var_a * var_b, floor)
    return np.asarray((both - sum_a * sum_b / count) / np.sqrt(product))


def _quick_length(least: int) -> int:
    """Return a length >= ``least`` with a fast transform: 2^k times 1, 3, 5, 9 or 15."""
    return min(m << max(math.ceil(math.log2(least / m)), 0) for m in (1, 3, 5, 9, 15))


def _refined(
    a: NDArray[np.float64], b: NDArray[np.float64], shift: int, sign: float
) -> tuple[float, float]:
    """Return shift in samples and coefficient at the maximum near a whole shift."""
    from scipy.optimize import minimize_scalar

    n = a.size
    slope = _spline_slopes(b)
    first, last = max(0, 1 - shift), min(n, n - 1 - shift)

    def later(s: float) -> NDArray[np.float64]:
        """Return the second signal, s samples later than the first."""
        whole = min(max(math.floor(s), shift - 1), shift)
        left, right = (slice(first + k, last + k) for k in (whole, whole + 1))
        t, r = s - whole, 1.0 - s + whole
        points = (1.0 + 2.0 * t) * r**2 * b[left] + (1.0 + 2.0 * r) * t**2 * b[right]
        return np.asarray(points + t * r * (r * slope[left] - t * slope[right]))

    def loss(s: float) -> float:
        return -sign * _correlation(a[first:last], later(s))

    peak = minimize_scalar(
        loss, bounds=(shift - 1.0, shift + 1.0), method="bounded", options={"xatol": 1e-6}
    )
    return float(peak.x), -sign * float(peak.fun)


def _spline_slopes(b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the slopes per sample of the not-a-knot cubic spline through a signal.

    (de Boor, A Practical Guide to Splines, 1978, chapter IV; SciPy's spline is slow to load.)
    """
    from scipy.linalg import solve_banded

    rise = np.diff(b)
    right = np.empty_like(b)
    right[1:-1] = 3.0 * (rise[1:] + rise[:-1])
    right[0], right[-1] = 2.5 * rise[0] + 0.5 * rise[1], 2.5 * rise[-1] + 0.5 * rise[-2]
    diagonals = np.ones((3, b.size))
    diagonals[1, 1:-1] = 4.0
    diagonals[0, 1] = diagonals[2, -2] = 2.0
    return np.asarray(solve_banded((1, 1), diagonals, right))


def _correlation(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the correlation coefficient; 0 if one of the signals does not change."""
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0.0 else 0.0


# --- Segments of a record

_STEADY = 0.02  # of the demand's range: maximum change of a demand that holds, over a window
_WINDOW = 0.1  # s
_MOST = 60
_Limits = Annotated[
    Mapping[str, str], Field(default_factory=dict), Hint("write a string, '<= 5 %'")
]
_Instant = Annotated[float, Unit("s"), Hint('for example, write start = "1 s", stop = "2 s"')]


class SegmentSection(Section):
    """A section ``[segments.NAME]``."""

    start: _Instant
    stop: _Instant
    tolerances: _Limits


class SegmentFile(Section):
    """A file of segments."""

    segments: Annotated[Mapping[str, SegmentSection], Field(default_factory=dict)]
    tolerances: _Limits


@dataclass(frozen=True)
class Segment:
    """A segment of a record.

    Parameters
    ----------
    name
        Name in reports.
    start, stop
        Ends on the measurement's clock [s].
    tolerances
        Figure, or ``SIGNAL.FIGURE`` -> limits, such as ``{"nrmse": "<= 5 %"}`` or
        ``{"lag": ">= -1 ms and <= 5 ms"}``.
    """

    name: str
    start: float
    stop: float
    tolerances: Mapping[str, str] = field(default_factory=dict)


def whole_record(time: Array, tolerances: Mapping[str, str]) -> list[Segment]:
    """Return the record as one segment."""
    return [Segment("whole", float(time[0]), float(time[-1]), dict(tolerances))]


def found_in(demand: xr.DataArray, tolerances: Mapping[str, str]) -> list[Segment]:
    """Return the segments in which a demand holds, and those in which it moves.

    It holds while it has changed by less than 2 % of its range within the last 0.1 s, so the
    response within 0.1 s after a step belongs to the step. Shorter segments join the previous one.

    Raises
    ------
    ParameterError
        When there are too many segments to review.
    """
    time, values = demand["time"].values, demand.values
    interval = float(np.median(np.diff(time)))
    width = max(round(_WINDOW / interval), 1)
    change = np.abs(values - np.pad(values, (width, 0), mode="edge")[: values.size])
    moving = change > _STEADY * max(float(np.ptp(values)), 1e-300)
    edges = np.flatnonzero(np.diff(moving.astype(int))) + 1
    ends = [0, *edges.tolist(), values.size - 1]
    merged = [ends[0]]
    for end in ends[1:-1]:
        if (end - merged[-1]) * interval >= _WINDOW:
            merged.append(end)
    if len(merged) > 1 and (ends[-1] - merged[-1]) * interval < _WINDOW:
        merged.pop()
    merged.append(ends[-1])
    if len(merged) - 1 > _MOST:
        raise ParameterError(
            f"the demand {demand.name} changes between holding and moving {len(merged) - 1} times. "
            f"List the relevant segments in a file ({option('segments')} FILE)",
            name="segments",
        )
    counts = {"hold": 0, "move": 0}
    segments = []
    for a, b in pairwise(merged):
        kind = "move" if moving[a:b].mean() > 0.5 else "hold"
        counts[kind] += 1
        segments.append(
            Segment(f"{kind}-{counts[kind]}", float(time[a]), float(time[b]), dict(tolerances))
        )
    return segments


def read_segments(path: str | Path, tolerances: Mapping[str, str]) -> list[Segment]:
    """Read a file of segments.

    Parameters
    ----------
    path
        TOML file with a section ``[segments.NAME]`` for each, with ``start``, ``stop`` and
        ``tolerances``; a section ``[tolerances]`` applies to all.
    tolerances
        Tolerances for all segments; those in the file take precedence.

    Raises
    ------
    FileError
        When the file cannot be read or is not valid TOML.
    InputError
        For content that is not valid.
    """
    file = Path(path)
    content = read_toml(file, "file of segments")
    try:
        return _from(content, tolerances)
    except InputError as error:
        raise error.reworded(f"{file}: {error}") from None


def _from(content: Mapping[str, Any], tolerances: Mapping[str, str]) -> list[Segment]:
    file = SegmentFile.read(content, "a file of segments")
    if not file.segments:
        raise ParameterError(
            "segments is empty. Add [segments.NAME] with start and stop", name="segments"
        )
    shared = {**tolerances, **file.tolerances}
    segments = []
    for name, section in file.segments.items():
        if not section.start < section.stop:
            raise ParameterError(f"[segments.{name}]: start must be before stop", name=name)
        limits = {**shared, **section.tolerances}
        segments.append(Segment(name, section.start, section.stop, limits))
    return segments


# --- Tolerances
# Errors may have either sign. If a signed figure has only an upper limit, it limits the magnitude.

SIGNED = ("bias", "lag")
"""figures that may be negative"""
_BOTH = re.compile(r"\s+and\s+")


def read_tolerances(texts: Sequence[str]) -> dict[str, str]:
    """Return all limits of each figure.

    Raises
    ------
    ParameterError
        When a text lacks a figure, a comparison or a limit.

    Examples
    --------
    >>> read_tolerances(["lag >= -1 ms", "nrmse <= 5 %", "lag <= 5 ms"])
    {'lag': '>= -1 ms and <= 5 ms', 'nrmse': '<= 5 %'}
    """
    limits: dict[str, str] = {}
    for text in texts:
        name, compare, bound = parted(text)
        if compare is None or not name or not bound:
            raise ParameterError(
                f"{option('tolerances')} {text!r} is not valid. For example, use 'nrmse <= 5 %' or "
                "'p_mc.max_error <= 2 bar'",
                name="tolerances",
                value=text,
            )
        limit = f"{compare} {bound}"
        limits[name] = f"{limits[name]} and {limit}" if name in limits else limit
    return limits


def judge_fit(
    tolerances: Mapping[str, str], signal: str, kpis: Sequence[Kpi]
) -> tuple[Verdict, ...]:
    """Compare the figures of one signal with the limits that apply to it.

    Parameters
    ----------
    tolerances
        Figure, or ``SIGNAL.FIGURE``, which takes precedence -> limits, joined by ``and``. An upper
        limit of ``bias`` or ``lag`` without a lower one limits the magnitude.
    signal, kpis
        Name and figures.

    Raises
    ------
    ParameterError
        When a limit is not valid, or no magnitude can meet it.
    UnitError
        When its unit has another dimension than the figure.
    """
    by_name = {kpi.name: kpi for kpi in kpis}
    wanted = {key: key for key in tolerances if "." not in key}
    for key in tolerances:
        if key.startswith(f"{signal}."):
            wanted[key.removeprefix(f"{signal}.")] = key
    return tuple(
        verdict_of(limit, by_name[name])
        for name, key in wanted.items()
        for limit in _limits(key, tolerances[key], by_name[name])
    )


def _require_known(tolerances: Mapping[str, str], figures: Mapping[str, Sequence[Kpi]]) -> None:
    """Reject tolerances of unknown figures or signals.

    Parameters
    ----------
    figures
        Figures by signal.

    Raises
    ------
    UnknownNameError
        With the nearest names.
    """
    names = [f"{name}.{k.name}" for name, kpis in figures.items() for k in kpis]
    known = dict.fromkeys([*(name.rpartition(".")[2] for name in names), *names])
    for name in tolerances:
        if name not in known:
            raise unknown_name("figure", name, known)


def _limits(key: str, text: str, kpi: Kpi) -> list[Limit]:
    limits = [read_limit(key, limit, kpi.unit, "tolerance") for limit in _BOTH.split(text.strip())]
    if kpi.name not in SIGNED or not all(limit.is_upper for limit in limits):
        return limits
    for limit in limits:
        if limit.bound < 0.0:
            raise ParameterError(
                f"tolerance {limit} applies to the magnitude, which is never negative. Add a "
                f"lower limit such as '{key} >= ...' to make both limits signed",
                name=key,
            )
    return [replace(limit, of_magnitude=True) for limit in limits]


# --- The fit

_LARGEST_LAG = 0.25  # of a segment
_FIRST_LAG = 8.0  # samples
_NO_LAG = 1e-3  # samples: rounding of zero lag


@dataclass(frozen=True)
class SegmentFit:
    """Fit of one signal over one segment.

    Parameters
    ----------
    segment, signal
        Segment, and name of the signal.
    kpis
        Its figures.
    verdicts
        Verdicts of its tolerances.
    """

    segment: Segment
    signal: str
    kpis: tuple[Kpi, ...]
    verdicts: tuple[Verdict, ...]


def fit_figures(pair: xr.Dataset, segment: Segment) -> tuple[Kpi, ...]:
    """Return the figures of one signal over one segment.

    Parameters
    ----------
    pair
        ``measured`` and ``modeled`` over ``time`` [s]; samples with NaN are not compared.
    segment
        The segment.

    Returns
    -------
    tuple of Kpi
        ``rmse``, ``nrmse`` (over the range of the whole record), ``vaf`` (variance accounted
        for), ``max_error``, ``bias``, ``lag`` (model behind measurement, by correlation).

    Raises
    ------
    ParameterError
        When the segment extends beyond the record, or contains fewer than two samples.
    """
    _require_within(pair["time"].values, segment)
    part = pair.sel(time=slice(segment.start - 1e-9, segment.stop + 1e-9))
    y, m = part["measured"].values, part["modeled"].values
    there = np.isfinite(y) & np.isfinite(m)
    if there.sum() < 2:
        raise ParameterError(
            f"segment {segment.name!r}, {segment.start:g} to {segment.stop:g} s, contains "
            f"{counted(int(there.sum()), 'sample')}, but at least two are needed",
            name=segment.name,
        )
    y, m = y[there], m[there]
    error = m - y
    whole = pair["measured"].values[np.isfinite(pair["measured"].values)]
    span, unit = float(np.ptp(whole)), str(pair["measured"].attrs.get("units", "1"))
    off = units.difference_unit(unit)
    rmse = float(np.sqrt(np.mean(error**2)))
    variance = float(np.var(y)) if np.ptp(y) else 0.0  # not the rounding errors
    lag, lag_note = _lag(part, there)
    still = "the measured signal does not change"
    return (
        Kpi("rmse", rmse, off, "Root mean square of modeled minus measured."),
        Kpi(
            "nrmse",
            100.0 * rmse / span if span else math.nan,
            "%",
            "Root mean square error, relative to the measured range of the whole record.",
            "" if span else still,
        ),
        Kpi(
            "vaf",
            100.0 * (1.0 - float(np.var(error)) / variance) if variance else math.nan,
            "%",
            "Variance accounted for: 1 minus the ratio of error variance to measured variance.",
            "" if variance else still,
        ),
        Kpi("max_error", float(np.abs(error).max()), off, "Maximum magnitude of the error."),
        Kpi("bias", float(error.mean()), off, "Mean of modeled minus measured."),
        Kpi(
            "lag", lag, "s", "Delay of the model behind the measurement, by correlation.", lag_note
        ),
    )


def _require_within(time: Array, segment: Segment) -> None:
    """Reject a segment that extends beyond the record by more than a sample."""
    first, last = float(time[0]), float(time[-1])
    spare = 1.001 * float(np.median(np.diff(time)))
    if segment.start < first - spare or segment.stop > last + spare:
        raise ParameterError(
            f"segment {segment.name!r}, {segment.start:g} to {segment.stop:g} s, extends beyond "
            f"the record, which covers {first:.6g} to {last:.6g} s. Correct its start or stop",
            name=segment.name,
        )


def _lag(part: xr.Dataset, there: NDArray[np.bool_]) -> tuple[float, str]:
    """Return the lag of best correlation nearest to zero, and a note.

    A periodic signal repeats after a period, so the range of lags grows until it contains a peak.
    """
    if not there.all():
        return math.nan, "the measured signal has gaps"
    t = part["time"].values
    step, most = float(t[1] - t[0]), _LARGEST_LAG * float(t[-1] - t[0])
    reach = max(_FIRST_LAG * step, 0.02 * most)
    while reach < most:
        try:
            peak = estimate_lag(part, "measured", "modeled", largest=reach, interval=step)
        except ParameterError as error:
            return math.nan, str(error)
        if not peak.at_limit and peak.correlation > 0.0:
            value = peak.value if abs(peak.value) > _NO_LAG * step else 0.0
            return value, f"correlation {peak.correlation:.4f}"
        reach *= 2.0
    return math.nan, "the correlation has no distinct peak"


def judged(
    outputs: Mapping[str, xr.Dataset],
    segments: Sequence[Segment],
    others: Mapping[float, Mapping[str, xr.Dataset]] = MappingProxyType({}),
) -> tuple[SegmentFit, ...]:
    """Return the figures of all signals over all segments, with the verdicts.

    ``others`` contains results at other steps, by step length relative to the run's. With these,
    figures have an error from the step. The verdict is undecided if the tolerance is closer than
    this error.

    A tolerance named ``nrmse`` applies to every signal, ``p_mc.nrmse`` to one;
    `bywire.identification.replay_fit.judge_fit` reads the limits.

    Raises
    ------
    ParameterError, UnitError
        When a limit is not valid, or a segment extends beyond the record.
    UnknownNameError
        When a tolerance names an unknown figure or signal.
    """
    fits = []
    for segment in segments:
        figures = {name: fit_figures(pair, segment) for name, pair in outputs.items()}
        _require_known(segment.tolerances, figures)
        for name, kpis in figures.items():
            if others:
                in_others = {f: fit_figures(made[name], segment) for f, made in others.items()}
                kpis = with_step_errors(kpis, in_others, {})
            verdicts = judge_fit(segment.tolerances, name, kpis)
            fits.append(SegmentFit(segment, name, kpis, verdicts))
    return tuple(fits)


def undefined(fits: Sequence[SegmentFit]) -> tuple[str, ...]:
    """Return the reasons why figures are undefined, one sentence each."""
    where: dict[tuple[str, str, str], list[str]] = {}
    for fit in fits:
        for kpi in fit.kpis:
            if math.isnan(kpi.value):
                where.setdefault((kpi.name, fit.signal, kpi.note), []).append(fit.segment.name)
    return tuple(
        f"{figure} of {signal} is not defined in {', '.join(segments)}: {reason}"
        for (figure, signal, reason), segments in where.items()
    )
