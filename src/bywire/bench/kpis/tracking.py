"""Tracking errors of a signal that follows a moving set point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.kpis.kpi import Undefined, measure
from bywire.bench.kpis.samples import defect, signal, smoothed, treatment
from bywire.core.typing import Array

if TYPE_CHECKING:
    import xarray as xr

_LONGEST_LAG = 0.3  # s: upper limit of the search
_STILL = 0.05  # of the set point's range: minimum motion of a signal that follows


@dataclass(frozen=True)
class Setting:
    """Set point and signal.

    Parameters
    ----------
    signal, set_point
        Names of the signals in the recording, of one unit.
    smoothing
        Averaging time [s] of the signal, usually one dither period; 0 for the raw signal.
    """

    signal: str
    set_point: str
    smoothing: float = 0.0


@dataclass(frozen=True, eq=False)
class Tracking:
    """Samples of a signal and its set point.

    Parameters
    ----------
    t
        Times [s], increasing, shape ``(n,)``.
    y, demand
        Signal and set point, shape ``(n,)`` each.
    unit
        SI unit of both.
    note
        Treatment of the samples.
    """

    t: Array
    y: Array
    demand: Array
    unit: str = "1"
    note: str = ""

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of the signal."""
        return {"level": self.unit}

    @cached_property
    def defect(self) -> str:
        """Reason why no figure is defined."""
        return defect(self.t, self.y, self.demand)

    @cached_property
    def lag(self) -> float | Undefined:
        """Delay of the set point [s] that fits best."""
        from scipy import optimize  # slow to load, and only this needs it

        if np.ptp(self.demand) == 0.0:
            return Undefined("the set point does not change", is_open=True)
        if np.ptp(self.y) <= _STILL * np.ptp(self.demand):
            return Undefined("the signal does not change", is_open=True)

        def misfit(delay: float) -> float:
            return float(np.mean((self.y - self.delayed(delay)) ** 2))

        delays = np.linspace(0.0, _LONGEST_LAG, 61)
        best = float(delays[int(np.argmin([misfit(d) for d in delays]))])
        bounds = (max(best - delays[1], 0.0), min(best + delays[1], _LONGEST_LAG))
        fine = optimize.minimize_scalar(misfit, bounds=bounds, method="bounded")
        if misfit(0.0) <= fine.fun:
            return Undefined("a delay of zero fits best")
        if misfit(_LONGEST_LAG) <= fine.fun:
            return Undefined(f"the best-fitting delay is not below {_LONGEST_LAG:g} s")
        return float(fine.x)

    def delayed(self, delay: float) -> Array:
        """Return the set point, shifted by a delay [s]."""
        return np.interp(self.t - delay, self.t, self.demand)


def select(recording: xr.Dataset, setting: Setting) -> Tracking:
    """Return the signal, averaged over the setting's period, and its set point.

    Raises
    ------
    UnknownNameError
        When the recording does not contain them.
    """
    t, _ = signal(recording, "time")
    y, unit = signal(recording, setting.signal)
    demand, _ = signal(recording, setting.set_point)
    return Tracking(
        t, smoothed(t, y, setting.smoothing), demand, unit, treatment(setting.smoothing)
    )


@measure("level")
def tracking_rms(data: Tracking) -> float | Undefined:
    """Root mean square of the signal minus its set point."""
    return float(np.sqrt(np.mean((data.y - data.demand) ** 2)))


@measure("level")
def tracking_max(data: Tracking) -> float | Undefined:
    """Maximum magnitude of the signal minus its set point."""
    return float(np.max(np.abs(data.y - data.demand)))


@measure("s")
def tracking_lag(data: Tracking) -> float | Undefined:
    """Delay of the set point that fits the signal best, by least squares."""
    return data.lag


@measure("level")
def tracking_rms_without_lag(data: Tracking) -> float | Undefined:
    """Root mean square of the signal minus the delayed set point."""
    if isinstance(data.lag, Undefined):
        return data.lag
    return float(np.sqrt(np.mean((data.y - data.delayed(data.lag)) ** 2)))
