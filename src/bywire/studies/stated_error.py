"""Step of a study whose bench states a numerical error, and a check of the error in its cases."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from bywire.bench.bench import Bench, StepChoice
from bywire.bench.experiment import error_text
from bywire.bench.running import Result
from bywire.bench.step_choice import (
    Figures,
    errors_of,
    figures_of,
    percent_text,
    scales_of,
    spread_over,
    with_chosen_step,
)
from bywire.bench.step_error import steps_of
from bywire.core.errors import FileError, InputError, RunError
from bywire.core.typing import Array, Progress
from bywire.studies.designs import WORST
from bywire.studies.findings import Findings
from bywire.studies.meant_study import RECORD
from bywire.studies.plan import StudyPlan
from bywire.studies.store import CASE, CHOICE, FAILURE, StudyStore, case_bench

_EDGES = (0.01, 0.25)
"""probabilities of the quantiles of the probing cases, which also use the opposite quantiles"""
_ROWS = 8  # probing cases for each of them
_CHECKED = 32  # cases that are rerun with other steps


def with_step(plan: StudyPlan, store: StudyStore, progress: Progress | None = None) -> StudyPlan:
    """Return a study with the step for the error that its bench states, if it states one.

    The bench itself and the `probing_cases` decide. A study that is already in its folder keeps its
    step, because another machine may round the errors differently.

    Raises
    ------
    StepError
        When no step meets the error.
    RunError
        When the bench fails.
    """
    bench = plan.bench
    if bench.error is None or bench.choice is not None:
        return plan
    kept = _kept_choice(plan, store)
    if kept is not None:
        return kept
    return replace(plan, bench=with_chosen_step(bench, probing_cases(plan), progress))


def _kept_choice(plan: StudyPlan, store: StudyStore) -> StudyPlan | None:
    """Return a study with the step in its folder; None if the folder is not this study's."""
    if not (store.folder / RECORD).is_file():
        return None
    try:
        record = store.record()
        choice = StepChoice(**record[CHOICE])
        bench = replace(plan.bench, step=float(choice.step), choice=choice)
        with_it = replace(plan, bench=bench)
        is_same = bench.choice is choice and with_it.digest == record["digest"]
    except (FileError, InputError, KeyError, TypeError, ValueError):
        return None
    return with_it if is_same else None


def probing_cases(plan: StudyPlan) -> list[dict[str, Any]]:
    """Return cases at the quantiles of the varied quantities, by name [SI].

    Two-level designs combine the 1 % and 99 % quantiles, and the quartiles (R. L. Plackett and J.
    P. Burman, The design of optimum multifactorial experiments, Biometrika 33, 1946). Among seven
    quantities, each pair occurs in all combinations. Discrete quantities cycle through their
    values.
    """
    from scipy import special

    columns = range(len(plan.varied))
    odd = [
        [((row & (k % 7 + 1)).bit_count() + k // 7) % 2 for k in columns] for row in range(_ROWS)
    ]
    signs = 1.0 - 2.0 * np.array(odd)
    shares = np.vstack([0.5 + (0.5 - edge) * signs for edge in _EDGES])
    values = plan.values_at(shares if plan.design == WORST else special.ndtri(shares))
    cases: dict[str, dict[str, Any]] = {}
    for k in range(len(shares)):
        case = {name: column[k].item() for name, column in values.items()}
        for varied in plan.varied:
            if singles := varied.distribution.singles:
                case[varied.name] = singles[k % len(singles)]
        cases.setdefault(str(case), case)
    return list(cases.values())


# --- Check of the cases


@dataclass(frozen=True)
class ErrorCheck:
    """Numerical errors of some cases of a study, from runs with other steps.

    Parameters
    ----------
    stated
        Stated error, as a fraction.
    each
        Errors as fractions by key figure, shape (cases,); infinite where a figure is defined only
        with some steps, NaN where it is not defined.
    cases
        Number of these cases.
    """

    stated: float
    each: Mapping[str, Array]
    cases: int

    @cached_property
    def largest(self) -> Mapping[str, float]:
        """Maximum error of each key figure that is defined in at least one case."""
        known = {n: errors[~np.isnan(errors)] for n, errors in self.each.items()}
        return {name: float(errors.max()) for name, errors in known.items() if errors.size}

    @cached_property
    def exceeding(self) -> Mapping[str, int]:
        """Number of cases that exceed the stated error, by key figure, if there are any."""
        counts = {n: int(np.sum(errors > self.stated)) for n, errors in self.each.items()}
        return {name: count for name, count in counts.items() if count}

    @property
    def warning(self) -> str:
        """Warning if cases exceed the stated error; otherwise empty."""
        texts = [
            f"{name} in {count} case{'s' * (count != 1)} (up to {100.0 * self.largest[name]:.3g} %)"
            for name, count in self.exceeding.items()
        ]
        if not texts:
            return ""
        return (
            f"the numerical error exceeds simulation.error = {error_text(self.stated)} in some of "
            f"the {self.cases} checked cases: {', '.join(texts)}. State a smaller error"
        )

    @property
    def note(self) -> str:
        """Result of the check if no case exceeds the stated error; otherwise empty."""
        if self.exceeding:
            return ""
        name = max(self.largest, key=lambda each: self.largest[each], default="")
        of = f" of {percent_text(self.largest[name])} ({name})" if name else ""
        return (
            f"in {self.cases} cases that bywire reran with other steps, the maximum numerical "
            f"error{of} is within simulation.error = {error_text(self.stated)}"
        )


def error_check(findings: Findings, nominal: Result) -> ErrorCheck | None:
    """Return a check of the errors of some of a study's cases, spread over all of them.

    None if the study states no error, or has no case with a result.

    Parameters
    ----------
    findings
        The cases.
    nominal
        Result of the bench itself.
    """
    plan = findings.plan
    choice = plan.bench.choice
    if choice is None:
        return None
    names = list(plan.bench.limits or findings.units)
    varied = [name for v in plan.varied for name in (v.name, *v.together)]
    cases = _checked_cases(findings, [*varied, *names])
    if not cases:
        return None
    at_start = {kpi.name: kpi.value for kpi in nominal.kpis}
    here = Figures(
        {n: np.array([at_start[n], *(case[n] for case in cases)]) for n in names},
        np.zeros(1 + len(cases), dtype=bool),
    )
    others: dict[float, Figures] = {}
    for factor, bench in _other_steps(plan.bench):
        finer = replace(plan, bench=bench)
        benches = [_case(finer, case[CASE], {n: case[n] for n in varied}) for case in cases]
        try:
            others[factor] = figures_of([bench, *benches])
        except RunError:
            continue
    errors = errors_of(plan.bench, here, others, scales_of(plan.bench, nominal.recordings))
    return ErrorCheck(choice.stated, {n: each[1:] for n, each in errors.each.items()}, len(cases))


def _checked_cases(findings: Findings, names: Sequence[str]) -> list[dict[str, Any]]:
    """Return cases with a result, spread over all cases: the named columns, and the number."""
    rows = np.array(spread_over(range(findings.count), _CHECKED), dtype=int)
    cases: list[dict[str, Any]] = []
    begin = 0
    for block in findings.blocks([CASE, FAILURE, *names]):
        size = len(block[CASE])
        for row in (rows[(rows >= begin) & (rows < begin + size)] - begin).tolist():
            if not block[FAILURE][row]:
                columns = {n: np.asarray(block[n])[row : row + 1] for n in (CASE, *names)}
                cases.append({n: column.tolist()[0] for n, column in columns.items()})
        begin += size
    return cases


def _case(plan: StudyPlan, number: int, values: Mapping[str, Any]) -> Bench | None:
    try:
        return case_bench(plan, number, values)
    except InputError:  # the step does not divide a sample time of this case
        return None


def _other_steps(bench: Bench) -> Iterator[tuple[float, Bench]]:
    for factor in steps_of(bench.runs().values()):
        yield factor, replace(bench, step=factor * bench.step)
