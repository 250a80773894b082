"""Probabilities that designed gains meet requirements, on linear models and on the bench."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from bywire.api.design_parts import Part, figure_cell
from bywire.api.loop_case import LoopCase
from bywire.api.study_tables import demand_table, figure_text, percent
from bywire.bench import running
from bywire.bench.bench import Bench
from bywire.bench.changes import OPTION
from bywire.bench.requirements import Limit
from bywire.core.callers import option
from bywire.core.errors import InputError, ParameterError, not_valid, quoted
from bywire.core.typing import Progress, silent
from bywire.core.units import parse
from bywire.report.tables import OUTCOMES, Cell, text_table
from bywire.studies.executor import executor_of
from bywire.studies.findings import Findings
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.statistics import Outcome, Share, judged, share
from bywire.studies.study_file import read_study
from bywire.synthesis.bench_figures import STEP_FIGURES, has_step
from bywire.synthesis.linear_case import LinearCase, existing_case, require_given
from bywire.synthesis.outcome import Judged

_JUDGES = 512  # additional models for testing the gains, or more if a probability needs more
_MOST_JUDGES = 20_000
_MISSING = 2  # number of test models that may miss a requirement that is still met
_MOST = 1000


@dataclass(frozen=True)
class DrawnModels:
    """Models drawn in the same way as a study draws its cases.

    Parameters
    ----------
    plan
        The study, with its distributions.
    cases
        Models for which bywire chooses the gains.
    lacking
        Number of draws for which no model exists, among those for choosing the gains.
    judges
        Additional models for testing the gains. None where no model exists.
    """

    plan: StudyPlan
    cases: tuple[LinearCase, ...]
    lacking: int
    judges: tuple[LinearCase | None, ...]

    @property
    def count(self) -> int:
        """Number of draws for choosing the gains."""
        return len(self.cases) + self.lacking


@dataclass(frozen=True)
class Probability:
    """Probability that the gains meet their requirements on linear models.

    Parameters
    ----------
    drawn
        The models.
    requirements
        The requirements.
    judged
        Number of test models that meet each requirement.
    wanted
        Required probability that all requirements are met together, or None.
    """

    drawn: DrawnModels
    requirements: tuple[Limit, ...]
    judged: Judged
    wanted: float | None

    @property
    def together(self) -> Share:
        """Probability of meeting all requirements, with its interval."""
        return self._share(self.judged.all_met)

    @property
    def outcome(self) -> Outcome | None:
        """Verdict on the required probability, or None if none is required."""
        if self.wanted is None:
            return None
        return judged(self.together, self.together, self.wanted)

    @cached_property
    def outcomes(self) -> Mapping[str, Outcome]:
        """Verdict on each requirement by its text; empty if none has a probability.

        All test models must meet a requirement without a probability, as in a study.
        """
        if not has_probability(self.requirements):
            return {}
        return {
            str(each): self._outcome(each, self._share(count))
            for each, count in zip(self.requirements, self.judged.met, strict=True)
        }

    @staticmethod
    def _outcome(required: Limit, met: Share) -> Outcome:
        if required.probability is not None:
            return judged(met, met, required.probability)
        return "met" if met.count == met.cases else "missed"

    def share_of(self, text: str) -> Share:
        """Return the probability of meeting a requirement, by its text."""
        return self._share(self.judged.met[self.requirements.index(self._limit(text))])

    def _limit(self, text: str) -> Limit:
        return next(each for each in self.requirements if str(each) == text)

    def remark(self, text: str) -> str:
        """Return a sentence on a requirement that is not met over the test models."""
        told = self.share_of(text)
        count = f"{told.count} of {told.cases} test models meet the requirement"
        if self._limit(text).probability is None:
            advice = "Add a probability, as in 'with 99 %', or"
        elif self.outcomes[text] == "undecided":
            advice = "This is too close to the required probability for a decision. For a larger"
            advice += " margin,"
        else:
            advice = "For gains that meet the requirement more often,"
        more = f"choose gains for more models ({option('drawn')} {4 * self.drawn.count})"
        if 4 * self.drawn.count > _MOST:
            more = "use a wider limit"
        return f"{text} is {self.outcomes[text]} on the linear models: {count}. {advice} {more}"

    def _share(self, count: int) -> Share:
        return share(count, self.judged.models, self.drawn.plan.confidence)

    def parts(self) -> Sequence[Part]:
        """Return a table and text lines."""
        interval = f"{100.0 * self.drawn.plan.confidence:g} % interval"
        rows: list[tuple[str | Cell, ...]] = [
            (
                str(wanted),
                *self._words(self._share(count)),
                figure_cell(wanted.figure, worst),
                *self._verdict_cells(str(wanted)),
            )
            for wanted, count, worst in zip(
                self.requirements, self.judged.met, self.judged.worst, strict=True
            )
        ]
        if len(rows) > 1:
            joint = "-" if self.outcome is None else OUTCOMES[self.outcome]
            cells = (joint,) if self.outcomes else ()
            rows.append(("all together", *self._words(self.together), "-", *cells))
        heading = ["of other models", "met by", "probability", interval, "worst"]
        heading += ["verdict"] * bool(self.outcomes)
        lines: list[Part] = [
            f"gains chosen for {len(self.drawn.cases)} models drawn from study "
            f"{self.drawn.plan.name!r}, and tested on {self.judged.models} other models",
            text_table(heading, rows),
        ]
        if self.judged.unstable:
            lines.append(
                f"{self.judged.unstable} of these other models are unstable or do not exist. They "
                "are treated as failing every requirement"
            )
        if self.drawn.lacking:
            lines.append(f"for {self.drawn.lacking} more draws, no model exists")
        return [*lines, self.verdict] if self.wanted is not None else lines

    @property
    def verdict(self) -> str:
        """Verdict on the required probability as text."""
        wanted = "" if self.wanted is None else f" with {100.0 * self.wanted:.10g} %"
        return f"all requirements{wanted}: {self.outcome or 'no probability is required'}"

    def _verdict_cells(self, text: str) -> tuple[Cell, ...]:
        return (OUTCOMES[self.outcomes[text]],) if self.outcomes else ()

    def _words(self, told: Share) -> tuple[str, str, str]:
        return (
            f"{told.count} of {told.cases}",
            percent(told.value, told),
            f"{percent(told.low, told)} to {percent(told.high, told)}",
        )

    def data(self) -> dict[str, Any]:
        """Return all results as plain data."""

        def said(told: Share) -> dict[str, Any]:
            return {
                "met": told.count,
                "probability": told.value,
                "low": told.low,
                "high": told.high,
            }

        return {
            "study": self.drawn.plan.name,
            "designed_for": len(self.drawn.cases),
            "lacking": self.drawn.lacking,
            "judged_by": self.judged.models,
            "unstable": self.judged.unstable,
            "wanted": self.wanted,
            "outcome": self.outcome,
            "all": said(self.together),
            "requirements": [
                {
                    "requirement": str(wanted),
                    "worst": worst,
                    **said(self._share(count)),
                    **({"outcome": self.outcomes[str(wanted)]} if self.outcomes else {}),
                }
                for wanted, count, worst in zip(
                    self.requirements, self.judged.met, self.judged.worst, strict=True
                )
            ],
        }


def drawn_models(
    case: LoopCase,
    file: str | Path,
    count: int,
    requirements: Sequence[Limit],
    wanted: float | None,
) -> DrawnModels:
    """Draw models of a loop whose parameters vary as in a study file.

    The study's cases, requirements and experiment are ignored.

    Parameters
    ----------
    case
        The loop, its parameters and operating point.
    file
        Study file. Relative values in it refer to the values of its bench.
    count
        Number of models for which bywire chooses the gains.
    requirements, wanted
        The requirements, and the required probability that all are met, or None. They determine the
        number of test models.

    Raises
    ------
    InputError
        If the study file does not fit the loop, the count is invalid, or no model exists.
    """
    if not 1 <= count <= _MOST:
        raise not_valid("drawn", f"{count}", f"1 to {_MOST} models")
    plan = replace(read_study(file), design="monte-carlo")
    _require_fitting(case, plan, file)
    judges = _judge_count(requirements, wanted, plan.confidence)
    columns = [plan.values(chunk) for chunk in range(-(-(count + judges) // CHUNK))]
    models = [
        _model(case, {name: column[k].item() for name, column in values.items()}, number, count)
        for number, (values, k) in enumerate(
            ((values, k) for values in columns for k in range(CHUNK)), 1
        )
    ]
    designed = tuple(each for each in models[:count] if each is not None)
    if not designed:
        raise ParameterError(
            f"{file}: none of its {count} draws results in a valid model. Narrow its [vary] "
            "section",
            name=str(file),
            value=str(count),
        )
    tests = tuple(models[count : count + judges])
    return DrawnModels(plan, designed, count - len(designed), tests)


def _judge_count(requirements: Sequence[Limit], wanted: float | None, confidence: float) -> int:
    """Return a number of test models that can decide every required probability.

    A requirement is met even if `_MISSING` of the models miss it. For the probability of all
    requirements together, no model may miss any of them.
    """
    demands = [(each.probability, _MISSING) for each in requirements]
    counts = [_deciding(p, missing, confidence) for p, missing in [*demands, (wanted, 0)] if p]
    return max([_JUDGES, *counts])


def _deciding(wanted: float, missing: int, confidence: float) -> int:
    """Return the minimum number of models with which a limit is met even if some miss it."""

    def is_decided(count: int) -> bool:
        return share(count - missing, count, confidence).low >= wanted

    sizes = range(missing + 1, _MOST_JUDGES + 1)
    place = bisect_left(sizes, True, key=is_decided)
    if place == len(sizes):
        raise ParameterError(
            f"a probability of {100.0 * wanted:.10g} % needs more than {_MOST_JUDGES} test models. "
            "Use a lower probability for the design, and test the designed gains with a study of "
            "rare failures (docs/studies.md)",
            name="probability",
            value=f"{100.0 * wanted:.10g} %",
        )
    return sizes[place]


def has_probability(requirements: Sequence[Limit]) -> bool:
    """Return whether any requirement has a probability."""
    return any(each.probability is not None for each in requirements)


def require_no_probability(requirements: Sequence[Limit]) -> None:
    """Reject a requirement with a probability for a gain schedule, which has no drawn models."""
    for each in requirements:
        if each.probability is not None:
            text = f"with {100.0 * each.probability:.10g} %"
            raise ParameterError(
                f"requirement {str(each)!r} has a probability, but bywire cannot schedule gains "
                f"for drawn models. Remove {text!r} or {option('schedule')}",
                name=each.figure,
                value=str(each),
                valid=f"{each.figure} {each.text}",
            )


def require_drawn(requirements: Sequence[Limit], probability: str, vary: str | Path) -> None:
    """Reject probabilities without a study file, because they need its distributions.

    Raises
    ------
    ParameterError
        With advice on what to add.
    """
    if vary:
        return
    if probability:
        raise ParameterError(
            f"{option('probability')} needs drawn models. Add {option('vary')} FILE with a study "
            "file",
            name="probability",
            value=probability,
            valid=option("vary"),
        )
    for each in requirements:
        if each.probability is not None:
            raise ParameterError(
                f"requirement {str(each)!r} has a probability, which needs distributions. Add "
                f"{option('vary')} FILE with a study file, or remove 'with "
                f"{100.0 * each.probability:.10g} %'",
                name=each.figure,
                value=str(each),
                valid=option("vary"),
            )


def read_probability(text: str) -> float | None:
    """Return the required probability, or None for an empty text.

    Raises
    ------
    ParameterError
        If the text is not a probability between 0 and 100 %.
    """
    if not text:
        return None
    wanted = parse(text, "1", "probability")
    if not 0.0 < wanted < 1.0:
        raise not_valid("probability", quoted(text), "between 0 and 100 %")
    return wanted


def _require_fitting(case: LoopCase, plan: StudyPlan, file: str | Path) -> None:
    if type(plan.bench.par) is not type(case.par):
        raise ParameterError(
            f"{file}: the study's bench runs {plan.bench.system}, but loop {case.loop.name!r} "
            f"belongs to {case.loop.assembly}. Choose a study of {case.loop.assembly}",
            name=str(file),
            value=plan.bench.system,
            valid=case.loop.assembly,
        )
    for name in (name for v in plan.varied for name in (v.name, *v.together)):
        if name.startswith(OPTION):
            raise ParameterError(
                f"{file}: {name} is an option of the experiment, but the loop has no such option. "
                f"Remove {name}",
                name=name,
            )
        require_given(case.loop, name)


def _model(case: LoopCase, values: Mapping[str, Any], number: int, draws: int) -> LinearCase | None:
    try:
        model = existing_case(case.loop, f"drawn model {number}", case.par, values, case.value)
    except InputError:
        return None
    return replace(model, draws=draws)


# --- The nonlinear bench over the same distributions


@dataclass(frozen=True)
class BenchProbability:
    """Requirements on the nonlinear bench with the designed gains, over a study's distributions.

    Parameters
    ----------
    findings
        Cases of the study, whose draws were not used to choose the gains.
    """

    findings: Findings

    @property
    def outcomes(self) -> Mapping[str, Outcome]:
        """Verdict on each requirement by its text."""
        return {str(each.demand): each.outcome for each in self.findings.judgments}

    def parts(self) -> Sequence[Part]:
        """Return a table and a text line."""
        findings = self.findings
        lines: list[Part] = [
            f"tested on the nonlinear bench ({findings.plan.bench.experiment}) in "
            f"{findings.count} cases of study {findings.plan.name!r}",
            demand_table(findings),
        ]
        if findings.failed:
            lines.append(
                f"{findings.failed} of these cases have no result, and do not meet any "
                f"requirement: {findings.reasons[0].text}"
            )
        return lines

    def remark(self, text: str, linear: Probability) -> str:
        """Return a sentence on a requirement that is not met on the bench over the distributions.

        Parameters
        ----------
        text
            Text of the requirement.
        linear
            The requirements on the linear models.
        """
        (judgment,) = [each for each in self.findings.judgments if str(each.demand) == text]
        known, models = judgment.share, linear.share_of(text)
        demand, nominal = judgment.demand, self._nominal(judgment.demand.figure)
        texts = [
            f"{text} is {judgment.outcome} on the bench, with a probability of "
            f"{percent(known.value, known)} ({percent(known.low, known)} to "
            f"{percent(known.high, known)}). On the linear models, it is "
            f"{linear.outcomes[text]} with {percent(models.value, models)}"
        ]
        reached = self.reached(demand)
        if math.isnan(reached):
            return texts[0]
        share_text = (
            ""
            if demand.probability is None
            else str(demand).removeprefix(f"{demand.figure} {demand.text}")
        )
        texts.append(
            f"The gains meet {demand.figure} {demand.compare} {self._shown(demand, reached)}"
            f"{share_text}, and the nominal bench has {self._shown(demand, nominal)}"
        )
        stricter = 2.0 * demand.bound - reached
        if 0.0 < stricter < demand.bound:
            texts.append(
                "To leave room for the scatter, design with a stricter limit, such as "
                f"{demand.figure} {demand.compare} {self._shown(demand, stricter)}{share_text}"
            )
        return ". ".join(texts)

    def reached(self, demand: Limit) -> float:
        """Return the strictest limit that the cases certainly meet with the required probability.

        In the figure's unit; NaN if there are too few cases, or too many lack the figure.
        """
        values = self.findings.figure(demand.figure)
        ascending = np.sort(values if demand.is_upper else -values)  # undefined ones are last
        wanted, confidence = demand.probability, self.findings.plan.confidence
        count = values.size
        if wanted is not None:
            sizes = range(count + 1)
            count = bisect_left(
                sizes, True, key=lambda met: share(met, values.size, confidence).low >= wanted
            )
        if not 0 < count <= values.size:
            return math.nan
        return float(ascending[count - 1] if demand.is_upper else -ascending[count - 1])

    def _nominal(self, figure: str) -> float:
        return next(kpi.value for kpi in self.findings.nominal if kpi.name == figure)

    def _shown(self, demand: Limit, value: float) -> str:
        return figure_text(self.findings, demand.figure, value, 3)

    def data(self) -> dict[str, Any]:
        """Return all results as plain data."""
        findings = self.findings
        return {
            "experiment": findings.plan.bench.experiment,
            "cases": findings.count,
            "failed": findings.failed,
            "requirements": [
                {
                    "requirement": str(each.demand),
                    "met": each.share.count,
                    "undecided_cases": each.undecided,
                    "probability": each.share.value,
                    "low": each.share.low,
                    "high": each.share.high,
                    "outcome": each.outcome,
                    "reached": self.reached(each.demand),
                    "nominal": self._nominal(each.demand.figure),
                    "unit": each.demand.unit,
                }
                for each in findings.judgments
            ],
        }


def bench_probability(
    drawn: DrawnModels,
    requirements: Sequence[Limit],
    bench: Bench | None,
    gains: Mapping[str, float],
    progress: Progress | None,
) -> BenchProbability | None:
    """Test requirements on the nonlinear bench, with gains, over the distributions of a study.

    Parameters
    ----------
    drawn
        The study. The cases are draws that were not used to choose the gains, and the first ones
        are those of the linear test models.
    requirements
        The requirements. The bench judges those on figures of its step.
    bench
        The loop's experiment, or None if it has none.
    gains
        By dotted name [SI].
    progress
        Called with a label and the completed fraction, 0 to 1.

    Returns
    -------
    BenchProbability or None
        None if no requirement has a probability, or the bench has none of the figures.
    """
    if bench is None or not has_probability(requirements) or not has_step(bench):
        return None
    bench = bench.with_overrides(dict(gains))
    demands = _on_step(requirements, bench)
    if not demands:
        return None
    first, count = -(-drawn.count // CHUNK), -(-len(drawn.judges) // CHUNK)
    plan = replace(drawn.plan, bench=bench, cases=count * CHUNK, demands=demands)
    label, report = "random cases on the bench", progress or silent
    columns = {}
    report(label, 0.0)
    with executor_of(None, "", count, engine=bench.engine).opened(plan) as compute:
        nominal = compute.beside(partial(running.run, bench, estimate_error=True))
        for chunk, computed in compute(range(first, first + count)):
            columns[chunk] = computed
            report(label, len(columns) / count)
        kpis = nominal.result().kpis
    import pandas as pd

    cases = pd.concat([pd.DataFrame(columns[chunk]) for chunk in sorted(columns)])
    return BenchProbability(Findings(plan, cases.reset_index(drop=True), kpis))


def _on_step(requirements: Sequence[Limit], bench: Bench) -> tuple[Limit, ...]:
    """Return the requirements that a bench judges by its step, in the units of its key figures.

    The loop's steady-state error is in percent of the step, the bench's in the signal's unit.
    """
    units = bench.definition.kpis_with(bench.chosen_options)
    step = bench.definition.step
    assert step is not None
    setting = step(bench.chosen_options)
    height = abs((setting.end or 0.0) - (setting.start or 0.0))
    demands = []
    for each in requirements:
        if each.figure not in STEP_FIGURES:
            continue
        unit = units[each.figure]
        if unit == each.unit:
            demands.append(each)
        elif height:
            demands.append(replace(each, bound=each.bound / 100.0 * height, unit=unit))
    return tuple(demands)
