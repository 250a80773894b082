"""What a bench gave: recordings, key figures, and whether the requirements are met."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Verdict
from bywire.core.errors import ParameterError, unknown_name


@dataclass(frozen=True)
class Result:
    """What a bench gave.

    Parameters
    ----------
    recordings
        One dataset per run of the experiment, by label.
    status
        ``done`` (nothing was required), ``passed``, ``failed`` (a requirement was not met),
        ``undecided`` (one is no further from its limit than its error from the step) or
        ``interrupted``.
    unestimated
        Why the error from the step is not known although it was asked for; empty where it is.
    """

    bench: Bench
    recordings: Mapping[str, xr.Dataset]
    kpis: tuple[Kpi, ...]
    verdicts: tuple[Verdict, ...]
    status: str
    unestimated: str = ""

    @property
    def recording(self) -> xr.Dataset:
        """The recording of an experiment that makes one run."""
        if len(self.recordings) != 1:
            labels = ", ".join(self.recordings)
            raise ParameterError(f"this experiment made several recordings: take one of {labels}")
        return next(iter(self.recordings.values()))

    def kpi(self, name: str) -> Kpi:
        """Return one KPI by name.

        Raises
        ------
        UnknownNameError
            With the nearest known names.
        """
        by_name = {kpi.name: kpi for kpi in self.kpis}
        if name not in by_name:
            raise unknown_name("KPI", name, by_name)
        return by_name[name]

    @property
    def warnings(self) -> list[str]:
        """What the user should know of the runs."""
        said = [*self.bench.outdated]
        said += [
            f"{label}: {text}" if len(self.recordings) > 1 else text
            for label, recording in self.recordings.items()
            for text in str(recording.attrs.get("warnings", "")).split("; ")
            if text
        ]
        return said + ([self.unestimated] if self.unestimated else [])
