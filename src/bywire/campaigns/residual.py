"""Residuals with which a controller can detect faults, and campaigns that brakes declare."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from bywire.core.arguments import checked
from bywire.core.model import ASSEMBLIES
from bywire.core.registry import Kind, instances
from bywire.core.typing import Array


@checked
def least_of_the_last(values: Array, rows: int) -> Array:
    """Return the minimum of the last rows, including the present one, along the last axis."""
    size = max(min(rows, values.shape[-1]), 1)
    return np.asarray(minimum_filter1d(values, size, axis=-1, origin=(size - 1) // 2))


@checked
def largest_of_the_last(values: Array, rows: int) -> Array:
    """Return the maximum of the last rows, including the present one, along the last axis."""
    return -least_of_the_last(-values, rows)


@checked
def mean_of_the_last(values: Array, rows: int) -> Array:
    """Return the mean of the last rows, including the present one, along the last axis."""
    size = max(min(rows, values.shape[-1]), 1)
    return np.asarray(uniform_filter1d(values, size, axis=-1, origin=(size - 1) // 2))


def first_time(holds: Array, time: Array, since: Array) -> Array:
    """Return the first time [s] after a start at which a condition is true, otherwise NaN.

    Parameters
    ----------
    holds
        Condition, shape (cases, rows).
    time
        Times of the rows [s].
    since
        Start of each case [s], shape (cases,).
    """
    counted = (holds > 0) & (time >= since[:, None] - 1e-9)
    there = counted.any(axis=1)
    return np.where(there, time[np.argmax(counted, axis=1)], np.nan)


# --- Residuals

NEVER = -1e9
"""value of an inactive residual; a residual that is always inactive has no threshold"""


@dataclass(frozen=True)
class Residual:
    """Residual: a quantity that is small without faults.

    Parameters
    ----------
    name
        Name in reports.
    summary
        The compared quantities.
    assembly
        Name of the assembly, or names of the assemblies, whose controller computes it.
    unit
        SI unit.
    signals
        Recorded signals that it uses, which must be available to the controller.
    compute
        ``compute(signals, par, dt)``: its magnitude in every row, shape (cases, rows), `NEVER`
        while it is inactive; ``signals`` by name, of that shape; ``par``: the controller's
        parameters; ``dt``: time between rows [s].
    hold
        Uninterrupted time above the threshold until detection [s].
    """

    name: str
    summary: str
    assembly: str | tuple[str, ...]
    unit: str
    signals: tuple[str, ...]
    compute: Callable[[Mapping[str, Array], Any, float], Array]
    hold: float = 0.0

    @property
    def assemblies(self) -> tuple[str, ...]:
        """Names of the assemblies with this residual."""
        return (self.assembly,) if isinstance(self.assembly, str) else self.assembly

    def lasted(self, signals: Mapping[str, Array], par: Any, time: Array) -> Array:
        """Return the minimum over the hold time, shape (cases, rows)."""
        dt = float(time[1] - time[0])
        return least_of_the_last(self.compute(signals, par, dt), round(self.hold / dt) + 1)


RESIDUALS = Kind("residual", ("residuals",), instances(Residual), declared="a Residual")
"""the residuals of every brake"""


def residuals_of(model: Any) -> dict[str, Residual]:
    """Return the residuals of a model and of the assemblies within it.

    The names of the latter begin with their parameters' path, and their signals have a prefix.
    """
    every = RESIDUALS.of(ASSEMBLIES.owner(model.name)).values()
    mine = (each for each in every if model.name in each.assemblies)
    known = {each.name: replace(each, assembly=model.name) for each in mine}
    for sub in getattr(model, "subs", {}).values():
        for each in residuals_of(sub.assembly).values():
            name = f"{sub.path}.{each.name}"
            known[name] = replace(
                each,
                name=name,
                summary=f"{sub.label}: {each.summary}",
                assembly=model.name,
                signals=tuple(map(sub.named, each.signals)),
                compute=partial(_within, sub, each.signals, each.compute),
            )
    return known


def _within(
    sub: Any,
    names: tuple[str, ...],
    compute: Callable[[Mapping[str, Array], Any, float], Array],
    signals: Mapping[str, Array],
    par: Any,
    dt: float,
) -> Array:
    own = {name: signals[sub.named(name)] for name in names}
    return compute(own, sub.parameters(par), dt)


def missed_ticks(task: str, assembly: str, period: float) -> Residual:
    """Return the watchdog of a task: number of missed ticks among the last five.

    It uses a signal ``missed_TASK``, which is 1 at a missed tick.
    """
    signal = f"missed_{task}"

    def count(signals: Mapping[str, Array], par: Any, dt: float) -> Array:
        return mean_of_the_last(signals[signal], max(round(5.0 * period / dt), 1))

    return Residual(
        f"watchdog.{task}", f"missed ticks of task {task}", assembly, "1", (signal,), count
    )


def threshold(largest: Array, share: float) -> float:
    """Return the threshold that at most a given fraction of fault-free runs exceeds.

    Parameters
    ----------
    largest
        Maximum of each fault-free run, shape (cases,).
    share
        Allowed fraction of false alarms; if it is less than one run, no run exceeds the threshold.
    """
    ordered = np.sort(largest)
    admitted = int(np.floor(share * ordered.size))
    return float(ordered[-1 - admitted]) if admitted < ordered.size else float(ordered[0])


def detected(lasted: Array, limit: float, time: Array, since: Array) -> Array:
    """Return the time at which a residual first exceeds its threshold [s]; NaN if never.

    A residual that was always inactive in fault-free runs has no threshold and detects nothing.
    """
    if limit <= NEVER:
        return np.full(len(lasted), np.nan)
    margin = 1e-9 * max(abs(limit), 1e-12)  # for rounding errors
    return first_time(np.where(lasted > limit + margin, 1.0, 0.0), time, since)


# --- Declared campaigns


@dataclass(frozen=True)
class DeclaredCampaign:
    """A campaign that belongs to a brake.

    Parameters
    ----------
    name
        Name on the command line.
    summary
        One line for listings.
    content
        Content of a campaign file, in which ``bench`` is the name of an experiment.
    """

    name: str
    summary: str
    content: Mapping[str, Any]


CAMPAIGNS = Kind("campaign", ("campaigns",), instances(DeclaredCampaign))
"""the campaigns of every brake"""
