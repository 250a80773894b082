"""What records of a current loop share: steps between levels, their noise, checks and curves."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import xarray as xr

from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.core.typing import Array
from bywire.data.labeled import over
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import estimate
from bywire.identification.measured import require_signals, wrong_sign
from bywire.identification.method import Check, Curve, Identified
from bywire.identification.output_error import Trial, moved_run, output_error
from bywire.identification.residuals import explained
from bywire.identification.unknown import parameters_of
from bywire.simulation.run import simulate

_AGAINST = -0.5  # correlation of demand and current: beyond chance
_EXPLAINED = 0.5  # of the variance: what is explained outweighs what is left
_MISFIT = 1.3  # a closed loop's own noise is 1.04 of the sensor's, which is known within 10 %


def levels(
    low: float, high: float, duration: float, dwell: float, interval: float, seed: int
) -> Callable[[Array], Array]:
    """Return a signal that steps between random levels, drawn from a seed.

    Parameters
    ----------
    low, high
        Ends of the range.
    duration, dwell, interval
        Length, time from step to step, sample time [s].
    """
    every = max(round(dwell / interval), 1)
    count = int(np.ceil(duration / (every * interval))) + 1
    values = np.random.default_rng(seed).uniform(low, high, count)
    values[0] = 0.5 * (low + high)

    def at(t: Array) -> Array:
        index = np.floor(np.round(t / interval, 6) / every).astype(int)
        return np.asarray(values[np.clip(index, 0, count - 1)])

    return at


def noise_of_levels(answer: Array, demand: Array) -> float:
    """Return the noise of an answer [its unit], from differences while the demand rests.

    Parameters
    ----------
    answer, demand
        Shape (n,).
    """
    still = np.convolve(np.diff(demand) == 0.0, np.ones(3), mode="valid") == 3
    second = np.diff(answer, 3)[: still.size]
    chosen = second[still] if still.sum() > 10 else second
    # Third differences of white noise have 20 times its variance.
    return max(float(np.median(np.abs(chosen))) / (0.6745 * math.sqrt(20.0)), 1e-9)


def require_steps(data: xr.Dataset, name: str, answer: str, label: str) -> None:
    """Refuse a record whose demand does not move, or whose current goes against it.

    A winding takes up power at every frequency, and a current loop follows: voltage or demand and
    current cannot be of opposite sign on the average.

    Parameters
    ----------
    data
        Signals over ``time`` [s].
    name, answer
        What the demand and the current are called.
    label
        Of the record.

    Raises
    ------
    UnknownNameError
        When the demand is missing.
    ParameterError
        When it does not step, or the current has the wrong sign.
    """
    require_signals(data, [name])
    demand, current = data[name].values, data[answer].values
    if not float(np.ptp(demand)) > 0.0:
        raise ParameterError(
            f"{name} of record {label or '1'} does not move: an answer at rest tells neither "
            "winding nor gains; step it between several levels, the rotor locked"
        )
    together = float(np.corrcoef(demand, current)[0, 1]) if np.ptp(current) > 0.0 else 0.0
    if together < _AGAINST:
        raise wrong_sign(f"{answer} of record {label or '1'}", name, f"correlation {together:.2f}")


def identified_loop(trials: Sequence[Trial], par: ParameterSet, names: Sequence[str]) -> Identified:
    """Return a closed loop's parameters from its runs.

    Parameters
    ----------
    trials
        Records beside the loop's model.
    par
        Where the search begins.
    names
        Unknown parameters.

    Raises
    ------
    ParameterError
        When nothing can be estimated.
    """
    fit = estimate(output_error(trials, parameters_of(par, names)))
    return Identified(
        estimates={"current loop": fit},
        parameters=believable(fit),
        checks=checks_of(trials, fit),
        curves=tuple(as_curve(t, fit) for t in trials),
    )


def believable(fit: Estimate) -> dict[str, float]:
    """Return the parameters by name, less those whose values mean nothing."""
    vague = fit.vague()
    return {name: value for name, value in fit.parameters().items() if name not in vague}


def checks_of(trials: Sequence[Trial], fit: Estimate) -> tuple[Check, ...]:
    """Return whether the model explains the current, and whether the values mean something.

    Noise alone is no proof of a model: where the record is nothing but noise, noise is what any
    model leaves, one with an answer of zero as well.
    """
    vague = fit.vague()
    said = "; ".join(f"{label} {reason}" for label, reason in vague.items())
    return (
        Check(
            "variance_explained",
            explained(trials, fit),
            limit=_EXPLAINED,
            at_least=True,
            note="share of the current's variance that the model predicts: do demand and "
            "current belong together?",
        ),
        Check(
            "residual_over_noise",
            fit.rms,
            limit=_MISFIT,
            note="1 where nothing but the sensor's noise is left",
        ),
        Check(
            "parameters_without_meaning",
            float(len(vague)),
            limit=0.0,
            note=said or "none at its bound, none with a 95 % interval wider than +-100 %",
        ),
    )


def as_curve(trial: Trial, fit: Estimate) -> Curve:
    """Return the measured current of a trial beside the modeled one."""
    signal = next(iter(trial.measured))
    shared = {
        u.name: float(v)
        for u, v in zip(fit.unknowns, fit.values, strict=True)
        if u.trial in ("", trial.label)
    }
    computed = simulate(moved_run(trial.run, shared), (signal,))
    modeled = np.where(trial.rows(signal), computed[signal], np.nan)
    columns = {"measured": trial.measured[signal], "modeled": modeled}
    data = over(("time", computed.time, "s", "time"), columns, "A", "current")
    name = f"current-{trial.label}" if trial.label else "current"
    return Curve(name, "Current: measured, and modeled where it counts.", data, "time")


class LoopOptions(ParameterSet):
    """What is unknown, and the steps of the synthetic experiment."""

    unknowns: Literal["gains", "all"]
    """gains alone, the winding being known; or the winding with them"""
    lead: Duration
    """beginning of a record that does not count: where the loop was before is not known"""
    dwell: Duration
    """synthetic: time from one step to the next"""
    duration: Duration
    """synthetic: length of the record"""

    def names(self, gains: tuple[str, ...], winding: tuple[str, ...]) -> tuple[str, ...]:
        """Return what is estimated, given the names of all."""
        return gains if self.unknowns == "gains" else (*gains, *winding)


def without_lead(trial: Trial, data: xr.Dataset, lead: float) -> Trial:
    """Return a trial of which the first seconds of its record do not count.

    Parameters
    ----------
    trial
        Of a whole record.
    data
        That record, over ``time`` [s].
    lead
        How long that is [s].
    """
    t = data["time"].values
    return replace(trial, used=t - t[0] >= lead)
