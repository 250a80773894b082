"""What the key figures of a study's cases take, beside their simulation."""

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
    """Return the least processor times of a case's simulation and of its key figures [s].

    Parameters
    ----------
    plan
        Study of an experiment of one run that families of key figures judge.
    times
        How often its first chunk is computed.
    """
    simulated, judged = (min(each) / CHUNK for each in zip(*_times(plan, times), strict=True))
    return simulated, judged


def _times(plan: StudyPlan, times: int) -> Iterator[tuple[float, float]]:
    """Yield what the runs of a chunk take, set up beforehand, and then their key figures [s]."""
    values = plan.values(0)
    benches = [
        changed(plan.bench, {name: column[k].item() for name, column in values.items()}, seed=k)
        for k in range(CHUNK)
    ]
    judge, options = plan.bench.definition.judge, [each.chosen_options for each in benches]
    assert isinstance(judge, FamilyJudge)
    for _ in range(times):
        begin = time.process_time()
        (made,) = rounds(benches, threads=1, signals=partial(needed, judge.signals(options)))
        computed = time.process_time()
        group = made.trajectories
        assert isinstance(group, RunGroup)
        rows = rows_of_group(group, made.cases[0].settle)
        judge.of_cases(rows, options, [run.par for run in group.runs])
        yield computed - begin, time.process_time() - computed
