"""Key figures of a step response: how fast, how exactly, how calmly.

All levels are relative to the step: 0 % is ``start``, 100 % is ``end``; steps downward count
alike. Crossings are interpolated linearly between samples. Ripple (dither) makes first crossings
early, last ones late, by up to its amplitude over the local slope, and adds to the overshoot;
the setting's ``smoothing`` averages first and says so in every note.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import xarray as xr

from bywire.bench.kpis.kpi import Undefined, defect, integral, measure, signal
from bywire.bench.kpis.smoothing import smoothed, treatment
from bywire.core.typing import Array

_DEAD, _BAND = 0.05, 0.02  # of the step height: end of the dead time; half settling band
_LAST = 0.2  # of the time after the step: the window of the steady state, by default
_SETTLED = 0.1  # of the time after the step: must lie inside the band, else nothing is proved


@dataclass(frozen=True)
class Setting:
    """What the step was, and how to look at its response.

    Parameters
    ----------
    signal
        Name of the response in the recording.
    t_step
        Instant of the step [s].
    start, end
        Set point before and after the step, in the signal's SI unit. None where there is none
        (open loop): then the response's mean before the step and that in the window.
    window
        Beginning and end [s] of the steady state; None for the last 20 % after the step.
    smoothing
        Averaging time [s], usually one dither period; 0 for the raw signal.
    set_point
        Name of the set point in the recording, for figures; empty where none is recorded.
    """

    signal: str
    t_step: float
    start: float | None = None
    end: float | None = None
    window: tuple[float, float] | None = None
    smoothing: float = 0.0
    set_point: str = ""


@dataclass(frozen=True, eq=False)
class StepResponse:
    """A response from the step on.

    Parameters
    ----------
    t, y
        Times [s], increasing from the instant of the step, and response, shape ``(n,)`` each.
    start, end, unit
        Levels of 0 % and 100 %, and the response's SI unit.
    window
        Beginning and end [s] of the steady state; None for the last 20 %.
    is_tracking
        Whether ``end`` is a set point; else there is no steady-state error.
    note, problem
        How the samples were treated; why nothing is defined, as found in them.
    """

    t: Array
    y: Array
    start: float
    end: float
    unit: str = "1"
    window: tuple[float, float] | None = None
    is_tracking: bool = True
    note: str = ""
    problem: str = ""

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of the response."""
        return {"level": self.unit}

    @cached_property
    def defect(self) -> str:
        """Why no figure is defined."""
        return self.problem or defect(self.t, self.y)

    @cached_property
    def course(self) -> Array | Undefined:
        """The response with 0 at ``start`` and 1 at ``end``."""
        height = self.end - self.start
        if not np.isfinite(height) or abs(height) <= 1e-12 * max(abs(self.start), abs(self.end)):
            return Undefined(f"the step height is zero ({self.start:g} to {self.end:g})")
        inside = self.y if isinstance(self.steady, Undefined) else self.steady[1]
        if not self.is_tracking and abs(height) <= np.ptp(inside):
            return Undefined("the response changes by less than its ripple: no step is seen")
        return np.asarray((self.y - self.start) / height)

    @cached_property
    def steady(self) -> tuple[Array, Array] | Undefined:
        """Times and values in the window of the steady state."""
        t, last = self.t, float(self.t[-1])
        a, b = self.window or (last - _LAST * (last - float(t[0])), last)
        inside = (t >= a) & (t <= b)
        if np.count_nonzero(inside) < 2:
            return Undefined(f"the steady state's window, {a:g} to {b:g} s, holds < 2 samples")
        return t[inside], self.y[inside]


def select(recording: xr.Dataset, setting: Setting) -> StepResponse:
    """Return the response from the step on.

    Raises
    ------
    UnknownNameError
        When the recording does not hold the signal.
    """
    t, _ = signal(recording, "time")
    raw, unit = signal(recording, setting.signal)
    whole = StepResponse(t, raw, math.nan, math.nan, unit, setting.window)
    problem = whole.defect
    if not problem and not t[0] <= setting.t_step < t[-1]:
        problem = f"the step at {setting.t_step:g} s is outside {t[0]:g} to {t[-1]:g} s"
    if problem:
        return replace(whole, problem=problem)
    y = smoothed(t, raw, setting.smoothing)
    first = int(np.searchsorted(t, setting.t_step, side="right"))
    after = replace(
        whole,
        t=np.append(setting.t_step, t[first:]),
        y=np.append(np.interp(setting.t_step, t, y), y[first:]),
        is_tracking=setting.end is not None,
        note=treatment(setting.smoothing),
    )
    start, end = setting.start, _mean(after) if setting.end is None else setting.end
    if start is None:
        before = y[t < setting.t_step - 0.5 * setting.smoothing]
        start = float(np.mean(before) if before.size else after.y[0])
    if isinstance(end, Undefined):
        return replace(after, problem=end.reason)
    return replace(after, start=start, end=end)


@measure("s")
def dead_time(response: StepResponse) -> float | Undefined:
    """Time from the step until the response first reaches 5 % of the step height.

    A first-order lag without dead time shows 0.051 of its time constant here.
    """
    return _first(response, _DEAD)


@measure("s")
def rise_time(response: StepResponse) -> float | Undefined:
    """Time between the first crossings of 10 % and of 90 % of the step height."""
    low, high = _first(response, 0.1), _first(response, 0.9)
    if isinstance(low, Undefined) or isinstance(high, Undefined):
        return low if isinstance(low, Undefined) else high
    return high - low


@measure("s")
def settling_time(response: StepResponse) -> float | Undefined:
    """Time from the step to the last entry into the band of 2 % of the step height around its end.

    The entry is interpolated. Not defined when it falls into the last tenth of the time after
    the step, where a longer recording could show another one. Ripple of more than 4 % peak to
    peak never settles, nor does a steady-state error of more than 2 %.
    """
    t, z = response.t, response.course
    if isinstance(z, Undefined):
        return z
    outside = np.flatnonzero(np.abs(z - 1.0) > _BAND)
    if outside.size == 0:
        return 0.0
    k = int(outside[-1])
    if k == t.size - 1:
        return Undefined(f"never settles: {100 * z[-1]:.4g} % of the step height at the end")
    edge = 1.0 + np.copysign(_BAND, z[k] - 1.0)
    entry = float(t[k] + (edge - z[k]) / (z[k + 1] - z[k]) * (t[k + 1] - t[k]))
    if entry > t[-1] - _SETTLED * (t[-1] - t[0]):
        return Undefined(
            f"enters the band only {t[-1] - entry:.3g} s before the recording ends: record longer"
        )
    return entry - float(t[0])


@measure("%")
def overshoot(response: StepResponse) -> float | Undefined:
    """Largest excess of the response over the step's end, in % of the step height.

    The largest sample counts; 0 where the end is never exceeded.
    """
    z = response.course
    return z if isinstance(z, Undefined) else 100.0 * max(0.0, float(np.max(z)) - 1.0)


@measure("level")
def steady_state_error(response: StepResponse) -> float | Undefined:
    """Magnitude of the set point less the mean response in the window of the steady state.

    Trapezoidal mean over the window's samples, by default the last 20 % of the time after the
    step. Ripple averages out but for an incomplete period.
    """
    if not response.is_tracking:
        return Undefined("no set point is given")
    mean = _mean(response)
    return mean if isinstance(mean, Undefined) else abs(response.end - mean)


@measure("level")
def ripple(response: StepResponse) -> float | Undefined:
    """Peak to peak of the response in the window of the steady state.

    Largest less smallest sample; a drift in the window counts. Smoothing removes the ripple of
    its own period from this figure too.
    """
    steady = response.steady
    return steady if isinstance(steady, Undefined) else float(np.ptp(steady[1]))


def _first(response: StepResponse, level: float) -> float | Undefined:
    """Return the time from the step to the first crossing of a level."""
    t, z = response.t, response.course
    if isinstance(z, Undefined):
        return z
    reached = np.flatnonzero(z >= level)
    if reached.size == 0:
        return Undefined(
            f"never reaches {100 * level:g} % of the step height: {100 * np.max(z):.4g} % at most"
        )
    k = int(reached[0])
    if k == 0:
        return Undefined(f"already at {100 * z[0]:.4g} % of the step height at the step")
    share = (level - z[k - 1]) / (z[k] - z[k - 1])
    return float(t[k - 1] + share * (t[k] - t[k - 1]) - t[0])


def _mean(response: StepResponse) -> float | Undefined:
    """Return the mean over time in the window of the steady state."""
    steady = response.steady
    if isinstance(steady, Undefined):
        return steady
    t, y = steady
    return integral(t, y) / float(t[-1] - t[0])
