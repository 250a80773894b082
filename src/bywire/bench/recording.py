"""Recordings of trajectories: datasets with units, labels and their origin."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, cast

import numpy as np
import pandas as pd
import xarray as xr

from bywire.bench.energy_ledger import energy_doubts, energy_signals, role_attributes
from bywire.bench.rows import Rows
from bywire.core.parameters import ParameterSet
from bywire.core.signals import Signal, signals_of
from bywire.core.version import __version__
from bywire.simulation.advance import put_in_signals
from bywire.simulation.ensemble import RunGroup
from bywire.simulation.run import Run, Trajectory, doubts_of


def parameter_hash(par: ParameterSet) -> str:
    """Return a short digest of all values and choices."""
    text = json.dumps(par.flat(), sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def record(
    run: Run, trajectory: Trajectory, settle: float, keep: float, notes: Mapping[str, Any]
) -> xr.Dataset:
    """Return the recording of a run.

    ``settle``: time of the run [s] before the recording's zero; ``keep``: part of it that is kept,
    at negative times; ``notes``: further attributes, for instance the experiment's name.

    Returns
    -------
    xarray.Dataset
        Dimension ``time`` [s]; variables with ``units`` and ``long_name``.
    """
    rows = rows_of(run, trajectory, settle, keep)
    variables = {n: ("time", row.values, dict(row.attrs)) for n, row in rows.data_vars.items()}
    # As an index of pandas: for an array, xarray would import pint to check its type.
    axis = pd.Index(rows["time"].values, name="time")
    recording = xr.Dataset(variables, coords={"time": ("time", axis, {"units": "s"})})
    recording["time"].attrs["long_name"] = "time"
    recording.attrs = {
        **run_notes(run, trajectory),
        "warnings": "; ".join(watch(cast(xr.Dataset, rows), run, trajectory)),
        **notes,
    }
    return recording


def run_notes(run: Run, trajectory: Trajectory) -> dict[str, Any]:
    """Return the attributes of a recording that describe its run, without warnings."""
    return {
        "bywire_version": __version__,
        "model": run.model.name,
        "parameter_hash": parameter_hash(run.par),
        "parameters": run.par.model_dump_json(),
        "step": run.step,
        "engine": trajectory.engine,
        "status": trajectory.status,
        "unsettled_substeps": trajectory.unsettled,
        "repeated_substeps": trajectory.repeated,
    }


def rows_of(
    run: Run,
    trajectory: Trajectory,
    settle: float,
    keep: float,
    notes: Callable[[], Mapping[str, Any]] = dict,
) -> Rows:
    """Return the content of a run's recording as plain arrays, without warnings; see `record`."""
    time = trajectory.time - settle
    begin = int(np.searchsorted(time, -keep - 1e-9))
    attributes = _attributes_of(run.model.Output)
    # A copy: each signal is contiguous, and the settling is not kept in memory.
    kept = dict(zip(trajectory.names, trajectory.values[begin:].T.copy(), strict=True))
    signals = {name: kept[name] for name in attributes if name in kept}
    return Rows(
        np.round(time[begin:], 12),
        signals,
        attributes,
        lambda: {**run_notes(run, trajectory), **notes()},
        run.par,
    )


def rows_of_group(group: RunGroup, settle: float) -> Rows:
    """Return the content of the recordings of several runs, for the computed rows."""
    signals = dict(zip(group.names, group.values, strict=True))
    attributes = _attributes_of(group.runs[0].model.Output)
    return Rows(
        np.round(group.time - settle, 12), signals, {name: attributes[name] for name in signals}
    )


def ends_of_group(group: RunGroup) -> Rows:
    """Return the first and last rows of several runs, with the signals of these rows alone."""
    values = {name: each[:, [0, -1]] for name, each in zip(group.names, group.values, strict=True)}
    values |= zip(group.end_names, group.ends, strict=True)
    attributes = _attributes_of(group.runs[0].model.Output)
    signals = {name: values[name] for name in attributes if name in values}
    return Rows(group.time[[0, -1]], signals, {name: attributes[name] for name in signals})


@cache
def _attributes_of(output: type) -> Mapping[str, Mapping[str, str]]:
    every = {**signals_of(output), **put_in_signals(output)}
    return {name: _attributes(signal) for name, signal in every.items()}


def _attributes(signal: Signal) -> dict[str, str]:
    attributes = {"units": signal.unit, "long_name": signal.label}
    attributes |= {"set_point_of": signal.set_point_of} if signal.set_point_of else {}
    return attributes | role_attributes(signal.role)


def watch(recording: xr.Dataset, run: Run, trajectory: Trajectory) -> list[str]:
    """Return warnings on a recording: ranges of validity, end stops, solver problems, energies."""
    if not recording.sizes["time"]:  # interrupted before the first row
        return []
    doubts = _solver_doubts(trajectory.doubt, trajectory.unsettled)
    return [*doubts, *energy_doubts(recording, [run]), *run.model.watch(recording, run.par)]


def watch_cases(
    rows: Rows, runs: Sequence[Run], unsettled: Sequence[int], books: Sequence[Sequence[str]]
) -> list[list[str]]:
    """Return the warnings of `watch` for each of several runs of one structure and plan.

    ``rows``: rows of all runs; ``unsettled``: substeps of each that hit the cap of the contacts;
    ``books``: `energy_doubts` of each.
    """
    solver = map(_solver_doubts, doubts_of(runs), unsettled)
    model, pars = runs[0].model, [run.par for run in runs]
    rows.silent = model.silent(rows, pars)
    asked = set(model.may_warn(rows, pars))
    return [
        [*doubts, *book, *(model.watch(rows.case(k), pars[k]) if k in asked else ())]
        for k, (doubts, book) in enumerate(zip(solver, books, strict=True))
    ]


def _solver_doubts(doubt: str, unsettled: int) -> list[str]:
    doubts = [doubt.replace("; ", ", ")] if doubt else []  # semicolons separate warnings
    if unsettled:
        doubts.append(
            f"{unsettled} substeps hit the cap of the contact iteration: take a smaller step"
        )
    return doubts


def energy_doubts_of(run: Run, trajectory: Trajectory) -> list[str]:
    """Return the `energy_doubts` of a run with computed `energy_signals`."""
    if not trajectory.time.size:
        return []
    attributes = _attributes_of(run.model.Output)
    energies = {name: trajectory[name] for name in energy_signals(run)}
    rows = Rows(trajectory.time, energies, {name: attributes[name] for name in energies})
    return energy_doubts(cast(xr.Dataset, rows), [run])
