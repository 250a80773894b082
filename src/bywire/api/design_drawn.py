"""Models that a design is made for, drawn as a study draws its cases, and how probably it holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bywire.api.design_parts import Part, figure_cell
from bywire.api.loop_case import LoopCase
from bywire.api.study_tables import percent
from bywire.bench.changes import OPTION
from bywire.bench.requirements import Limit
from bywire.core.errors import InputError, ParameterError, quoted
from bywire.core.typing import Progress, silent
from bywire.core.units import parse
from bywire.report.tables import Cell, text_table
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.statistics import Outcome, Share, judged, share
from bywire.studies.study_file import read_study
from bywire.synthesis.linear_case import LinearCase, existing_case, require_given
from bywire.synthesis.outcome import Judged, judged_over

_JUDGES = 512  # further ones, that judge the gains
_MOST = 1000


@dataclass(frozen=True)
class DrawnModels:
    """Models as a study draws its cases.

    Parameters
    ----------
    study
        The study's name.
    cases
        Models that gains are chosen for.
    lacking
        How many of those that were drawn for it do not exist.
    judges
        Further models, which judge the gains; None for one that does not exist.
    confidence
        Of intervals.
    """

    study: str
    cases: tuple[LinearCase, ...]
    lacking: int
    judges: tuple[LinearCase | None, ...]
    confidence: float


@dataclass(frozen=True)
class Probability:
    """How probably gains meet their requirements, on the linear models.

    Parameters
    ----------
    drawn
        The models.
    requirements
        The requirements.
    judged
        How many of the judging models meet each.
    wanted
        Probability that is wanted of all requirements together; None for none.
    """

    drawn: DrawnModels
    requirements: tuple[Limit, ...]
    judged: Judged
    wanted: float | None

    @property
    def together(self) -> Share:
        """Probability with which all requirements are met, and its interval."""
        return self._share(self.judged.all_met)

    @property
    def outcome(self) -> Outcome | None:
        """Whether they are met as probably as wanted; None where nothing is."""
        if self.wanted is None:
            return None
        return judged(self.together, self.together, self.wanted)

    def _share(self, count: int) -> Share:
        return share(count, self.judged.models, self.drawn.confidence)

    def parts(self) -> Sequence[Part]:
        """Return a table and sentences."""
        told = f"{100.0 * self.drawn.confidence:g} % interval"
        rows: list[tuple[str | Cell, ...]] = [
            (str(wanted), *self._words(self._share(count)), figure_cell(wanted.figure, worst))
            for wanted, count, worst in zip(
                self.requirements, self.judged.met, self.judged.worst, strict=True
            )
        ]
        if len(rows) > 1:
            rows.append(("all together", *self._words(self.together), "-"))
        lines: list[Part] = [
            f"gains chosen for {len(self.drawn.cases)} models drawn from study "
            f"{self.drawn.study!r}, judged by {self.judged.models} others",
            text_table(["of other models", "met by", "probability", told, "worst"], rows),
        ]
        if self.judged.unstable:
            lines.append(
                f"{self.judged.unstable} of them are unstable, or do not exist: they "
                "count as missing every requirement"
            )
        if self.drawn.lacking:
            lines.append(f"{self.drawn.lacking} more that were drawn for the gains do not exist")
        return [*lines, self.verdict] if self.wanted is not None else lines

    @property
    def verdict(self) -> str:
        """Whether all requirements are met as probably as wanted, in words."""
        wanted = "" if self.wanted is None else f" with {100.0 * self.wanted:.10g} %"
        return f"all requirements{wanted}: {self.outcome or 'no probability is wanted'}"

    def _words(self, told: Share) -> tuple[str, str, str]:
        return (
            f"{told.count} of {told.cases}",
            percent(told.value, told),
            f"{percent(told.low, told)} to {percent(told.high, told)}",
        )

    def data(self) -> dict[str, Any]:
        """Return everything as plain data."""

        def said(told: Share) -> dict[str, Any]:
            return {
                "met": told.count,
                "probability": told.value,
                "low": told.low,
                "high": told.high,
            }

        return {
            "study": self.drawn.study,
            "designed_for": len(self.drawn.cases),
            "lacking": self.drawn.lacking,
            "judged_by": self.judged.models,
            "unstable": self.judged.unstable,
            "wanted": self.wanted,
            "outcome": self.outcome,
            "all": said(self.together),
            "requirements": [
                {"requirement": str(wanted), "worst": worst, **said(self._share(count))}
                for wanted, count, worst in zip(
                    self.requirements, self.judged.met, self.judged.worst, strict=True
                )
            ],
        }


def drawn_models(case: LoopCase, file: str | Path, count: int) -> DrawnModels:
    """Return models of a loop whose parameters vary as in a study file.

    What the study says of cases, requirements and its bench's experiment does not count.

    Parameters
    ----------
    case
        The loop, its parameters and operating point.
    file
        Study file; shares in it are of what its own bench has.
    count
        Models that gains are chosen for.

    Raises
    ------
    InputError
        For a study file that does not fit the loop, a count that is not valid, and models of
        which none exists.
    """
    if not 1 <= count <= _MOST:
        raise ParameterError(f"drawn = {count} is not valid: 1 to {_MOST} models")
    plan = replace(read_study(file), design="monte-carlo")
    _require_fitting(case, plan, file)
    columns = [plan.values(chunk) for chunk in range(-(-(count + _JUDGES) // CHUNK))]
    models = [
        _model(case, {name: column[k].item() for name, column in values.items()}, number)
        for number, (values, k) in enumerate(
            ((values, k) for values in columns for k in range(CHUNK)), 1
        )
    ]
    designed = tuple(each for each in models[:count] if each is not None)
    if not designed:
        raise ParameterError(f"{file}: none of {count} models drawn of it exists")
    judges = tuple(models[count : count + _JUDGES])
    return DrawnModels(plan.name, designed, count - len(designed), judges, plan.confidence)


def probability_of(
    drawn: DrawnModels,
    requirements: Sequence[Limit],
    gains: Mapping[str, float],
    wanted: str,
    progress: Progress | None,
) -> Probability:
    """Return how probably gains meet requirements over the models that judge."""
    judged = judged_over(drawn.judges, requirements, gains, progress or silent)
    return Probability(drawn, tuple(requirements), judged, probability_wanted(wanted))


def probability_wanted(text: str) -> float | None:
    """Return the probability that is wanted; None for an empty text.

    Raises
    ------
    ParameterError
        For what is no probability between 0 and 1.
    """
    if not text:
        return None
    wanted = parse(text, "1", "probability")
    if not 0.0 < wanted < 1.0:
        raise ParameterError(f"probability = {quoted(text)} must lie between 0 and 100 %")
    return wanted


def _require_fitting(case: LoopCase, plan: StudyPlan, file: str | Path) -> None:
    if type(plan.bench.par) is not type(case.par):
        raise ParameterError(
            f"{file}: its bench is of {plan.bench.system}, and loop {case.loop.name!r} of another "
            "brake: name a study of this one"
        )
    for name in (name for v in plan.varied for name in (v.name, *v.together)):
        if name.startswith(OPTION):
            raise ParameterError(
                f"{file}: {name} is an option of the experiment, which the loop does not have: "
                "leave it out"
            )
        require_given(case.loop, name)


def _model(case: LoopCase, values: Mapping[str, Any], number: int) -> LinearCase | None:
    try:
        return existing_case(case.loop, f"drawn model {number}", case.par, values, case.value)
    except InputError:
        return None
