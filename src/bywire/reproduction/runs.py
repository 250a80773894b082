"""Bench results that several tables and figures of a source share, each computed once."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from concurrent.futures import Future
from typing import Any

import numpy as np
import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.running import Progress, Result, run
from bywire.core.arguments import checked
from bywire.core.interrupts import raise_if_stopped


class Runs:
    """Bench results, each computed once; threads that ask for the same wait for it.

    Parameters
    ----------
    progress
        Called with the label of a piece of work and its finished share, 0 to 1.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress
        self._known: dict[str, Future[Result]] = {}
        self._lock = threading.Lock()

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
            When the user stopped a run, or another part failed: half a reproduction is none.
        """
        bench = Bench(experiment, name, overrides or {}, options or {}, stimulus or {})
        key = repr(bench)
        with self._lock:
            is_first = key not in self._known
            result = self._known.setdefault(key, Future())
        if is_first:
            try:
                result.set_result(self._run(bench))
            except BaseException as error:
                result.set_exception(error)
        return result.result()

    def _run(self, bench: Bench) -> Result:
        raise_if_stopped()
        result = run(bench)
        if result.status == "interrupted":
            raise KeyboardInterrupt
        return result


@checked
def kpis(result: Result) -> dict[str, float]:
    """Return the KPIs of a result by name, SI."""
    return {kpi.name: kpi.value for kpi in result.kpis}


def selected(recording: xr.Dataset, *names: str) -> xr.Dataset:
    """Return a recording with some of its variables, those that it has."""
    return recording[[name for name in names if name in recording]]


def peak(recording: xr.Dataset, name: str) -> float:
    """Return the largest value of a signal."""
    return float(np.max(recording[name].values))
