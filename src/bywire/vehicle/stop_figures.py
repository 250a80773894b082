"""Key figures of a stop: how far, how smoothly, and what the wheels did meanwhile."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.bench.kpis.smoothing import smoothed
from bywire.core.typing import Array

Flags = NDArray[np.bool_]
SLOW = 2.5
"""speed [m/s] below which a wheel may lock, and slip is not judged"""
_FILTER, _BUILD_UP = 0.02, 0.3  # s: averaging of the deceleration, and what is no jerk of control

STOP = Figures(
    undefined="the vehicle does not stop in the recorded time: give a longer options.duration",
    stopping_distance=("m", "Distance from time zero to the first standstill."),
    stopping_time=("s", "Time from zero to the first standstill."),
    braking_efficiency=("%", "Ideal stopping distance on this road over the distance."),
    mean_deceleration=(
        "m/s**2", "Mean fully developed deceleration: over the way from 0.8 to 0.1 of the speed."
    ),
    jerk=(
        "m/s**3",
        f"Largest rate of the deceleration, averaged over {_FILTER:g} s, from {_BUILD_UP:g} s on "
        f"above {SLOW:g} m/s.",
    ),
    peak_pitch=("rad", "Largest pitch, nose down, beyond that at time zero."),
    lift_time=("s", "Time in which the rear wheel is off the ground."),
    disc_energy=("J", "Heat of all brake discs."),
)  # fmt: skip
WHEEL = Figures(
    peak_slip=("1", f"Largest slip above {SLOW:g} m/s."),
    excess_slip_time=("s", f"Time with twice the peak's slip above {SLOW:g} m/s."),
    locked_time=("s", f"Time in which the wheel stands, above {SLOW:g} m/s."),
    longest_lock=("s", f"Longest time in which the wheel stands at once, above {SLOW:g} m/s."),
    disc_share=("%", "Share of the discs' heat that this wheel's take."),
)
WHEELS = {"_front": "f", "_rear": "r"}


@dataclass(frozen=True)
class Setting:
    """What a stop is measured by.

    Parameters
    ----------
    ideal
        Ideal stopping distance [m].
    peak_slip
        Slip of the largest adhesion.
    """

    ideal: float
    peak_slip: float


def units() -> dict[str, str]:
    """Return the unit of every figure of a stop by its name."""
    return {**STOP.units, **WHEEL.ending(*WHEELS)}


def standstill(t: Array, v: Array) -> float:
    """Return when a speed is zero for the first time after zero [s]; NaN where it never is."""
    stopped = np.flatnonzero((v[1:] <= 0) & (v[:-1] > 0) & (t[1:] > 0))
    if not stopped.size:
        return math.nan
    k = int(stopped[0]) + 1
    return float(t[k - 1] + (t[k] - t[k - 1]) * v[k - 1] / (v[k - 1] - v[k]))


def stop_figures(run: xr.Dataset, setting: Setting) -> tuple[Kpi, ...]:
    """Return the key figures of a stop that begins at time zero."""
    t, v = run["time"].values, run["v"].values
    end = standstill(t, v)
    braked = (t >= -1e-9) & (t <= end if math.isfinite(end) else np.isfinite(t))
    fast = braked & (v > SLOW)
    heat = {name: _growth(run[f"E_brake_{name}"].values, braked) for name in WHEELS.values()}
    total = sum(heat.values())
    kpis = STOP(**_course(run, end, setting), **_smoothness(run, braked, fast), disc_energy=total)
    for ending, name in WHEELS.items():
        share = 100.0 * heat[name] / total if total > 0 else (math.nan, "no brake takes heat")
        kpis += WHEEL(ending, **_wheel(run, name, fast, setting), disc_share=share)
    return kpis


def _course(run: xr.Dataset, end: float, setting: Setting) -> dict[str, float]:
    t, x, v = (run[name].values for name in ("time", "x", "v"))
    begin = float(np.interp(0.0, t, x))
    distance = float(np.interp(end, t, x)) - begin if math.isfinite(end) else math.nan
    return {
        "stopping_distance": distance,
        "stopping_time": end,
        "braking_efficiency": 100.0 * setting.ideal / distance,
        "mean_deceleration": _developed(t, x, v) if math.isfinite(end) else math.nan,
    }


def _developed(t: Array, x: Array, v: Array) -> float:
    """Return (v_b^2 - v_e^2)/(2 (x_e - x_b)) from 0.8 to 0.1 of the speed at time zero."""
    start = float(np.interp(0.0, t, v))
    fast, slow = 0.8 * start, 0.1 * start
    k = int(np.flatnonzero(v <= slow)[0]) + 1
    falling = np.minimum.accumulate(v[:k])[::-1]
    at = [float(np.interp(level, falling, x[:k][::-1])) for level in (fast, slow)]
    return (fast**2 - slow**2) / (2.0 * (at[1] - at[0])) if at[1] > at[0] else math.nan


def _smoothness(run: xr.Dataset, braked: Flags, fast: Flags) -> dict[str, float]:
    t, a = run["time"].values, run["a"].values
    rate = np.gradient(smoothed(t, a, _FILTER), t)
    judged = fast & (t > _BUILD_UP)
    phi = run["phi"].values
    off = braked & (run["support"].values <= 0)
    return {
        "jerk": float(np.max(np.abs(rate[judged]), initial=0.0)),
        "peak_pitch": float(np.max(phi[braked]) - np.interp(0.0, t, phi)),
        "lift_time": _time(t, off),
    }


def _wheel(run: xr.Dataset, name: str, fast: Flags, setting: Setting) -> dict[str, float]:
    t, slip = run["time"].values, run[f"slip_{name}"].values
    locked = fast & (run[f"omega_{name}"].values == 0)
    return {
        "peak_slip": float(np.max(slip[fast], initial=0.0)),
        "excess_slip_time": _time(t, fast & (slip > 2.0 * setting.peak_slip)),
        "locked_time": _time(t, locked),
        "longest_lock": _longest(t, locked),
    }


def _growth(energy: Array, rows: Flags) -> float:
    values = energy[rows]
    return float(values[-1] - values[0]) if values.size else 0.0


def _time(t: Array, rows: Flags) -> float:
    """Return how long a condition holds: the intervals that begin with a row in which it does."""
    return float(np.sum(np.diff(t)[rows[:-1]]))


def _longest(t: Array, rows: Flags) -> float:
    edges = np.diff(np.concatenate(([0], rows.astype(int), [0])))
    begins = np.flatnonzero(edges > 0)
    ends = np.minimum(np.flatnonzero(edges < 0), t.size - 1)
    return float(np.max(t[ends] - t[begins], initial=0.0))
