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
from bywire.api.design_parts import Part, judged_on, verdict_text
from bywire.api.design_probability import (
    BenchProbability,
    Probability,
    bench_probability,
    drawn_models,
    read_probability,
    require_drawn,
    require_no_probability,
)
from bywire.api.linear_texts import corner_notes
from bywire.api.loop_case import LoopCase, loop_case, over_range, spread
from bywire.bench.bench import Bench
from bywire.bench.requirements import Limit
from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.parameters import leaf_fields
from bywire.core.typing import Progress, silent
from bywire.core.units import shown
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
from bywire.studies.statistics import Outcome
from bywire.synthesis import designer
from bywire.synthesis.linear_case import cases_of, read
from bywire.synthesis.outcome import (
    Across,
    Design,
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

# --- Inputs of a design

Spans = Mapping[str, tuple[float, float]]


def requirements_of(file: str | Path | None, texts: Sequence[str]) -> tuple[Limit, ...]:
    """Return the requirements of a file and of strings such as ``"bandwidth >= 10 Hz"``."""
    given = _from_file(None if file is None else Path(file))
    return read([*given, *texts], has_probabilities=True)


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
    def outcomes(self) -> Mapping[str, Outcome]:
        """Verdicts over distributions by requirement; empty if none has a probability."""
        return {}

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
        loop = self.case.loop
        parts = [*self.parts(), *design_parts.limit_lines(self.case, self.limits)]
        verdict = self._verdict()
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

    def _verdict(self) -> str:
        if self.tried is None:
            return f"requirements {self.linear.status} on the linear model"
        return verdict_text((*self.requirements, *self._missed_floors(self.tried)), self.tried)

    def _brief(self, parts: Sequence[Part], verdict: str) -> list[str | Block]:
        """Return verdict, requirements and gains. The rest needs ``--verbose``."""
        table = design_parts.requirement_table(
            self.requirements, self.worst, self.tried, self.outcomes
        )
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
    on_bench
        Requirements over the same distributions on the nonlinear bench, or None without this test.
    """

    designed: Design
    probability: Probability | None = None
    on_bench: BenchProbability | None = None

    @property
    def outcomes(self) -> Mapping[str, Outcome]:
        """Verdicts over distributions by requirement; the bench decides if it has the figure."""
        linear = {} if self.probability is None else self.probability.outcomes
        return {**linear, **({} if self.on_bench is None else self.on_bench.outcomes)}

    @property
    def holds(self) -> bool:
        """Whether requirements are met, also on the bench and with the required probabilities."""
        joint = None if self.probability is None else self.probability.outcome
        return super().holds and joint in (None, "met") and set(self.outcomes.values()) <= {"met"}

    def _verdict(self) -> str:
        missed = [each for each in self.outcomes.values() if each != "met"]
        if not super().holds or not missed:
            return super()._verdict()
        return f"requirements: {len(missed)} of {len(self.outcomes)} not met over the distributions"

    def _remarks(self) -> list[str]:
        if self.holds or not super().holds or self.probability is None:
            return super()._remarks()
        joint = self.probability.outcome in (None, "met")
        remarks = [] if joint else [self.probability.verdict]
        missed = [text for text, outcome in self.outcomes.items() if outcome != "met"]
        measured = {} if self.on_bench is None else self.on_bench.outcomes
        remarks += [
            self.on_bench.remark(text, self.probability)
            if self.on_bench is not None and text in measured
            else self.probability.remark(text)
            for text in missed
        ]
        return remarks

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
        return [*parts, *self._over_distributions]

    @cached_property
    def _over_distributions(self) -> Sequence[Part]:
        both = (self.probability, self.on_bench)
        return [part for each in both if each is not None for part in each.parts()]

    def worst(self, figure: str) -> float:
        """Return the worst value of a figure on the linear model."""
        return self.designed.worst[figure][0]

    def first_parts(self, parts: Sequence[Part]) -> list[Part]:
        """Also return the probabilities over drawn models."""
        first = super().first_parts(parts)
        count = len(self._over_distributions)
        end = len(parts) - len(design_parts.limit_lines(self.case, self.limits))
        return [*first, *parts[end - count : end]]

    def data(self) -> dict[str, Any]:
        """Return all results as plain data."""
        data = design_parts.as_object(self.case, self.requirements, self.designed, self.tried)
        if self.probability is not None:
            data["drawn"] = self.probability.data()
        if self.on_bench is not None:
            data["drawn"]["bench"] = self.on_bench.data()
        return data


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
    least = read_probability(probability)
    require_drawn(wanted, probability, vary)
    case, overrides, limits = _for_ecu(case, overrides, free_derivative)
    tunables = _left_to_choose(case.loop.name, _narrowed(_tunables_of(case), limits), overrides)
    ranges = dict(over_range(text, case)[::2] for text in over)
    models = drawn_models(case, vary, drawn, wanted, least) if vary else None
    cases = cases_of(case.loop, case.par, case.value, ranges)
    cases += () if models is None else models.cases
    trial = None if amplitudes is None else _trial_of(case, overrides, amplitudes)
    start = {name: case.par.leaves()[name] for name in tunables}
    tried = None
    designed = designer.design(tunables, wanted, cases, start, seed=seed, progress=progress)
    if trial is not None and designed.status == "met":
        tried = verify(designed.gains, wanted, tunables, cases, trial, seed=seed, progress=progress)
    judged = on_bench = None
    if models is not None:
        gains = designed.gains if tried is None else tried.final.gains
        met = judged_over(models.judges, wanted, gains, progress or silent)
        judged = Probability(models, wanted, met, least)
    if models is not None and trial is not None and tried is not None:
        on_bench = bench_probability(models, wanted, trial.bench, tried.final.gains, progress)
    return LoopDesign(case, overrides, wanted, limits, tried, designed, judged, on_bench)


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
    require_no_probability(wanted)
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
