"""The plan of a life: which brake wears how, the population of its stops, how it is stepped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

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
    """

    name: str
    life: Life
    bench: Bench
    wear: ParameterSet
    conditions: StopConditions
    varied: tuple[Varied, ...] = ()
    stops: int = 16
    seed: int = 1
    share: float = 0.05
    tolerance: float = 2e-2
    longest: int = 200_000

    @cached_property
    def population(self) -> Mapping[str, NDArray[Any]]:
        """The stops: what varies by name [SI], shape (stops,); empty where all are alike."""
        if not self.varied:
            return {}
        laws = [each.distribution for each in self.varied]
        drawn = Sampled("latin-hypercube", self.seed, laws).values(0, self.stops)
        return {each.name: v for each, v in zip(self.varied, drawn, strict=True)}

    @property
    def simulated(self) -> int:
        """How many different stops there are."""
        return self.stops if self.varied else 1
