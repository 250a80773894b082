"""Time that the key figures of a study's cases need, compared with their simulation."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial

import numpy as np

from bywire.bench.bench import Bench
from bywire.bench.ensemble import changed, needed, rounds
from bywire.bench.joined import in_groups, options_of
from bywire.bench.kpis.families import FamilyJudge
from bywire.bench.recording import rows_of_group
from bywire.simulation.ensemble import RunGroup
from bywire.simulation.run_table import parameters_of
from bywire.studies.plan import CHUNK, StudyPlan

CHUNKS = 4
"""chunks that a study computes together"""


def simulated_and_judged(plan: StudyPlan, times: int) -> tuple[float, float]:
    """Return the minimum processor times of a case's simulation and of its key figures [s].

    Parameters
    ----------
    plan
        Study of an experiment with one run, whose key figures come from families.
    times
        Number of computations of the first chunks.
    """
    cases = CHUNKS * CHUNK
    simulated, judged = (min(each) / cases for each in zip(*_times(plan, times), strict=True))
    return simulated, judged


def _times(plan: StudyPlan, times: int) -> Iterator[tuple[float, float]]:
    """Yield the times of the runs in several chunks, after setup, and of their key figures [s]."""
    each = [plan.values(chunk) for chunk in range(CHUNKS)]
    values = {name: np.concatenate([one[name] for one in each]) for name in each[0]}
    cases = range(CHUNKS * CHUNK)

    def bench(k: int) -> Bench:
        return changed(plan.bench, {n: column[k].item() for n, column in values.items()}, seed=k)

    ((_, joined),) = in_groups(plan.bench, values, cases, bench)
    benches = list(map(bench, cases)) if joined is None else joined
    judge, options = plan.bench.definition.judge, options_of(benches)
    assert isinstance(judge, FamilyJudge)
    for _ in range(times):
        begin = time.process_time()
        (batch,) = rounds(benches, threads=1, signals=partial(needed, judge.signals(options)))
        computed = time.process_time()
        group = batch.trajectories
        assert isinstance(group, RunGroup)
        rows = rows_of_group(group, batch.cases[0].settle)
        judge.of_cases(rows, options, parameters_of(group.runs))
        yield computed - begin, time.process_time() - computed
