"""Strokes of a piston: where it crosses a stretch of its travel one way without turning back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.identification.differentiation import low_passed
from bywire.identification.measured import wrong_sign
from bywire.identification.output_error import even_interval

_CROSSED = 0.8  # of the stretch that a stroke has to cross
_LEVEL = 0.01  # of a false alarm
_FEWEST_STROKES = 4  # that tell a drift
_APART = 1.2  # ratio of the highest pressure to the lowest that tells them apart


@dataclass(frozen=True)
class Stroke:
    """One crossing.

    Parameters
    ----------
    direction
        1 outward, -1 inward.
    rows
        Samples in it that slide, of the record.
    """

    direction: int
    rows: NDArray[np.intp]


def velocity(x: Array, interval: float, cutoff: float) -> Array:
    """Return the velocity of a measured travel, low-passed; gaps are bridged straight.

    Parameters
    ----------
    x
        Travel [m], shape (n,); NaN in gaps.
    interval, cutoff
        Sample time [s] and corner frequency [Hz].
    """
    there = np.isfinite(x)
    at = np.arange(x.size)
    whole = x if there.all() else np.interp(at, at[there], x[there])
    return np.gradient(low_passed(whole, interval, cutoff), interval)


def find_strokes(x: Array, v: Array, low: float, high: float, slowest: float) -> list[Stroke]:
    """Return the strokes through a stretch of travel.

    Parameters
    ----------
    x, v
        Travel [m] and velocity [m/s], shape (n,).
    low, high
        The stretch [m].
    slowest
        Slower samples stick, creep or turn round, and do not count [m/s].
    """
    inside = np.isfinite(x) & (x > low) & (x < high)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], inside.astype(int), [0]))))
    strokes = []
    for begin, end in edges.reshape(-1, 2).tolist():
        travel = float(x[end - 1] - x[begin])
        if abs(travel) < _CROSSED * (high - low):
            continue
        direction = 1 if travel > 0 else -1
        rows = begin + np.flatnonzero(direction * v[begin:end] > slowest)
        if rows.size:
            strokes.append(Stroke(direction, rows))
    return strokes


@dataclass(frozen=True)
class Group:
    """Strokes of one record in one direction.

    Parameters
    ----------
    direction
        1 outward, -1 inward.
    p, F
        Means over the strokes [Pa, N].
    scatter
        Standard deviation of F from stroke to stroke [N].
    strokes
        Means of each stroke, in their order: time [s], p, F; shape (count, 3).
    record
        Label of the record; empty where there is one alone.
    """

    direction: int
    p: float
    F: float
    scatter: float
    strokes: Array
    record: str = ""

    @property
    def label(self) -> str:
        """Record and direction, in words."""
        way = "outward" if self.direction > 0 else "inward"
        return f"{self.record} {way}" if self.record else way


def grouped(
    record: xr.Dataset, stretch: tuple[float, float], slowest: float, cutoff: float, label: str = ""
) -> list[Group]:
    """Return the groups of a record, outward first.

    Parameters
    ----------
    record
        ``x`` [m], ``p`` [Pa] and ``F`` [N] over ``time`` [s], evenly spaced.
    stretch
        Travels between which strokes count [m].
    slowest
        Speed above which the piston slides [m/s].
    cutoff
        Corner of the low-pass before the travel is differentiated [Hz].
    label
        Of the record.
    """
    time = record["time"].values
    x, p, F = (record[name].values for name in ("x", "p", "F"))
    v = velocity(x, even_interval(time), cutoff)
    strokes = find_strokes(x, v, *stretch, slowest)
    groups = []
    for direction in (1, -1):
        means = np.array(
            [
                (time[s.rows].mean(), np.nanmean(p[s.rows]), np.nanmean(F[s.rows]))
                for s in strokes
                if s.direction == direction and np.isfinite(F[s.rows]).any()
            ]
        )
        if means.size:
            scatter = float(means[:, 2].std(ddof=1)) if len(means) > 1 else 0.0
            _, p_mean, F_mean = means.mean(axis=0).tolist()
            groups.append(Group(direction, p_mean, F_mean, scatter, means, label))
    return groups


def require_told(groups: Sequence[Group]) -> None:
    """Refuse strokes that do not tell the friction from the area, or its two parts apart.

    Raises
    ------
    ParameterError
        When there are none, in one direction alone, or at one pressure alone.
    """
    if not groups:
        raise ParameterError(
            "no stroke crosses the stretch x_low to x_high: move the piston to and fro through "
            f"it, or set {option('options')} x_low and x_high to where it moves"
        )
    if len({g.direction for g in groups}) < 2:
        raise ParameterError("F_0 and f need strokes both ways: friction alone changes sign")
    levels = [g.p for g in groups]
    if max(levels) < _APART * min(levels) or len(groups) < 4:
        raise ParameterError(
            f"f cannot be told from F_0: all strokes were made at {min(levels) / 1e5:.3g} to "
            f"{max(levels) / 1e5:.3g} bar; give a record each at two pressures or more"
        )


def require_signs(A: float, friction: float) -> None:
    """Refuse an area below zero, and friction that drives.

    Parameters
    ----------
    A
        Force over pressure [m^2].
    friction
        In the mean over all strokes [N].

    Raises
    ------
    ParameterError
        When a signal has the wrong sign: the force pushes against the pressure, and more of it
        outward than inward.
    """
    if A < 0.0:
        raise wrong_sign("F", "p", f"area {shown(float(f'{A:.4g}'), 'm**2')}")
    if friction < 0.0:
        raise wrong_sign("F", "x", f"friction {friction:.3g} N in the mean: it would drive")


def half_widths(groups: Sequence[Group]) -> tuple[Array, Array]:
    """Return mean pressure and half the loop's height of neighboring groups up and down."""
    pairs = [(a, b) for a, b in pairwise(groups) if a.direction == 1 and b.direction == -1]
    p = np.array([0.5 * (a.p + b.p) for a, b in pairs])
    return p, np.array([0.5 * (a.F - b.F) for a, b in pairs])


def pressure_between(groups: Sequence[Group]) -> float:
    """Return by how much the pressure is higher outward than inward [Pa]."""
    up, down = (np.mean([g.p for g in groups if g.direction == d]) for d in (1, -1))
    return float(up - down)


def drifting(groups: Sequence[Group], area: float) -> tuple[str, ...]:
    """Return which groups' force drifts from stroke to stroke, with how much.

    Parameters
    ----------
    groups
        Of all records.
    area
        Force over pressure [m^2]: what the pressure's own drift adds is no drift.
    """
    from scipy import stats

    texts = []
    for group in groups:
        time, p, F = group.strokes.T
        if time.size < _FEWEST_STROKES:
            continue
        line = stats.linregress(time, F - area * p)
        if line.pvalue < _LEVEL / len(groups):
            change = float(line.slope * np.ptp(time))
            texts.append(
                f"the force drifts by {change:.2g} N over the {time.size} strokes {group.label}: "
                "let it run in, or cut the record"
            )
    return tuple(texts)


def misfits(groups: Sequence[Group], W: Array, F: Array) -> tuple[str, ...]:
    """Return which records lie off what all others tell, with how far.

    The mean forces of each record are compared with what the fit without it predicts.

    Parameters
    ----------
    groups
        In the order of the rows.
    W, F
        The regression: shapes (n, p) and (n,).
    """
    from scipy import stats

    texts, (n, p) = [], W.shape
    labels = np.array([group.record for group in groups])
    for label in dict.fromkeys(labels.tolist()):
        held = labels == label
        rest, count = ~held, int(held.sum())
        freedom = n - count - p
        if freedom < 1 or np.linalg.matrix_rank(W[rest] / np.linalg.norm(W, axis=0)) < p:
            continue
        values = np.linalg.lstsq(W[rest], F[rest], rcond=None)[0]
        left = F[rest] - W[rest] @ values
        off = F[held] - W[held] @ values
        inverse = np.linalg.pinv(W[rest]) @ np.linalg.pinv(W[rest]).T
        spread = np.eye(count) + W[held] @ inverse @ W[held].T
        variance = max(float(left @ left) / freedom, 1e-300)
        ratio = float(off @ np.linalg.solve(spread, off)) / count / variance
        if ratio > stats.f.isf(_LEVEL / len(groups), count, freedom):
            texts.append(
                f"{label or 'the record'} lies {float(np.abs(off).max()):.2g} N off what all other "
                "records tell: look at its zeros, its pressure and its run-in"
            )
    return tuple(texts)
