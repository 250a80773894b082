"""When a fault is there: onset, end, ramp, and whether it comes and goes."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import TimeConstant, Unit
from bywire.core.typing import Array

Instant = Annotated[float, Unit("s", 1.0), Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Share = Annotated[float, Unit("1", 0.5), Field(gt=0, le=1, allow_inf_nan=False)]
STAGES = 50  # in which a parameter follows a ramp
MOST = 10_000
"""times that a fault may come and go in a run"""
_EDGE = 1e-9  # s, within which an instant counts as reached


class Course(ParameterSet):
    """When a fault is there, on the recording's axis; sampled at the ticks of the controllers."""

    onset: Instant
    """when it begins; before the start of the run: it is there all along"""
    lasts: TimeConstant
    """how long it stays; 0: for good"""
    ramp: TimeConstant
    """time in which it grows to its full size, and in which it goes; 0: at once"""
    every: TimeConstant
    """interval in which it comes back; 0: it stays"""
    share: Share
    """share of that interval in which it is there"""

    @model_validator(mode="after")
    def _comes_and_goes(self) -> Course:
        if self.every > 0 and self.ramp > 0:
            raise ValueError("a fault either grows (ramp) or comes and goes (every), not both")
        if self.share < 1 and not self.every > 0:
            raise ValueError("share is that of an interval: give every, in which it comes back")
        return self

    @property
    def end(self) -> float:
        """When it begins to go [s]; infinite where it stays."""
        return self.onset + self.lasts if self.lasts > 0 else np.inf

    @property
    def gone(self) -> float:
        """From when on nothing is left of it [s]."""
        return self.end + self.ramp

    def is_there(self, t: Array) -> Array:
        """Return 1 where the fault is there, however small, else 0; of times [s]."""
        there = (t > self.onset - _EDGE) & (t < self.gone - _EDGE)
        if self.every > 0:
            phase = np.mod(t - self.onset + _EDGE, self.every)
            there &= phase < self.share * self.every
        return there.astype(float)

    def size(self, t: Array) -> Array:
        """Return the share of its full size, 0 to 1, at times [s]."""
        there = self.is_there(t)
        if not self.ramp > 0:
            return there
        with np.errstate(over="ignore"):  # of the shortest ramps: fully grown
            grown = np.clip((t - self.onset) / self.ramp, 0.0, 1.0)
            if np.isfinite(self.gone):
                grown = np.minimum(grown, np.clip((self.gone - t) / self.ramp, 0.0, 1.0))
        return there * grown

    def returns(self, first: float, last: float) -> float:
        """Return how often it comes and goes between two times [s]."""
        span = min(last, self.end) - max(first, self.onset)
        return max(span / self.every, 0.0) if self.every > 0 else 0.0

    def instants(self, first: float, last: float) -> list[float]:
        """Return when parameters change that follow it, of times [s]; ramps in stages."""
        ends = self.end
        if self.every > 0:
            begun = max(math.floor((first - self.onset) / self.every), 0)
            count = math.ceil(self.returns(first, last)) + 1
            pairs = (
                (self.onset + k * self.every, self.onset + (k + self.share) * self.every)
                for k in range(begun, begun + count)
            )
            return [min(t, ends) for pair in pairs if pair[0] < min(last, ends) for t in pair]
        edges = [self.onset, *([ends] if np.isfinite(ends) else [])]
        if not self.ramp > 0:
            return edges
        stages = np.arange(1, STAGES + 1) / STAGES * self.ramp
        return [float(edge + stage) for edge in edges for stage in stages]


AT_ZERO = Course(onset=0.0, lasts=0.0, ramp=0.0, every=0.0, share=1.0)
"""from time zero on"""
