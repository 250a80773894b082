"""Design of gains or gain schedules from requirements, optionally for randomly drawn models."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.loop import LOOPS
from bywire.analysis.margins import NO_LOOP, figures_at, loop_curve
from bywire.api import design_parts
from bywire.api.design_parts import Part, figure_cell, judged_on, verdict_text
from bywire.api.linear_texts import corner_notes
from bywire.api.loop_case import LoopCase, loop_case, over_range, spread
from bywire.api.study_tables import percent
from bywire.bench.bench import Bench
from bywire.bench.changes import OPTION
from bywire.bench.requirements import Limit
from bywire.core.callers import option
from bywire.core.errors import InputError, ParameterError, not_valid, quoted
from bywire.core.parameters import leaf_fields
from bywire.core.typing import Progress, silent
from bywire.core.units import parse, shown
from bywire.data.toml_file import read_toml
from bywire.report.answer import Answer
from bywire.report.document import (
    Attachment,
    Banner,
    Block,
    Details,
    Document,
    FigureBlock,
    Listing,
    Paragraph,
    Section,
    TableBlock,
)
from bywire.report.tables import Cell, text_table
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.statistics import Outcome, Share, judged, share
from bywire.studies.study_file import read_study
from bywire.synthesis import designer
from bywire.synthesis.linear_case import LinearCase, cases_of, existing_case, read, require_given
from bywire.synthesis.outcome import (
    Across,
    Design,
    Judged,
    ScheduleDesign,
    Status,
    bench_text,
    judged_over,
)
from bywire.synthesis.schedules import (
    design_schedule,
    frozen,
    points_by_region,
    scheduled,
    verify_schedule,
)
from bywire.synthesis.verification import Trial, Verification, verify

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bywire.report.loop_curves import DesignCurve

_JUDGES = 512  # additional models for testing the gains
_MOST = 1000


@dataclass(frozen=True)
class DrawnModels:
    """Models drawn in the same way as a study draws its cases.

    Parameters
    ----------
    study
        Name of the study.
    cases
        Models for which bywire chooses the gains.
    lacking
        Number of draws for which no model exists, among those for choosing the gains.
    judges
        Additional models for testing the gains. None where no model exists.
    confidence
        Confidence level of intervals.
    """

    study: str
    cases: tuple[LinearCase, ...]
    lacking: int
    judges: tuple[LinearCase | None, ...]
    confidence: float


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

    def _share(self, count: int) -> Share:
        return share(count, self.judged.models, self.drawn.confidence)

    def parts(self) -> Sequence[Part]:
        """Return a table and text lines."""
        interval = f"{100.0 * self.drawn.confidence:g} % interval"
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
            f"{self.drawn.study!r}, and tested on {self.judged.models} other models",
            text_table(["of other models", "met by", "probability", interval, "worst"], rows),
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


def _drawn_models(case: LoopCase, file: str | Path, count: int) -> DrawnModels:
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

    Raises
    ------
    InputError
        If the study file does not fit the loop, the count is invalid, or no model exists.
    """
    if not 1 <= count <= _MOST:
        raise not_valid("drawn", f"{count}", f"1 to {_MOST} models")
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
        raise ParameterError(
            f"{file}: none of its {count} draws results in a valid model. Narrow its [vary] "
            "section",
            name=str(file),
            value=str(count),
        )
    judges = tuple(models[count : count + _JUDGES])
    return DrawnModels(plan.name, designed, count - len(designed), judges, plan.confidence)


def _probability(text: str) -> float | None:
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
            f"{file}: its bench runs {plan.bench.system}, but loop {case.loop.name!r} belongs to "
            f"{case.loop.assembly}. Choose a study of {case.loop.assembly}",
            name=str(file),
            value=plan.bench.system,
            valid=case.loop.assembly,
        )
    for name in (name for v in plan.varied for name in (v.name, *v.together)):
        if name.startswith(OPTION):
            raise ParameterError(
                f"{file}: {name} is an option of the experiment, but the loop has no such option. "
                "Remove it",
                name=name,
            )
        require_given(case.loop, name)


def _model(case: LoopCase, values: Mapping[str, Any], number: int) -> LinearCase | None:
    try:
        return existing_case(case.loop, f"drawn model {number}", case.par, values, case.value)
    except InputError:
        return None


# --- Inputs of a design

Spans = Mapping[str, tuple[float, float]]


def requirements_of(file: str | Path | None, texts: Sequence[str]) -> tuple[Limit, ...]:
    """Return the requirements of a file and of strings such as ``"bandwidth >= 10 Hz"``."""
    return read([*_from_file(None if file is None else Path(file)), *texts])


def _left_to_choose(
    loop: str, spans: Spans, changes: Mapping[str, Any]
) -> dict[str, tuple[float, float]]:
    """Return the gains to choose, except those that the user has set.

    Raises
    ------
    ParameterError
        If no gain is left.
    """
    if not spans:
        raise ParameterError(
            f"loop {loop!r} declares no gains to design. Choose another loop",
            name="loop",
            value=loop,
        )
    left = {name: span for name, span in spans.items() if name not in changes}
    if not left:
        raise ParameterError(
            f"{option('overrides')} fixes all gains ({', '.join(spans)}). Remove those that "
            "bywire should choose",
            name=option("overrides"),
            value=", ".join(spans),
        )
    return left


def _for_ecu(
    case: LoopCase, changes: Mapping[str, Any], free: bool
) -> tuple[LoopCase, dict[str, Any], Spans]:
    """Return a case, its changes, and the spans of gains that an ECU can implement.

    Parameters that the user has set have no span. If a parameter's span is a single value, the case
    gets this value, and the changes get it as a string with its unit. ``free`` removes all limits.
    """
    if free:
        return case, dict(changes), {}
    limits = {n: span for n, span in case.loop.realizable(case.par).items() if n not in changes}
    fixed = {name: low for name, (low, high) in limits.items() if low == high}
    units = leaf_fields(type(case.par))
    texts = {n: f"{v:.9g} {units[n].unit.symbol}".removesuffix(" 1") for n, v in fixed.items()}
    return replace(case, par=case.par.replace(fixed)), {**changes, **texts}, limits


def _narrowed(spans: Spans, limits: Spans) -> Spans:
    """Return the spans, replaced by limits where these exist."""
    return {name: limits.get(name, span) for name, span in spans.items()}


def _tunables_of(case: LoopCase) -> Spans:
    """Return the loop's tunables, or those of the region if a schedule is active."""
    schedule = case.loop.schedule
    if schedule is None or not schedule.is_on(case.par):
        return case.loop.tunables
    return schedule.regions[schedule.region(case.par, case.value)]


def _trial_of(case: LoopCase, changes: Mapping[str, Any], amplitudes: str) -> Trial:
    """Return the trial on the bench, with the sines' ``amplitudes`` as a string with units."""
    loop = case.loop
    sizes = spread(amplitudes, case.input_unit, "amplitudes") if amplitudes else loop.amplitudes[1:]
    bench = Bench(loop.proof, case.name, changes) if loop.proof else None
    return Trial(loop, case.par, case.value, tuple(sizes), bench)


def _from_file(path: Path | None) -> list[str]:
    """Read requirements from a TOML file: ``figure = "<= limit"``, or a list of limits."""
    if path is None:
        return []
    section = read_toml(path, "file of requirements").get("requirements")
    if not isinstance(section, dict) or not section:
        raise ParameterError(
            f'{path} needs a [requirements] section with lines such as bandwidth = ">= 10 Hz"',
            name="[requirements]",
        )
    wanted = []
    for figure, limits in section.items():
        for limit in limits if isinstance(limits, list) else [limits]:
            if not isinstance(limit, str):
                raise ParameterError(
                    f'{path}: {figure} = {limit} is not a string such as ">= 10 Hz"',
                    name=figure,
                    value=str(limit),
                    valid='a string such as ">= 10 Hz"',
                )
            wanted.append(f"{figure} {limit}")
    return wanted


# --- The answer

_STEPS, _SETTLED = 5.0, 1.2  # drawn length of a step, in bandwidth periods and settling times


@dataclass(frozen=True)
class DesignAnswer(Answer):
    """Common part of the designs of gains and of gain schedules.

    Parameters
    ----------
    case
        Loop, its parameters before the design, and its operating point.
    overrides
        Parameters that the user has set.
    requirements
        The requirements.
    limits
        Spans [SI] within which an ECU can implement the gains. Empty with ``free_derivative``.
    tried
        The design on the nonlinear bench, or None if it was skipped or no gains are feasible.
    """

    case: LoopCase
    overrides: Mapping[str, Any]
    requirements: tuple[Limit, ...]
    limits: Spans
    tried: Verification | None

    @property
    @abstractmethod
    def linear(self) -> Design | ScheduleDesign:
        """The design on the linear model."""

    @property
    @abstractmethod
    def points(self) -> str:
        """Operating points as text."""

    @abstractmethod
    def parts(self) -> Sequence[Part]:
        """Return the result's tables and text lines in their order."""

    @abstractmethod
    def data(self) -> dict[str, Any]:
        """Return all results as plain data."""

    @property
    def gains(self) -> Mapping[str, float]:
        """Gains [SI] by dotted name, retuned on the bench unless it was skipped."""
        return self.linear.gains if self.tried is None else self.tried.final.gains

    @property
    def status(self) -> Status:
        """``met``, ``infeasible`` or ``interrupted``."""
        tuning = None if self.tried is None else self.tried.tuning
        return "interrupted" if tuning is not None and tuning.interrupted else self.linear.status

    @property
    def notes(self) -> list[str]:
        """Notes on the side of a kink that the linear models use."""
        loop, par = self.case.loop, self.case.par.replace(self.gains)
        return corner_notes([loop.closed(par, self.case.value).corners])

    @property
    def partial(self) -> str:
        """Meaning of the result if the design was interrupted."""
        return "the result is the best so far"

    @property
    def holds(self) -> bool:
        """Whether the requirements are met, including on the bench unless it was skipped."""
        return self.linear.status == "met" and (self.tried is None or self.tried.met)

    def document(self) -> Document:
        """Return the result, the figures, and the gains as a bench file."""
        loop, status, tried = self.case.loop, self.linear.status, self.tried
        parts = [*self.parts(), *design_parts.limit_lines(self.case, self.limits)]
        verdict = f"requirements {status} on the linear model"
        if tried is not None:
            verdict = verdict_text((*self.requirements, *self._missed_floors(tried)), tried)
        required = Listing([str(requirement) for requirement in self.requirements])
        return Document(
            f"Design of loop {loop.name}",
            self.case.subject.line,
            sections=lambda: [
                Section("Requirements", [required]),
                Section("Result", design_parts.as_blocks(parts)),
                Section("Figures", self._figures()),
                self.case.subject.provenance("Parameters before the design."),
            ],
            brief=self._brief(parts, verdict),
            data={**self.data(), "kept_for_the_ecu": {k: list(v) for k, v in self.limits.items()}},
            banner=Banner(verdict, "good" if self.holds else "bad"),
            attachments=[Attachment(f"{loop.name}-design.toml", self._write_bench)],
            remarks=self._remarks(),
            changes=self.case.subject.changes,
        )

    def _brief(self, parts: Sequence[Part], verdict: str) -> list[str | Block]:
        """Return verdict, requirements and gains. The rest needs ``--verbose``."""
        table = design_parts.requirement_table(self.requirements, self.worst, self.tried)
        first = self.first_parts(parts)
        rest = [part for part in parts if not any(part is each for each in first)]
        point = f"loop {self.case.loop.name} of {self.case.name} at {self.points}: {verdict}"
        return [
            point,
            "",
            TableBlock(table),
            "",
            *design_parts.as_brief(first),
            Details("", design_parts.as_blocks(rest)),
        ]

    @abstractmethod
    def worst(self, figure: str) -> float:
        """Return the worst value of a figure on the linear model, or NaN if there is none."""

    def first_parts(self, parts: Sequence[Part]) -> list[Part]:
        """Return the gains, their limits, and the best values of conflicting requirements."""
        return [part for part in parts if design_parts.is_brief(part)]

    def _remarks(self) -> list[str]:
        if self.status == "infeasible":
            return [
                "no gains meet all requirements together. The lines above show the best achievable "
                "values"
            ]
        if self.tried is not None and not self.tried.met:
            final = self.tried.final
            missed = [text for text, slack in final.slacks.items() if slack < 0.0]
            texts = ", ".join(f"{text} ({judged_on(final, text)})" for text in missed)
            return [
                "the gains meet all requirements in the linear model, but not on the bench: "
                f"{texts}"
            ]
        return []

    @staticmethod
    def _missed_floors(tried: Verification) -> list[Limit]:
        """Return the enforced figures that the gains miss, which count in the verdict."""
        return [each for each in tried.kept if tried.final.slacks[str(each)] < 0.0]

    def _write_bench(self, path: Path) -> Path:
        """Write the gains to a bench file."""
        from bywire.report.drawing import write_bytes

        case, tried = self.case, self.tried
        state = self.linear.status if tried is None or tried.met else "not met"
        text = bench_text(
            f"loop {case.loop.name} at {case.loop.at.name} = {self.points}, requirements {state}",
            case.loop.proof,
            case.name,
            self.overrides,
            case.par,
            self.gains,
        )
        return write_bytes(path, text.encode())

    @cached_property
    def _curves(self) -> list[DesignCurve]:
        every: dict[str, Mapping[str, float]] = {"as given": {}, "linear design": self.linear.gains}
        if self.tried is not None and self.tried.tuning is not None:
            every["retuned on the bench"] = self.gains
        curves = [_curve(self.case, label, gains) for label, gains in every.items()]
        return [each for each in curves if each.curve.margins.has_loop]

    def _figures(self) -> list[Block]:
        if not self._curves:
            return [Paragraph(f"{NO_LOOP}.")]
        limits = {(each.figure, each.is_upper): each.bound for each in self.requirements}
        captions = {
            "loop-gain": "Loop gain of the nominal linear model. Spans show the phase margins.",
            "sensitivity": "Sensitivity S = 1/(1 + L) and complementary sensitivity T = L/(1 + L), "
            "with the usual limits (Skogestad and Postlethwaite, section 2.4.3).",
            "step": "Unit step response of the nominal linear model at the sampling instants.",
        }
        return [
            FigureBlock(
                partial(self._draw, kind, limits), text, f"{self.case.loop.name}-design-{kind}"
            )
            for kind, text in captions.items()
        ]

    def _draw(self, kind: str, limits: Mapping[tuple[str, bool], float]) -> Figure:
        from bywire.report.loop_curves import loop_gains, sensitivities, steps

        if kind == "loop-gain":
            return loop_gains(self._curves, limits.get(("phase_margin", False)))
        if kind == "sensitivity":
            return sensitivities(self._curves)
        return steps(self._curves, limits.get(("overshoot", True)))


@dataclass(frozen=True)
class LoopDesign(DesignAnswer):
    """Gains of a loop, designed to meet requirements.

    Parameters
    ----------
    designed
        The linear design.
    probability
        Probability of meeting the requirements over drawn models, or None without them.
    """

    designed: Design
    probability: Probability | None = None

    @property
    def holds(self) -> bool:
        """Whether requirements are met, also on the bench and with the required probability."""
        is_probable = self.probability is None or self.probability.outcome in (None, "met")
        return super().holds and is_probable

    def _remarks(self) -> list[str]:
        if self.holds or not super().holds or self.probability is None:
            return super()._remarks()
        return [self.probability.verdict]

    @property
    def linear(self) -> Design:
        """The design on the linear model."""
        return self.designed

    @property
    def points(self) -> str:
        """Operating point as text."""
        return shown(self.case.value, self.case.loop.at.unit)

    def parts(self) -> Sequence[Part]:
        """Return the result's tables and text lines."""
        parts = design_parts.as_parts(self.case, self.requirements, self.designed, self.tried)
        return parts if self.probability is None else [*parts, *self.probability.parts()]

    def worst(self, figure: str) -> float:
        """Return the worst value of a figure on the linear model."""
        return self.designed.worst[figure][0]

    def first_parts(self, parts: Sequence[Part]) -> list[Part]:
        """Also return the probabilities over drawn models."""
        first = super().first_parts(parts)
        count = 0 if self.probability is None else len(self.probability.parts())
        end = len(parts) - len(design_parts.limit_lines(self.case, self.limits))
        return [*first, *parts[end - count : end]]

    def data(self) -> dict[str, Any]:
        """Return all results as plain data."""
        data = design_parts.as_object(self.case, self.requirements, self.designed, self.tried)
        return data | ({} if self.probability is None else {"drawn": self.probability.data()})


@dataclass(frozen=True)
class LoopScheduleDesign(DesignAnswer):
    """Gains of a loop by region. ``retuned`` is the loop across regions with the bench's gains."""

    designed: ScheduleDesign
    retuned: tuple[Across, ...]

    @property
    def linear(self) -> ScheduleDesign:
        """The design on the linear model."""
        return self.designed

    def worst(self, figure: str) -> float:
        """Return the value of a figure at the worst point on the linear model."""
        return float(self.designed.worst.figures.get(figure, math.nan))

    @property
    def points(self) -> str:
        """Operating points as text."""
        unit = self.case.loop.at.unit
        return ", ".join(shown(v, unit) for values in self.designed.points.values() for v in values)

    def parts(self) -> Sequence[Part]:
        """Return the result's tables and text lines."""
        return design_parts.schedule_as_parts(self.case, self.designed, self.tried, self.retuned)

    def data(self) -> dict[str, Any]:
        """Return all results as plain data."""
        return design_parts.schedule_as_object(
            self.case, self.requirements, self.designed, self.tried, self.retuned
        )


def _curve(case: LoopCase, label: str, gains: Mapping[str, float]) -> DesignCurve:
    from bywire.report.loop_curves import DesignCurve

    figures = figures_at(case.loop, case.par.replace(gains), case.value)
    step: NDArray[np.float64] = np.zeros(1)
    span, period = 0.0, figures.closed.period
    if figures.is_stable and figures.has_loop:
        step, settling = figures.step, figures.settling_time
        usual = _STEPS / figures.bandwidth if figures.bandwidth > 0.0 else step.size * period
        span = max(usual, _SETTLED * settling if settling < np.inf else 0.0)
    time = np.arange(step.size, dtype=float) * period
    return DesignCurve(label, loop_curve(case.loop, figures), time, step, span)


# --- The design


def designed_at_point(
    case: LoopCase,
    overrides: Mapping[str, Any],
    wanted: tuple[Limit, ...],
    over: Sequence[str],
    amplitudes: str | None,
    free_derivative: bool,
    vary: str | Path,
    drawn: int,
    probability: str,
    seed: int,
    progress: Progress | None,
) -> LoopDesign:
    """Design a loop's gains at its operating point, over ranges, and for drawn models.

    ``wanted`` are the requirements. ``amplitudes`` is None without the nonlinear bench. For others,
    see `bywire.design`.
    """
    least = _probability(probability)
    if least is not None and not vary:
        raise ParameterError(
            f"{option('probability')} needs drawn models. Add {option('vary')} FILE with a study "
            "file",
            name="probability",
            value=probability,
            valid=option("vary"),
        )
    case, overrides, limits = _for_ecu(case, overrides, free_derivative)
    tunables = _left_to_choose(case.loop.name, _narrowed(_tunables_of(case), limits), overrides)
    ranges = dict(over_range(text, case)[::2] for text in over)
    models = _drawn_models(case, vary, drawn) if vary else None
    cases = cases_of(case.loop, case.par, case.value, ranges)
    cases += () if models is None else models.cases
    trial = None if amplitudes is None else _trial_of(case, overrides, amplitudes)
    start = {name: case.par.leaves()[name] for name in tunables}
    tried = None
    designed = designer.design(tunables, wanted, cases, start, seed=seed, progress=progress)
    if trial is not None and designed.status == "met":
        tried = verify(designed.gains, wanted, tunables, cases, trial, seed=seed, progress=progress)
    judged = None
    if models is not None:
        gains = designed.gains if tried is None else tried.final.gains
        met = judged_over(models.judges, wanted, gains, progress or silent)
        judged = Probability(models, wanted, met, least)
    return LoopDesign(case, overrides, wanted, limits, tried, designed, judged)


def designed_by_region(
    name: str,
    parameters: str,
    at: str,
    overrides: Mapping[str, Any],
    wanted: tuple[Limit, ...],
    over: Sequence[str],
    amplitudes: str | None,
    free_derivative: bool,
    seed: int,
    progress: Progress | None,
    side: str,
) -> LoopScheduleDesign:
    """Design gains for each region of the operating point.

    ``wanted`` are the requirements. ``amplitudes`` is None without the nonlinear bench. For others,
    see `bywire.design`.
    """
    schedule = scheduled(LOOPS.find(name))
    overrides = {**overrides, **schedule.changes}
    case = loop_case(name, parameters, "", overrides, side)
    loop = case.loop
    case, overrides, limits = _for_ecu(case, overrides, free_derivative)
    given = spread(at, loop.at.unit, loop.at.name) if at else []
    points = points_by_region(loop, case.par, given)
    case = replace(case, value=points[schedule.main][0])
    tunables = {
        region: {n: span for n, span in _narrowed(spans, limits).items() if n not in overrides}
        for region, spans in schedule.regions.items()
    }
    ranges = dict(over_range(text, case)[::2] for text in over)
    trial = None if amplitudes is None else _trial_of(case, overrides, amplitudes)
    tried = None
    designed = design_schedule(
        loop, case.par, wanted, points, tunables, over=ranges, seed=seed, progress=progress
    )
    if trial is not None and designed.status == "met":
        tried = verify_schedule(designed, wanted, tunables, trial, seed=seed, progress=progress)
    retuned: tuple[Across, ...] = ()
    if tried is not None and tried.tuning is not None:
        every = [value for values in points.values() for value in values]
        retuned = frozen(loop, case.par, every, tried.final.gains, wanted)
    return LoopScheduleDesign(case, overrides, wanted, limits, tried, designed, retuned)
