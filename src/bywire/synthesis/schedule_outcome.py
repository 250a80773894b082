"""What the design of a gain schedule gives: gains by region, and the loop across the regions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bywire.synthesis.linear_case import LinearCase
from bywire.synthesis.outcome import MISSED, Design, Status


@dataclass(frozen=True)
class Across:
    """The scheduled loop with its gains frozen at an operating point.

    Parameters
    ----------
    label, at, region
        The model, its operating point [SI], and the region that it belongs to.
    figures
        All figures of the linear model.
    slack
        Of the requirement that is worst off there; negative infinity where it is unstable.
    """

    label: str
    at: float
    region: str
    figures: Mapping[str, float]
    slack: float


@dataclass(frozen=True)
class ScheduleDesign:
    """A gain schedule and what it gives.

    Parameters
    ----------
    regions
        Design of each region, by ascending operating point, where anything was left to choose;
        each sees its own models alone.
    points
        Operating points [SI] for which each region was designed.
    gains
        Of all regions together, by dotted name [SI].
    nominal
        All figures of the nominal model.
    cases
        Models of the scheduled loop: the nominal one, and those of all points and ranges.
    across
        The scheduled loop from the lowest to the highest point and across the borders.
    """

    regions: Mapping[str, Design]
    points: Mapping[str, tuple[float, ...]]
    gains: Mapping[str, float]
    nominal: Mapping[str, float]
    cases: tuple[LinearCase, ...]
    across: tuple[Across, ...]

    @property
    def worst(self) -> Across:
        """Where the scheduled loop is worst off."""
        return min(self.across, key=lambda one: one.slack)

    @property
    def status(self) -> Status:
        """Whether every region, and the loop between them, meets the requirements."""
        found = [one.status for one in self.regions.values()]
        if "interrupted" in found:
            return "interrupted"
        return "met" if {*found} == {"met"} and self.worst.slack >= MISSED else "infeasible"
