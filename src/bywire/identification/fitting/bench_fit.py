"""Output error on a bench: measured inputs drive its model, unknowns are fitted to its outputs.

Where the bench closes a loop, the measured set point drives model and controller together:
closed-loop output error. The run begins where the experiment does with the parameters of the
moment, so that an equilibrium stays one while the parameters that make it are searched.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.bench.bench import Bench
from bywire.bench.values import number
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import signals_of
from bywire.identification.estimate import Estimate
from bywire.identification.fitting.asked import Asked
from bywire.identification.fitting.options import Options
from bywire.identification.fitting.unknown_texts import is_parameter, starts_of, unknowns_of
from bywire.identification.fitting.worth import (
    Compared,
    believable,
    checks_of,
    compared,
    figures_of,
    validation_of,
)
from bywire.identification.least_squares import estimate
from bywire.identification.method import Effort, Identified
from bywire.identification.multistart import search
from bywire.identification.noise import noise_of
from bywire.identification.output_error import Trial, initial_states, output_error
from bywire.identification.records import split
from bywire.identification.replaying.measured_run import MeasuredRun, case_of, measured_run
from bywire.identification.unknown import Unknown

Array = NDArray[np.float64]

# Rounding has no derivative, closed loops would look open: these laws leave it out.
_SMOOTH = {"adc.law": "ideal", "encoder.law": "ideal"}
_FINEST = 1.0 / 65536.0  # of a signal's range: what a converter of 16 bits resolves
_FEWEST = 10  # samples
_AT_REST = 5.0  # times the noise: a start below it is none that could be estimated


@dataclass(frozen=True)
class BenchFit:
    """The fit of a bench.

    Parameters
    ----------
    bench
        What was measured, with the values that are known.
    asked
        What is measured and what is unknown.
    """

    bench: Bench
    asked: Asked

    def identify(
        self, data: xr.Dataset, par: ParameterSet, options: Options, effort: Effort
    ) -> Identified:
        """Return the unknowns from one or several records.

        Parameters
        ----------
        data
            Inputs and outputs over ``time`` [s], SI.
        par
            The bench's parameters, with the values at which the search begins.

        Raises
        ------
        InputError
            When a record does not fit the bench, or tells none of the unknowns.
        """
        bench = self.moved(par)
        records = {
            label: self.record(bench, one, options) for label, one in split(data, True).items()
        }
        trials = [self.trial(one, label) for label, one in records.items()]
        unknowns = list(unknowns_of(case_of(bench, self.asked.case), bench.par, self.asked))
        for one, trial in zip(records.values(), trials, strict=True):
            unknowns += self.starts(one, trial)
        problem = output_error(trials, unknowns)
        starts = starts_of(
            unknowns, self.asked.unknowns, effort.starts, effort.spread, effort.seed
        )
        led = search(problem, starts, options.loss, effort.progress, effort.store, effort.threads)
        found = estimate(problem, options.loss, led.best.values)
        shown = [
            compared(one, trial, found)
            for one, trial in zip(records.values(), trials, strict=True)
        ]
        held = self._held_out(bench, found, options)
        checks = checks_of(trials, found, options)
        return Identified(
            estimates={"output error": found},
            parameters=believable(found),
            figures=figures_of(shown, trials),
            checks=(
                *checks, *(() if held is None else validation_of(held, options)),
            ),
            curves=(
                *(curve for one in shown for curve in one.curves("fit")),
                *(() if held is None else held.curves("validation")),
            ),
            notes=(
                *_said(records, options, coarse=not checks[0].holds), *_smoothed(bench),
                f"{led.reached} of {effort.starts} starts reached the minimum",
            ),
        )  # fmt: skip

    def moved(self, par: ParameterSet) -> Bench:
        """Return the bench with other values of what is unknown."""
        leaves, known = par.leaves(), self.bench.par.leaves()
        return self.bench.with_overrides(
            {n: leaves[n] for n in filter(is_parameter, self.asked.unknowns)
             if leaves.get(n) != known.get(n)}
        )  # fmt: skip

    def record(self, bench: Bench, data: xr.Dataset, options: Options) -> MeasuredRun:
        """Return a record with the run that stands beside it."""
        return measured_run(
            bench, data, self.asked.inputs or None, list(self.asked.outputs), self.asked.case,
            settle=not self.asked.states, between=options.between,
        )  # fmt: skip

    def trial(self, one: MeasuredRun, label: str) -> Trial:
        """Return a record beside its run; while the run settles nothing is compared."""
        before = np.full(one.settled, np.nan)
        known = one.case.par.choices()
        smooth = {name: law for name, law in _SMOOTH.items() if name in known}
        values = {name: one.data[name].values for name in one.compared}
        return Trial(
            replace(one.run, par=one.run.par.replace(smooth)),
            {name: np.concatenate((before, row)) for name, row in values.items()},
            {name: self._noise(name, row, one) for name, row in values.items()},
            label,
            start=None if one.bench.definition.preview else partial(_begun, one.bench, one.case),
        )

    def _noise(self, name: str, values: Array, one: MeasuredRun) -> float:
        """Return the standard deviation of an output's noise, given or of the record."""
        unit = signals_of(one.case.model.Output)[name].unit
        if text := self.asked.outputs[name]:
            return noise_given(name, text, unit)
        there = values[np.isfinite(values)]
        if there.size < _FEWEST:
            raise ParameterError(
                f"{name} has {there.size} samples: {_FEWEST} at least are needed to tell its noise"
            )
        span = float(np.ptp(there))
        if not span > 0.0:
            raise ParameterError(
                f"{name} does not move: an output that rests tells nothing; leave it out, or "
                "excite the system"
            )
        return max(noise_of(there), _FINEST * span)

    def starts(self, one: MeasuredRun, trial: Trial) -> tuple[Unknown, ...]:
        """Return a record's own unknowns: initial states, and a start told by a noisy sample."""
        fields = leaf_fields(one.bench.definition.options)
        found = []
        for name, signal in one.begun_at.items():
            value = float(one.bench.options[name])
            if trial.start is not None and value > _AT_REST * trial.noise[signal]:
                unit = fields[name].unit.symbol
                found.append(Unknown(f"start.{name}", value, 0.0, scale=value, unit=unit,
                                     trial=trial.label))  # fmt: skip
        return (*found, *initial_states(trial, self.asked.states))

    def _held_out(self, bench: Bench, found: Estimate, options: Options) -> Compared | None:
        if self.asked.holdout is None:
            return None
        one = self.record(bench, self.asked.holdout, options)
        # A label that no record has: only what all records share is known of it.
        return compared(one, self.trial(one, "held out"), found)


def noise_given(name: str, text: str, unit: str) -> float:
    """Return the standard deviation of an output's noise, written with its unit.

    Raises
    ------
    UnitError, ParameterError
        When it is no quantity of that unit, or not > 0.
    """
    found = number(text, unit, f"noise of {name}")
    if not found > 0.0:
        raise ParameterError(f"noise of {name} = {text} is not admissible: it must be > 0 {unit}")
    return found


def _begun(bench: Bench, case: Any, values: Mapping[str, float]) -> tuple[Any, Any]:
    """Return where the experiment begins with other parameters and options of the start."""
    options = {n.removeprefix("start."): v for n, v in values.items() if n.startswith("start.")}
    own = {n: v for n, v in values.items() if not n.startswith("start.")}
    par, chosen = bench.par.replace(own), bench.chosen_options.replace(options)
    made = bench.definition.cases(par, chosen, bench.chosen_stimulus)
    (one,) = (k for k in made if k.label == case.label)
    return one.state, one.memory


def _smoothed(bench: Bench) -> tuple[str, ...]:
    known = bench.par.choices()
    changed = [name for name, law in _SMOOTH.items() if known.get(name, law) != law]
    return tuple(f"{name} = {_SMOOTH[name]} in the fit: rounding has no derivative"
                 for name in changed)  # fmt: skip


def _said(records: Mapping[str, MeasuredRun], options: Options, coarse: bool) -> list[str]:
    """Return what the user should know of the records, and of coarse inputs where asked."""
    said = [f"{k}: {note}" if k else note for k, one in records.items() for note in one.notes]
    one = next(iter(records.values()))
    said.append("driven by " + ", ".join(f"{name} = {v}" for name, v in one.driven.items()))
    interval, period = one.run.record, min(k.period for k in one.case.model.tasks(one.case.par))
    if coarse and options.between == "held" and period < 0.5 * interval:
        said.append(
            f"inputs are held for {1e3 * interval:.4g} ms from sample to sample, but act every "
            f"{1e3 * period:.4g} ms: if they are smooth, take --option between=linear"
        )
    return said
