"""Measured slips, cut out of a record with what lies around them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bywire.assemblies.motorcycle_parameters import MotorcycleParameters
from bywire.assemblies.motorcycle_trim import state_at
from bywire.core.errors import ParameterError
from bywire.identification.stick_slip.slips import Slip

Array = NDArray[np.float64]

LEAD = 0.05
"""rest before the measured onset [s]"""
_LEAST = 8  # samples
_RESTED = 1.0  # s of rest from which the ramp of the current is read


@dataclass(frozen=True)
class Shot:
    """A measured slip.

    Parameters
    ----------
    slip
        Where it lies.
    time, pressure, current
        Measured around it, from a little before its onset; shape (n,), SI.
    line
        Rate [A/s] and level [A], at the first of these times, of the current's ramp while the
        piston rested.
    """

    slip: Slip
    time: Array
    pressure: Array
    current: Array
    line: tuple[float, float]


def cut_out(
    time: Array, pressure: Array, current: Array, slips: Sequence[Slip], longest: float
) -> list[Shot]:
    """Return the measured slips with what lies around them, up to the next onset.

    Those of too few samples to tell when they went half of their way are left out.

    Raises
    ------
    ParameterError
        When none is left.
    """
    interval = float(time[1] - time[0])
    found = []
    lead, most, rested = (int(span / interval) for span in (LEAD, longest, _RESTED))
    for k, slip in enumerate(slips):
        first = max(slip.begin - lead, 0)
        until = slips[k + 1].begin - lead if k + 1 < len(slips) else time.size
        last = min(slip.end + 2 * lead, slip.begin + most, until)
        if last - first < _LEAST or slip.begin < 2:
            continue
        since = max(slip.begin - rested, slips[k - 1].end + lead if k else 0)
        before = slice(min(since, slip.begin - 2), slip.begin)
        rate, level = np.polyfit(time[before] - time[first], current[before], 1)
        rows = slice(first, last)
        line = (float(rate), float(level))
        found.append(Shot(slip, time[rows], pressure[rows], current[rows], line))
    if not found:
        raise ParameterError(
            f"none of the {len(slips)} slips has {_LEAST} samples before the next one begins: they "
            "are noise, or the signal's unit is wrong; check the unit, and raise what counts as a "
            "slip (--option least=...)"
        )
    return found


def require_reachable(shots: Sequence[Shot], par: MotorcycleParameters) -> None:
    """Refuse rests at a pressure that the brake of these parameters cannot hold."""
    highest = max(shot.slip.rest for shot in shots)
    try:
        state_at(max(highest, 0.0), par)
    except ParameterError as error:
        raise ParameterError(
            f"the measured pressure rests at {highest / 1e5:.4g} bar, which this brake cannot "
            f"hold: check the unit of p_mc, and the parameters ({error})"
        ) from None
