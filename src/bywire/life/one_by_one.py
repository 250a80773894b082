"""Stops run one by one, each with the slow states that the one before left: brute force."""

from __future__ import annotations

import numpy as np

from bywire.core.typing import Array, Progress, silent
from bywire.life.declaration import Values
from bywire.life.plan import LifePlan
from bywire.life.rates import conditions, simulated, stop_figures


def one_by_one(plan: LifePlan, stops: int, progress: Progress = silent) -> dict[str, Array]:
    """Return the slow states after each of some stops [SI], shape (stops + 1,) each.

    The population's stops follow one another, again and again. A projection steps over them: this
    says how far it is to be trusted.

    Parameters
    ----------
    plan
        What wears, and by which stops.
    stops
        How many to run, >= 1.
    progress
        Called with a label and the finished share, 0 to 1.

    Raises
    ------
    RunError
        When a run fails, or a stop lacks a key figure that wear is computed from.
    KeyboardInterrupt
        When interrupted.
    """
    life, par, wear, count = plan.life, plan.bench.par, plan.wear, plan.count
    z = life.begin(par, wear)
    figures, _ = stop_figures(plan, z)  # of the stops before the first, for its heat
    path: list[Values] = [z]
    for n in range(stops):
        k = n % count
        made, _ = simulated(plan, z, [k])
        for name, value in made.items():
            figures[name][k] = value[0]
        each = life.effects(figures, conditions(plan), z, par, wear)
        changed = {name: z[name] + float(change[k]) for name, change in each.changes.items()}
        z = life.between({**z, **changed}, each.readings, par, wear)
        path.append(z)
        progress("one by one", (n + 1) / stops)
    return {name: np.array([each[name] for each in path]) for name in life.states}
