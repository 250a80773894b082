"""The lag between two measured signals, by correlation, to a fraction of a sample."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.core import units
from bywire.core.errors import ParameterError, unknown_name
from bywire.data.alignment import resample

_LEAST = 8  # samples in which two shifted signals must overlap to be compared


@dataclass(frozen=True)
class Lag:
    """By how much one signal follows another.

    Parameters
    ----------
    value
        How much later the second signal shows what the first showed [s].
    correlation
        Correlation coefficient at that lag, -1 to 1; negative for signals of opposite sign.
    at_limit
        Whether the lag lies at the end of the range that was searched, and so is none.
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
    """Estimate the lag of a signal behind another from what both measured.

    The correlation coefficient over the overlap is taken at every whole sample; its highest
    magnitude is then refined between samples, with a cubic spline through the second signal.

    Parameters
    ----------
    measurement
        What `read_measurement` returns.
    first, second
        Names of two signals of the same event.
    largest
        Largest lag to search for in both directions, text with a unit or [s].
    interval
        Step at which they are compared, text with a unit or [s]; by default that of the one
        with fewer samples.

    Raises
    ------
    ParameterError
        When a signal does not move, has gaps, or the overlap is too short for such a lag.
    UnknownNameError
        For an unknown signal.

    Notes
    -----
    A first-order difference in how the two sensors respond counts as lag too. To undo a lag
    that was found, give it as ``delay`` in the mapping of the second signal.
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
                f"{name} has gaps or missing values: choose a piece without them, for instance "
                "measurement.sel(time=slice(0, 10))"
            )
        if np.ptp(values) == 0.0:
            raise ParameterError(f"{name} does not move: a lag cannot be seen in it")
    most = int(np.ceil(reach / step))
    if not most >= 1 or a.size - most < _LEAST:
        raise ParameterError(
            f"largest = {reach:g} s is not valid: it must be at least a step, {step:g} s, and "
            f"leave an overlap of {_LEAST} steps in {a.size * step:g} s"
        )
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
        """Sum of x[i] over the i for which i + shift exists as well."""
        up_to = np.concatenate([[0.0], np.cumsum(x)])
        return np.asarray(up_to[np.minimum(n, n - shift)] - up_to[np.maximum(0, -shift)])

    count = n - np.abs(shifts)
    sum_a, sum_b = summed(a, shifts), summed(b, -shifts)
    var_a = summed(a**2, shifts) - sum_a**2 / count
    var_b = summed(b**2, -shifts) - sum_b**2 / count
    size = _quick_length(n + most)  # what wraps around stays clear of the shifts that are asked
    spectrum = np.fft.rfft(b, size) * np.fft.rfft(a, size).conj()
    both = np.fft.irfft(spectrum, size)[shifts]
    floor = 1e-12 * max(float((a**2).sum()), 1e-300) * max(float((b**2).sum()), 1e-300)
    product = np.maximum(var_a * var_b, floor)
    return np.asarray((both - sum_a * sum_b / count) / np.sqrt(product))


def _quick_length(least: int) -> int:
    """Return a length from ``least`` on whose transform is quick: 2^k times 1, 3, 5, 9 or 15."""
    return min(m << max(math.ceil(math.log2(least / m)), 0) for m in (1, 3, 5, 9, 15))


def _refined(
    a: NDArray[np.float64], b: NDArray[np.float64], shift: int, sign: float
) -> tuple[float, float]:
    """Return shift in samples and coefficient at the highest point around a whole shift."""
    from scipy.optimize import minimize_scalar

    n = a.size
    slope = _spline_slopes(b)
    first, last = max(0, 1 - shift), min(n, n - 1 - shift)

    def later(s: float) -> NDArray[np.float64]:
        """Return the second signal s samples later than the first one's."""
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
    """Return the slopes per sample of the cubic spline through a signal, without knots at the ends.

    (de Boor, A Practical Guide to Splines, 1978, chapter IV; SciPy's takes long to load.)
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
    """Return the correlation coefficient; 0 where one of them does not move."""
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0.0 else 0.0
