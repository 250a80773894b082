"""Any parameters of any bench by output error, open or closed loop (Ljung 1999, section 7.2)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case, as_run
from bywire.core.callers import option
from bywire.core.errors import ParameterError, unknown_name, unknown_of_few
from bywire.core.signals import Signal, signals_of, without_noise
from bywire.data.named_columns import reject_swapped
from bywire.identification.bench_fit import BenchFit, noise_given
from bywire.identification.bench_replay import case_of
from bywire.identification.method import Method
from bywire.identification.question import BenchMethod, Options, Question, is_parameter, unknowns_of
from bywire.simulation.run import simulate

_NAME = "output-error"
_DEFAULTS = Options(
    loss="linear", between="held", most_residual=1.3, most_outliers=0.05, least_vaf=0.9, noise=2e-3
)
_SIMULATED = ("noise",)


def simulated(bench: Bench, question: Question, options: Options, seed: int) -> xr.Dataset:
    """Simulate the inputs and measured outputs of the experiment.

    Parameters
    ----------
    bench
        Bench with the true values.
    question
        Names of outputs and inputs, and the noise of the outputs.
    options
        Noise of outputs for which the question specifies none.
    seed
        Seed of the noise.

    Returns
    -------
    xarray.Dataset
        Over ``time`` [s]; it starts before zero if the experiment's recording does.
    """
    bench = replace(bench, seed=seed)
    number = [begun.label for begun in bench.cases()].index(case_of(bench, question.case).label)
    case = bench.cases()[number]
    run = as_run(case, bench.step, seed=(seed, number))
    computed = simulate(run, tuple(question.noise))
    kept = computed.time >= case.settle - case.keep - 1e-9
    t = np.round(computed.time[kept] - case.settle, 12)
    random = np.random.default_rng([seed, 1])
    known = signals_of(run.model.Output)
    rows = {}
    for name, text in question.noise.items():
        values = computed[name][kept]
        sigma = (
            noise_given(name, text, known[name].unit)
            if text
            else options.noise * float(np.ptp(values))
        )
        noisy = values + random.normal(0.0, sigma, values.size)
        rows[name] = ("time", noisy, _attrs(known[name]))
    stimuli, given = signals_of(run.model.Stimulus), case.stimulus(t)
    driven = question.inputs or {n: n for n in without_noise(given)}
    for name, signal in driven.items():
        values = np.asarray(given.get(name, np.zeros(t.size)), dtype=float)
        rows[signal] = ("time", np.broadcast_to(values, t.shape), _attrs(stimuli[name]))
    axis = pd.Index(t, name="time")
    return xr.Dataset(rows, {"time": ("time", axis, {"units": "s", "long_name": "time"})})


def _attrs(signal: Signal) -> dict[str, str]:
    return {"units": signal.unit, "long_name": signal.label}


def on(bench: Bench, question: Question) -> Method:
    """Return the method for a question about a bench.

    Parameters
    ----------
    bench
        Model, experiment, and known values.
    question
        Measured signals and unknowns.

    Raises
    ------
    InputError
        When a name in the question does not exist, or a text is not valid.

    References
    ----------
    L. Ljung, System Identification: Theory for the User, 2nd ed., 1999, section 7.2.
    """
    case = case_of(bench, question.case)
    _require_known(case, question)
    unknowns_of(case, bench.par, question)
    stimuli, outputs = signals_of(case.model.Stimulus), signals_of(case.model.Output)
    driving = without_noise(stimuli)
    measured = {name: outputs[name].unit for name in question.noise}
    for name, text in question.noise.items():
        if text:
            noise_given(name, text, measured[name])
    fit = BenchFit(bench, question)
    return Method(
        name=_NAME,
        assembly=bench.system,
        summary=f"parameters of {bench.experiment} by output error",
        experiment=bench.experiment,
        signals={s: stimuli[name].unit for name, s in question.inputs.items()} | measured,
        optional={} if question.inputs else {name: stimuli[name].unit for name in driving},
        options=Options,
        defaults=_DEFAULTS,
        identify=fit.identify,
        synthetic=_Simulation(fit),
        unknowns=tuple(filter(is_parameter, question.ranges)),
        several=True,
        gaps=True,
        simulated=_SIMULATED,
        bench=bench,
        key=f"{bench} {question.key}",
    )


@dataclass(frozen=True)
class _Simulation:
    """Simulation of the experiment with given parameters."""

    fit: BenchFit

    def __call__(self, par: Any, options: Options, seed: int) -> xr.Dataset:
        return simulated(self.fit.moved(par), self.fit.question, options, seed)


def _require_known(case: Case, question: Question) -> None:
    """Reject names of signals and states that the model does not have."""
    outputs, stimuli = signals_of(case.model.Output), signals_of(case.model.Stimulus)
    if not question.noise:
        raise ParameterError(
            f"there is no output. Add {option('outputs')} SIGNAL for each recorded output of the "
            f"model, for example {', '.join(list(outputs)[:6])}",
            name="outputs",
            valid=", ".join(outputs),
        )
    driven = without_noise(stimuli)
    states = case.model.State._fields
    reject_swapped("outputs", question.columns, outputs)
    reject_swapped("inputs", question.inputs, driven)
    for kind, names, known, refused in (
        ("output", question.noise, outputs, unknown_name),
        ("stimulus", question.inputs, driven, unknown_of_few),
        (f"state in {option('states')}", question.states, states, unknown_of_few),
    ):
        for name in names:
            if name not in known:
                raise refused(kind, name, known)


METHOD = BenchMethod(
    name=_NAME,
    summary="any parameters of any bench, from measured inputs and outputs",
    options=Options,
    defaults=_DEFAULTS,
    simulated=_SIMULATED,
    on=on,
)
