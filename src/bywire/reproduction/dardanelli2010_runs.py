"""Runs that several tables and figures of Dardanelli et al. (2010) share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import numpy as np
import xarray as xr

from bywire.assemblies.motorcycle_parameters import MotorcycleParameters
from bywire.bench.bench import Bench
from bywire.bench.result import Result
from bywire.bench.running import Progress, run
from bywire.catalog.registry import entry

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
    return cast(MotorcycleParameters, entry(name).parameters())


class Runs:
    """Bench results, each computed once.

    Parameters
    ----------
    progress
        Called with the label of a piece of work and its finished share, 0 to 1.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress
        self._known: dict[str, Result] = {}

    def report(self, label: str, share: float) -> None:
        """Tell how far a piece of work is."""
        if self._progress is not None:
            self._progress(label, share)

    def bench(
        self,
        experiment: str,
        name: str,
        overrides: Mapping[str, Any] | None = None,
        options: Mapping[str, Any] | None = None,
        stimulus: Mapping[str, Any] | None = None,
    ) -> Result:
        """Return the result of an experiment with a parameter set.

        Parameters
        ----------
        experiment, name
            Names of experiment and parameter set.
        overrides, options, stimulus
            As in `Bench`.

        Raises
        ------
        RunError
            When a run fails.
        KeyboardInterrupt
            When the user stopped a run: half a reproduction is none.
        """
        bench = Bench(experiment, name, overrides or {}, options or {}, stimulus or {})
        key = repr(bench)
        if key not in self._known:
            result = run(bench)
            if result.status == "interrupted":
                raise KeyboardInterrupt
            self._known[key] = result
        return self._known[key]

    def settled_step(self, name: str, p: float, i_step: float) -> Result:
        """Return a current step that begins where the dithered pressure has settled at ``p``.

        Parameters
        ----------
        name
            Parameter set.
        p
            Pressure before the step [Pa].
        i_step
            Height of the step [A].
        """
        return self.bench("pressure-step", name, options={"p_start": p, "i_step": i_step})


def before(step: Result) -> float:
    """Return the mean pressure before a step [Pa]."""
    recording = step.recordings["run"]
    return float(recording["p_mc"].sel(time=slice(None, -1e-9)).mean())


def kpis(result: Result) -> dict[str, float]:
    """Return the KPIs of a result by name, SI."""
    return {kpi.name: kpi.value for kpi in result.kpis}


def selected(recording: xr.Dataset, *names: str) -> xr.Dataset:
    """Return a recording with some of its variables, those that it has."""
    return recording[[name for name in names if name in recording]]


def peak(recording: xr.Dataset, name: str) -> float:
    """Return the largest value of a signal."""
    return float(np.max(recording[name].values))
