"""Projection of a life: rates of slow states, and steps of Heun's method over many stops.

Within a step, the states advance stop by stop with constant rates, so that an adjuster acts at the
right stop. Only the ends of steps are simulated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from bywire.bench.bench import Bench
from bywire.bench.ensemble import changed, key_figures_of
from bywire.core.errors import ParameterError, RunError
from bywire.core.typing import Array, Progress, silent
from bywire.core.units import shown
from bywire.life.declaration import Effects, StopConditions, Values
from bywire.life.life_file import CONDITION, LifePlan
from bywire.studies.distribution import Distribution


@dataclass(frozen=True)
class Rates:
    """Changes of slow states per stop.

    Parameters
    ----------
    z
        Slow states of the simulated stops [SI].
    effects
        Effects of each stop of the population.
    warnings
        Warnings from the runs.
    """

    z: Values
    effects: Effects
    warnings: tuple[str, ...] = field(default=(), repr=False)

    @cached_property
    def mean(self) -> Values:
        """Mean change of each slow state per stop [SI]."""
        return {name: float(np.mean(change)) for name, change in self.effects.changes.items()}


def rates(plan: LifePlan, z: Values) -> Rates:
    """Return the changes per stop at given slow states, for the plan's population of stops.

    Raises
    ------
    InputError
        If the brake cannot be set up with these states.
    RunError
        If a run fails, or a stop lacks a key figure that determines wear.
    KeyboardInterrupt
        If interrupted.
    """
    figures, warnings = stop_figures(plan, z)
    given = plan.life.effects(figures, conditions(plan), z, plan.bench.par, plan.wear)
    return Rates(z, given, warnings)


def stop_figures(plan: LifePlan, z: Values) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return key figures of the population's stops by name, shape (stops,), and warnings."""
    which, places = plan.different
    figures, warnings = simulated(plan, z, which)
    return {name: values[places] for name, values in figures.items()}, warnings


def simulated(
    plan: LifePlan, z: Values, which: Sequence[int]
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return key figures of some stops of the population, and warnings from their runs.

    Stops that do not depend on slow states are simulated once.
    """
    follows = plan.life.follows(z, plan.bench.par, plan.wear)
    key = (tuple(follows.items()), tuple(which))
    if key not in plan.known:
        plan.known[key] = _simulated(plan, follows, which)
    figures, warnings = plan.known[key]
    return dict(figures), warnings


def _simulated(
    plan: LifePlan, follows: Mapping[str, float], which: Sequence[int]
) -> tuple[dict[str, Array], tuple[str, ...]]:
    results = key_figures_of([_stop_bench(plan, follows, k) for k in which])
    figures = {figure.name: figure for figure in results.figures}
    for name in plan.life.figures:
        lacking = np.flatnonzero(~np.isfinite(figures[name].values))
        if lacking.size:
            stop = ", ".join(f"{n} = {v[which[lacking[0]]]:g}" for n, v in plan.population.items())
            raise RunError(
                f"a stop{stop and f' with {stop} (SI)'} has no {name}: "
                + figures[name].note_of(lacking[0]),
                name=name,
            )
    warnings = dict.fromkeys(text for texts in results.warnings for text in texts)
    return {name: np.asarray(figures[name].values) for name in plan.life.figures}, tuple(warnings)


def conditions(plan: LifePlan) -> Mapping[str, Array]:
    """Return the conditions of every stop of the population by name [SI], shape (stops,)."""
    given = plan.population
    return {
        name: np.broadcast_to(
            np.asarray(given.get(f"{CONDITION}{name}", getattr(plan.conditions, name)), float),
            (plan.count,),
        )
        for name in StopConditions.model_fields
    }


def _stop_bench(plan: LifePlan, follows: Mapping[str, float], k: int) -> Bench:
    """Return a stop of the population with the parameters that depend on slow states."""
    drawn = {
        name: values[k].item()
        for name, values in plan.population.items()
        if not name.startswith(CONDITION)
    }
    return changed(plan.bench, {**drawn, **follows})


# --- The projection, which includes every event between stops

CONFIDENCE = 0.95
"""confidence level of the interval of a life"""
_LEAST = 0.02  # minimum step, as a fraction of the whole life


@dataclass(frozen=True)
class Step:
    """A step over several stops.

    Parameters
    ----------
    first, count
        Number of the stop before the first, and number of stops.
    rates
        Rates at the beginning and the end of the step.
    """

    first: int
    count: int
    rates: tuple[Rates, Rates]


@dataclass(frozen=True)
class Projection:
    """A projected life.

    Parameters
    ----------
    plan
        Plan of the projection.
    states, left
        Slow states, and margins to the limits, after each stop [SI]: shape (stops + 1,), starting
        with the new brake.
    ended_by
        Limit that ended the life; empty if the projection reached its maximum number of stops.
    steps
        Steps of the projection.
    error
        Half width of the confidence interval of the number of stops, due to the sample of the
        population; NaN if the life reached no limit.
    """

    plan: LifePlan
    states: Mapping[str, Array]
    left: Mapping[str, Array]
    ended_by: str
    steps: tuple[Step, ...]
    error: float

    @property
    def stops(self) -> int:
        """Number of stops until the end of life, or until the end of the projection."""
        return len(next(iter(self.states.values()))) - 1

    @property
    def warnings(self) -> list[str]:
        """Warnings from the runs."""
        each = (text for step in self.steps for r in step.rates for text in r.warnings)
        return [*dict.fromkeys(each)]


def projected(plan: LifePlan, progress: Progress = silent) -> Projection:
    """Return the projected life of a brake.

    Parameters
    ----------
    plan
        Wear, and its stops.
    progress
        Called with a label and the finished share, 0 to 1.

    Raises
    ------
    InputError
        If the brake is already at the end of its life, or cannot be set up.
    RunError
        If a run fails.
    KeyboardInterrupt
        If interrupted.
    """
    z = plan.life.begin(plan.bench.par, plan.wear)
    _require_alive(plan, z)
    path, steps, ended = [z], [], ""
    before = rates(plan, z)
    whole = 0
    while not ended and len(path) <= plan.longest:
        room = plan.longest + 1 - len(path)
        held, _ = _walked(plan, path[-1], (before, before), 1, room)
        whole = whole or len(held)
        progress("life", (len(path) - 1) / (len(path) - 1 + len(held)))
        count, after = _step(plan, before, held, whole)
        most = min(2 * count, room) if count == len(held) else count
        more, ended = _walked(plan, path[-1], (before, after), count, most)
        steps.append(Step(len(path) - 1, len(more), (before, after)))
        path += more
        before = after
    states = {name: np.array([each[name] for each in path]) for name in plan.life.states}
    left = [plan.life.left(each, plan.bench.par, plan.wear) for each in path]
    return Projection(
        plan,
        states,
        {name: np.array([each[name] for each in left]) for name in plan.life.limits},
        ended,
        tuple(steps),
        _interval(plan, steps, ended),
    )


def _require_alive(plan: LifePlan, z: Values) -> None:
    for name, value in plan.life.left(z, plan.bench.par, plan.wear).items():
        if not value > 0.0:
            limit = plan.life.limits[name]
            raise ParameterError(
                f"life {plan.life.name!r} ends before its first stop, because {limit.label} is "
                f"{shown(value, limit.unit)} at the start. It must be > 0",
                name=limit.label,
                value=shown(value, limit.unit),
                valid="> 0",
            )


def _walked(
    plan: LifePlan, z: Values, ends: tuple[Rates, Rates], count: int, most: int
) -> tuple[list[Values], str]:
    """Return the slow states after each of at most ``most`` stops, and the limit that ended them.

    Rates are the mean of the rates at both ends of the step (Heun's corrector); readings change
    linearly from one end to the other over the ``count`` stops of the step.
    """
    life, par, wear = plan.life, plan.bench.par, plan.wear
    first, last = ends
    changes = {name: 0.5 * (rate + last.mean[name]) for name, rate in first.mean.items()}
    begin = first.effects.readings
    slopes = {name: (last.effects.readings[name] - x) / count for name, x in begin.items()}
    path: list[Values] = []
    for n in range(1, most + 1):
        readings = {name: x + slopes[name] * n for name, x in begin.items()}
        worn = {name: value + changes.get(name, 0.0) for name, value in z.items()}
        z = life.between(worn, readings, par, wear)
        path.append(z)
        for name, value in life.left(z, par, wear).items():
            if value <= 0.0:
                return path, name
    return path, ""


def _step(plan: LifePlan, before: Rates, held: Sequence[Values], whole: int) -> tuple[int, Rates]:
    """Return the number of stops of a step, and the rates at its end."""
    count = min(math.ceil(max(plan.share * len(held), _LEAST * whole)), len(held))
    while True:
        after = rates(plan, held[count - 1])
        error = 0.5 * _distance(before.mean, after.mean)
        if error <= plan.tolerance or count == 1:
            return count, after
        count = max(1, min(count - 1, int(0.9 * count * plan.tolerance / error)))


def _distance(first: Values, second: Values) -> float:
    """Return the maximum relative change of a rate."""
    largest = {name: max(abs(first[name]), abs(second[name])) for name in first}
    return max(
        (abs(second[name] - first[name]) / size for name, size in largest.items() if size > 0.0),
        default=0.0,
    )


def _interval(plan: LifePlan, steps: Sequence[Step], limit: str) -> float:
    """Return the half width of the interval of a life [stops].

    The same stops represent the population at every step, so their errors add up.
    """
    if not limit:
        return math.nan
    count = plan.count
    if count == 1:
        return 0.0
    falls = [(step.count, [_falls(plan, each, limit) for each in step.rates]) for step in steps]
    error = sum(n * float(np.mean([standard_error(plan, x) for x in pair])) for n, pair in falls)
    slope = float(np.mean(falls[-1][1]))
    return float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, count - 1)) * error / abs(slope)


def standard_error(plan: LifePlan, values: Array) -> float:
    """Return the standard error of a mean over the population, for values of shape (stops,).

    Notes
    -----
    The population is a Latin hypercube: it is as even as possible along every quantity, so the
    spread that a quantity explains is not an error of the mean. The estimate uses successive
    differences along the quantity that explains most (K. M. Wolter, Introduction to Variance
    Estimation, section 8.2), which fully counts the spread from all other quantities. A discrete
    quantity may change its value exactly between two stops, because of its weights; this difference
    is not an error.
    """
    squares = [
        np.diff(values[np.argsort(plan.population[each.name], kind="stable")]) ** 2
        * _counts(each.distribution, values.size)
        for each in plan.varied
    ]
    least = min(float(np.sum(each)) for each in squares)
    return math.sqrt(least / (2.0 * values.size * (values.size - 1)))


def _counts(law: Distribution, stops: int) -> NDArray[np.bool_]:
    """Return the differences between neighbors that are random, shape (stops - 1,)."""
    edges = np.arange(1, stops) / stops
    if not law.is_discrete:
        return np.ones(stops - 1, dtype=bool)
    return np.asarray(law.quantile(edges - 1e-9) == law.quantile(edges + 1e-9))


def _falls(plan: LifePlan, held: Rates, limit: str) -> Array:
    """Return the loss of margin to a limit during each stop, shape (stops,)."""
    life, par, wear = plan.life, plan.bench.par, plan.wear
    changes, now = held.effects.changes, life.left(held.z, par, wear)[limit]
    each = [
        {**held.z, **{name: held.z[name] + float(change[k]) for name, change in changes.items()}}
        for k in range(plan.count)
    ]
    return now - np.array([life.left(z, par, wear)[limit] for z in each])


# --- Brute force: stops simulated one by one, each with the slow states after the previous stop


def one_by_one(plan: LifePlan, stops: int, progress: Progress = silent) -> dict[str, Array]:
    """Return the slow states after each of some stops [SI], shape (stops + 1,) each.

    The population's stops repeat in order. The result checks the error of a projection, which skips
    most stops.

    Parameters
    ----------
    plan
        Wear, and its stops.
    stops
        Number of stops, >= 1.
    progress
        Called with a label and the finished share, 0 to 1.

    Raises
    ------
    RunError
        If a run fails, or a stop lacks a key figure that determines wear.
    KeyboardInterrupt
        If interrupted.
    """
    life, par, wear, count = plan.life, plan.bench.par, plan.wear, plan.count
    z = life.begin(par, wear)
    figures, _ = stop_figures(plan, z)  # of earlier stops, which heated the brake
    path: list[Values] = [z]
    for n in range(stops):
        k = n % count
        stop, _ = simulated(plan, z, [k])
        for name, value in stop.items():
            figures[name][k] = value[0]
        each = life.effects(figures, conditions(plan), z, par, wear)
        changed = {name: z[name] + float(change[k]) for name, change in each.changes.items()}
        z = life.between({**z, **changed}, each.readings, par, wear)
        path.append(z)
        progress("one by one", (n + 1) / stops)
    return {name: np.array([each[name] for each in path]) for name in life.states}
