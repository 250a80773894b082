"""Simulation of fault-free and faulty runs, and comparison of their effects and times."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np

from bywire.bench.experiment import Case, FaultyCase, as_run
from bywire.bench.faults.fault_section import Injection
from bywire.bench.faults.injected import injected
from bywire.bench.recording import solver_doubts
from bywire.campaigns.plan import CampaignPlan, Failing, touch_alike
from bywire.campaigns.residual import NEVER, detected, threshold
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.simulation.ensemble import fit_lanes, simulate_group
from bywire.simulation.run import Run, Trajectory, simulate
from bywire.simulation.tapped import rests

LANES = 64
"""maximum number of runs in one batch, to limit the size of their recordings"""
_MOST = 250e6  # maximum number of values in memory: 2 GB


@dataclass(frozen=True)
class Traces:
    """Signals of several runs.

    Parameters
    ----------
    time
        Times of the rows [s], shape (rows,).
    signals
        Signals by name, shape (cases, rows) each.
    doubts
        Warnings from the solver, without repetitions.
    """

    time: Array
    signals: dict[str, Array]
    doubts: tuple[str, ...] = ()

    def of(self, cases: Sequence[int]) -> Traces:
        """Return the signals of some of the runs."""
        return Traces(self.time, {name: rows[cases] for name, rows in self.signals.items()})


def require_small(plan: CampaignPlan) -> None:
    """Reject a campaign whose recordings do not fit into memory.

    Raises
    ------
    ParameterError
        If they do not fit, with their size.
    """
    case = plan.case(0)
    rows = (case.keep + case.duration) / case.record
    signals = len(plan.signals) + len(plan.taps[1])
    runs = max(plan.healthy, len(plan.onsets))
    if runs * rows * signals > _MOST:
        raise ParameterError(
            f"{runs} runs with {rows:.3g} rows of {signals} signals exceed the limit of "
            f"{_MOST:.3g} numbers. Use fewer fault-free runs (healthy) or onsets, a shorter "
            "maneuver, "
            "or a longer simulation.record",
            name="simulation.record",
            valid=f"{_MOST:.3g}",
        )


def healthy_traces(plan: CampaignPlan) -> Traces:
    """Return the signals of all fault-free runs."""
    cases = [_case(plan, sample, (), False) for sample in range(plan.healthy)]
    return _traces(plan, cases, list(range(plan.healthy)))


def faulty_traces(
    plan: CampaignPlan,
    failing: Failing,
    onsets: Sequence[float],
    samples: Sequence[int],
    reactions: Sequence[float] | None = None,
) -> Traces:
    """Return the signals of runs with a fault.

    Parameters
    ----------
    failing
        Injected fault.
    onsets
        Onset in each run [s].
    samples
        Healthy runs that provide scatter and noise.
    reactions
        Time of the campaign's reaction in each run [s], or None for no reaction.
    """
    cases = []
    for k, (onset, sample) in enumerate(zip(onsets, samples, strict=True)):
        faults = failing.at(onset, plan.seed + sample)
        is_apart = plan.is_apart(failing)
        if reactions is not None and plan.reaction is not None:
            faults += plan.reaction.failing.at(reactions[k], 0)
            is_apart |= plan.is_apart(plan.reaction.failing)
        cases.append(_case(plan, sample, faults, is_apart))
    return _traces(plan, cases, list(samples))


def _case(plan: CampaignPlan, sample: int, faults: Sequence[Injection], is_apart: bool) -> Case:
    """Return a sample's run with faults, with the common model or a separate model."""
    taps, tasks = ((), ()) if is_apart else plan.taps
    return injected(plan.case(sample), faults, taps, tasks)


def _traces(plan: CampaignPlan, cases: Sequence[Case], samples: Sequence[int]) -> Traces:
    bench = plan.bench
    runs = [
        as_run(case, bench.step, bench.record, (bench.seed + sample, 0))
        for case, sample in zip(cases, samples, strict=True)
    ]
    computed: list[Trajectory] = []
    for first in range(0, len(runs), LANES):
        computed += _computed(runs[first : first + LANES], plan.signals, bench.engine)
    case = cases[0].aligned(bench.step, bench.record)
    time = computed[0].time - case.settle
    begin = int(np.searchsorted(time, -case.keep - 1e-9))
    signals = {name: np.array([each[name][begin:] for each in computed]) for name in plan.signals}
    time = np.round(time[begin:], 12)
    for task in plan.taps[1]:
        signals[f"missed_{task}"] = np.array([_missed(each, task, time) for each in cases])
    doubts = (text for each in computed for text in solver_doubts(each.doubt, each.unsettled))
    return Traces(time, signals, tuple(dict.fromkeys(doubts)))


def _computed(runs: Sequence[Run], signals: Sequence[str], engine: str) -> Sequence[Trajectory]:
    if len(runs) > 1 and fit_lanes(runs, engine):
        return simulate_group(runs, signals, engine=engine)
    return [simulate(run, signals, engine=engine) for run in runs]


def _missed(case: Case, task: str, time: Array) -> Array:
    """Return the rows in which a task misses its ticks, which a watchdog detects."""
    given = case.corrupted(time) if isinstance(case, FaultyCase) else {}
    return np.minimum(given.get(rests(task), np.zeros(time.size)), 1.0)


# --- Judging

FACTORS = (0.5, 0.7, 1.0, 1.4, 2.0, 3.0, 5.0)
"""multiples of each threshold, for curves of delay versus false alarms"""

Outcome = dict[str, Any]


@dataclass(frozen=True)
class Healthy:
    """Results of fault-free runs: signals, thresholds and false alarms.

    Parameters
    ----------
    traces
        Signals of all fault-free runs.
    thresholds
        Threshold of every residual, tuned on the first half.
    alarms
        Number of runs in the other half in which each residual exceeds its threshold times
        `FACTORS`, by name, shape (factors,).
    any_alarm
        Number of runs in which any residual exceeds its threshold, shape (factors,).
    """

    traces: Traces
    thresholds: Mapping[str, float]
    alarms: Mapping[str, list[int]]
    any_alarm: int


def judge_healthy(plan: CampaignPlan, traces: Traces) -> Healthy:
    """Tune thresholds on one half of the fault-free runs, and count false alarms in the other."""
    thresholds: dict[str, float] = {}
    alarms: dict[str, list[int]] = {}
    alarmed = np.zeros(plan.healthy - plan.tuning, dtype=bool)
    start = np.full(alarmed.size, traces.time[0])
    for residual in plan.watched:
        lasted = residual.lasted(traces.signals, plan.bench.par, traces.time)
        limit = threshold(lasted[: plan.tuning].max(axis=1), plan.false_alarms)
        thresholds[residual.name] = limit
        judged = lasted[plan.tuning :]
        each = [
            ~np.isnan(detected(judged, _scaled(limit, factor), traces.time, start))
            for factor in FACTORS
        ]
        alarms[residual.name] = [int(alarm.sum()) for alarm in each]
        alarmed |= each[FACTORS.index(1.0)]
    return Healthy(traces, thresholds, alarms, int(alarmed.sum()))


def _scaled(limit: float, factor: float) -> float:
    """Return a threshold of either sign that is less sensitive by a factor."""
    if limit <= NEVER:  # no threshold to scale
        return limit
    return limit * factor if limit >= 0 else limit / factor


def judge_fault(plan: CampaignPlan, failing: Failing, healthy: Healthy) -> Outcome:
    """Return the outcomes of all runs with a fault, as plain numbers."""
    onsets = np.array(plan.onsets_of(failing))
    # The name selects the runs, so that other faults in the catalog do not change the scatter.
    first = crc32(failing.name.encode())
    samples = [plan.sample_of(first + k) for k in range(onsets.size)]
    traces = faulty_traces(plan, failing, onsets.tolist(), samples)
    beside = healthy.traces.of(samples)
    seen = _detections(plan, traces, onsets, healthy.thresholds)
    earliest = _earliest([column[FACTORS.index(1.0)] for column in seen.values()], onsets.size)
    outcome: Outcome = {
        "reached": _reached(plan, traces, beside, onsets),
        "extremes": _extremes(plan, traces, beside, onsets),
        "detected": {name: _plain(np.array(column)) for name, column in seen.items()},
        "doubts": list(traces.doubts),
    }
    if plan.reaction is not None:
        outcome["reacted"] = _with_reaction(plan, failing, samples, earliest, beside)
    return outcome


def _reached(
    plan: CampaignPlan, traces: Traces, beside: Traces, onsets: Array
) -> dict[str, list[Any]]:
    """Return the time from a fault's onset to the violation of each criterion [s]."""
    return {
        c.name: _plain(
            c.reached(traces.signals[c.signal], beside.signals[c.signal], traces.time, onsets)
            - onsets
        )
        for c in plan.criteria
    }


def _extremes(
    plan: CampaignPlan, traces: Traces, beside: Traces, onsets: Array
) -> dict[str, list[Any]]:
    """Return each judged signal's deviation from its fault-free run: extremes and end value."""
    later = traces.time >= onsets[:, None] - 1e-9
    extremes = {}
    for name in dict.fromkeys(c.signal for c in plan.criteria):
        off = np.where(later, traces.signals[name] - beside.signals[name], 0.0)
        tail = max(off.shape[1] // 20, 1)
        extremes[name] = [
            _plain(off.min(axis=1)),
            _plain(off.max(axis=1)),
            _plain(off[:, -tail:].mean(axis=1)),
        ]
    return extremes


def _detections(
    plan: CampaignPlan, traces: Traces, onsets: Array, thresholds: Mapping[str, float]
) -> dict[str, list[Array]]:
    """Return the time from a fault's onset to its detection [s], by residual and factor."""
    seen = {}
    for residual in plan.watched:
        lasted = residual.lasted(traces.signals, plan.bench.par, traces.time)
        limit = thresholds[residual.name]
        seen[residual.name] = [
            detected(lasted, _scaled(limit, factor), traces.time, onsets) - onsets
            for factor in FACTORS
        ]
    return seen


def _with_reaction(
    plan: CampaignPlan, failing: Failing, samples: Sequence[int], earliest: Array, beside: Traces
) -> dict[str, Any]:
    """Return the outcomes with the reaction, for the runs in which the fault is detected."""
    assert plan.reaction is not None
    onsets = np.array(plan.onsets_of(failing))
    cases = np.flatnonzero(~np.isnan(earliest)).tolist()
    if not cases or _is_the_same(plan, failing):
        return {}
    begun = (onsets + earliest + plan.reaction.delay)[cases]
    traces = faulty_traces(
        plan, failing, onsets[cases].tolist(), [samples[k] for k in cases], begun.tolist()
    )
    return {
        "cases": cases,
        "reached": _reached(plan, traces, beside.of(cases), onsets[cases]),
    }


def _is_the_same(plan: CampaignPlan, failing: Failing) -> bool:
    """Return whether fault and reaction change the same value, which prevents the reaction."""
    assert plan.reaction is not None
    par = plan.case(0).par
    return touch_alike(failing, plan.reaction.failing, par) or (
        failing.latent is not None and touch_alike(failing.latent, plan.reaction.failing, par)
    )


def _earliest(columns: Sequence[Array], count: int) -> Array:
    """Return the earliest of several times in each case; NaN without a time."""
    times = np.array([np.full(count, np.nan), *columns])
    missing = np.isnan(times).all(axis=0)
    return np.where(missing, np.nan, np.nanmin(np.where(np.isnan(times), np.inf, times), axis=0))


def _plain(values: Array) -> list[Any]:
    """Return numbers for a JSON file, null for undefined ones."""
    if values.ndim > 1:
        return [_plain(row) for row in values]
    return [None if math.isnan(value) else value for value in values.tolist()]
