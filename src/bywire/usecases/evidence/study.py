"""Evidence from a study: probabilities of meeting limits, from many cases."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from bywire.api.study_run import StudyRun, completed
from bywire.bench.requirements import Limit
from bywire.core.arguments import whole_number
from bywire.core.errors import ParameterError, unknown_of_few
from bywire.core.typing import Progress
from bywire.signoff.judging import Judged
from bywire.signoff.plan import Computed, Task
from bywire.studies.designs import MOST
from bywire.studies.findings import Judgment
from bywire.studies.plan import StudyPlan
from bywire.studies.stated_error import with_step
from bywire.studies.store import Origin as StudyOrigin
from bywire.studies.store import StudyStore
from bywire.studies.study_file import read_study
from bywire.usecases import use_cases
from bywire.usecases.evidence.entry import (
    Origin,
    read_figure_limit,
    require_file,
    there,
    title_of,
    value_of,
)

KEYS = ("set", "cases")
"""keys of a study in addition to those of every ``[[evidence]]``"""


@dataclass(frozen=True)
class StudyTask(Task):
    """Evidence from a study.

    Parameters
    ----------
    subject, arguments, folder
        Content of the entry, and the folder of the sign-off file.
    file, changes
        The study file, and changes to its bench.
    plan
        The study with the requirements of its file.
    limits
        Limits of the sign-off, which replace these requirements if there are any.
    """

    subject: str
    arguments: Mapping[str, Any]
    folder: Path
    file: Path
    changes: Mapping[str, str]
    plan: StudyPlan
    limits: tuple[Limit, ...] = ()

    @property
    def is_parallel(self) -> bool:
        """True: studies use all cores."""
        return True

    @property
    def origin(self) -> Origin:
        """The reader and its arguments, for another process."""
        return read_study_task, (self.subject, self.arguments, self.folder)

    @property
    def title(self) -> str:
        """The entry in one line."""
        return title_of("study", self.subject, self.arguments)

    @cached_property
    def judged_plan(self) -> StudyPlan:
        """The study with the limits of the sign-off."""
        if not self.limits:
            return self.plan
        texts = {each.figure: each.text for each in self.limits}
        return replace(
            self.plan,
            demands=self.limits,
            bench=replace(self.plan.bench, requirements=texts),
        )

    @property
    def identity(self) -> Mapping[str, Any]:
        """Everything that affects its figures."""
        plan = self.judged_plan
        return {
            "kind": "study",
            **plan.identity,
            "cases": plan.cases,
            "confidence": plan.confidence,
            "limits": sorted(map(str, plan.demands)),
        }

    @property
    def shelf(self) -> str:
        """Digest of the cases, which a larger number of cases or other limits continue."""
        return self.judged_plan.digest

    def limit(self, text: str) -> Limit:
        """Return a limit of one of its figures."""
        bench = self.plan.bench
        figures = bench.definition.kpis_with(bench.chosen_options)
        return read_figure_limit(text, figures, has_probability=True)

    def with_limits(self, limits: Sequence[Limit]) -> StudyTask:
        """Return the task with all limits of the sign-off file, one per key figure."""
        figures = [each.figure for each in limits]
        for name in figures:
            if figures.count(name) > 1:
                raise ParameterError(
                    f"the same study has several limits on {name}, but a study judges each key "
                    "figure only once. Copy the study file for the second limit",
                    name=name,
                )
        return replace(self, limits=tuple(limits))

    def compute(self, folder: Path, progress: Progress) -> Computed:
        """Compute the result, and write its report."""
        store = StudyStore(folder)
        plan = with_step(self.judged_plan, store, progress)
        run = completed(StudyOrigin(self.file, self.changes), plan, store, None, "", progress)
        run.write(folder)
        return Computed(run, {str(j.demand): _judged(run, j) for j in run.findings.judgments})


def _judged(run: StudyRun, judgment: Judgment) -> Judged:
    """Return the verdict on a limit over all cases of a study."""
    demand, share, failure = judgment.demand, judgment.share, judgment.failure
    text = str(demand)
    if failure is not None:
        estimate, admitted = failure.estimate, 1.0 - (demand.probability or 0.0)
        return Judged(
            judgment.outcome,
            text,
            estimate.value,
            "1",
            estimate.high - estimate.value,
            admitted - estimate.high,
            note=f"probability of missing the limit: {estimate.value:.2g} ({estimate.low:.2g} to "
            f"{estimate.high:.2g}, {failure.runs} cases)",
        )
    note = f"{share.count} of {share.cases} cases meet the limit"
    if run.plan.is_sampled:
        interval = f"{100.0 * share.low:.4g} to {100.0 * share.high:.4g} %"
        note += f", {100.0 * run.plan.confidence:g} % interval {interval}"
    if demand.probability is not None:
        return Judged(
            judgment.outcome,
            text,
            100.0 * share.value,
            "%",
            100.0 * max(share.high - share.value, share.value - share.low),
            100.0 * (share.low - demand.probability),
            note=note,
        )
    value = _worst(run, judgment)
    room = (demand.bound - value) if demand.is_upper else (value - demand.bound)
    at = "" if judgment.worst is None else f"case {run.findings.number(judgment.worst)}"
    error = next((k.bound for k in run.nominal.kpis if k.name == demand.figure), math.nan)
    return Judged(judgment.outcome, text, value, demand.unit, error, room, at, note)


def _worst(run: StudyRun, judgment: Judgment) -> float:
    """Return the key figure of the worst case; of any case if all are equal."""
    if not run.findings.count:
        return math.nan
    row = 0 if judgment.worst is None else judgment.worst
    return float(run.findings.row(row)[judgment.demand.figure])


def read_study_task(subject: str, arguments: Mapping[str, Any], folder: Path) -> StudyTask:
    """Read the evidence of a study (see `bywire.usecases.evidence.kinds.read_kind`)."""
    known = {each.name: each for each in use_cases()["run_study"].arguments if each.name in KEYS}
    for name in arguments:
        if name not in known:
            raise unknown_of_few(
                "key of [[evidence]] study", name, (*KEYS, "shows", "limit", "note")
            )
    asked = {name: value_of(known[name], value, folder) for name, value in arguments.items()}
    file = Path(there(subject, None, folder))
    require_file(file)
    changes = asked.get("set", {})
    plan = read_study(file, changes)
    if (cases := asked.get("cases")) is not None:
        whole_number("cases", cases, 1, MOST)
        plan = replace(plan, cases=cases)
    return StudyTask(subject, arguments, folder, file, changes, plan)
