"""Gains of a loop from requirements: linear design, trial and retuning on the nonlinear bench."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.loop import LOOPS
from bywire.analysis.loop_curves import loop_curve
from bywire.analysis.margins import figures_at
from bywire.api import design_parts, schedule_parts
from bywire.api.design_drawn import (
    DRAWN,
    Probability,
    drawn_models,
    probability_of,
    probability_wanted,
)
from bywire.api.design_inputs import (
    Spans,
    for_ecu,
    left_to_choose,
    narrowed,
    requirements_of,
    trial_of,
    tunables_of,
)
from bywire.api.loop_case import LoopCase, loop_case, over_range, spread
from bywire.api.verification_parts import Part
from bywire.bench.running import Progress
from bywire.core.errors import ParameterError
from bywire.core.units import shown
from bywire.report.answer import Answer, use_case
from bywire.report.document import (
    Attachment,
    Banner,
    Document,
    FigureBlock,
    Listing,
    Section,
    TableBlock,
)
from bywire.synthesis import designer
from bywire.synthesis.linear_case import cases_of
from bywire.synthesis.outcome import Across, Design, ScheduleDesign, Status, bench_text
from bywire.synthesis.requirement import Requirement
from bywire.synthesis.schedule_designer import (
    design_schedule,
    frozen,
    points_by_region,
    scheduled,
)
from bywire.synthesis.schedule_verification import verify_schedule
from bywire.synthesis.verification import Verification, verify

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bywire.report.design_curves import DesignCurve

_STEPS, _SETTLED = 5.0, 1.2  # what is drawn of a step: periods of the bandwidth, settling times


@dataclass(frozen=True)
class DesignAnswer(Answer):
    """What designs of gains and of gain schedules have in common.

    Parameters
    ----------
    case
        The loop, its parameters before the design, and its operating point.
    overrides
        Parameters that were set beforehand.
    requirements
        What was required.
    limits
        Spans [SI] that were kept to so that an ECU can run the gains; none of ``free_derivative``.
    tried
        The design on the nonlinear bench; None where that was left out, or nothing is feasible.
    """

    case: LoopCase
    overrides: Mapping[str, Any]
    requirements: tuple[Requirement, ...]
    limits: Spans
    tried: Verification | None

    @property
    @abstractmethod
    def linear(self) -> Design | ScheduleDesign:
        """The design on the linear model."""

    @property
    @abstractmethod
    def points(self) -> str:
        """The operating points in words."""

    @abstractmethod
    def parts(self) -> Sequence[Part]:
        """Return tables and sentences of the result, in their order."""

    @abstractmethod
    def data(self) -> dict[str, Any]:
        """Return everything as plain data."""

    @property
    def gains(self) -> Mapping[str, float]:
        """The gains [SI] by dotted name: those of the bench where it retuned them."""
        return self.linear.gains if self.tried is None else self.tried.final.gains

    @property
    def status(self) -> Status:
        """``met``, ``infeasible`` or ``interrupted``."""
        tuning = None if self.tried is None else self.tried.tuning
        return "interrupted" if tuning is not None and tuning.interrupted else self.linear.status

    @property
    def partial(self) -> str:
        """What an interrupted design still shows."""
        return "what is shown is the best until then"

    @property
    def holds(self) -> bool:
        """Whether the requirements are met, on the bench too where that was tried."""
        return self.linear.status == "met" and (self.tried is None or self.tried.met)

    def document(self) -> Document:
        """Return result, figures, and the gains as a bench file."""
        loop, status, tried = self.case.loop, self.linear.status, self.tried
        parts = [*self.parts(), *design_parts.limit_lines(self.case, self.limits)]
        state = status if status != "met" or tried is None or tried.met else "not met"
        where = "on the linear model" if tried is None else "on the nonlinear bench"
        required = Listing([requirement.text for requirement in self.requirements])
        return Document(
            f"Design of loop {loop.name}",
            self.case.subject.line,
            sections=lambda: [
                Section("Requirements", [required]),
                Section("Result", design_parts.as_blocks(parts)),
                Section("Figures", self._figures()),
                self.case.subject.provenance("Parameters as they were before the design."),
            ],
            brief=[part if isinstance(part, str) else TableBlock(part) for part in parts],
            data={**self.data(), "kept_for_the_ecu": {k: list(v) for k, v in self.limits.items()}},
            banner=Banner(f"requirements {state} {where}", "good" if self.holds else "bad"),
            attachments=[Attachment(f"{loop.name}-design.toml", self._write_bench)],
            remarks=self._remarks(),
        )

    def _remarks(self) -> list[str]:
        if self.status == "infeasible":
            return ["no gains meet the requirements together: see what excludes what"]
        if self.status == "met" and not self.holds:
            return ["the linear requirements are met, those on the nonlinear bench are not"]
        return []

    def _write_bench(self, path: Path) -> Path:
        """Write the gains as a bench file."""
        from bywire.report.files import write_bytes

        case, tried = self.case, self.tried
        state = self.linear.status if tried is None or tried.met else "not met on the bench"
        text = bench_text(
            f"loop {case.loop.name} at {case.loop.at.name} = {self.points}, requirements {state}",
            case.loop.proof, case.name, self.overrides, case.par, self.gains,
        )  # fmt: skip
        return write_bytes(path, text.encode())

    @cached_property
    def _curves(self) -> list[DesignCurve]:
        every: dict[str, Mapping[str, float]] = {
            "as given": {}, "linear design": self.linear.gains
        }  # fmt: skip
        if self.tried is not None and self.tried.tuning is not None:
            every["retuned on the bench"] = self.gains
        return [_curve(self.case, label, gains) for label, gains in every.items()]

    def _figures(self) -> list[FigureBlock]:
        limits = {(each.figure, each.sense): each.limit for each in self.requirements}
        captions = {
            "loop-gain": "Loop gain of the nominal linear model; phase margins as the spans in "
            "which they are read.",
            "sensitivity": "Sensitivity S = 1/(1 + L) and complementary sensitivity T = L/(1 + L), "
            "with the limits that are usually asked for (Skogestad and Postlethwaite, section "
            "2.4.3).",
            "step": "Unit step of the nominal linear model, at the sampling instants.",
        }
        return [
            FigureBlock(
                partial(self._draw, kind, limits), text, f"{self.case.loop.name}-design-{kind}"
            )
            for kind, text in captions.items()
        ]

    def _draw(self, kind: str, limits: Mapping[tuple[str, int], float]) -> Figure:
        from bywire.report.design_curves import loop_gains, sensitivities, steps

        if kind == "loop-gain":
            return loop_gains(self._curves, limits.get(("phase_margin", 1)))
        if kind == "sensitivity":
            return sensitivities(self._curves)
        return steps(self._curves, limits.get(("overshoot", -1)))


@dataclass(frozen=True)
class LoopDesign(DesignAnswer):
    """Gains of a loop from requirements.

    Parameters
    ----------
    designed
        The linear design.
    probability
        How probably its requirements are met over drawn models; None where none were drawn.
    """

    designed: Design
    probability: Probability | None = None

    @property
    def holds(self) -> bool:
        """Whether the requirements are met, on the bench too, and as probably as is wanted."""
        is_probable = self.probability is None or self.probability.outcome in (None, "met")
        return super().holds and is_probable

    @property
    def linear(self) -> Design:
        """The design on the linear model."""
        return self.designed

    @property
    def points(self) -> str:
        """The operating point in words."""
        return shown(self.case.value, self.case.loop.at.unit)

    def parts(self) -> Sequence[Part]:
        """Return tables and sentences of the result."""
        parts = design_parts.as_parts(self.case, self.requirements, self.designed, self.tried)
        return parts if self.probability is None else [*parts, *self.probability.parts()]

    def data(self) -> dict[str, Any]:
        """Return everything as plain data."""
        data = design_parts.as_object(self.case, self.requirements, self.designed, self.tried)
        return data | ({} if self.probability is None else {"drawn": self.probability.data()})


@dataclass(frozen=True)
class LoopScheduleDesign(DesignAnswer):
    """Gains of a loop by region; ``retuned`` is the loop across the regions with the bench's."""

    designed: ScheduleDesign
    retuned: tuple[Across, ...]

    @property
    def linear(self) -> ScheduleDesign:
        """The design on the linear model."""
        return self.designed

    @property
    def points(self) -> str:
        """The operating points in words."""
        unit = self.case.loop.at.unit
        return ", ".join(shown(v, unit) for values in self.designed.points.values() for v in values)

    def parts(self) -> Sequence[Part]:
        """Return tables and sentences of the result."""
        return schedule_parts.as_parts(self.case, self.designed, self.tried, self.retuned)

    def data(self) -> dict[str, Any]:
        """Return everything as plain data."""
        return schedule_parts.as_object(
            self.case, self.requirements, self.designed, self.tried, self.retuned
        )


@use_case
def design(
    loop: str,
    parameters: str = "",
    at: str = "",
    overrides: Mapping[str, Any] = MappingProxyType({}),
    *,
    require: Sequence[str] = (),
    requirements: str | Path | None = None,
    over: Sequence[str] = (),
    amplitudes: str = "",
    schedule: bool = False,
    linear_only: bool = False,
    free_derivative: bool = False,
    vary: str | Path = "",
    drawn: int = DRAWN,
    probability: str = "",
    seed: int = 0,
    progress: Progress | None = None,
) -> LoopDesign | LoopScheduleDesign:
    """Choose a loop's gains from requirements.

    Parameters
    ----------
    loop, parameters, at, overrides
        As of `bywire.margins`; parameters that are set are not chosen. With ``schedule``, ``at``
        lists points of all regions.
    require
        Requirements, for instance ``"bandwidth >= 10 Hz"``.
    requirements
        TOML file with a section ``requirements``.
    over
        Ranges to serve too, ``"NAME=LOW:HIGH:COUNT"`` each.
    amplitudes
        Of the sines on the bench, with units and commas; the loop's own by default.
    schedule
        Whether the gains are chosen by region.
    linear_only
        Whether the nonlinear bench is left out.
    free_derivative
        Whether the derivative's filter may be faster than the sampling and the set point be
        differentiated: better figures of gains that one would hardly put into an ECU.
    vary
        Study file: the gains are chosen for models that are drawn as its cases are, and judged by
        others.
    drawn
        How many models they are chosen for.
    probability
        With which all requirements are to be met together, for instance ``"99 %"``.
    seed
        Of the searches.
    progress
        Called with a label and the finished share, 0 to 1.

    Returns
    -------
    LoopDesign or LoopScheduleDesign
        Gains in SI units, the figures that they give, which requirement binds, and what the bench
        shows of them.

    Raises
    ------
    InputError
        For names that are unknown, values out of range, and requirements that make no sense.
    """
    if schedule and vary:
        raise ParameterError("schedule and vary: gains by region are not chosen for drawn models")
    if probability_wanted(probability) is not None and not vary:
        raise ParameterError("probability needs drawn models: name a study file, --vary FILE")
    if schedule:
        return _scheduled(
            loop, parameters, at, overrides, requirements_of(requirements, require), over,
            None if linear_only else amplitudes, free_derivative, seed, progress,
        )  # fmt: skip
    case = loop_case(loop, parameters, at, overrides)
    wanted = requirements_of(requirements, require)
    case, overrides, limits = for_ecu(case, overrides, free_derivative)
    tunables = left_to_choose(loop, narrowed(tunables_of(case), limits), overrides)
    ranges = dict(over_range(text, case)[::2] for text in over)
    models = drawn_models(case, vary, drawn) if vary else None
    cases = cases_of(case.loop, case.par, case.value, ranges)
    cases += () if models is None else models.cases
    trial = None if linear_only else trial_of(case, overrides, amplitudes)
    start = {name: case.par.leaves()[name] for name in tunables}
    tried = None
    designed = designer.design(tunables, wanted, cases, start, seed=seed, progress=progress)
    if trial is not None and designed.status == "met":
        tried = verify(designed.gains, wanted, tunables, cases, trial, seed=seed, progress=progress)
    final = designed.gains if tried is None else tried.final.gains
    told = None if models is None else probability_of(models, wanted, final, probability, progress)
    return LoopDesign(case, overrides, wanted, limits, tried, designed, told)


def _scheduled(
    name: str,
    parameters: str,
    at: str,
    overrides: Mapping[str, Any],
    wanted: tuple[Requirement, ...],
    over: Sequence[str],
    amplitudes: str | None,
    free_derivative: bool,
    seed: int,
    progress: Progress | None,
) -> LoopScheduleDesign:
    loop = LOOPS.find(name)
    schedule = scheduled(loop)
    overrides = {**overrides, **schedule.changes}
    case = loop_case(name, parameters, "", overrides)
    case, overrides, limits = for_ecu(case, overrides, free_derivative)
    given = spread(at, loop.at.unit, loop.at.name) if at else []
    points = points_by_region(loop, case.par, given)
    case = replace(case, value=points[schedule.main][0])
    tunables = {
        region: {n: span for n, span in narrowed(spans, limits).items() if n not in overrides}
        for region, spans in schedule.regions.items()
    }
    ranges = dict(over_range(text, case)[::2] for text in over)
    trial = None if amplitudes is None else trial_of(case, overrides, amplitudes)
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


def _curve(case: LoopCase, label: str, gains: Mapping[str, float]) -> DesignCurve:
    from bywire.report.design_curves import DesignCurve

    figures = figures_at(case.loop, case.par.replace(gains), case.value)
    step: NDArray[np.float64] = np.zeros(1)
    span = 0.0
    if figures.is_stable:
        step, settling = figures.step, figures.settling_time
        span = max(_STEPS / figures.bandwidth, _SETTLED * settling if settling < np.inf else 0.0)
    time = np.arange(step.size, dtype=float) * figures.closed.period
    return DesignCurve(label, loop_curve(case.loop, figures), time, step, span)
