"""Signals with different rates, times and delays on one time axis, with a report."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bywire.core import units
from bywire.core.arguments import checked
from bywire.core.errors import ParameterError, not_valid, unknown_name
from bywire.data.channel_quality import (
    AlignedChannel,
    AlignmentReport,
    ChannelQuality,
    Stretch,
    quality,
)
from bywire.data.file_format import room

if TYPE_CHECKING:
    import xarray as xr

METHODS = ("linear", "previous", "nearest", "average")
"""methods for values between samples"""

_Values = Callable[[NDArray[np.float64]], NDArray[np.float64]]

_BLOCK = 1 << 20  # times per chunk, which limits the memory in addition to the result
_SLACK = 1e-9  # intervals: tolerance for rounding of equal times


def resampled(
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    axis: NDArray[np.float64],
    step: float,
    method: str,
) -> NDArray[np.float64]:
    """Return a signal at other times.

    Parameters
    ----------
    time, values
        Increasing times [s] and values there, shape ``(sample,)``; none is NaN.
    axis
        Requested times [s], within those of the signal, shape ``(time,)``.
    step
        Their distance [s].
    method
        One of ``METHODS`` (see `bywire.data.alignment.resample`).

    Returns
    -------
    numpy.ndarray
        Shape ``(time,)``.
    """
    pieces = range(0, axis.size, _BLOCK)
    at = _means(time, values, step) if method == "average" else _samples(time, values, step, method)
    return np.concatenate([at(axis[begin : begin + _BLOCK]) for begin in pieces])


def _samples(
    time: NDArray[np.float64], values: NDArray[np.float64], step: float, method: str
) -> _Values:
    """Return the interpolation between samples as a function."""

    def at(axis: NDArray[np.float64]) -> NDArray[np.float64]:
        before = np.searchsorted(time, axis + _SLACK * step, side="right") - 1
        before = np.clip(before, 0, time.size - 1)
        if method == "linear":
            line = np.asarray(np.interp(axis, time, values))
            # A sample on the axis, except for rounding, keeps its exact value.
            return np.where(np.abs(time[before] - axis) <= _SLACK * step, values[before], line)
        if method == "nearest":
            after = np.minimum(before + 1, time.size - 1)
            before = np.where(time[after] - axis < axis - time[before], after, before)
        return np.asarray(values[before], dtype=np.float64)

    return at


def _means(time: NDArray[np.float64], values: NDArray[np.float64], step: float) -> _Values:
    """Return the mean over a step of the line through the samples, as a function."""
    # Without the mean, sums stay small, and so does their rounding.
    middle = float(values.mean())
    areas = np.diff(time) * (0.5 * (values[1:] + values[:-1]) - middle)
    total = np.concatenate([[0.0], np.cumsum(areas)])

    def at(axis: NDArray[np.float64]) -> NDArray[np.float64]:
        edges = np.append(axis - step / 2.0, axis[-1] + step / 2.0)
        edges = np.clip(edges, time[0], time[-1])
        at_edges = np.interp(edges, time, values)
        k = np.clip(np.searchsorted(time, edges, side="right") - 1, 0, time.size - 2)
        into = (edges - time[k]) * (0.5 * (at_edges + values[k]) - middle)
        return np.asarray(middle + np.diff(total[k] + into) / np.diff(edges))

    return at


# --- Alignment

FLAWS = ("gaps", "missing", "clipped")
"""flaws that can be excluded"""


@dataclass(frozen=True)
class Aligned:
    """Signals on one time axis, with a report."""

    dataset: xr.Dataset
    report: AlignmentReport


@checked
def resample(
    measurement: xr.Dataset,
    interval: str | float,
    signals: Sequence[str] | None = None,
    method: str = "linear",
    *,
    exclude: Iterable[str] = ("gaps", "missing"),
    max_gap: str | float | None = None,
) -> Aligned:
    """Bring signals to one time axis.

    The axis contains the whole multiples of the interval in the overlap of all signals.

    Parameters
    ----------
    measurement
        Result of `read_measurement`: variables with one dimension each, times in s.
    interval
        Step of the axis, text with a unit or [s].
    signals
        Names of the signals; all by default.
    method
        Values between samples: ``"linear"``, ``"previous"`` (held until the next sample) or
        ``"nearest"``; or ``"average"``, the mean of the line through the samples over an interval
        around each time, which reduces aliasing.
    exclude
        Flaws during which the result is NaN: ``"gaps"``, ``"missing"`` (NaN in the file),
        ``"clipped"``. The method bridges gaps that are not excluded.
    max_gap
        Longest interval that is not a gap, text with a unit or [s]; ten median steps by default.

    Returns
    -------
    Aligned
        Dataset with dimension ``time``, and the report.

    Raises
    ------
    ParameterError
        When the interval or the longest pause is not positive, the result would be too large, a
        signal has too few usable values, or signals do not overlap.
    UnknownNameError
        For an unknown signal, method or flaw.
    """
    import pandas as pd  # slow to load, like xarray
    import xarray as xr

    step = _positive(interval, "interval")
    longest = None if max_gap is None else _positive(max_gap, "max_gap")
    left_out = _flaws(exclude)
    if method not in METHODS:
        raise unknown_name("method", method, METHODS)
    names = [str(n) for n in measurement.data_vars] if signals is None else list(signals)
    for name in names:
        if name not in measurement.data_vars:
            raise unknown_name("signal", name, map(str, measurement.data_vars))
    qualities = {name: _quality(measurement, name, longest) for name in names}
    axis = _axis(qualities, step, method)
    variables, channels = {}, []
    for name, channel in qualities.items():
        values, excluded = _on_axis(measurement, name, channel, axis, step, method, left_out)
        variables[name] = ("time", values, dict(measurement[name].attrs))
        delay = float(measurement[name].attrs.get("delay", 0.0))
        channels.append(AlignedChannel(name, channel, delay, excluded))
    time = ("time", pd.Index(axis, copy=False, name="time"), {"units": "s", "long_name": "time"})
    dataset = xr.Dataset(variables, coords={"time": time}, attrs=dict(measurement.attrs))
    report = AlignmentReport(
        step, float(axis[0]), float(axis[-1]), int(axis.size), method, left_out, tuple(channels)
    )
    return Aligned(dataset, report)


def _instants_of(measurement: xr.Dataset, name: str) -> NDArray[np.float64]:
    """Return the times of a signal [s]."""
    (dim,) = measurement[name].dims
    return np.asarray(measurement[dim].values, dtype=np.float64)


def _positive(value: str | float, name: str) -> float:
    number = units.parse(value, "s", name)
    if not number > 0.0:
        raise not_valid(name, repr(value), "> 0 s")
    return number


def _flaws(exclude: Iterable[str]) -> tuple[str, ...]:
    named = tuple(exclude)
    for flaw in named:
        if flaw not in FLAWS:
            raise unknown_name("flaw", flaw, FLAWS)
    return named


def _quality(measurement: xr.Dataset, name: str, longest: float | None) -> ChannelQuality:
    signal = measurement[name]
    if signal.ndim != 1:
        raise ParameterError(
            f"{name} has the dimensions {', '.join(map(str, signal.dims))}. Select one case",
            name=name,
            value=", ".join(map(str, signal.dims)),
        )
    low, high = signal.attrs.get("valid_min"), signal.attrs.get("valid_max")
    limits = (float(low), float(high)) if low is not None and high is not None else None
    try:
        return quality(
            _instants_of(measurement, name), signal.values, max_gap=longest, limits=limits
        )
    except ValueError as error:
        raise ParameterError(
            f"{name} has {error}, but at least two are needed", name=name
        ) from None


def _axis(qualities: dict[str, ChannelQuality], step: float, method: str) -> NDArray[np.float64]:
    """Return the multiples of the step within all channels."""
    margin = step / 2.0 if method == "average" else 0.0
    if not qualities:
        raise ParameterError("signals is empty. Specify at least one signal", name="signals")
    last_start = max(qualities, key=lambda name: qualities[name].start)
    first_stop = min(qualities, key=lambda name: qualities[name].stop)
    start, stop = qualities[last_start].start + margin, qualities[first_stop].stop - margin
    first, last = math.ceil(start / step - _SLACK), math.floor(stop / step + _SLACK)
    if last - first < 1:
        raise ParameterError(
            f"no interval of {step:g} s fits between the start of {last_start} at "
            f"{qualities[last_start].start:g} s and the end of {first_stop} at "
            f"{qualities[first_stop].stop:g} s. Use a smaller interval, or signals that overlap",
            name="interval",
            value=f"{step:g} s",
        )
    size = 8 * (last - first + 1) * (len(qualities) + 1)
    if size > room():
        raise ParameterError(
            f"interval = {step:g} s would create {last - first + 1:.3g} samples of each signal, "
            f"which need {size / 2**30:.3g} GiB of memory. The limit is {room() / 2**30:.3g} GiB. "
            "Use a larger interval, or fewer signals",
            name="interval",
            value=f"{step:g} s",
        )
    axis = np.arange(first, last + 1, dtype=np.float64)
    axis *= step
    return np.round(axis, 12, out=axis)


def _on_axis(
    measurement: xr.Dataset,
    name: str,
    channel: ChannelQuality,
    axis: NDArray[np.float64],
    step: float,
    method: str,
    left_out: tuple[str, ...],
) -> tuple[NDArray[np.float64], int]:
    """Return a signal on the axis, and the number of its NaN values."""
    time, values = _instants_of(measurement, name), measurement[name].values
    there = ~np.isnan(values)
    if not there.all():
        time, values = time[there], values[there]
    result = resampled(time, values, axis, step, method)
    reach = step / 2.0 if method == "average" else 0.0
    flawed = np.zeros(axis.size, dtype=bool)
    for flaw in left_out:
        for stretch in getattr(channel, flaw):
            flawed[_inside(stretch, axis, step, reach, ends=flaw == "clipped")] = True
    if flawed.all():
        raise ParameterError(
            f"{name} has no values left after excluding {', '.join(left_out)}. Check its limits, "
            "or exclude less",
            name=name,
        )
    result[flawed] = np.nan
    return result, int(flawed.sum())


def _inside(
    stretch: Stretch, axis: NDArray[np.float64], step: float, reach: float, *, ends: bool
) -> slice:
    """Return the part of the axis whose values depend on a stretch."""
    slack = -_SLACK * step if ends else _SLACK * step  # the samples at the ends of a gap are good
    begin = stretch.start - reach + slack
    end = stretch.start + stretch.length + reach - slack
    return slice(int(np.searchsorted(axis, begin)), int(np.searchsorted(axis, end, side="right")))
