"""Key figures of a step response: how fast, how exactly, how calmly.

All levels are relative to the step: 0 % is ``start``, 100 % is ``end``; steps downward count
alike. Crossings are interpolated linearly between samples. Ripple (dither) makes first crossings
early, last ones late, by up to its amplitude over the local slope, and adds to the overshoot;
the setting's ``smoothing`` averages first and says so in every note.

A response that never leaves its first level by more than 5 % of the step height does not answer: of
these figures it has the steady-state error alone. One that still moves in the window of the steady
state leaves open how far it will go: its overshoot, error and ripple are not defined. Without a set
point, none of the figures is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import xarray as xr

from bywire.bench.kpis.in_c import UNSOUND, InC
from bywire.bench.kpis.kpi import Undefined, Values, Why, measure
from bywire.bench.kpis.samples import defect, integral, sample, signal, total
from bywire.bench.kpis.smoothing import smoothed, treatment
from bywire.core.typing import Array

_DEAD, _BAND = 0.05, 0.02  # of the step height: end of the dead time; half settling band
_MOVING = 0.02  # of the step height, between both halves of the window of the steady state
_LAST = 0.2  # of the time after the step: the window of the steady state, by default
_SETTLED = 0.1  # of the time after the step: must lie inside the band, else nothing is proved


@dataclass(frozen=True)
class Setting:
    """What the step was, and how to look at its response.

    The levels may differ between cases that are judged together: shape ``(...)`` then.

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

    BY_CASE: ClassVar[tuple[str, ...]] = ("start", "end")

    signal: str
    t_step: float
    start: float | None = None
    end: float | None = None
    window: tuple[float, float] | None = None
    smoothing: float = 0.0
    set_point: str = ""


def _packed(setting: Setting, cases: int) -> Array:
    """Return the setting as the C takes it: what the step was, then levels of each case."""
    levels = np.full((cases, 2), math.nan)
    for column, level in enumerate((setting.start, setting.end)):
        levels[:, column] = math.nan if level is None else level
    given = [float(each is not None) for each in (setting.start, setting.end, setting.window)]
    step = (setting.t_step, setting.smoothing, *given, *(setting.window or (0.0, 0.0)))
    return np.concatenate((step, levels.ravel()))


IN_C = InC(
    signals=("signal",),
    reasons=(
        "the step height is zero",
        "the response changes by less than its ripple: no step is seen",
        "never gets as far",
        "there already at the step",
        "never settles",
        "enters the band only shortly before the recording ends",
        "no set point is given",
        "the steady state's window holds < 2 samples",
        "the response does not move",
        "the response still moves at the end",
        "ends short of the set point and never exceeds it",
    ),
    open=(1, 2, 6, 9, 10, 11),
    failures=(
        UNSOUND,
        "the step is outside the recording",
        "the steady state's window holds < 2 samples",
    ),
    packed=_packed,
    note=lambda setting: treatment(setting.smoothing),
    room=8,
)


@dataclass(frozen=True, eq=False)
class StepResponse:
    """A response from the step on.

    Parameters
    ----------
    t, y
        Times [s], increasing from the instant of the step, shape ``(n,)``, and response,
        ``(..., n)``.
    start, end, unit
        Levels of 0 % and 100 %, shape ``(...)``, and the response's SI unit.
    window
        Beginning and end [s] of the steady state; None for the last 20 %.
    is_tracking
        Whether ``end`` is a set point; else there is no steady-state error.
    note, problem
        How the samples were treated; why nothing is defined, as found in them.
    """

    t: Array
    y: Array
    start: Any
    end: Any
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
    def flat(self) -> Why:
        """Where the step height is zero."""
        start, end = np.asarray(self.start), np.asarray(self.end)
        height = np.abs(end - start)
        least = 1e-12 * np.maximum(np.abs(start), np.abs(end))
        return Why(
            ~np.isfinite(height) | (height <= least),
            lambda c: f"the step height is zero ({_at(start, c):g} to {_at(end, c):g})",
            is_open=True,
        )

    @cached_property
    def still(self) -> Why:
        """Where the response never leaves its first level by more than 5 % of the step height."""
        height = np.abs(np.asarray(self.end) - np.asarray(self.start))
        way, unit = np.asarray(np.max(np.abs(self.y - self.y[..., :1]), axis=-1)), self.unit
        return Why(
            way <= _DEAD * height,
            lambda c: (
                f"the response does not move: {_at(way, c):.3g} of a step of "
                f"{_at(height, c):.3g} {unit} at most"
            ),
            is_open=True,
        )

    @cached_property
    def blind(self) -> tuple[Why, ...]:
        """Where there is no step to be seen, and why."""
        if self.is_tracking:
            return (self.flat, self.still)
        height = np.abs(np.asarray(self.end) - np.asarray(self.start))
        inside = self.y if isinstance(self.steady, Undefined) else self.steady[1]
        text = "the response changes by less than its ripple: no step is seen"
        calm = Why(height <= np.ptp(inside, axis=-1), lambda _: text, is_open=True)
        return (self.flat, self.still, calm, self.unsteady)

    @cached_property
    def unsteady(self) -> Why:
        """Where the response still moves in the window of the steady state.

        The means of both halves of the window, of as many intervals each, differ by more than 2 %
        of the step height, or the extremes of the later half go beyond those of the earlier one by
        more than that. Ripple of several periods does neither.
        """
        height = np.abs(np.asarray(self.end) - np.asarray(self.start))
        none = Why(np.zeros(height.shape, dtype=bool), lambda _: "")
        if isinstance(self.steady, Undefined):
            return none
        t, y = self.steady
        k = (t.size - 1) // 2
        if k < 1:
            return none
        halves = [(t[: k + 1], y[..., : k + 1]), (t[t.size - 1 - k :], y[..., t.size - 1 - k :])]
        (first, low, high), (then, lower, higher) = (
            (integral(s, z) / (s[-1] - s[0]), np.min(z, axis=-1), np.max(z, axis=-1))
            for s, z in halves
        )
        drift = np.maximum(np.abs(then - first), np.maximum(low - lower, higher - high))
        return Why(
            (drift > _MOVING * height) & ~self.flat.where,
            lambda c: (
                "the response still moves at the end: by "
                f"{100 * _at(drift, c) / _at(height, c):.3g} % of the step height in the window of "
                "the steady state; record longer"
            ),
            is_open=True,
        )

    @cached_property
    def course(self) -> Array:
        """The response with 0 at ``start`` and 1 at ``end``; nothing else where `blind`."""
        start = np.asarray(self.start)[..., None]
        height = np.asarray(self.end)[..., None] - start
        with np.errstate(all="ignore"):
            return np.asarray((self.y - start) / height)

    @cached_property
    def steady(self) -> tuple[Array, Array] | Undefined:
        """Times and values in the window of the steady state."""
        t, last = self.t, float(self.t[-1])
        a, b = self.window or (last - _LAST * (last - float(t[0])), last)
        inside = slice(np.searchsorted(t, a), np.searchsorted(t, b, side="right"))
        if t[inside].size < 2:
            return Undefined(f"the steady state's window, {a:g} to {b:g} s, holds < 2 samples")
        return t[inside], self.y[..., inside]


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
    begins = _between(t, y, setting.t_step)[..., None]
    after = replace(
        whole,
        t=np.append(setting.t_step, t[first:]),
        y=np.concatenate((begins, y[..., first:]), axis=-1),
        is_tracking=setting.end is not None,
        note=treatment(setting.smoothing),
    )
    start: Any = setting.start
    end: Any = _mean(after) if setting.end is None else setting.end
    if start is None:
        before = y[..., : np.searchsorted(t, setting.t_step - 0.5 * setting.smoothing)]
        start = total(before) / before.shape[-1] if before.size else after.y[..., 0]
    if isinstance(end, Undefined):
        return replace(after, problem=end.reason)
    return replace(after, start=start, end=end)


@measure("s")
def dead_time(response: StepResponse) -> Values:
    """Time from the step until the response first reaches 5 % of the step height.

    A first-order lag without dead time shows 0.051 of its time constant here.
    """
    return _first(response, _DEAD)


@measure("s")
def rise_time(response: StepResponse) -> Values:
    """Time between the first crossings of 10 % and of 90 % of the step height."""
    low, high = _first(response, 0.1), _first(response, 0.9)
    return Values(high.values - low.values, *low.reasons, *high.reasons)


@measure("s")
def settling_time(response: StepResponse) -> Values:
    """Time from the step to the last entry into the band of 2 % of the step height around its end.

    The entry is interpolated. Not defined when it falls into the last tenth of the time after
    the step, where a longer recording could show another one. Ripple of more than 4 % peak to
    peak never settles, nor does a steady-state error of more than 2 %.
    """
    t, z = response.t, response.course
    last = t.size - 1
    outside = np.abs(z - 1.0) > _BAND
    k = np.minimum(last - np.argmax(outside[..., ::-1], axis=-1), last - 1)
    here, there = sample(z, k), sample(z, k + 1)
    with np.errstate(all="ignore"):  # where nothing lies outside
        edge = 1.0 + np.copysign(_BAND, here - 1.0)
        entry = t[k] + (edge - here) / (there - here) * (t[k + 1] - t[k])
    strayed = outside.any(axis=-1)
    late = strayed & (entry > t[-1] - _SETTLED * (t[-1] - t[0]))
    return Values(
        np.where(strayed, entry - t[0], 0.0),
        *response.blind,
        Why(
            outside[..., -1],
            lambda c: f"never settles: {100 * z[c][-1]:.4g} % of the step height at the end",
        ),
        Why(
            late,
            lambda c: (
                f"enters the band only {t[-1] - entry[c]:.3g} s before the recording ends: "
                "record longer"
            ),
            is_open=True,
        ),
    )


@measure("%")
def overshoot(response: StepResponse) -> Values:
    """Largest excess of the response over the step's end, in % of the step height.

    The largest sample counts. It is 0 where the end is never exceeded; a response that does not
    even settle there leaves open whether it would overshoot.
    """
    z = response.course
    excess = np.max(z, axis=-1) - 1.0
    short = Why(
        (np.abs(z[..., -1] - 1.0) > _BAND) & (excess <= 0.0),
        lambda c: f"never exceeds the set point, and ends at {100 * z[c][-1]:.4g} % of the step",
        is_open=True,
    )
    reasons = (*response.blind, response.unsteady, short)
    return Values(100.0 * np.maximum(0.0, excess), *reasons)


@measure("level")
def steady_state_error(response: StepResponse) -> Values | Undefined:
    """Magnitude of the set point minus the mean response in the window of the steady state.

    Trapezoidal mean over the window's samples, by default the last 20 % of the time after the
    step. Ripple averages out but for an incomplete period.
    """
    if not response.is_tracking:
        return Undefined("no set point is given")
    mean = _mean(response)
    if isinstance(mean, Undefined):
        return mean
    return Values(np.abs(response.end - mean), response.unsteady)


@measure("level")
def ripple(response: StepResponse) -> Values | Undefined:
    """Peak to peak of the response in the window of the steady state.

    Largest minus smallest sample. Smoothing removes the ripple of its own period from this figure
    too.
    """
    steady = response.steady
    if isinstance(steady, Undefined):
        return steady
    motionless = (response.still,) if response.is_tracking else (response.flat, response.still)
    return Values(np.ptp(steady[1], axis=-1), *motionless, response.unsteady)


def _first(response: StepResponse, level: float) -> Values:
    """Return the time from the step to the first crossing of a level."""
    t, z = response.t, response.course
    reached = z >= level
    k = np.argmax(reached, axis=-1)
    before = np.maximum(k - 1, 0)
    below, above = sample(z, before), sample(z, k)
    with np.errstate(all="ignore"):  # where it is never reached
        share = (level - below) / (above - below)
        time = t[before] + share * (t[k] - t[before]) - t[0]
    return Values(
        time,
        *response.blind,
        Why(
            ~reached.any(axis=-1),
            lambda c: (
                f"never reaches {100 * level:g} % of the step height: "
                f"{100 * np.max(z[c]):.4g} % at most"
            ),
        ),
        Why(
            k == 0,
            lambda c: f"already at {100 * z[c][0]:.4g} % of the step height at the step",
        ),
    )


def _mean(response: StepResponse) -> Array | Undefined:
    """Return the mean over time in the window of the steady state."""
    steady = response.steady
    if isinstance(steady, Undefined):
        return steady
    t, y = steady
    return np.asarray(integral(t, y) / (t[-1] - t[0]))


def _between(t: Array, y: Array, at: float) -> Array:
    """Return the response of each case at an instant within its times, as `numpy.interp` does."""
    k = int(np.searchsorted(t, at, side="right")) - 1
    here, there = y[..., k], y[..., k + 1]
    if t[k] == at:
        return np.asarray(here)
    return np.asarray((there - here) / (t[k + 1] - t[k]) * (at - t[k]) + here)


def _at(level: Array, case: Any) -> float:
    """Return a level that is that of all cases, or one of each."""
    return float(level[case] if level.ndim else level)
