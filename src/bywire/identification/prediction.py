"""A fitted model beside a record, for instance one that was not fitted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.identification.estimate import Estimate
from bywire.identification.moved_run import moved_run
from bywire.identification.output_error import Trial
from bywire.identification.replaying.fit import fit_figures
from bywire.identification.replaying.segments import Segment
from bywire.simulation.run import simulate

_OWN = ("initial.", "start.")  # what each record has for itself


@dataclass(frozen=True)
class Prediction:
    """A record beside the model with the estimates.

    Parameters
    ----------
    label
        Of the record; empty where there is one alone.
    pairs
        ``measured`` and ``modeled`` over ``time`` [s], by output.
    """

    label: str
    pairs: Mapping[str, xr.Dataset]

    def figures(self, name: str) -> dict[str, float]:
        """Return the figures of an output over the whole record; see ``fit_figures``."""
        time = self.pairs[name]["time"].values
        whole = Segment("all", float(time[0]), float(time[-1]))
        return {k.name: k.value for k in fit_figures(self.pairs[name], whole)}


def predict(trial: Trial, estimate: Estimate) -> Prediction:
    """Return a record beside the model with the estimates, without fitting anything.

    Parameters
    ----------
    trial
        A record and its model. Unknowns of a record's own, such as where it begins, are taken
        from the estimate only where they carry this trial's label.
    estimate
        Of this or of other records; what the data does not tell stays where it was.

    Raises
    ------
    SolverError
        When the run cannot be computed.
    """
    modeled, time = computed(trial, estimate, tuple(trial.measured))
    signals = signals_of(trial.run.model.Output)
    pairs = {}
    for name, values in trial.measured.items():
        attrs = {"units": signals[name].unit, "long_name": signals[name].label}
        pairs[name] = xr.Dataset(
            {
                "measured": ("time", np.where(trial.rows(name), values, np.nan), attrs),
                "modeled": ("time", modeled[name], attrs),
            },
            {"time": ("time", time, {"units": "s"})},
        )
    return Prediction(trial.label, pairs)


def computed(
    trial: Trial, estimate: Estimate, names: tuple[str, ...]
) -> tuple[dict[str, Array], Array]:
    """Return outputs of a trial's run with the estimates, offsets added, and its instants [s]."""
    values = {
        u.name: float(v)
        for u, v in (
            *zip(estimate.unknowns, estimate.values, strict=True),
            *((k.unknown, k.unknown.start) for k in estimate.kept),
        )
        if u.trial == trial.label or not (u.trial or u.name.startswith(_OWN))
    }
    moving = {name: v for name, v in values.items() if not name.startswith("offset.")}
    run = simulate(moved_run(trial.run, moving, trial.start), names)
    return {name: run[name] + values.get(f"offset.{name}", 0.0) for name in names}, run.time
