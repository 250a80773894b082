"""Unknowns of an estimation: names with starts, bounds, and prior knowledge."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bywire.core.arguments import checked
from bywire.core.errors import ParameterError, not_valid, unknown_name
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.typing import Array

_BEYOND = 1e3  # of the start: bounds of a parameter without others


@dataclass(frozen=True)
class Unknown:
    """A number that is estimated, SI.

    Parameters
    ----------
    name
        Dotted name of a parameter; or ``initial.STATE``, ``stimulus.NAME`` (an offset of an
        input), ``offset.SIGNAL`` (an offset of a measured output).
    start
        Start of the search.
    low, high
        Bounds.
    scale
        Typical magnitude, > 0: reference for the size of an uncertainty.
    unit
        SI unit.
    prior
        Mean and standard deviation from prior knowledge, or None.
    trial
        Label of its trial; empty if all trials share it.
    """

    name: str
    start: float
    low: float = -math.inf
    high: float = math.inf
    scale: float = 1.0
    unit: str = "1"
    prior: tuple[float, float] | None = None
    trial: str = ""

    def __post_init__(self) -> None:
        if not self.low <= self.start <= self.high:
            valid = f"between {self.low:g} and {self.high:g} {self.unit}"
            raise not_valid(f"start of {self.label}", f"{self.start:g} {self.unit}", valid)
        if not (self.scale > 0.0 and math.isfinite(self.scale)):
            raise not_valid(f"scale of {self.label}", f"{self.scale:g}", "> 0 and finite")
        if self.prior is not None and not self.prior[1] > 0.0:
            raise ParameterError(
                f"prior of {self.label} needs a standard deviation > 0", name=self.label
            )

    @property
    def label(self) -> str:
        """Name, after the trial's label if it belongs to one."""
        return f"{self.trial}:{self.name}" if self.trial else self.name


@checked
def parameters_of(
    par: ParameterSet,
    names: Sequence[str],
    starts: Mapping[str, float] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
) -> tuple[Unknown, ...]:
    """Return parameters of a set as unknowns, within their valid ranges.

    Parameters
    ----------
    par
        Source of units, ranges, and default starts.
    names
        Dotted names.
    starts, priors
        By name, SI.

    Raises
    ------
    UnknownNameError
        When the set has no such number.
    ParameterError
        When a start is out of range.
    """
    fields, known = leaf_fields(type(par)), par.leaves()
    unknowns = []
    for name in names:
        if name not in fields or name not in known:
            raise unknown_name("parameter", name, tuple(n for n in fields if n in known))
        field, start = fields[name], (starts or {}).get(name, known[name])
        size = abs(start) or abs(known[name]) or field.unit.nominal
        low, high = _inside(field.low, field.low_open, size), min(field.high, _BEYOND * size)
        prior = (priors or {}).get(name)
        unknowns.append(Unknown(name, start, low, high, size, field.unit.symbol, prior))
    return tuple(unknowns)


def _inside(low: float, is_open: bool, size: float) -> float:
    if is_open:
        return low + 1e-6 * size
    return max(low, -_BEYOND * size)


def scattered(
    unknowns: Sequence[Unknown], count: int, spread: float, seed: int
) -> tuple[Array, ...]:
    """Return ``count`` starts: the given one, then others within ``spread`` of it.

    Parameters
    ----------
    spread
        Fraction of the start, or of the scale if the start is zero.
    seed
        Seed of the random numbers.
    """
    random = np.random.default_rng(seed)
    first = np.array([u.start for u in unknowns])
    reach = np.array([abs(u.start) or u.scale for u in unknowns])
    low, high = (np.array([getattr(u, end) for u in unknowns]) for end in ("low", "high"))
    away = random.uniform(-spread, spread, (count - 1, len(unknowns)))
    return (first, *np.clip(first + away * reach, low, high))


def moved(unknowns: Sequence[Unknown], values: Array) -> tuple[Unknown, ...]:
    """Return the unknowns with other starts."""
    return tuple(replace(u, start=float(v)) for u, v in zip(unknowns, values, strict=True))
