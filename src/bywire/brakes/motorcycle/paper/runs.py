"""Runs that several tables and figures of Dardanelli et al. (2010) share."""

from __future__ import annotations

from typing import cast

from bywire.bench.running import Result
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.catalog import PARAMETER_SETS
from bywire.reproduction import runs

MAIN = "dardanelli2010"
PRINTED = "dardanelli2010-table1"
SETS = {MAIN: "", PRINTED: "@table1"}
"""parameter sets, with what follows an item's id"""
BAR = 1e5

FRICTIONLESS = {
    "seal.T_pr": 0.0,
    "seal.f_cfr_p": 0.0,
    "seal.f_cfr_n": 0.0,
    "ecu.dither.waveform": "off",
}
"""overrides that remove the dry friction, and with it the dither"""


def parameters(name: str) -> MotorcycleParameters:
    """Return a parameter set of the catalog."""
    return cast(MotorcycleParameters, PARAMETER_SETS.find(name).parameters())


class Runs(runs.Runs):
    """Bench results, each computed once; see `bywire.reproduction.runs.Runs`."""

    def settled_step(self, name: str, p: float, i_step: float) -> Result:
        """Return a current step that begins where the dithered pressure has settled at ``p``.

        ``name``: parameter set; ``p``: pressure before the step [Pa]; ``i_step``: height of the
        step [A].
        """
        return self.bench("pressure-step", name, options={"p_start": p, "i_step": i_step})


def before(step: Result) -> float:
    """Return the mean pressure before a step [Pa]."""
    recording = step.recordings["run"]
    return float(recording["p_mc"].sel(time=slice(None, -1e-9)).mean())
