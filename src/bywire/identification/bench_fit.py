"""Output error on a bench: the fit of unknowns to measured outputs, and its checks."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.bench.bench import Bench
from bywire.core.callers import option
from bywire.core.errors import ParameterError, counted, not_valid
from bywire.core.parameters import ParameterSet, choice_fields, choices_of, leaf_fields
from bywire.core.quantities import display_unit
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.core.units import difference_unit, shown
from bywire.core.values import number
from bywire.identification.bench_replay import MeasuredRun, beside, case_of, measured_run
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Problem, estimate, solve
from bywire.identification.measured import (
    FAR,
    NOISE_OF_SAMPLES,
    determines_its_noise,
    noise_of,
    outliers,
    robust_scale,
    split,
)
from bywire.identification.method import Check, Curve, Effort, Identified
from bywire.identification.multistart import Search, search
from bywire.identification.output_error import Trial, initial_states, moved_run, output_error
from bywire.identification.question import (
    Options,
    Question,
    is_parameter,
    starts_of,
    switched_off,
    unknowns_of,
)
from bywire.identification.replay_fit import Segment, fit_figures
from bywire.identification.residuals import by_output, explained
from bywire.identification.unknown import Unknown
from bywire.simulation.run import simulate

_OWN = ("initial.", "start.")  # prefixes of unknowns that belong to a single record


@dataclass(frozen=True)
class Prediction:
    """A record and the model's outputs with the estimates.

    Parameters
    ----------
    label
        Label of the record; empty if there is only one.
    pairs
        ``measured`` and ``modeled`` over ``time`` [s], by output.
    """

    label: str
    pairs: Mapping[str, xr.Dataset]

    def figures(self, name: str) -> dict[str, float]:
        """Return the figures of an output over the whole record; see ``fit_figures``."""
        time = self.pairs[name]["time"].values
        whole = Segment("all", float(time[0]), float(time[-1]))
        return {k.name: k.value for k in fit_figures(self.pairs[name], whole)}


def predict(trial: Trial, estimate: Estimate) -> Prediction:
    """Compare a record with the model at the estimates, without a fit.

    Parameters
    ----------
    trial
        A record and its model. The estimate supplies unknowns of a single record, such as its
        start, only if they have this trial's label.
    estimate
        An estimate from this or other records; undetermined unknowns keep their start values.

    Raises
    ------
    SolverError
        When the run cannot be computed.
    """
    modeled, time = computed(trial, estimate, tuple(trial.measured))
    signals = signals_of(trial.run.model.Output)
    pairs = {}
    for name, values in trial.measured.items():
        attrs = {"units": signals[name].unit, "long_name": signals[name].label}
        pairs[name] = xr.Dataset(
            {
                "measured": ("time", np.where(trial.rows(name), values, np.nan), attrs),
                "modeled": ("time", modeled[name], attrs),
            },
            {"time": ("time", time, {"units": "s"})},
        )
    return Prediction(trial.label, pairs)


def computed(
    trial: Trial, estimate: Estimate, names: tuple[str, ...]
) -> tuple[dict[str, Array], Array]:
    """Return outputs of a trial's run with the estimates, offsets added, and its times [s]."""
    values = {
        u.name: float(v)
        for u, v in (
            *zip(estimate.unknowns, estimate.values, strict=True),
            *((k.unknown, k.unknown.start) for k in estimate.kept),
        )
        if u.trial == trial.label or not (u.trial or u.name.startswith(_OWN))
    }
    moving = {name: v for name, v in values.items() if not name.startswith("offset.")}
    run = simulate(moved_run(trial.run, moving, trial.start), names)
    return {name: run[name] + values.get(f"offset.{name}", 0.0) for name in names}, run.time


# --- Quality of the fit

_EXPLAINED = 0.5  # minimum fraction of the variance: as much as the residual
_BETWEEN = (
    ". Outputs were measured at uneven times and interpolated, which adds errors if they "
    "change fast from sample to sample"
)
_FEW = 0.02  # maximum fraction of residuals that may be outliers
_SEVERAL, _MET = 4, 2  # minimum number of starts for the check, and of those at the minimum
_CAPTIONS = {
    "fit": "measurement, and model with the estimates",
    "validation": "held-out measurement, and model with the estimates",
}


def _curves_of(prediction: Prediction, role: str) -> tuple[Curve, ...]:
    """Return measured and modeled curves, one for each output."""
    label = prediction.label
    suffix = f"-{_file_name(label)}" if label else ""
    place = f" in {label}" if label else ""
    return tuple(
        Curve(f"{role}-{name}{suffix}", f"{name}{place}: {_CAPTIONS[role]}.", pair, "time")
        for name, pair in prediction.pairs.items()
    )


def _compared(measured: MeasuredRun, trial: Trial, fit: Estimate) -> Prediction:
    """Compare a record with the model at the estimates, without the settling time.

    Parameters
    ----------
    measured, trial
        The record. Its own unknowns have its label, which is empty if it was fitted alone.
    fit
        The estimates; undetermined unknowns keep their start values.
    """
    modeled, _ = computed(trial, fit, measured.compared)
    return Prediction(
        trial.label,
        {
            name: beside(measured.data, name, modeled[name][measured.settled :])
            for name in measured.compared
        },
    )


def _checks_of(
    trials: Sequence[Trial], fit: Estimate, options: Options, resampled: bool = False
) -> tuple[Check, ...]:
    """Check whether the model explains the records and the values are meaningful.

    A residual of pure noise does not prove a model: if the record is only noise, so is the residual
    of any model. Outliers under a robust loss are excluded from the residual, and counted.

    Parameters
    ----------
    trials, fit
        Fitted trials, and the estimate.
    options
        Loss and limits.
    resampled
        Whether outputs were measured at uneven times.
    """
    vague = {n: why for n, why in fit.vague().items() if _of_bench(fit, n)}
    said = "; ".join(f"{label} {reason}" for label, reason in vague.items())
    undetermined = [k.unknown.label for k in fit.kept]
    far = outliers(fit.residuals)
    robust = options.loss != "linear"
    counted = ~far if robust else np.ones_like(far)
    left = math.sqrt(float(np.mean(fit.residuals[counted] ** 2)))
    return (
        Check(
            "residual_over_noise",
            left,
            limit=options.most_residual,
            note="1 if only sensor noise remains"
            + _few(fit.residuals, far, robust)
            + (_BETWEEN if resampled else ""),
            next_step=_missing(fit, robust),
        ),
        *((_outliers(far, options),) if robust else ()),
        Check(
            "variance_explained",
            explained(trials, fit, counted),
            limit=_EXPLAINED,
            at_least=True,
            note="fraction of the output variance, relative to the noise, that the model predicts",
            next_step=f"check that the signals in {option('inputs')} drove the system during the "
            "record, and that their units and signs are right ('bywire replay' plots inputs and "
            "outputs)",
        ),
        Check(
            "parameters_without_meaning",
            float(len(vague)),
            limit=0.0,
            note=said or "no value is at its bound or has a 95 % interval wider than +-100 %",
            next_step=f"remove these {option('unknowns')}, add prior knowledge "
            f"({option('priors')}), or record a motion that depends on them",
        ),
        Check(
            "not_told",
            float(len(undetermined)),
            note=", ".join(undetermined) or "the data determine every unknown",
        ),
    )


def _missing(fit: Estimate, robust: bool) -> str:
    """Return the next step for the output with the largest residual."""
    left = [each for each in fit.leftovers() if each.noise]
    if not left:
        return ""
    worst = max(left, key=lambda each: each.rms / (each.noise or 1.0))
    name = worst.label.rpartition(":")[2]
    spikes = f". If single samples are wrong, such as spikes, use {option('loss', 'huber')}"
    return (
        f"check {worst.label}, which has the largest residual. If its curves are shifted, add "
        f"{option('unknowns')} offset.{name}. If they differ at the beginning, use "
        f"{option('states')}. If another parameter explains the residual, add it with "
        f"{option('unknowns')}. If the residual only scatters, specify its noise with "
        f"{option('outputs')} '{name}=...'{'' if robust else spikes}"
    )


def _few(r: Array, far: NDArray[np.bool_], robust: bool) -> str:
    """Return a note on a few outliers, for a fit without a robust loss."""
    if robust or not 0.0 < float(far.mean()) < _FEW or robust_scale(r) > FAR:
        return ""
    advice = f"if they are outliers, use {option('loss', 'huber')}"
    return f". {far.sum()} of {far.size} residuals are far larger ({advice})"


def _outliers(far: NDArray[np.bool_], options: Options) -> Check:
    return Check(
        "outliers",
        float(far.mean()),
        limit=options.most_outliers,
        note=f"{far.sum()} of {far.size} residuals are at least {FAR:g} times the noise. A "
        "fraction above the limit indicates a model error",
        next_step="find where they occur. A cluster indicates a motion that the model lacks",
    )


def _noise_check(doubtful: Mapping[str, str], given: Mapping[str, str]) -> tuple[Check, ...]:
    """Check noise levels that were estimated from the record.

    Parameters
    ----------
    doubtful
        Outputs whose noise estimate is too large -> reason.
    given
        Noise by output, where the user specified it.
    """
    if all(given.values()):
        return ()
    note = "; ".join(doubtful.values()) or "the scatter in the record is noise"
    return (
        Check(
            "noise_not_told",
            float(len(doubtful)),
            limit=0.0,
            note=note,
            next_step="record the signal at rest, and specify its standard deviation",
        ),
    )


def starts_check(reached: int, starts: int) -> tuple[Check, ...]:
    """Check whether another start reached the lowest minimum, if there were several."""
    if starts < _SEVERAL:
        return ()
    note = "starts that reached the lowest minimum"
    if reached < _MET:
        note += (
            f". A lower minimum may exist. Use more {option('starts')}, narrower ranges "
            f"({option('unknowns')} "
            "NAME=LOW..HIGH), or fewer unknowns"
        )
    return (
        Check(
            "starts_at_minimum",
            float(reached),
            limit=_MET,
            at_least=True,
            note=note,
            next_step=f"use {option('starts')} 16, or a range for each {option('unknowns')}",
        ),
    )


def _of_bench(fit: Estimate, label: str) -> bool:
    """Return whether a label belongs to a parameter; offsets and starts may be near zero."""
    unknown = fit.unknowns[fit.names.index(label)]
    return is_parameter(unknown.name) and not unknown.name.startswith(_OWN)


def _believable(fit: Estimate) -> dict[str, float]:
    """Return the parameters by name, without those whose values are meaningless."""
    vague = fit.vague()
    return {
        u.name: float(v)
        for u, v in zip(fit.unknowns, fit.values, strict=True)
        if _of_bench(fit, u.label) and u.label not in vague
    }


def _validation_of(held: Prediction, options: Options) -> tuple[Check, ...]:
    """Return the variance accounted for in a held-out record, by signal."""
    checks = []
    for name in held.pairs:
        figures = held.figures(name)
        vaf = figures["vaf"] / 100.0
        still = "" if math.isfinite(vaf) else ", undefined because the measured signal is constant"
        checks += [
            Check(
                f"validation.{name}.vaf",
                vaf,
                limit=options.least_vaf,
                at_least=True,
                note=f"variance accounted for in the held-out record{still}",
                next_step="fit a record with similar motions, or estimate fewer unknowns",
            ),
            Check(
                f"validation.{name}.nrmse",
                figures["nrmse"] / 100.0,
                note="root mean square error of the held-out record, relative to the range",
            ),
        ]
    return tuple(checks)


def _figures_of(
    records: Sequence[Prediction], trials: Sequence[Trial]
) -> dict[str, tuple[float, str]]:
    """Return noise, variance accounted for and error of every output in every record."""
    values: dict[str, tuple[float, str]] = {}
    for compared_run, trial in zip(records, trials, strict=True):
        for name, pair in compared_run.pairs.items():
            key = f"{compared_run.label}:{name}" if compared_run.label else name
            figures = compared_run.figures(name)
            unit = str(pair["measured"].attrs.get("units", "1"))
            values |= {
                f"{key}.noise": (trial.noise[name], unit),
                f"{key}.vaf": (figures["vaf"], "%"),
                f"{key}.nrmse": (figures["nrmse"], "%"),
            }
    return values


def _file_name(label: str) -> str:
    return re.sub(r"[^\w.-]+", "_", label)


# --- The fit
# Where the bench closes a loop, the measured set point drives model and controller together:
# closed-loop output error. The run begins at the experiment's start for the current parameters, so
# an equilibrium remains one while the search changes the parameters that define it.

_FINEST = 1.0 / 65536.0  # of a signal's range: resolution of a 16-bit converter
_FEWEST = 10  # samples
_LEFT = 0.5  # of the noise: with a smaller residual, the assumed noise is too large


def noise_given(name: str, text: str, unit: str) -> float:
    """Return the standard deviation of an output's noise, written with its unit.

    Raises
    ------
    UnitError, ParameterError
        When it is not a quantity of that unit, or not > 0.
    """
    noise = number(text, unit, f"noise of {name}")
    if not noise > 0.0:
        raise not_valid(f"noise of {name}", text, f"> 0 {unit}")
    return noise


def _output_noise(measured: MeasuredRun, name: str, text: str) -> float:
    """Return the standard deviation of an output's noise, specified or estimated from the record.

    Parameters
    ----------
    measured
        The record.
    name
        Output.
    text
        Its noise; empty to estimate it from the record.

    Raises
    ------
    ParameterError
        When the record is too short or at rest, so that it does not determine the noise.
    """
    if text:
        return noise_given(name, text, signals_of(measured.case.model.Output)[name].unit)
    there = _finite(measured.data[name])
    if there.size < _FEWEST:
        raise ParameterError(
            f"{name} has {counted(there.size, 'sample')}, but the noise estimate needs at least "
            f"{_FEWEST}",
            name=name,
            value=str(there.size),
            valid=str(_FEWEST),
        )
    span = float(np.ptp(there))
    if not span > 0.0:
        raise ParameterError(
            f"{name} does not change, so it determines nothing. Remove it, or excite the system",
            name=name,
        )
    # Interpolation averages neighboring samples, so the noise is smaller and no longer white.
    before = measured.data[name].attrs.get(NOISE_OF_SAMPLES)
    return max(noise_of(there) if before is None else float(before), _FINEST * span)


def _resampled(measured: MeasuredRun) -> bool:
    """Return whether a record's outputs are interpolated between measured samples."""
    return any(NOISE_OF_SAMPLES in measured.data[name].attrs for name in measured.compared)


def _overestimated(
    records: Sequence[MeasuredRun],
    trials: Sequence[Trial],
    residuals: Array,
    given: Mapping[str, str],
) -> dict[str, str]:
    """Return the outputs whose record does not determine their noise, with the reason.

    If the noise is too large, any model passes.

    Parameters
    ----------
    records, trials
        Records, in the order of the residuals.
    residuals
        Residuals divided by the noise.
    given
        Noise by output, where the user specified it.
    """
    runs = {trial.label: measured for measured, trial in zip(records, trials, strict=True)}
    doubtful = {}
    for trial, name, r in by_output(trials, residuals):
        values = _finite(runs[trial.label].data[name])
        if given[name] or trial.noise[name] <= 1.01 * _FINEST * float(np.ptp(values)):
            continue
        left = robust_scale(r)
        even = NOISE_OF_SAMPLES not in runs[trial.label].data[name].attrs
        if even and not determines_its_noise(values):
            why = "changes from sample to sample"
        elif left < _LEFT:
            why = f"has a residual of only {left:.2g} times the estimated noise"
        else:
            continue
        unit = difference_unit(signals_of(runs[trial.label].case.model.Output)[name].unit)
        size = shown(float(f"{trial.noise[name]:.3g}"), unit)
        key = f"{trial.label}:{name}" if trial.label else name
        doubtful[key] = (
            f"{key} {why}, so the noise estimate of {size} is too large. Specify the noise with "
            f'{option("outputs")} "{name}=NOISE {display_unit(unit)}"'
        )
    return doubtful


def _finite(signal: xr.DataArray) -> Array:
    values = np.asarray(signal.values, dtype=float)
    return np.asarray(values[np.isfinite(values)])


# --- The fit

_ROUNDED, _EXACT = "quantized", "ideal"  # laws of a sensor or a converter
_ROUGH = 1e-4  # of the cost: accurate enough for a start
_AT_REST = 5.0  # times the noise: a smaller start cannot be estimated


@dataclass(frozen=True)
class BenchFit:
    """The fit of a bench.

    Parameters
    ----------
    bench
        Bench of the measurement, with the known values.
    question
        Measured signals and unknowns.
    """

    bench: Bench
    question: Question

    def identify(
        self, data: xr.Dataset, par: ParameterSet, options: Options, effort: Effort
    ) -> Identified:
        """Estimate the unknowns from one or several records.

        Parameters
        ----------
        data
            Inputs and outputs over ``time`` [s], SI.
        par
            The bench's parameters, with the values at which the search begins.

        Raises
        ------
        InputError
            When a record does not fit the bench, or determines none of the unknowns.
        """
        bench = self.moved(par)
        records = {
            label: self.record(bench, signals, options)
            for label, signals in split(data, True).items()
        }
        trials = [self.trial(record, label) for label, record in records.items()]
        unknowns = list(unknowns_of(case_of(bench, self.question.case), bench.par, self.question))
        for record, trial in zip(records.values(), trials, strict=True):
            unknowns += self.starts(record, trial)
        problem = replace(
            output_error(trials, unknowns),
            silent=switched_off(bench.par, unknowns, _exact_laws(type(bench.par))),
        )
        starts = starts_of(
            unknowns, self.question.ranges, effort.starts, effort.spread, effort.seed
        )
        led = search(
            problem,
            starts,
            options.loss,
            effort.progress,
            effort.store,
            effort.threads,
            # A redescending loss also has distant minima, where the model misses the whole record.
            partial(_nearer, problem) if options.loss == "cauchy" else None,
        )
        fit = estimate(problem, options.loss, led.best.values)
        reached = _reached(led, fit)
        shown = [
            _compared(record, trial, fit)
            for record, trial in zip(records.values(), trials, strict=True)
        ]
        held = self._held_out(bench, fit, options)
        uneven = any(_resampled(record) for record in records.values())
        checks = _checks_of(trials, fit, options, uneven)
        doubtful = (
            {}
            if fit.is_exact
            else _overestimated(list(records.values()), trials, fit.residuals, self.question.noise)
        )
        return Identified(
            estimates={"output error": fit},
            parameters=_believable(fit),
            figures=_figures_of(shown, trials),
            checks=(
                *checks,
                *_noise_check(doubtful, self.question.noise),
                *starts_check(reached, effort.starts),
                *(() if held is None else _validation_of(held, options)),
            ),
            curves=(
                *(curve for record in shown for curve in _curves_of(record, "fit")),
                *(() if held is None else _curves_of(held, "validation")),
            ),
            notes=(
                *_said(records, options, coarse=not checks[0].holds),
                *_smoothed(bench),
                f"{reached} of {effort.starts} starts reached the minimum",
            ),
        )

    def moved(self, par: ParameterSet) -> Bench:
        """Return the bench with other values of the unknowns."""
        leaves, known = par.leaves(), self.bench.par.leaves()
        return self.bench.with_overrides(
            {
                n: leaves[n]
                for n in filter(is_parameter, self.question.ranges)
                if leaves.get(n) != known.get(n)
            }
        )

    def record(self, bench: Bench, data: xr.Dataset, options: Options) -> MeasuredRun:
        """Return a record with its run."""
        return measured_run(
            bench,
            data,
            self.question.inputs or None,
            list(self.question.noise),
            self.question.case,
            settle=not self.question.states,
            between=options.between,
        )

    def trial(self, measured: MeasuredRun, label: str) -> Trial:
        """Return the trial of a record, which excludes the settling time."""
        before = np.full(measured.settled, np.nan)
        smooth = _exact_laws(type(measured.case.par))
        values = {name: measured.data[name].values for name in measured.compared}
        return Trial(
            replace(measured.run, par=measured.run.par.replace(smooth)),
            {name: np.concatenate((before, row)) for name, row in values.items()},
            {name: _output_noise(measured, name, self.question.noise[name]) for name in values},
            label,
            start=None
            if measured.bench.definition.preview
            else partial(_begun, measured.bench, measured.case),
        )

    def starts(self, measured: MeasuredRun, trial: Trial) -> tuple[Unknown, ...]:
        """Return a record's own unknowns: initial states, and a start from a noisy sample."""
        fields = leaf_fields(measured.bench.definition.options)
        unknowns = []
        for name, signal in measured.begun_at.items():
            value = float(measured.bench.options[name])
            if trial.start is not None and value > _AT_REST * trial.noise[signal]:
                unit = fields[name].unit.symbol
                unknowns.append(
                    Unknown(f"start.{name}", value, 0.0, scale=value, unit=unit, trial=trial.label)
                )
        return (*unknowns, *initial_states(trial, self.question.states))

    def _held_out(self, bench: Bench, fit: Estimate, options: Options) -> Prediction | None:
        data = self.question.holdout
        if data is None:
            return None
        if not isinstance(data, xr.Dataset):
            raise ParameterError(
                f"holdout = {data} is a path. Read it first with bywire.read_measurement",
                name="holdout",
                value=str(data),
            )
        held = self.record(bench, data, options)
        # No record has this label, so only the shared unknowns apply.
        return _compared(held, self.trial(held, "held out"), fit)


def _nearer(problem: Problem, start: Array) -> Array:
    """Return the result of a search with losses that have no distant minima."""
    return solve(problem, solve(problem, start, share=_ROUGH).values, "huber", share=_ROUGH).values


def _reached(led: Search, fit: Estimate) -> int:
    """Return the number of starts within 1 % of the lowest minimum, or of the noise's cost."""
    size = 0.5 * fit.residuals.size
    lowest = led.best.cost
    return sum(solution.cost <= lowest + 0.01 * max(lowest, size) for solution in led.solutions)


def _begun(bench: Bench, case: Any, values: Mapping[str, float]) -> tuple[Any, Any]:
    """Return the start of the experiment with other parameters and start options."""
    options = {n.removeprefix("start."): v for n, v in values.items() if n.startswith("start.")}
    parameters = {n: v for n, v in values.items() if not n.startswith("start.")}
    par, chosen = bench.par.replace(parameters), bench.chosen_options.replace(options)
    cases = bench.cases_with(par, chosen)
    (begun,) = (k for k in cases if k.label == case.label)
    return begun.state, begun.memory


def _exact_laws(cls: type[ParameterSet]) -> dict[str, str]:
    """Return the laws of a parameter class without rounding, by dotted name.

    Rounding has no derivative, so closed loops would look open. A rounding element has a law
    ``"quantized"`` and a law ``"ideal"``.
    """
    return {
        name: _EXACT
        for name in choice_fields(cls)
        if {_ROUNDED, _EXACT} <= set(choices_of(cls, name))
    }


def _smoothed(bench: Bench) -> tuple[str, ...]:
    known, exact = bench.par.choices(), _exact_laws(type(bench.par))
    changed = [name for name, law in exact.items() if known.get(name, law) != law]
    return tuple(
        f"{name} = {exact[name]} in the fit, because rounding has no derivative" for name in changed
    )


def _said(records: Mapping[str, MeasuredRun], options: Options, coarse: bool) -> list[str]:
    """Return notes on the records and, if requested, on coarse inputs."""
    said = [
        f"{label}: {note}" if label else note
        for label, record in records.items()
        for note in record.notes
    ]
    measured = next(iter(records.values()))
    said.append("driven by " + ", ".join(f"{name} = {v}" for name, v in measured.driven.items()))
    case, interval = measured.case, measured.run.record
    period = min(task.period for task in case.model.tasks(case.par))
    if coarse and options.between == "held" and period < 0.5 * interval:
        said.append(
            f"inputs stay constant for {1e3 * interval:.4g} ms between samples, but the model uses "
            f"them every {1e3 * period:.4g} ms. If they are smooth, use "
            f"{option('options', {'between': 'linear'})}"
        )
    return said
