"""The plan of a life: which brake wears how, the population of its stops, how it is stepped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.bench.bench import Bench
from bywire.core.parameters import ParameterSet
from bywire.life.declaration import Life, StopConditions
from bywire.studies.plan import Varied
from bywire.studies.points import Sampled

CONDITION = "stop."
"""what the names of a stop's conditions begin with"""


@dataclass(frozen=True)
class LifePlan:
    """What a life file says.

    Parameters
    ----------
    name
        What reports call it.
    life
        What wears.
    bench
        A stop of the new brake.
    wear
        Parameters of wear.
    conditions
        Conditions of a stop that does not vary.
    varied
        How stops differ: numbers of the bench, options, and conditions named ``stop.NAME``.
    stops
        Stops that stand for the population, simulated each time that slow states are held.
    seed
        Of their sample.
    share
        A step covers at most this share of the stops that remain, 0 to 1.
    tolerance
        Largest share of itself by which a rate may be wrong within a step.
    longest
        Stops after which a life is not followed any more.
    known
        What was simulated already, by what of the bench follows from slow states.
    """

    name: str
    life: Life
    bench: Bench
    wear: ParameterSet
    conditions: StopConditions
    varied: tuple[Varied, ...] = ()
    stops: int = 20
    seed: int = 1
    share: float = 0.05
    tolerance: float = 2e-2
    longest: int = 200_000
    known: dict[Any, Any] = field(default_factory=dict, compare=False, repr=False)

    @cached_property
    def population(self) -> Mapping[str, NDArray[Any]]:
        """The stops: what varies by name [SI], shape (stops,); empty where all are alike."""
        if not self.varied:
            return {}
        laws = [each.distribution for each in self.varied]
        drawn = Sampled("latin-hypercube", self.seed, laws).values(0, self.stops)
        return {each.name: v for each, v in zip(self.varied, drawn, strict=True)}

    @property
    def count(self) -> int:
        """How many stops stand for the population."""
        return self.stops if self.varied else 1

    @cached_property
    def different(self) -> tuple[list[int], NDArray[np.intp]]:
        """The stops whose benches differ, and which of these each of the population is.

        Stops that differ in their conditions alone are simulated once.
        """
        rows = [
            tuple(
                values[k].item()
                for name, values in self.population.items()
                if not name.startswith(CONDITION)
            )
            for k in range(self.count)
        ]
        first: dict[tuple[Any, ...], int] = {}
        for k, row in enumerate(rows):
            first.setdefault(row, k)
        places = {k: place for place, k in enumerate(first.values())}
        return list(places), np.array([places[first[row]] for row in rows])
