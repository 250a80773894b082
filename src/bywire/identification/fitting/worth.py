"""What a fit of a bench is worth: checks, figures and curves, held-out record included."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.core.callers import option
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.identification.estimate import Estimate
from bywire.identification.fitting.question import Options, is_parameter
from bywire.identification.method import Check, Curve
from bywire.identification.noise import FAR, outliers, robust_scale
from bywire.identification.output_error import Trial, moved_run
from bywire.identification.replaying.bench_replay import MeasuredRun, beside
from bywire.identification.replaying.fit import fit_figures
from bywire.identification.replaying.segments import Segment
from bywire.identification.residuals import explained
from bywire.simulation.run import simulate

_OWN = ("initial.", "start.")  # what each record has for itself


@dataclass(frozen=True)
class Prediction:
    """A record beside the model with the estimates.

    Parameters
    ----------
    label
        Of the record; empty where there is one alone.
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
    """Return a record beside the model with the estimates, without fitting anything.

    Parameters
    ----------
    trial
        A record and its model. Unknowns of a record's own, such as where it begins, are taken
        from the estimate only where they carry this trial's label.
    estimate
        Of this or of other records; what the data does not tell stays where it was.

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
    """Return outputs of a trial's run with the estimates, offsets added, and its instants [s]."""
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


# --- What the fit is worth

_EXPLAINED = 0.5  # of the variance: what is explained outweighs what is left
_BETWEEN = (
    "; outputs were measured at uneven instants and interpolated: where they move fast from sample "
    "to sample, that leaves errors of its own"
)
_FEW = 0.02  # of the residuals: as many as may be outliers
_SEVERAL, _MET = 4, 2  # starts: so many are to tell whether one alone found a minimum
_CAPTIONS = {
    "fit": "measured and modeled with the estimates",
    "validation": "a record that was not fitted: measured, and modeled with the estimates",
}


def curves_of(prediction: Prediction, role: str) -> tuple[Curve, ...]:
    """Return measured beside modeled, a curve for each output."""
    label = prediction.label
    suffix = f"-{_file_name(label)}" if label else ""
    said = f" in {label}" if label else ""
    return tuple(
        Curve(f"{role}-{name}{suffix}", f"{name}{said}, {_CAPTIONS[role]}.", pair, "time")
        for name, pair in prediction.pairs.items()
    )


def compared(measured: MeasuredRun, trial: Trial, fit: Estimate) -> Prediction:
    """Return a record beside the model with the estimates; settling is left out.

    Parameters
    ----------
    measured, trial
        The record; unknowns of its own carry its label, which is empty where it was fitted alone.
    fit
        The estimates; what the data does not tell stays where it was.
    """
    modeled, _ = computed(trial, fit, measured.compared)
    return Prediction(
        trial.label,
        {
            name: beside(measured.data, name, modeled[name][measured.settled :])
            for name in measured.compared
        },
    )


def checks_of(
    trials: Sequence[Trial], fit: Estimate, options: Options, resampled: bool = False
) -> tuple[Check, ...]:
    """Return whether the model explains the records, and whether the values mean something.

    Noise alone is no proof of a model: where a record is nothing but noise, noise is what any
    model leaves. What a robust loss sets aside is left out of the residual, and counted.

    Parameters
    ----------
    trials, fit
        What was fitted, and how.
    options
        Loss and limits.
    resampled
        Whether outputs were measured at uneven instants.
    """
    vague = {n: why for n, why in fit.vague().items() if _of_bench(fit, n)}
    said = "; ".join(f"{label} {reason}" for label, reason in vague.items())
    untold = [k.unknown.label for k in fit.kept]
    far = outliers(fit.residuals)
    robust = options.loss != "linear"
    counted = ~far if robust else np.ones_like(far)
    left = math.sqrt(float(np.mean(fit.residuals[counted] ** 2)))
    return (
        Check(
            "residual_over_noise",
            left,
            limit=options.most_residual,
            note="1 where nothing but the sensors' noise is left"
            + _few(fit.residuals, far, robust)
            + (_BETWEEN if resampled else ""),
            next_step=_missing(fit),
        ),
        *((_outliers(far, options),) if robust else ()),
        Check(
            "variance_explained",
            explained(trials, fit, counted),
            limit=_EXPLAINED,
            at_least=True,
            note="share of the outputs' variance, over their noise, that the model predicts",
            next_step=f"check that {option('inputs')} is what drove the record, its unit and its "
            "sign; 'bywire replay' draws both",
        ),
        Check(
            "parameters_without_meaning",
            float(len(vague)),
            limit=0.0,
            note=said or "none at its bound, none with a 95 % interval wider than +-100 %",
            next_step=f"leave these {option('unknowns')} out, give a {option('priors')}, or record "
            "a motion that they change",
        ),
        Check(
            "not_told",
            float(len(untold)),
            note=", ".join(untold) or "the data tells all that was asked for",
        ),
    )


def _missing(fit: Estimate) -> str:
    """Return what to try at the output of which most is left."""
    left = [each for each in fit.leftovers() if each.noise]
    if not left:
        return ""
    worst = max(left, key=lambda each: each.rms / (each.noise or 1.0))
    name = worst.label.rpartition(":")[2]
    return (
        f"look at {worst.label}, of which most is left: if its curves are shifted, add "
        f"{option('unknowns')} offset.{name}; if they part at the beginning, "
        f"{option('states')}; if another parameter shapes what is left, make it an "
        f"{option('unknowns')}; if it only scatters, give its noise with "
        f"{option('outputs')} '{name}=...'"
    )


def _few(r: Array, far: NDArray[np.bool_], robust: bool) -> str:
    """Return what stands behind residuals without a robust loss: perhaps a few outliers."""
    if robust or not 0.0 < float(far.mean()) < _FEW or robust_scale(r) > FAR:
        return ""
    advice = f"if they are outliers, take {option('loss', 'huber')}"
    return f"; {far.sum()} of {far.size} stand out: {advice}"


def _outliers(far: NDArray[np.bool_], options: Options) -> Check:
    return Check(
        "outliers",
        float(far.mean()),
        limit=options.most_outliers,
        note=f"{far.sum()} of {far.size} residuals stand out by {FAR:g} times the noise or more: "
        "beyond the limit they are the model's",
        next_step="look where they stand: a stretch of them is a motion that the model lacks",
    )


def noise_check(doubtful: Mapping[str, str], given: Mapping[str, str]) -> tuple[Check, ...]:
    """Return whether each output's noise is one, where the record itself had to tell it.

    Parameters
    ----------
    doubtful
        Outputs whose noise comes out too large -> why.
    given
        Noise by output, where it was given.
    """
    if all(given.values()):
        return ()
    note = "; ".join(doubtful.values()) or "what scatters in the record is noise"
    return (
        Check(
            "noise_not_told",
            float(len(doubtful)),
            limit=0.0,
            note=note,
            next_step="record it at rest, and give its standard deviation",
        ),
    )


def starts_check(reached: int, starts: int) -> tuple[Check, ...]:
    """Return whether another start met the lowest minimum too, where several were made."""
    if starts < _SEVERAL:
        return ()
    note = "starts that met the lowest minimum"
    if reached < _MET:
        note += (
            f": there may be a lower one; take more {option('starts')}, narrower ranges "
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
            next_step=f"take {option('starts')} 16, or a range for each {option('unknowns')}",
        ),
    )


def _of_bench(fit: Estimate, label: str) -> bool:
    """Return whether a label is that of a parameter; offsets and starts may be near zero."""
    unknown = fit.unknowns[fit.names.index(label)]
    return is_parameter(unknown.name) and not unknown.name.startswith(_OWN)


def believable(fit: Estimate) -> dict[str, float]:
    """Return the parameters by name, less those whose values mean nothing."""
    vague = fit.vague()
    return {
        u.name: float(v)
        for u, v in zip(fit.unknowns, fit.values, strict=True)
        if _of_bench(fit, u.label) and u.label not in vague
    }


def validation_of(held: Prediction, options: Options) -> tuple[Check, ...]:
    """Return how much of a held-out record is accounted for, signal by signal."""
    checks = []
    for name in held.pairs:
        figures = held.figures(name)
        vaf = figures["vaf"] / 100.0
        still = "" if math.isfinite(vaf) else "; the measured signal does not move"
        checks += [
            Check(
                f"validation.{name}.vaf",
                vaf,
                limit=options.least_vaf,
                at_least=True,
                note=f"variance accounted for in the record that was not fitted{still}",
                next_step="fit a record that covers what the held-out one does, or fewer unknowns",
            ),
            Check(
                f"validation.{name}.nrmse",
                figures["nrmse"] / 100.0,
                note="root mean square of the error there, over the range",
            ),
        ]
    return tuple(checks)


def figures_of(
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
