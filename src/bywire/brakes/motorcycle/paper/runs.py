"""Runs shared by several tables and figures of Dardanelli et al. (2010)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, cast

from bywire.analysis.loop import LOOPS, Point
from bywire.analysis.response.frequency_response import frequency_response
from bywire.analysis.response.sweep import Sweep
from bywire.bench.running import Result
from bywire.brakes.motorcycle.ecu import Stimulus
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current, memory_at, state_at
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.signals import zeros
from bywire.reproduction import reproduction

if TYPE_CHECKING:
    import xarray as xr

MAIN = "dardanelli2010"
PRINTED = "dardanelli2010-table1"
SETS = {MAIN: "", PRINTED: "@table1"}
"""parameter sets, with the suffix that each adds to an item's id"""
BAR = 1e5

FRICTIONLESS = {
    "seal.T_pr": 0.0,
    "seal.f_cfr_p": 0.0,
    "seal.f_cfr_n": 0.0,
    "ecu.dither.waveform": "off",
}
"""overrides that remove the dry friction and the dither"""


def parameters(name: str) -> MotorcycleParameters:
    """Return a parameter set of the catalog."""
    return cast(MotorcycleParameters, PARAMETER_SETS.find(name).parameters())


class Runs(reproduction.Runs):
    """Bench results, each computed once; see `bywire.reproduction.reproduction.Runs`."""

    def settled_step(self, name: str, p: float, i_step: float) -> Result:
        """Return a current step from a dithered pressure that has settled at ``p``.

        ``name``: parameter set; ``p``: pressure before the step [Pa]; ``i_step``: step height [A].
        """
        return self.bench("pressure-step", name, options={"p_start": p, "i_step": i_step})


def before(step: Result) -> float:
    """Return the mean pressure before a step [Pa]."""
    recording = step.recordings["run"]
    return float(recording["p_mc"].sel(time=slice(None, -1e-9)).mean())


# --- Sines

WINDOW = 4.0
"""minimum time for evaluating a sine [s]: averages out slow creep under dither"""


@cache
def of_set_point(
    name: str, p: float, amplitudes: tuple[float, ...], frequencies: tuple[float, ...]
) -> xr.Dataset:
    """Return the response from set point to pressure, with dimensions amplitude and frequency.

    ``name``: parameter set; ``p``: mean pressure [Pa]; ``amplitudes``: of the set point [Pa];
    ``frequencies``: in Hz.
    """
    return _measured(
        LOOPS.find("pressure").point(parameters(name), p), "p_set", amplitudes, frequencies
    )


def of_current(
    name: str, p: float, amplitudes: tuple[float, ...], frequencies: tuple[float, ...]
) -> xr.Dataset:
    """Return the response from current demand to pressure [Pa/A]; the mean demand holds ``p``."""
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
