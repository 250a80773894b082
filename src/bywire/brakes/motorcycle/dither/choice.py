"""The dither that overcomes the friction at least price, and what limits it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bywire.core.typing import Array

Figures = Mapping[str, Array]

OVERCOMES = ("stuck", "band")
"""figures that fall with the amplitude: friction counts as overcome below their limits"""
COSTS = ("ripple_caliper", "current_share", "duty_share")
"""figures that grow with the amplitude"""

NAMES = {
    "stuck": "share of the time stuck",
    "band": "dead band left",
    "ripple_caliper": "ripple at the caliper",
    "current_share": "current limit",
    "duty_share": "duty cycle's limit",
}
"""what messages call them"""


@dataclass(frozen=True)
class Least:
    """The weakest dither of one frequency that overcomes the friction.

    Parameters
    ----------
    gain
        Of the dither's law; NaN where none on the grid does.
    binding
        Which of `OVERCOMES` asks for that much.
    exceeded
        Which of `COSTS` it then exceeds.
    figures
        All figures at that gain, interpolated.
    """

    gain: float
    binding: str
    exceeded: tuple[str, ...]
    figures: Mapping[str, float]


def least(gains: Array, figures: Figures, limits: Mapping[str, float]) -> Least:
    """Return the weakest dither that overcomes the friction, from there on upward.

    ``gains``: shape (n,), ascending; ``figures``: name -> values at these gains, shape (n,);
    ``limits``: largest value of each of `OVERCOMES` and `COSTS`.
    """
    wanted = {name: crossing(gains, figures[name], limits[name]) for name in OVERCOMES}
    binding = max(OVERCOMES, key=lambda name: (math.isnan(wanted[name]), wanted[name]))
    gain = wanted[binding]
    if math.isnan(gain):
        return Least(gain, binding, (), dict.fromkeys(figures, math.nan))
    return at_gain(gains, figures, limits, gain, binding)


def at_gain(
    gains: Array, figures: Figures, limits: Mapping[str, float], gain: float, binding: str
) -> Least:
    """Return the figures at a gain within the grid, linear between its points."""
    at = {name: float(np.interp(gain, gains, values)) for name, values in figures.items()}
    exceeded = tuple(name for name in COSTS if at[name] > limits[name])
    return Least(gain, binding, exceeded, at)


def crossing(gains: Array, values: Array, limit: float) -> float:
    """Return the gain above which values stay within a limit, linear between points; NaN for none.

    Examples
    --------
    >>> import numpy as np
    >>> round(crossing(np.array([1.0, 2.0, 3.0]), np.array([0.9, 0.2, 0.0]), 0.1), 6)
    2.5
    """
    above = np.flatnonzero(~(values <= limit))  # NaN is above every limit
    if not above.size:
        return float(gains[0])
    k = int(above[-1])
    if k == gains.size - 1 or math.isnan(values[k]):
        return math.nan if k == gains.size - 1 else float(gains[k + 1])
    share = (values[k] - limit) / (values[k] - values[k + 1])
    return float(gains[k] + share * (gains[k + 1] - gains[k]))


@dataclass(frozen=True)
class Candidate:
    """The least gain of one frequency that is enough at every pressure.

    ``gain``: naN where none on the grid is enough; ``decisive``: which pressure asks for that gain;
    ``binding``: which of `OVERCOMES` asks for it; ``price``: copper power [W], mean over the
    pressures; ``ripple``: ripple at the caliper [Pa], worst pressure; ``exceeded``: which of
    `COSTS` exceed their limits at any pressure.
    """

    gain: float
    decisive: int
    binding: str
    price: float
    ripple: float
    exceeded: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """Why it cannot be had; empty where it can."""
        if math.isnan(self.gain):
            return f"{NAMES[self.binding]}: no gain is enough"
        return ", ".join(NAMES[name] for name in self.exceeded)


def candidates(
    gains: Array, figures: Sequence[Figures], limits: Mapping[str, float]
) -> list[Candidate]:
    """Return one candidate for every frequency.

    Parameters
    ----------
    figures
        Of every pressure: name -> values, shape (gains, frequencies).
    """
    count = next(iter(figures[0].values())).shape[1]
    return [
        _candidate(gains, [_column(at_pressure, k) for at_pressure in figures], limits)
        for k in range(count)
    ]


def _column(figures: Figures, k: int) -> Figures:
    """Return the figures of a frequency, shape (gains,) each."""
    return {name: values[:, k] for name, values in figures.items()}


def best_of(candidates: Sequence[Candidate]) -> int | None:
    """Return which candidate costs least; None where none is admissible."""
    admissible = [k for k, candidate in enumerate(candidates) if not candidate.verdict]
    return min(admissible, key=lambda k: candidates[k].price, default=None)


def _candidate(gains: Array, columns: Sequence[Figures], limits: Mapping[str, float]) -> Candidate:
    each = [least(gains, column, limits) for column in columns]
    n = max(range(len(each)), key=lambda k: (math.isnan(each[k].gain), each[k].gain))
    gain, binding = each[n].gain, each[n].binding
    if math.isnan(gain):
        return Candidate(gain, n, binding, math.nan, math.nan, ())
    there = [at_gain(gains, column, limits, gain, binding) for column in columns]
    return Candidate(
        gain,
        n,
        binding,
        price=float(np.mean([at_pressure.figures["copper"] for at_pressure in there])),
        ripple=max(at_pressure.figures["ripple_caliper"] for at_pressure in there),
        exceeded=tuple(sorted({name for at_pressure in there for name in at_pressure.exceeded})),
    )
