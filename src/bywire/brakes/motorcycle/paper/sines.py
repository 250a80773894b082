"""Sines on the nonlinear brake with friction and dither, as Fig. 7 and Table 4 want them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import xarray as xr

from bywire.analysis.loop import LOOPS, Point
from bywire.analysis.response.frequency_response import frequency_response
from bywire.analysis.response.sweep import Sweep
from bywire.brakes.motorcycle.ecu import Stimulus
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.paper.runs import parameters
from bywire.brakes.motorcycle.trim import holding_current, memory_at, state_at
from bywire.core.signals import zeros

WINDOW = 4.0
"""time over which every sine is evaluated, at least [s]: slow creep under dither is averaged"""


@cache
def of_set_point(
    name: str, p: float, amplitudes: tuple[float, ...], frequencies: tuple[float, ...]
) -> xr.Dataset:
    """Return pressure over its set point, dimensions amplitude and frequency.

    ``name``: parameter set; ``p``: mean pressure [Pa]; ``amplitudes``: of the set point [Pa];
    ``frequencies``: in Hz.
    """
    return _measured(
        LOOPS.find("pressure").point(parameters(name), p), "p_set", amplitudes, frequencies
    )


def of_current(
    name: str, p: float, amplitudes: tuple[float, ...], frequencies: tuple[float, ...]
) -> xr.Dataset:
    """Return pressure over the current demand [Pa/A], likewise; the demand holds a pressure."""
    par = parameters(name).replace({"drive.mode": "current"})
    stimulus = zeros(Stimulus)._replace(i_set=holding_current(p, par))
    point = Point(MotorcycleBrake(), par, state_at(p, par), memory_at(p, par), stimulus)
    return _measured(point, "i_set", amplitudes, frequencies)


def _measured(
    point: Point, shaken: str, amplitudes: Sequence[float], frequencies: Sequence[float]
) -> xr.Dataset:
    whole = LOOPS.find("pressure").whole(point.par)
    sweep = Sweep(
        (shaken,), "p_mc", frequencies, amplitudes, flags=(), whole=whole, shortest=WINDOW
    )
    return frequency_response(point.run(), sweep).isel(variant=0)
