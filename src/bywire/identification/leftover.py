"""What a model leaves of a measurement, output by output: its size, how well it fits, its noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bywire.core.typing import Array

_FEWEST = 30  # residuals that tell their noise
_RESOLVED = 2.0**-24  # of a signal's size: what single precision and the finest converters resolve


@dataclass(frozen=True)
class Part:
    """Neighboring residuals of one kind: of one output, in one record.

    Parameters
    ----------
    name, record
        What was measured, and the label of its record; empty where there is one alone.
    count
        How many residuals.
    unit
        Of what was measured.
    noise
        What they were divided by [unit]; None where no noise was assumed.
    spread
        Standard deviation of what the model has to explain [unit].
    size
        Largest magnitude of what was measured [unit].
    numerical
        Root mean square of what half the step of the simulation changes [unit].
    """

    name: str
    record: str
    count: int
    unit: str = "1"
    noise: float | None = None
    spread: float = 0.0
    size: float = 0.0
    numerical: float = 0.0

    @property
    def label(self) -> str:
        """Name, with the record's where there are several."""
        return f"{self.record}:{self.name}" if self.record else self.name


@dataclass(frozen=True)
class Leftover:
    """What a model leaves of one output in one record.

    Parameters
    ----------
    label, unit
        What was measured, with the record's label where there are several.
    residuals
        Computed less measured [unit], shape (n,).
    noise
        Standard deviation that was assumed [unit]; None for none.
    spread, size, numerical
        As of its `Part` [unit].
    """

    label: str
    unit: str
    residuals: Array
    noise: float | None
    spread: float
    size: float = 0.0
    numerical: float = 0.0

    @property
    def rms(self) -> float:
        """Root mean square [unit]."""
        return math.sqrt(float(np.mean(self.residuals**2))) if self.residuals.size else 0.0

    @property
    def is_rounding(self) -> bool:
        """Whether no more is left than numbers resolve: the record is the model's own."""
        return self.rms <= _RESOLVED * max(self.size, self.spread)

    @property
    def is_numerical(self) -> bool:
        """Whether no more is left than rounding, or the step of the simulation, explains."""
        return self.is_rounding or self.rms <= self.numerical

    @property
    def fit(self) -> float:
        """100 (1 - rms / spread) [%]: 100 where nothing is left, 0 where a constant does as well.

        NaN where what was measured does not move (Ljung 1999, section 16.4).
        """
        return 100.0 * (1.0 - self.rms / self.spread) if self.spread > 0.0 else math.nan

    @property
    def over_noise(self) -> float:
        """Rms over the noise that the residuals' own third differences show.

        About 1 where they are noise; a model that is wrong leaves more, which changes slowly from
        sample to sample and which differences therefore hardly hold. NaN where they are too few.
        """
        if self.residuals.size < _FEWEST:
            return math.nan
        # Of white noise they have 20 times the variance. Their mean square, not their median: what
        # an encoder rounds rests from sample to sample, and jumps.
        noise = math.sqrt(float(np.mean(np.diff(self.residuals, 3) ** 2)) / 20.0)
        return self.rms / noise if noise > 0.0 else math.nan
