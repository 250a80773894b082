"""Key figures of a two-wheeler's stop: distance, deceleration, wheel slip, and disc heat."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from math import isfinite
from typing import NamedTuple

from bywire.bench.kpis.kpi import Undefined, measure
from bywire.bench.kpis.samples import Samples, moving_average, value_at
from bywire.core.typing import Array

SLOW = 2.5
"""speed [m/s] below which a wheel may lock, and its slip does not count in any figure"""
_ROUNDING = 1e-9  # s, rounding error of time zero
_FILTER, _BUILD_UP = 0.02, 0.3  # s: averaging time; build-up of the deceleration, not counted
_NO_STOP = "the vehicle does not stop within the recording. Set a longer options.duration"
_NO_WAY = "the vehicle does not move"


@dataclass(frozen=True)
class Setting:
    """References for a stop, and names of the signals in the recording.

    Parameters
    ----------
    ideal
        Ideal stopping distance [m].
    peak_slip
        Slip at maximum adhesion.
    """

    ideal: float = math.nan
    peak_slip: float = math.nan
    v: str = "v"
    x: str = "x"
    a: str = "a"
    phi: str = "phi"
    support: str = "support"
    heat_front: str = "E_brake_f"
    heat_rear: str = "E_brake_r"
    slip_front: str = "slip_f"
    slip_rear: str = "slip_r"
    omega_front: str = "omega_f"
    omega_rear: str = "omega_r"


class Stop(NamedTuple):
    """Stop that begins at time zero: times, speed, and its rows until standstill.

    ``end``: first standstill [s], if ``does_stop``.
    """

    t: Samples
    v: Samples
    begin: int
    until: int
    end: float
    does_stop: bool


def stop(t: Samples, v: Samples) -> Stop | Undefined:
    """Rows of the stop."""
    end = _first_standstill(t, v)
    does_stop = isfinite(end)
    begin = bisect_left(t, -_ROUNDING)
    until = bisect_right(t, end) if does_stop else len(t)
    if begin >= until:
        return Undefined("the recording ends before time zero")
    return Stop(t, v, begin, until, end, does_stop)


def standstill(t: Array, v: Array) -> float:
    """Return the first time after zero at which a speed is zero [s]; NaN if there is none."""
    return _first_standstill(t.tolist(), v.tolist())


def _first_standstill(t: Samples, v: Samples) -> float:
    """First time after zero at which a speed is zero [s]; NaN if there is none."""
    for k in range(1, len(t)):
        if v[k] <= 0.0 and v[k - 1] > 0.0 and t[k] > 0.0:
            return t[k - 1] + (t[k] - t[k - 1]) * v[k - 1] / (v[k - 1] - v[k])
    return math.nan


@measure("m")
def stopping_distance(stop: Stop, x: Samples) -> float | Undefined:
    """Distance from t = 0 to the first standstill."""
    return _distance(stop, x) if stop.does_stop else Undefined(_NO_STOP)


@measure("s")
def stopping_time(stop: Stop) -> float | Undefined:
    """Time from t = 0 to the first standstill."""
    return stop.end if stop.does_stop else Undefined(_NO_STOP)


@measure("%")
def braking_efficiency(stop: Stop, x: Samples, setting: Setting) -> float | Undefined:
    """Ideal stopping distance on this road, relative to the actual distance."""
    if not stop.does_stop:
        return Undefined(_NO_STOP)
    if not isfinite(setting.ideal):
        return Undefined(
            "the tires cannot hold the vehicle on this road, so there is no ideal stop"
        )
    distance = _distance(stop, x)
    return 100.0 * setting.ideal / distance if distance > 0.0 else Undefined(_NO_WAY)


@measure("m/s**2")
def mean_deceleration(stop: Stop, x: Samples) -> float | Undefined:
    """Mean fully developed deceleration: from 0.8 to 0.1 of the initial speed, over distance."""
    if not stop.does_stop:
        return Undefined(_NO_STOP)
    start = value_at(stop.t, stop.v, 0.0)
    fast = 0.8 * start
    slow = 0.1 * start
    way = _fallen(x, stop.v, slow) - _fallen(x, stop.v, fast)
    return (fast * fast - slow * slow) / (2.0 * way) if way > 0.0 else Undefined(_NO_WAY)


@measure("m/s**3")
def jerk(stop: Stop, a: Samples) -> float:
    """Maximum slope of the deceleration (0.02 s average), after 0.3 s, above 2.5 m/s."""
    t = stop.t
    mean = moving_average(t, a, _FILTER)
    last = len(t) - 1
    most = 0.0
    for k in range(stop.begin, stop.until):
        if stop.v[k] > SLOW and t[k] > _BUILD_UP:
            if k == 0:
                rate = (mean[1] - mean[0]) / (t[1] - t[0])
            elif k == last:
                rate = (mean[k] - mean[k - 1]) / (t[k] - t[k - 1])
            else:  # the slope of the parabola through three samples
                before = t[k] - t[k - 1]
                after = t[k + 1] - t[k]
                rising = (mean[k] - mean[k - 1]) / before
                onward = (mean[k + 1] - mean[k]) / after
                rate = (after * rising + before * onward) / (before + after)
            most = max(most, abs(rate))
    return most


@measure("rad")
def peak_pitch(stop: Stop, phi: Samples) -> float:
    """Maximum nose-down pitch, relative to the pitch at time zero."""
    return max(phi[stop.begin : stop.until]) - value_at(stop.t, phi, 0.0)


@measure("s")
def lift_time(stop: Stop, support: Samples) -> float:
    """Time during which the rear wheel is off the ground."""
    lasted = 0.0
    for k in range(stop.begin, min(stop.until, len(stop.t) - 1)):
        if support[k] <= 0.0:
            lasted += stop.t[k + 1] - stop.t[k]
    return lasted


@measure("J")
def disc_energy(stop: Stop, heat_front: Samples, heat_rear: Samples) -> float:
    """Total heat into all brake discs."""
    return _heat(stop, heat_front) + _heat(stop, heat_rear)


@measure("1")
def peak_slip_front(stop: Stop, slip_front: Samples) -> float:
    """Maximum slip at speeds above 2.5 m/s."""
    return _peak_slip(stop, slip_front)


@measure("1")
def peak_slip_rear(stop: Stop, slip_rear: Samples) -> float:
    """Maximum slip at speeds above 2.5 m/s."""
    return _peak_slip(stop, slip_rear)


@measure("s")
def excess_slip_time_front(stop: Stop, slip_front: Samples, setting: Setting) -> float:
    """Time during which slip exceeds twice the slip at peak adhesion, at speeds above 2.5 m/s."""
    return _excess_slip_time(stop, slip_front, setting.peak_slip)


@measure("s")
def excess_slip_time_rear(stop: Stop, slip_rear: Samples, setting: Setting) -> float:
    """Time during which slip exceeds twice the slip at peak adhesion, at speeds above 2.5 m/s."""
    return _excess_slip_time(stop, slip_rear, setting.peak_slip)


@measure("s")
def locked_time_front(stop: Stop, omega_front: Samples) -> float:
    """Time during which the wheel is locked, at speeds above 2.5 m/s."""
    return _locked_time(stop, omega_front)


@measure("s")
def locked_time_rear(stop: Stop, omega_rear: Samples) -> float:
    """Time during which the wheel is locked, at speeds above 2.5 m/s."""
    return _locked_time(stop, omega_rear)


@measure("s")
def longest_lock_front(stop: Stop, omega_front: Samples) -> float:
    """Longest uninterrupted time during which the wheel is locked, at speeds above 2.5 m/s."""
    return _longest_lock(stop, omega_front)


@measure("s")
def longest_lock_rear(stop: Stop, omega_rear: Samples) -> float:
    """Longest uninterrupted time during which the wheel is locked, at speeds above 2.5 m/s."""
    return _longest_lock(stop, omega_rear)


@measure("%")
def disc_share_front(stop: Stop, heat_front: Samples, heat_rear: Samples) -> float | Undefined:
    """Fraction of the total disc heat that goes into this wheel's discs."""
    return _share(_heat(stop, heat_front), _heat(stop, heat_rear))


@measure("%")
def disc_share_rear(stop: Stop, heat_front: Samples, heat_rear: Samples) -> float | Undefined:
    """Fraction of the total disc heat that goes into this wheel's discs."""
    return _share(_heat(stop, heat_rear), _heat(stop, heat_front))


def _distance(stop: Stop, x: Samples) -> float:
    """Distance from time zero to standstill [m]."""
    return value_at(stop.t, x, stop.end) - value_at(stop.t, x, 0.0)


def _fallen(x: Samples, v: Samples, level: float) -> float:
    """Position at which a falling speed first reaches a level [m]."""
    k = 0
    while k < len(v) and not v[k] <= level:
        k += 1
    if k == len(v):
        return x[0]
    if k == 0 or v[k] == level:
        return x[k]
    return (x[k - 1] - x[k]) / (min(v[:k]) - v[k]) * (level - v[k]) + x[k]


def _heat(stop: Stop, energy: Samples) -> float:
    """Heat into a wheel's discs [J]."""
    return energy[stop.until - 1] - energy[stop.begin]


def _share(this: float, other: float) -> float | Undefined:
    every = this + other
    return 100.0 * this / every if every > 0.0 else Undefined("no brake absorbs heat")


def _peak_slip(stop: Stop, slip: Samples) -> float:
    most = 0.0
    for k in range(stop.begin, stop.until):
        if stop.v[k] > SLOW:
            most = max(most, slip[k])
    return most


def _excess_slip_time(stop: Stop, slip: Samples, peak: float) -> float:
    lasted = 0.0
    for k in range(stop.begin, min(stop.until, len(stop.t) - 1)):
        if stop.v[k] > SLOW and slip[k] > 2.0 * peak:
            lasted += stop.t[k + 1] - stop.t[k]
    return lasted


def _locked_time(stop: Stop, omega: Samples) -> float:
    lasted = 0.0
    for k in range(stop.begin, min(stop.until, len(stop.t) - 1)):
        if stop.v[k] > SLOW and omega[k] == 0.0:
            lasted += stop.t[k + 1] - stop.t[k]
    return lasted


def _longest_lock(stop: Stop, omega: Samples) -> float:
    t = stop.t
    longest = 0.0
    since = -1
    for k in range(stop.begin, stop.until):
        if stop.v[k] > SLOW and omega[k] == 0.0:
            if since < 0:
                since = k
            longest = max(longest, t[min(k + 1, len(t) - 1)] - t[since])
        else:
            since = -1
    return longest
