"""Studies whose bench states a numerical error: their time, and the true error of their cases."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.result import Result, at_most
from benchmarks.timing import interleaved, processor_timed, ratio
from bywire.bench.running import run
from bywire.bench.step_choice import scales_of
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.stated_error import with_step
from bywire.studies.store import StudyStore, computed_chunk
from bywire.studies.study_file import read_study

_REFERENCE = 1e-6  # s: step of the runs that show the true error
_ROUNDS = 9


def of_stated_error(path: Path, error: str, name: str) -> Iterator[Result]:
    """Measure a study with a stated error, relative to the same study with the usual step.

    Parameters
    ----------
    path
        Study file, whose bench states neither step nor error.
    error
        The error, for example ``"0.1 %"``.
    name
        Prefix of the figures' names.
    """
    usual, stated = read_study(path), read_study(path, {"simulation.error": error})
    computed_chunk(usual, 0, threads=1)  # the kernel is built
    begin = time.process_time()
    chosen = with_step(stated, StudyStore(path.parent / name))
    choosing = time.process_time() - begin
    works = {
        key: processor_timed(partial(computed_chunk, plan, 0, threads=1))
        for key, plan in {"stated": chosen, "usual": usual}.items()
    }
    seconds = interleaved(works, _ROUNDS)
    yield Result(
        f"{name}_ratio",
        ratio(seconds, "stated", "usual"),
        "1",
        note=f"time of a case with simulation.error = {error}, for which bywire chooses "
        f"{1e6 * chosen.bench.step:.4g} us, relative to 20 us; choosing the step takes as long as "
        f"{choosing / min(seconds['usual']) * CHUNK:.3g} cases",
    )
    true, figure = _true_error(chosen)
    yield at_most(
        f"{name}_true",
        100.0 * true,
        100.0 * float(stated.bench.error or 0.0),
        "%",
        f"largest error of the key figures that the step was chosen for, in {CHUNK} of these "
        f"cases, compared with {1e6 * _REFERENCE:g} us ({figure})",
    )


def _true_error(plan: StudyPlan) -> tuple[float, str]:
    """Return the largest error in the first chunk of a study as a fraction, and its figure."""
    finest = replace(plan, bench=replace(plan.bench, step=_REFERENCE))
    coarse, fine = (computed_chunk(each, 0) for each in (plan, finest))
    bench = plan.bench
    full = scales_of(bench, run(bench).recordings).full
    errors = {}
    for name in bench.limits or bench.definition.kpis_with(bench.chosen_options):
        scales = np.maximum(np.maximum(abs(fine[name]), abs(coarse[name])), full.get(name, 0.0))
        apart = abs(coarse[name] - fine[name])
        known = apart > 0.0
        errors[name] = float(np.max(apart[known] / scales[known], initial=0.0))
    worst = max(errors, key=lambda name: errors[name])
    return errors[worst], worst
