"""Contract of a model's sensitivities: the exact derivatives of a run are its differences."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np

from bywire.contracts.evidence import Evidence, NotCheckedError, measured
from bywire.contracts.trial import Trial, constants, lanes
from bywire.core.errors import ParameterError
from bywire.core.parameters import leaf_fields
from bywire.core.signals import signals_of
from bywire.simulation.compiler import find_compiler
from bywire.simulation.run import Run
from bywire.simulation.sensitivity import simulate_with_sensitivities

PARAMETERS = 8
"""how many parameters are tried: those that move the states most"""
INFLUENCE = 1e-3
"""relative change of a parameter by which its influence is judged"""
DIFFERENCE = 1e-6
"""relative step of the differences"""
SLOPE = 1e-3
"""by how much a derivative may differ from them, of the largest of all states, half of the time"""


def has_its_derivatives(trial: Trial) -> Iterator[Evidence]:
    """Find whether the derivatives of the states by the parameters are differences of runs.

    Without dry friction, and without controllers that round: breakaway and reversals move in time
    with a parameter, which exact derivatives follow within a few per cent and differences do not.
    """
    if find_compiler() is None:
        raise NotCheckedError("there is no C compiler: install the extra bywire[compiler]")
    run = trial.large_run(frictions=False)
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
    values = lanes(run, ahead)[:, :, : len(names)]
    whose = "the plant alone" if trial.rounds else "the run"
    nominal = np.array([abs(s.nominal) for s in signals_of(trial.model.State).values()])
    for k, name in enumerate(chosen):
        width = ahead[name][2 * k] - ahead[name][2 * k + 1]
        differences = (values[2 * k] - values[2 * k + 1]) / width / nominal
        slopes = exact.derivatives[:, :, k] / nominal
        rounding = np.abs(values[2 * k]).max(axis=0) * 1e-12 / width / nominal
        largest = float(max(np.abs(slopes).max(), np.abs(differences).max()))
        if largest * SLOPE <= rounding.max():
            continue  # what the states feel of this parameter drowns in rounding
        # Not everywhere: contacts that close move in time, and fixed steps do not show that.
        off = np.median(np.abs(slopes - differences), axis=0) / largest
        j = int(np.argmax(off))
        state = trial.model.State._fields[j]
        text = (
            f"d({state})/d({name}) of {whose} without dry friction is off by {off[j]:.1e} of the "
            "largest, in usual magnitudes, half of the time"
        )
        yield measured(float(off[j]), SLOPE, text, trial.place("balance", "wire"))


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
    values = lanes(run, table)[:, :, :count]
    nominal = np.array([s.nominal for s in signals_of(trial.model.State).values()])
    size = np.maximum(np.ptp(values[0], axis=0), 1e-3 * np.abs(nominal))
    moved = (np.abs(values[1:] - values[0]) / size).max(axis=1).mean(axis=1)
    order = np.argsort(-moved)[:PARAMETERS]
    names = list(cases)
    return [names[k] for k in order if moved[k] > 1e-9]


def _moved(run: Run, name: str, share: float) -> float:
    value = run.par.leaves()[name]
    return value + share * (abs(value) or leaf_fields(type(run.par))[name].unit.nominal)
