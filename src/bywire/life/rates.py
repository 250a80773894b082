"""Rates of slow states: a population of stops simulated while these states are held."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from bywire.bench.bench import Bench
from bywire.bench.ensemble import changed
from bywire.bench.key_figures import key_figures_of
from bywire.core.errors import RunError
from bywire.core.typing import Array
from bywire.life.declaration import Effects, StopConditions, Values
from bywire.life.plan import CONDITION, LifePlan


@dataclass(frozen=True)
class Rates:
    """How slow states change per stop.

    Parameters
    ----------
    z
        Slow states that were held [SI].
    effects
        What each stop of the population does.
    warnings
        What the runs warned of.
    """

    z: Values
    effects: Effects
    warnings: tuple[str, ...] = field(default=(), repr=False)

    @cached_property
    def mean(self) -> Values:
        """Mean change of each slow state per stop [SI]."""
        return {name: float(np.mean(change)) for name, change in self.effects.changes.items()}


def rates(plan: LifePlan, z: Values) -> Rates:
    """Return what the plan's population of stops does to slow states that are held meanwhile.

    Raises
    ------
    InputError
        When the brake cannot be set up with these states.
    RunError
        When a run fails, or a stop lacks a key figure that wear is computed from.
    KeyboardInterrupt
        When interrupted.
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
    """Return key figures of some stops of the population, and what their runs warned of.

    What slow states change nothing of is simulated once.
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
    made = key_figures_of([_stop_bench(plan, follows, k) for k in which])
    known = {figure.name: figure for figure in made.figures}
    for name in plan.life.figures:
        lacking = np.flatnonzero(~np.isfinite(known[name].values))
        if lacking.size:
            stop = ", ".join(f"{n} = {v[which[lacking[0]]]:g}" for n, v in plan.population.items())
            raise RunError(
                f"a stop{stop and f' with {stop} (in SI)'} has no {name}: "
                + known[name].told(lacking[0])
            )
    warnings = dict.fromkeys(text for texts in made.warnings for text in texts)
    return {name: np.asarray(known[name].values) for name in plan.life.figures}, tuple(warnings)


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
    """Return a stop of the population with what follows from slow states that are held."""
    drawn = {
        name: values[k].item()
        for name, values in plan.population.items()
        if not name.startswith(CONDITION)
    }
    return changed(plan.bench, {**drawn, **follows})
