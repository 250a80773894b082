"""How a vehicle with two wheels stops: how far, how smoothly, and what its wheels did meanwhile."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.bench.kpis.in_c import UNSOUND, InC
from bywire.bench.kpis.kpi import Measure, Undefined, measure
from bywire.bench.kpis.samples import defect, signal, total
from bywire.bench.kpis.smoothing import smoothed
from bywire.core.typing import Array

Flags = NDArray[np.bool_]
SLOW = 2.5
"""speed [m/s] below which a wheel may lock, and slip is not judged"""
_ROUNDING = 1e-9  # s: of time zero
_FILTER, _BUILD_UP = 0.02, 0.3  # s: averaging of the deceleration, and what is no jerk of control
_NO_STOP = "the vehicle does not stop in the recorded time: give a longer options.duration"
_NO_IDEAL = "tyres do not hold the vehicle on this road, so no stop is ideal"
_NO_WAY = "the vehicle makes no way"
_NO_HEAT = "no brake takes heat"
_NO_ROWS = "nothing is recorded from time zero on"
_WHEELS = ("front", "rear")


@dataclass(frozen=True)
class Setting:
    """What a stop is measured by, and names of the signals in the recording.

    Parameters
    ----------
    ideal
        Ideal stopping distance [m].
    peak_slip
        Slip of the largest adhesion.
    """

    BY_CASE: ClassVar[tuple[str, ...]] = ("ideal", "peak_slip")

    ideal: Any = math.nan
    peak_slip: Any = math.nan
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


_SIGNALS = (
    "v",
    "x",
    "a",
    "phi",
    "support",
    "heat_front",
    "heat_rear",
    "slip_front",
    "slip_rear",
    "omega_front",
    "omega_rear",
)


def _packed(setting: Setting, cases: int) -> Array:
    levels = np.broadcast_arrays(np.zeros(cases), setting.ideal, setting.peak_slip)[1:]
    return np.stack(levels, axis=-1)


IN_C = InC(
    signals=_SIGNALS,
    reasons=(_NO_STOP, _NO_IDEAL, _NO_WAY, _NO_HEAT),
    failures=(UNSOUND, _NO_ROWS),
    packed=_packed,
    room=6,
    is_alone_in_python=True,
)


@dataclass(frozen=True, eq=False)
class Stop:
    """Samples of a stop that begins at time zero.

    Parameters
    ----------
    t
        Times [s], increasing, shape ``(n,)``.
    signals
        Signals by the fields of the setting, shape ``(n,)`` each.
    ideal, peak_slip
        As in `Setting`.
    """

    t: Array
    signals: Mapping[str, Array]
    ideal: float
    peak_slip: float

    @property
    def units(self) -> Mapping[str, str]:
        """No placeholder is used."""
        return {}

    @property
    def note(self) -> str:
        """Nothing is treated."""
        return ""

    @cached_property
    def defect(self) -> str:
        """Why no figure is defined."""
        wrong = defect(self.t, *self.signals.values())
        return wrong or ("" if self.braked.any() else _NO_ROWS)

    @cached_property
    def end(self) -> float:
        """First standstill [s]; NaN where there is none."""
        return standstill(self.t, self.signals["v"])

    @cached_property
    def braked(self) -> Flags:
        """Rows from time zero to the standstill."""
        is_before = self.t <= self.end if math.isfinite(self.end) else np.isfinite(self.t)
        rows: Flags = (self.t >= -_ROUNDING) & is_before
        return rows

    @cached_property
    def fast(self) -> Flags:
        """Rows at which wheels are judged."""
        rows: Flags = self.braked & (self.signals["v"] > SLOW)
        return rows

    @cached_property
    def distance(self) -> float:
        """Way to the standstill [m], where there is one."""
        x = self.signals["x"]
        return _at(self.t, x, self.end) - _at(self.t, x, 0.0)

    def heat(self, wheel: str) -> float:
        """Return the heat of a wheel's discs [J]."""
        energy = self.signals[f"heat_{wheel}"][self.braked]
        return float(energy[-1] - energy[0])


def select(recording: xr.Dataset, setting: Setting) -> Stop:
    """Return what the figures need."""
    t, _ = signal(recording, "time")
    signals = {each: signal(recording, getattr(setting, each))[0] for each in _SIGNALS}
    return Stop(t, signals, float(setting.ideal), float(setting.peak_slip))


def standstill(t: Array, v: Array) -> float:
    """Return when a speed is zero for the first time after zero [s]; NaN where it never is."""
    stopped = np.flatnonzero((v[1:] <= 0) & (v[:-1] > 0) & (t[1:] > 0))
    if not stopped.size:
        return math.nan
    k = int(stopped[0]) + 1
    return float(t[k - 1] + (t[k] - t[k - 1]) * v[k - 1] / (v[k - 1] - v[k]))


@measure("m")
def stopping_distance(data: Stop) -> float | Undefined:
    """Distance from time zero to the first standstill."""
    return data.distance if math.isfinite(data.end) else Undefined(_NO_STOP)


@measure("s")
def stopping_time(data: Stop) -> float | Undefined:
    """Time from zero to the first standstill."""
    return data.end if math.isfinite(data.end) else Undefined(_NO_STOP)


@measure("%")
def braking_efficiency(data: Stop) -> float | Undefined:
    """Ideal stopping distance on this road over the distance."""
    if not math.isfinite(data.end):
        return Undefined(_NO_STOP)
    if not math.isfinite(data.ideal):
        return Undefined(_NO_IDEAL)
    return 100.0 * data.ideal / data.distance if data.distance > 0 else Undefined(_NO_WAY)


@measure("m/s**2")
def mean_deceleration(data: Stop) -> float | Undefined:
    """Mean fully developed deceleration: over the way from 0.8 to 0.1 of the speed."""
    if not math.isfinite(data.end):
        return Undefined(_NO_STOP)
    x, v = data.signals["x"], data.signals["v"]
    start = _at(data.t, v, 0.0)
    fast, slow = 0.8 * start, 0.1 * start
    begin, end = _fallen(x, v, fast), _fallen(x, v, slow)
    squares = fast * fast - slow * slow
    return squares / (2.0 * (end - begin)) if end > begin else Undefined(_NO_WAY)


@measure("m/s**3")
def jerk(data: Stop) -> float:
    """Largest rate of the deceleration, averaged over 0.02 s, from 0.3 s on above 2.5 m/s."""
    t, judged = data.t, data.fast & (data.t > _BUILD_UP)
    slope = np.diff(smoothed(t, data.signals["a"], _FILTER)) / np.diff(t)
    before, after = t[1:-1] - t[:-2], t[2:] - t[1:-1]
    bent = (after * slope[:-1] + before * slope[1:]) / (before + after)
    rate = np.concatenate((slope[:1], bent, slope[-1:]))
    return float(np.max(np.abs(rate[judged]), initial=0.0))


@measure("rad")
def peak_pitch(data: Stop) -> float:
    """Largest pitch, nose down, beyond that at time zero."""
    phi = data.signals["phi"]
    return float(np.max(phi[data.braked]) - _at(data.t, phi, 0.0))


@measure("s")
def lift_time(data: Stop) -> float:
    """Time in which the rear wheel is off the ground."""
    return _time(data.t, data.braked & (data.signals["support"] <= 0))


@measure("J")
def disc_energy(data: Stop) -> float:
    """Heat of all brake discs."""
    return data.heat("front") + data.heat("rear")


def _of_wheels(
    unit: str, function: Callable[[Stop, str], float | Undefined]
) -> tuple[Measure[Stop], ...]:
    """Return a figure of each wheel."""

    def of(wheel: str) -> Measure[Stop]:
        def figure(data: Stop) -> float | Undefined:
            return function(data, wheel)

        figure.__name__, figure.__doc__ = f"{function.__name__[1:]}_{wheel}", function.__doc__
        return Measure(unit, figure)

    return tuple(map(of, _WHEELS))


def _peak_slip(data: Stop, wheel: str) -> float:
    """Largest slip above 2.5 m/s."""
    return float(np.max(data.signals[f"slip_{wheel}"][data.fast], initial=0.0))


def _excess_slip_time(data: Stop, wheel: str) -> float:
    """Time with twice the peak's slip above 2.5 m/s."""
    return _time(data.t, data.fast & (data.signals[f"slip_{wheel}"] > 2.0 * data.peak_slip))


def _locked_time(data: Stop, wheel: str) -> float:
    """Time in which the wheel stands, above 2.5 m/s."""
    return _time(data.t, data.fast & (data.signals[f"omega_{wheel}"] == 0))


def _longest_lock(data: Stop, wheel: str) -> float:
    """Longest time in which the wheel stands at once, above 2.5 m/s."""
    locked = data.fast & (data.signals[f"omega_{wheel}"] == 0)
    edges = np.diff(np.concatenate(([0], locked.astype(int), [0])))
    begins = np.flatnonzero(edges > 0)
    ends = np.minimum(np.flatnonzero(edges < 0), data.t.size - 1)
    return float(np.max(data.t[ends] - data.t[begins], initial=0.0))


def _disc_share(data: Stop, wheel: str) -> float | Undefined:
    """Share of the discs' heat that this wheel's take."""
    every = data.heat("front") + data.heat("rear")
    return 100.0 * data.heat(wheel) / every if every > 0 else Undefined(_NO_HEAT)


peak_slip_front, peak_slip_rear = _of_wheels("1", _peak_slip)
excess_slip_time_front, excess_slip_time_rear = _of_wheels("s", _excess_slip_time)
locked_time_front, locked_time_rear = _of_wheels("s", _locked_time)
longest_lock_front, longest_lock_rear = _of_wheels("s", _longest_lock)
disc_share_front, disc_share_rear = _of_wheels("%", _disc_share)


def _at(t: Array, y: Array, instant: float) -> float:
    """Return a signal at an instant, straight between samples, as at the ends beyond them."""
    k = int(np.searchsorted(t, instant, side="right")) - 1
    if k < 0 or k == t.size - 1 or t[k] == instant:
        return float(y[max(k, 0)])
    return float((y[k + 1] - y[k]) / (t[k + 1] - t[k]) * (instant - t[k]) + y[k])


def _fallen(x: Array, v: Array, level: float) -> float:
    """Return where a speed that falls to zero is at a level for the first time [m]."""
    k = int(np.argmax(v <= level))
    if k == 0 or v[k] == level:
        return float(x[k])
    least = np.min(v[:k])
    return float((x[k - 1] - x[k]) / (least - v[k]) * (level - v[k]) + x[k])


def _time(t: Array, rows: Flags) -> float:
    """Return how long a condition holds: the intervals that begin with a row in which it does."""
    held = np.diff(t)[rows[:-1]]
    return float(total(held)) if held.size else 0.0
