r"""Gain and phase of an output in response to sines of a drive, one frequency at a time.

At each frequency f, both signals are projected on :math:`e^{-j 2 \pi f t}` over whole periods. The
response is their quotient. Components of the output at other frequencies do not count.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.bench.kpis.kpi import Undefined, measure
from bywire.bench.kpis.samples import defect, signal
from bywire.core.typing import Array

if TYPE_CHECKING:
    import xarray as xr

_HALF_POWER = math.sqrt(0.5)
_ROUNDED = 1e-12  # of the output's maximum magnitude: smaller motion is rounding error
_STILL = Undefined("the output does not respond at the lowest frequency", is_open=True)


@dataclass(frozen=True)
class Setting:
    """Signals and windows of the sines.

    Parameters
    ----------
    drive, response
        Names of the signals in the recording.
    windows
        Frequency [Hz], and start and end [s] of whole periods of the settled response.
    """

    drive: str
    response: str
    windows: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True, eq=False)
class Sweep:
    """Samples of drive and response over times [s], their units, and the windows of `Setting`."""

    t: Array
    drive: Array
    response: Array
    windows: tuple[tuple[float, float, float], ...]
    drive_unit: str = "1"
    response_unit: str = "1"

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of the gain."""
        return {"gain": gain_unit(self.drive_unit, self.response_unit)}

    @cached_property
    def defect(self) -> str:
        """Reason why no figure is defined."""
        broken = defect(self.t, self.drive, self.response)
        if not broken and not self.frequencies.size:
            return "the recording does not contain a whole period"
        return broken

    @property
    def note(self) -> str:
        """Empty: the samples are raw."""
        return ""

    @property
    def frequencies(self) -> Array:
        """Frequencies whose window is recorded [Hz], shape (k,)."""
        last = float(self.t[-1]) + 1e-9
        return np.array([f for f, _, end in self.windows if end <= last])

    @cached_property
    def values(self) -> NDArray[np.complexfloating[Any, Any]]:
        """Response at these frequencies, shape (k,)."""
        return np.array(
            [
                self._line(self.response, *window) / self._line(self.drive, *window)
                for window in self.windows[: self.frequencies.size]
            ]
        )

    @cached_property
    def moves(self) -> NDArray[np.bool_]:
        """Whether the output moves at each of these frequencies, shape (k,)."""
        least = _ROUNDED * float(np.max(np.abs(self.response)))
        return np.array(
            [
                np.ptp(self.response[self._rows(begin, end)]) > least
                for _, begin, end in self.windows[: self.frequencies.size]
            ]
        )

    def _rows(self, begin: float, end: float) -> slice:
        return slice(*np.searchsorted(self.t, [begin - 1e-9, end + 1e-9]))

    def _line(self, y: Array, f: float, begin: float, end: float) -> complex:
        """Return the Fourier coefficient of a signal over a window."""
        k = self._rows(begin, end)
        t, turned = self.t[k], y[k] * np.exp(-2j * np.pi * f * self.t[k])
        return complex(np.sum(0.5 * (turned[1:] + turned[:-1]) * np.diff(t)))


def gain_unit(drive: str, response: str) -> str:
    """Return the unit of a gain from the SI units of drive and response."""
    return "1" if drive == response else f"({response})/({drive})"


def select(recording: xr.Dataset, setting: Setting) -> Sweep:
    """Return drive and response.

    Raises
    ------
    UnknownNameError
        When the recording does not contain them.
    """
    t, _ = signal(recording, "time")
    drive, drive_unit = signal(recording, setting.drive)
    response, response_unit = signal(recording, setting.response)
    return Sweep(t, drive, response, setting.windows, drive_unit, response_unit)


@measure("gain")
def sweep_gain(data: Sweep) -> float | Undefined:
    """Gain at the lowest frequency: output amplitude divided by input amplitude."""
    return float(np.abs(data.values[0])) if data.moves[0] else _STILL


@measure("1")
def sweep_peak(data: Sweep) -> float | Undefined:
    """Maximum gain, relative to the gain at the lowest frequency."""
    gains = np.abs(data.values)
    return float(np.max(gains) / gains[0]) if data.moves[0] else _STILL


@measure("Hz")
def sweep_bandwidth(data: Sweep) -> float | Undefined:
    """Frequency at which the gain falls below 0.707 times the gain at the lowest frequency (-3 dB).

    The first crossing, interpolated in the logarithms of frequency and gain.
    """
    gains, f = np.abs(data.values), data.frequencies
    below = np.flatnonzero(gains < _HALF_POWER * gains[0])
    if not data.moves[0]:
        return _STILL
    if not below.size:
        return Undefined(f"above {f[-1]:g} Hz, the highest frequency")
    k = int(below[0])
    if gains[k] == 0.0:
        return float(f[k])
    x = np.log([gains[k - 1], gains[k], _HALF_POWER * gains[0]])
    share = float((x[0] - x[2]) / (x[0] - x[1]))
    return float(f[k - 1] * (f[k] / f[k - 1]) ** share)


@measure("deg")
def sweep_lag(data: Sweep) -> float | Undefined:
    """Phase lag of the output behind the input at the highest frequency."""
    if not data.moves.all():
        f = data.frequencies[np.argmin(data.moves)]
        return Undefined(f"the output does not respond at {f:g} Hz", is_open=True)
    return float(-np.rad2deg(np.unwrap(np.angle(data.values))[-1]))
