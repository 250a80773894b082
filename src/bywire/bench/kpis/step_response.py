"""Key figures of a step response: speed, accuracy and ripple.

All levels are relative to the step: 0 % is ``start``, 100 % is ``end``, also for steps downward.
Crossings are interpolated linearly between samples. Ripple (dither) makes first crossings early and
last crossings late, by up to its amplitude over the local slope, and adds to the overshoot. The
setting's ``smoothing`` averages first, and every note mentions it.

A signal that stays within 5 % of the step height of its first level does not respond. Of these
figures, only the steady-state error is then defined. A response that still moves in the
steady-state window has no overshoot, steady-state error or ripple, because its final level is
unknown. Without a set point, such a response has none of these figures.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from math import isfinite
from typing import NamedTuple

from bywire.bench.kpis.kpi import Undefined, measure
from bywire.bench.kpis.samples import Samples, integral, moving_average, total, treatment, value_at

_DEAD, _BAND = 0.05, 0.02  # of the step height: end of the dead time; half settling band
_MOVING = 0.02  # of the step height, between both halves of the steady-state window
_LAST = 0.2  # of the time after the step: default steady-state window
_SETTLED = 0.1  # of the time after the step: minimum time in the band that is treated as settled


@dataclass(frozen=True)
class Setting:
    """The step, and the treatment of its response.

    Parameters
    ----------
    signal
        Name of the response in the recording.
    t_step
        Time of the step [s].
    start, end
        Set point before and after the step, in the signal's SI unit. None in an open loop, for the
        response's mean before the step and its mean in the window.
    window
        Start and end [s] of the steady state; None for the last 20 % after the step.
    smoothing
        Averaging time [s], usually one dither period; 0 for the raw signal.
    set_point
        Name of the set point in the recording, for plots; empty if none is recorded.
    """

    signal: str
    t_step: float
    start: float | None = None
    end: float | None = None
    window: tuple[float, float] | None = None
    smoothing: float = 0.0
    set_point: str = ""

    @property
    def note(self) -> str:
        """Note on the treatment of the samples."""
        return treatment(self.smoothing)


class Response(NamedTuple):
    """Response from the step on.

    ``t`` and ``z``: times since the step, and the response with 0 at ``start`` and 1 at ``end``;
    ``most``: its maximum distance from its first level. Its mean, its peak-to-peak
    value, and its drift are those in the steady-state window, ``low`` to ``high``.
    """

    t: Samples
    z: Samples
    start: float
    end: float
    is_tracking: bool
    most: float
    low: float
    high: float
    has_window: bool
    mean: float
    band: float
    drift: float


def response(t: Samples, signal: Samples, setting: Setting) -> Response | Undefined:
    """Response from the step on."""
    y = moving_average(t, signal, setting.smoothing) if setting.smoothing > 0.0 else signal
    start = setting.start
    if start is None:
        start = level_before(t, y, setting.t_step, setting.smoothing)
    return response_from(t, y, setting.t_step, start, setting.end, setting.window)


def level_before(t: Samples, y: Samples, t_step: float, smoothing: float) -> float:
    """Mean of an averaged response before a step; without samples there, its value at the step."""
    before = bisect_left(t, t_step - 0.5 * smoothing)
    return total(y[:before]) / before if before > 0 else value_at(t, y, t_step)


def response_from(
    t: Samples,
    y: Samples,
    t_step: float,
    start: float,
    set_point: float | None,
    window: tuple[float, float] | None,
) -> Response | Undefined:
    """Response from the step on, between two levels; without a set point, up to its final mean.

    The default steady-state window is the last 20 %.
    """
    last = t[-1]
    if not t[0] <= t_step < last:
        return Undefined(
            f"the step at {t_step:g} s is outside the recording, {t[0]:g} to {last:g} s"
        )
    here = bisect_right(t, t_step) - 1
    times = list(t[here:])
    levels = list(y[here:])
    times[0] = t_step  # the time of the step replaces the sample before it
    levels[0] = value_at(t, y, t_step)
    low = last - _LAST * (last - t_step) if window is None else window[0]
    high = last if window is None else window[1]
    begin = bisect_left(times, low)
    end = bisect_right(times, high)
    has_window = end - begin >= 2
    mean = 0.0
    band = 0.0
    drift = 0.0
    if has_window:
        inside = times[begin:end]
        steady = levels[begin:end]
        mean = integral(inside, steady) / (inside[-1] - inside[0])
        band = max(steady) - min(steady)
        drift = _drift(inside, steady)
    elif set_point is None:
        return _without_window(low, high)
    final = mean if set_point is None else set_point
    height = final - start if _has_height(start, final) else 1.0
    z = [(level - start) / height for level in levels]
    most = max(max(levels) - levels[0], levels[0] - min(levels))
    return Response(
        times,
        z,
        start,
        final,
        set_point is not None,
        most,
        low,
        high,
        has_window,
        mean,
        band,
        drift,
    )


@measure("s")
def dead_time(response: Response) -> float | Undefined:
    """Time from the step until the response first reaches 5 % of the step height.

    For a first-order lag without dead time, this time is 0.051 times the time constant.
    """
    return _first(response, _DEAD)


@measure("s")
def rise_time(response: Response) -> float | Undefined:
    """Time between the first crossings of 10 % and 90 % of the step height."""
    low = _first(response, 0.1)
    high = _first(response, 0.9)
    if isinstance(low, Undefined):
        return low
    if isinstance(high, Undefined):
        return high
    return high - low


@measure("s")
def settling_time(response: Response) -> float | Undefined:
    """Time from the step until the response stays in a band of +-2 % of the step height.

    The last entry into this band around the final value is interpolated. The time is undefined if
    that entry is in the last tenth of the time after the step, where a longer recording could show
    a later entry. A response with ripple of more than 4 % peak to peak, or a steady-state error of
    more than 2 %, never settles.
    """
    unseen = why_unseen(response)
    if unseen is not None:
        return unseen
    t = response.t
    z = response.z
    k = len(z) - 1
    while k >= 0 and not abs(z[k] - 1.0) > _BAND:
        k -= 1
    if k == len(z) - 1:
        return Undefined(f"never settles: it ends at {100.0 * z[-1]:.4g} % of the step height")
    if k < 0:
        return 0.0
    edge = 1.0 - _BAND if z[k] < 1.0 else 1.0 + _BAND
    entry = t[k] + (edge - z[k]) / (z[k + 1] - z[k]) * (t[k + 1] - t[k])
    if entry > t[-1] - _SETTLED * (t[-1] - t[0]):
        return Undefined(
            f"enters the band only {t[-1] - entry:.3g} s before the recording ends. Record longer",
            is_open=True,
        )
    return entry - t[0]


@measure("%")
def overshoot(response: Response) -> float | Undefined:
    """Maximum excess of the response over its final value, in % of the step height.

    The peak is the largest sample. The overshoot is 0 if the response never exceeds the final
    value. If the response does not settle, it is unknown whether it would overshoot.
    """
    unseen = why_unseen(response)
    if unseen is not None:
        return unseen
    moving = _why_unsteady(response)
    if moving is not None:
        return moving
    excess = max(response.z) - 1.0
    last = response.z[-1]
    if abs(last - 1.0) > _BAND and excess <= 0.0:
        return Undefined(
            f"never exceeds the set point, and ends at {100.0 * last:.4g} % of the step height",
            is_open=True,
        )
    return 100.0 * max(0.0, excess)


@measure("level")
def steady_state_error(response: Response) -> float | Undefined:
    """Magnitude of the set point minus the mean response in the steady-state window.

    Trapezoidal mean over the window's samples. The default window is the last 20 % of the time
    after the step. Ripple averages out except for an incomplete period.
    """
    if not response.is_tracking:
        return Undefined("the experiment has no set point")
    if not response.has_window:
        return _without_window(response.low, response.high)
    moving = _why_unsteady(response)
    if moving is not None:
        return moving
    return abs(response.end - response.mean)


@measure("level")
def ripple(response: Response) -> float | Undefined:
    """Peak-to-peak value of the response in the steady-state window.

    Maximum minus minimum sample. The default window is the last 20 % of the time after the step.
    Smoothing also removes ripple of the smoothing period from this key figure.
    """
    if not response.has_window:
        return _without_window(response.low, response.high)
    flat = _why_flat(response)
    if flat is not None and not response.is_tracking:
        return flat
    still = _why_still(response)
    if still is not None:
        return still
    moving = _why_unsteady(response)
    if moving is not None:
        return moving
    return response.band


def why_unseen(response: Response) -> Undefined | None:
    """Reason why there is no visible step; None if there is one."""
    flat = _why_flat(response)
    if flat is not None:
        return flat
    still = _why_still(response)
    if still is not None or response.is_tracking:
        return still
    if abs(response.end - response.start) <= response.band:
        return Undefined(
            "the response changes by less than its ripple, so any step is hidden", is_open=True
        )
    return _why_unsteady(response)


def _why_flat(response: Response) -> Undefined | None:
    """Reason if the step height is zero or unknown; else None."""
    if _has_height(response.start, response.end):
        return None
    return Undefined(
        f"the step height is zero ({response.start:g} to {response.end:g})", is_open=True
    )


def _why_still(response: Response) -> Undefined | None:
    """Reason if the response stays within 5 % of the step height of its first level; else None."""
    height = abs(response.end - response.start)
    if not response.most <= _DEAD * height:
        return None
    return Undefined(
        f"the response hardly changes: it varies by at most {response.most:.3g} in a step of "
        f"{height:.3g} {{level}}",
        is_open=True,
    )


def _why_unsteady(response: Response) -> Undefined | None:
    """Reason if the response still moves in the steady-state window; else None.

    It moves if the means of the window's halves differ by more than 2 % of the step height, or if
    the extremes of the later half exceed those of the earlier half by more than that. Both halves
    have the same number of intervals. Ripple of several periods does neither.
    """
    height = abs(response.end - response.start)
    if not _has_height(response.start, response.end) or not response.drift > _MOVING * height:
        return None
    return Undefined(
        "the response still moves at the end, by "
        f"{100.0 * response.drift / height:.3g} % of the step height in the steady-state window. "
        "Record longer",
        is_open=True,
    )


def _without_window(low: float, high: float) -> Undefined:
    return Undefined(
        f"the steady-state window, {low:g} to {high:g} s, contains fewer than 2 samples"
    )


def _has_height(start: float, end: float) -> bool:
    """Whether two levels differ."""
    height = end - start
    return isfinite(height) and abs(height) > 1e-12 * max(abs(start), abs(end))


def _drift(t: Samples, y: Samples) -> float:
    """Drift of a response between the halves of a window: of its mean, or of its extremes."""
    k = (len(t) - 1) // 2
    if k < 1:
        return 0.0
    early = y[: k + 1]
    late = y[len(t) - 1 - k :]
    first = integral(t[: k + 1], early) / (t[k] - t[0])
    then = integral(t[len(t) - 1 - k :], late) / (t[-1] - t[len(t) - 1 - k])
    return max(abs(then - first), max(min(early) - min(late), max(late) - max(early)))


def _first(response: Response, level: float) -> float | Undefined:
    """Time from the step to the first crossing of a level."""
    unseen = why_unseen(response)
    if unseen is not None:
        return unseen
    t = response.t
    z = response.z
    k = 0
    while k < len(z) and not z[k] >= level:
        k += 1
    if k == len(z):
        return Undefined(
            f"never reaches {100.0 * level:g} % of the step height, at most {100.0 * max(z):.4g} %"
        )
    if k == 0:
        return Undefined(f"already at {100.0 * z[0]:.4g} % of the step height at the step")
    share = (level - z[k - 1]) / (z[k] - z[k - 1])
    return t[k - 1] + share * (t[k] - t[k - 1]) - t[0]
