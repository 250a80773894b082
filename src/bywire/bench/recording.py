"""Trajectories as recordings: datasets with units, names and where they come from."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache
from typing import Any, cast

import numpy as np
import pandas as pd
import xarray as xr

from bywire.bench.energy_ledger import Delivery, actuator_ledger, deliveries, role_attributes
from bywire.bench.rows import Rows
from bywire.core.parameters import ParameterSet
from bywire.core.signals import Signal, signals_of
from bywire.core.version import __version__
from bywire.simulation.advance import put_in_signals
from bywire.simulation.run import Run, Trajectory, doubts_of
from bywire.simulation.run_group import RunGroup

_OPEN = 1e-5  # of the energies, that the balance of a run may leave open, and a loss may give
_NOTHING = 1e-9  # J, that nobody misses: rounding of what is stored while nothing moves


def parameter_hash(par: ParameterSet) -> str:
    """Return a short digest of all values and choices."""
    text = json.dumps(par.flat(), sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def record(
    run: Run, trajectory: Trajectory, settle: float, keep: float, notes: Mapping[str, Any]
) -> xr.Dataset:
    """Return the recording of a run.

    ``settle``: time of the run [s] that lies before the recording's zero; ``keep``: how much of it
    is kept, at negative times; ``notes``: further attributes, for instance the experiment's name.

    Returns
    -------
    xarray.Dataset
        Dimension ``time`` [s]; variables with ``units`` and ``long_name``.
    """
    rows = rows_of(run, trajectory, settle, keep)
    variables = {n: ("time", row.values, dict(row.attrs)) for n, row in rows.data_vars.items()}
    # As an index of pandas: from an array, xarray would load pint to see what it is.
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
    """Return what a recording says of its run, but for the warnings."""
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
    """Return what a recording of a run holds, as plain arrays, without warnings; see `record`."""
    time = trajectory.time - settle
    begin = int(np.searchsorted(time, -keep - 1e-9))
    attributes = _attributes_of(run.model.Output)
    # A copy: each signal in one piece, and the settling not kept in memory.
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
    """Return what recordings of several runs hold, of those rows that were computed."""
    signals = dict(zip(group.names, group.values, strict=True))
    attributes = _attributes_of(group.runs[0].model.Output)
    return Rows(
        np.round(group.time - settle, 12), signals, {name: attributes[name] for name in signals}
    )


def ends_of_group(group: RunGroup) -> Rows:
    """Return the first and the last row of several runs, with what these alone recorded."""
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
    """Return what the user should know of a recording: validity left, stops met, solver trouble."""
    if not recording.sizes["time"]:  # interrupted before the first row
        return []
    doubts = _solver_doubts(trajectory.doubt, trajectory.unsettled)
    return [*doubts, *energy_doubts(recording, [run]), *run.model.watch(recording, run.par)]


def watch_cases(
    rows: Rows, runs: Sequence[Run], unsettled: Sequence[int], books: Sequence[Sequence[str]]
) -> list[list[str]]:
    """Return what `watch` says of each of several runs of one structure and plan.

    ``rows``: of all of them; ``unsettled``: substeps of each that hit the cap of the contacts;
    ``books``: what `energy_doubts` says of each.
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
    doubts = [doubt.replace("; ", ", ")] if doubt else []  # what joins the warnings
    if unsettled:
        doubts.append(
            f"{unsettled} substeps hit the cap of the contact iteration: take a smaller step"
        )
    return doubts


def energy_doubts(recording: xr.Dataset, runs: Sequence[Run] = ()) -> list[str]:
    """Return warnings where the energies of a recording cannot be true.

    The energy balance is open by more than the step can explain, or a loss gives energy. The scheme
    closes the balance to a few parts in 1e8, the remainder of nonlinear elements, and a loss grows
    in every substep. Where parameters are so extreme that numbers cancel, or an element's equations
    leave their range, they do not.

    ``runs``: the one whose recording it is, where that is known.
    """
    return energy_doubts_of_cases(recording, 1, runs)[0]


def energy_doubts_of_cases(
    recording: xr.Dataset, cases: int, runs: Sequence[Run] = ()
) -> list[list[str]]:
    """Return what `energy_doubts` says of each of several runs, of the rows of all."""
    doubts: list[list[str]] = [[] for _ in range(cases)]
    for each in deliveries(recording, _losses(runs)):
        if not np.any(_is_delivered(each)):
            continue
        where = f" of the book {each.book!r}" if each.book else ""
        energies, totals = (np.broadcast_to(e, cases) for e in (each.energy, each.turnover))
        is_said = np.broadcast_to(_is_delivered(each), cases)
        for k in np.flatnonzero(is_said).tolist():
            doubts[k].append(
                f"the loss {each.label!r}{where} ({each.name}) gives {energies[k]:.3g} J of "
                f"{totals[k]:.3g} J that were turned over, and a loss cannot give energy: do not "
                "believe this run, take a smaller step, and look for a parameter that is extreme"
            )
    if _are_surely_closed(recording):
        return doubts
    books = actuator_ledger(recording)
    error, turned = (np.broadcast_to(each, cases) for each in (books.closing_error, books.turnover))
    for k, (left, total) in enumerate(zip(error.tolist(), turned.tolist(), strict=True)):
        if abs(left) > _OPEN * total + _NOTHING:
            doubts[k].append(
                f"the energy balance is open by {abs(left):.3g} J of {total:.3g} J that were "
                "turned over: do not believe this run, take a smaller step, and look for a "
                "parameter that is extreme"
            )
    return doubts


def _losses(runs: Sequence[Run]) -> Collection[str] | None:
    """Return the losses that grow whatever happens; None for all.

    In the loss of a contact stands what a change of its parameters does, see `simulation.advance`.
    """
    return runs[0].model.Flow._fields if any(run.changes for run in runs) else None


def _is_delivered(delivery: Delivery) -> Any:
    """Return whether a loss gave more than numbers explain, of several runs in which of them."""
    return np.greater(delivery.energy, _OPEN * delivery.turnover + _NOTHING)


def are_surely_sound(recording: xr.Dataset, runs: Sequence[Run] = ()) -> bool:
    """Return whether the ends of a recording, or of several runs', tell of no `energy_doubts`."""
    given = deliveries(recording, _losses(runs))
    is_quiet = not any(np.any(_is_delivered(each)) for each in given)
    return is_quiet and _are_surely_closed(recording)


def _are_surely_closed(recording: xr.Dataset) -> bool:
    """Return whether the ends of a recording, or of several runs', tell that no books are open."""
    books = actuator_ledger(recording, is_split=False)
    if not (books.sources and books.sinks):
        return True
    # What is split turns over no less: where the whole is far from open, so are its parts.
    return bool(np.all(2.0 * np.abs(books.closing_error) <= _OPEN * books.turnover + _NOTHING))


def energy_signals(run: Run) -> tuple[str, ...]:
    """Return the outputs of a run's model that stand in the books of its energy."""
    return tuple(
        name
        for name, signal in signals_of(run.model.Output).items()
        if name.startswith(("E_", "W_")) or signal.role is not None
    )


def energy_doubts_of(run: Run, trajectory: Trajectory) -> list[str]:
    """Return what `energy_doubts` says of a run of which the `energy_signals` were computed."""
    if not trajectory.time.size:
        return []
    attributes = _attributes_of(run.model.Output)
    energies = {name: trajectory[name] for name in energy_signals(run)}
    rows = Rows(trajectory.time, energies, {name: attributes[name] for name in energies})
    return energy_doubts(cast(xr.Dataset, rows), [run])


def energy_residual(recording: xr.Dataset) -> xr.DataArray:
    """Return energy in, less losses, less the change of stored energy [J]; 0 but for the step.

    Of the actuator's own book; what stands in further ones is left out.
    """
    losses = sum(
        values
        for name, values in recording.items()
        if str(name).startswith("E_")
        and name not in ("E_source", "E_stored")
        and "energy_book" not in values.attrs
    )
    balance = recording["E_source"] - losses - recording["E_stored"]
    residual: xr.DataArray = balance - float(balance.values[0])
    residual.attrs = {"units": "J", "long_name": "residual of the energy balance"}
    return residual
