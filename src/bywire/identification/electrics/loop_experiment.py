"""Experiments on current loops: what is unknown, how the demand steps, what of it counts."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import xarray as xr

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.identification.output_error import Trial


class LoopOptions(ParameterSet):
    """What is unknown, and the steps of the synthetic experiment."""

    unknowns: Literal["gains", "all"]
    """gains alone, the winding being known; or the winding with them"""
    lead: Duration
    """beginning of a record that does not count: where the loop was before is not known"""
    dwell: Duration
    """synthetic: time from one step to the next"""
    duration: Duration
    """synthetic: length of the record"""

    def names(self, gains: tuple[str, ...], winding: tuple[str, ...]) -> tuple[str, ...]:
        """Return what is estimated, given the names of all."""
        return gains if self.unknowns == "gains" else (*gains, *winding)


def without_lead(trial: Trial, data: xr.Dataset, lead: float) -> Trial:
    """Return a trial of which the first seconds of its record do not count.

    Parameters
    ----------
    trial
        Of a whole record.
    data
        That record, over ``time`` [s].
    lead
        How long that is [s].
    """
    t = data["time"].values
    return replace(trial, used=t - t[0] >= lead)
