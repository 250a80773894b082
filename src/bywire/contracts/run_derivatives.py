"""Contract of a model's sensitivities: the exact derivatives of a run are its differences."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bywire.contracts.evidence import Evidence, NotCheckedError, measured
from bywire.contracts.trial import Trial, constants
from bywire.core.errors import ParameterError
from bywire.core.parameters import leaf_fields
from bywire.core.signals import signals_of
from bywire.simulation.compiler import find_compiler
from bywire.simulation.run import Run
from bywire.simulation.sensitivity import simulate_with_sensitivities

Array = NDArray[np.float64]

PARAMETERS = 8
"""how many parameters are tried: those that move the states most"""
INFLUENCE = 1e-3
"""relative change of a parameter by which its influence is judged"""
DIFFERENCE = 1e-6
"""relative step of the differences"""
LEAST = 1e-6
"""of a state's usual magnitude: what all of a parameter moves it by at least"""
SLOPE = 0.02
"""by how much a derivative may differ from them, of its largest value, at half of the instants:
what a first breakaway that moves in time leaves at 20 us; without one it is a millionth"""


def has_its_derivatives(trial: Trial) -> Iterator[Evidence]:
    """Find whether the derivatives of the states by the parameters are differences of runs."""
    if find_compiler() is None:
        raise NotCheckedError("there is no C compiler: install the extra bywire[compiler]")
    run = trial.free_run
    names = [f"x_{name}" for name in trial.model.State._fields]
    chosen = _strongest(trial, run)
    if not chosen:
        raise NotCheckedError(f"from {trial.start.known} no parameter moves any state")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of converters; their runs are those of the plant alone
        exact = simulate_with_sensitivities(run, tuple(chosen), names)
    at = run.par.leaves()
    ahead = {name: [at[name]] * 2 * len(chosen) for name in chosen}
    for k, name in enumerate(chosen):
        ahead[name][2 * k : 2 * k + 2] = [_moved(run, name, sign * DIFFERENCE) for sign in (1, -1)]
    values = trial.lanes(ahead)[:, :, : len(names)]
    whose = "the plant alone" if trial.rounds else "the run"
    nominal = [abs(s.nominal) for s in signals_of(trial.model.State).values()]
    smooth = _until_a_reversal(trial, exact.trajectory.values)
    for k, name in enumerate(chosen):
        width = ahead[name][2 * k] - ahead[name][2 * k + 1]
        differences = (values[2 * k, :smooth] - values[2 * k + 1, :smooth]) / width
        slopes = exact.derivatives[:smooth, :, k]
        rounding = np.abs(values[2 * k]).max(axis=0) * 1e-12 / width
        for j, state in enumerate(trial.model.State._fields):
            largest = max(np.abs(slopes[:, j]).max(), np.abs(differences[:, j]).max())
            felt_at_all = largest * abs(at[name]) > LEAST * nominal[j]
            if largest * SLOPE <= rounding[j] or not felt_at_all:
                continue  # what the state feels of this parameter drowns in rounding
            off = np.abs(slopes[:, j] - differences[:, j])
            felt = np.abs(slopes[:, j]) + np.abs(differences[:, j]) > 1e-3 * largest
            # Not everywhere: contacts that close move in time, and fixed steps do not show that.
            share = float(np.median(off[felt]) / largest)
            text = (
                f"d({state})/d({name}) of {whose} is off by {share:.1e} of its largest value at "
                f"half of the instants up to {exact.trajectory.time[smooth - 1]:.3g} s"
            )
            yield measured(share, SLOPE, text, trial.place("balance", "wire"))


def _until_a_reversal(trial: Trial, recorded: Array) -> int:
    """Return how many rows there are until something with dry friction stops or turns round.

    That moves in time with a parameter; a step that ends at fixed instants shows it in the mean
    alone, and differences over a short way do not.
    """
    columns = [trial.model.State._fields.index(name) for name in trial.model.frictions]
    signs = np.sign(recorded[:, columns])
    turned = (signs[1:] != signs[:-1]) & (signs[:-1] != 0.0)
    rows = np.flatnonzero(turned.any(axis=1))
    return int(rows[0]) + 1 if rows.size else len(recorded)


def _strongest(trial: Trial, run: Run) -> list[str]:
    """Return the parameters that move the states most, each by the same share of its value."""
    known = dict(constants(run))
    cases: dict[str, float] = {}
    for name in known:
        try:
            value = _moved(run, name, INFLUENCE)
            run.par.replace({name: value})
        except ParameterError:
            continue
        cases[name] = value
    if not cases:
        return []
    table = {
        name: [known[name], *(cases[name] if other == name else known[name] for other in cases)]
        for name in cases
    }
    count = len(trial.model.State._fields)
    values = trial.lanes(table)[:, :, :count]
    nominal = np.array([s.nominal for s in signals_of(trial.model.State).values()])
    size = np.maximum(np.ptp(values[0], axis=0), 1e-3 * np.abs(nominal))
    moved = (np.abs(values[1:] - values[0]) / size).max(axis=1).mean(axis=1)
    order = np.argsort(-moved)[:PARAMETERS]
    names = list(cases)
    return [names[k] for k in order if moved[k] > 1e-9]


def _moved(run: Run, name: str, share: float) -> float:
    value = run.par.leaves()[name]
    return value + share * (abs(value) or leaf_fields(type(run.par))[name].unit.nominal)

