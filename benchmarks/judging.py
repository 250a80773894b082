"""Time that the key figures of a study's cases need, compared with their simulation."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial

from bywire.bench.ensemble import changed, needed, rounds
from bywire.bench.kpis.families import FamilyJudge
from bywire.bench.recording import rows_of_group
from bywire.simulation.ensemble import RunGroup
from bywire.studies.plan import CHUNK, StudyPlan


def simulated_and_judged(plan: StudyPlan, times: int) -> tuple[float, float]:
    """Return the minimum processor times of a case's simulation and of its key figures [s].

    Parameters
    ----------
    plan
        Study of an experiment with one run, whose key figures come from families.
    times
        Number of computations of the first chunk.
    """
    simulated, judged = (min(each) / CHUNK for each in zip(*_times(plan, times), strict=True))
    return simulated, judged


def _times(plan: StudyPlan, times: int) -> Iterator[tuple[float, float]]:
    """Yield the times of the runs in a chunk, after setup, and of their key figures [s]."""
    values = plan.values(0)
    benches = [
        changed(plan.bench, {name: column[k].item() for name, column in values.items()}, seed=k)
        for k in range(CHUNK)
    ]
    judge, options = plan.bench.definition.judge, [each.chosen_options for each in benches]
    assert isinstance(judge, FamilyJudge)
    for _ in range(times):
        begin = time.process_time()
        (batch,) = rounds(benches, threads=1, signals=partial(needed, judge.signals(options)))
        computed = time.process_time()
        group = batch.trajectories
        assert isinstance(group, RunGroup)
        rows = rows_of_group(group, batch.cases[0].settle)
        judge.of_cases(rows, options, [run.par for run in group.runs])
        yield computed - begin, time.process_time() - computed
