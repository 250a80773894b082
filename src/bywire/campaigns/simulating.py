"""The runs of a campaign: healthy ones, and those with a fault beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bywire.bench.experiment import Case, FaultyCase, as_run
from bywire.bench.faults.fault_section import Injection
from bywire.bench.faults.injected import injected
from bywire.campaigns.plan import CampaignPlan, Failing
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.simulation.run import Run, Trajectory, simulate
from bywire.simulation.run_group import fit_lanes, simulate_group
from bywire.simulation.tapped import rests

LANES = 64
"""runs that are computed side by side at most, so that their recordings stay small"""
_MOST = 250e6  # numbers that are held at once: 2 GB


@dataclass(frozen=True)
class Traces:
    """Signals of several runs.

    Parameters
    ----------
    time
        Of the rows [s], shape (rows,).
    signals
        By name, shape (cases, rows) each.
    """

    time: Array
    signals: dict[str, Array]

    def of(self, cases: Sequence[int]) -> Traces:
        """Return the signals of some of the runs."""
        return Traces(self.time, {name: rows[cases] for name, rows in self.signals.items()})


def require_small(plan: CampaignPlan) -> None:
    """Refuse a campaign whose recordings do not fit into memory.

    Raises
    ------
    ParameterError
        With what there would be.
    """
    case = plan.case(0)
    rows = (case.keep + case.duration) / case.record
    signals = len(plan.signals) + len(plan.taps[1])
    runs = max(plan.healthy, len(plan.onsets))
    if runs * rows * signals > _MOST:
        raise ParameterError(
            f"{runs} runs of {rows:.3g} rows of {signals} signals are more than {_MOST:.3g} "
            "numbers: take fewer healthy runs or onsets, a shorter maneuver, or a longer "
            "simulation.record"
        )


def healthy_traces(plan: CampaignPlan) -> Traces:
    """Return the signals of all healthy runs."""
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
        What fails.
    onsets
        When, in each run [s].
    samples
        Whose scatter each run has.
    reactions
        When the reaction of the campaign takes effect in each run [s]; None for none.
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
    """Return a run of a sample with faults, of the model that most share or of one of its own."""
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
    return Traces(time, signals)


def _computed(runs: Sequence[Run], signals: Sequence[str], engine: str) -> Sequence[Trajectory]:
    if len(runs) > 1 and fit_lanes(runs, engine):
        return simulate_group(runs, signals, engine=engine)
    return [simulate(run, signals, engine=engine) for run in runs]


def _missed(case: Case, task: str, time: Array) -> Array:
    """Return where a task misses its ticks, which a watchdog sees."""
    given = case.falsified(time) if isinstance(case, FaultyCase) else {}
    return np.minimum(given.get(rests(task), np.zeros(time.size)), 1.0)
