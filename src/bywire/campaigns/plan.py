"""Plan of a campaign: maneuver, faults with onsets, criteria and residuals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from bywire.bench.bench import Bench
from bywire.bench.changes import split_options
from bywire.bench.computation import computation, files_identity
from bywire.bench.experiment import Case
from bywire.bench.faults.fault_section import AT_ZERO, Injection
from bywire.bench.faults.injected import taps_of, touched
from bywire.bench.faults.modes import Mode
from bywire.bench.step_choice import with_chosen_step
from bywire.campaigns.residual import Residual, first_time, least_of_the_last, missed_ticks
from bywire.cases.identity import as_json, digest_of
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import TimeConstant
from bywire.core.section import Name, Section
from bywire.core.signals import Signal
from bywire.core.typing import Array, Progress
from bywire.core.values import written
from bywire.core.version import __version__
from bywire.simulation.tapped import Tap
from bywire.studies.plan import CHUNK, StudyPlan, Varied
from bywire.studies.stated_error import probing_cases

Sense = Literal["above", "below", "above_healthy", "below_healthy", "below_share"]
SENSES: tuple[Sense, ...] = ("above", "below", "above_healthy", "below_healthy", "below_share")


class CriterionSection(Section):
    """Section ``[[criteria]]``, whose level is in its signal's unit."""

    name: Name
    signal: Any = ""
    lasting: TimeConstant = 0.0
    severity: str = ""
    above: Any = None
    below: Any = None
    above_healthy: Any = None
    below_healthy: Any = None
    below_share: Any = None


@dataclass(frozen=True)
class Criterion:
    """Criterion of a campaign: an effect that a fault must not have.

    Parameters
    ----------
    name
        Name in reports.
    signal
        Recorded signal that is judged.
    sense, level
        Forbidden side of a level [SI], of a distance from the fault-free run, or of a fraction of
        it. lasting
        Uninterrupted duration [s] of a violation.
    severity
        Severity class from the user, for example ``"S3"``.
    """

    name: str
    signal: str
    sense: Sense
    level: float
    lasting: float = 0.0
    severity: str = ""

    def excess(self, values: Array, healthy: Array) -> Array:
        """Return the excess of each row over the limit, shape (cases, rows)."""
        if self.sense == "above":
            return values - self.level
        if self.sense == "below":
            return self.level - values
        if self.sense == "above_healthy":
            return values - healthy - self.level
        if self.sense == "below_healthy":
            return healthy - values - self.level
        return np.asarray(self.level * healthy - values)

    def reached(self, values: Array, healthy: Array, time: Array, onset: Array) -> Array:
        """Return the time at which a violation has lasted long enough [s]; NaN if never."""
        dt = float(time[1] - time[0])
        rows = round(min(self.lasting, dt * time.size) / dt) + 1
        lasted = least_of_the_last(self.excess(values, healthy), rows)
        beyond = np.where(lasted > 0, 1.0, 0.0)
        return first_time(beyond, time, onset + self.lasting)


def criteria_of(
    sections: Sequence[CriterionSection], signals: Mapping[str, Signal]
) -> tuple[Criterion, ...]:
    """Return the criteria of a campaign.

    Parameters
    ----------
    sections
        Sections of the file.
    signals
        Signals that the model records.

    Raises
    ------
    InputError
        If a criterion is not valid.
    """
    criteria = tuple(_criterion(each, signals) for each in sections)
    names = [criterion.name for criterion in criteria]
    for name in names:
        if names.count(name) > 1:
            raise ParameterError(
                f"[[criteria]] {name!r} occurs twice. Rename one of them", name=name
            )
    return criteria


def _criterion(section: CriterionSection, signals: Mapping[str, Signal]) -> Criterion:
    name, signal = section.name, section.signal
    if not isinstance(signal, str) or signal not in signals:
        raise unknown_name(f"signal of criterion {name!r}", str(signal), signals)
    senses = [sense for sense in SENSES if sense in section.given]
    if len(senses) != 1:
        raise ParameterError(
            f"[[criteria]] {name!r} needs exactly one of {', '.join(SENSES)}, for example "
            'above_healthy = "5 bar"',
            name=name,
            valid=", ".join(SENSES),
        )
    (sense,) = senses
    unit = "1" if sense == "below_share" else signals[signal].unit
    level = written(getattr(section, sense), unit, f"criterion {name}.{sense}")
    return Criterion(name, signal, sense, level, section.lasting, section.severity)


# --- The plan

_LONG_AGO = -1e6  # s: before any run starts


@dataclass(frozen=True)
class Failing:
    """A fault of the campaign.

    Parameters
    ----------
    mode, value
        Failure mode, and its value [SI].
    is_present
        Whether the fault is present before the run starts. If so, times count from zero.
    latent
        Another undetected fault that is already present, or None.
    """

    mode: Mode
    value: float
    is_present: bool = False
    latent: Failing | None = None

    @property
    def name(self) -> str:
        """Name of the mode, and its value [SI] if the mode has one."""
        unit = "" if self.mode.unit == "1" else f" {self.mode.unit}"
        name = f"{self.mode.name} {self.value:.6g}{unit}" if self.mode.unit else self.mode.name
        return f"{name} after {self.latent.name}" if self.latent is not None else name

    def at(self, onset: float, seed: int) -> list[Injection]:
        """Return the fault from an onset [s] on, or from the start, with the latent one."""
        start = 0.0 if self.mode.corrupted == "drift" else _LONG_AGO  # a drift grows from its start
        begin = start if self.is_present else onset
        fault = Injection(self.mode, self.value, AT_ZERO.replace({"onset": begin}), seed)
        return [fault, *([] if self.latent is None else self.latent.at(onset, seed))]


@dataclass(frozen=True)
class Reaction:
    """Reaction to a detected fault: a fail-safe mode of the brake.

    Parameters
    ----------
    failing
        Mode of the reaction.
    delay
        Delay from detection to its effect [s].
    """

    failing: Failing
    delay: float


@dataclass(frozen=True)
class CampaignPlan:
    """Content of a campaign file.

    Parameters
    ----------
    name
        Name in reports.
    bench
        The maneuver.
    faults
        Faults, injected one at a time.
    onsets
        Times of the onset [s].
    criteria, residuals
        Criteria, and residuals that detect faults.
    varied, correlations
        Quantities that scatter from run to run; pairs of names -> correlation of their normal
        scores.
    healthy
        Number of fault-free runs: one half tunes thresholds, the other half judges them.
    false_alarms
        Fraction of fault-free runs in which a residual may exceed its threshold.
    seed
        Seed of scatter and noise.
    rates
        Failure rates by fault, or by its place.
    reaction
        Reaction to a detected fault, or None.
    """

    name: str
    bench: Bench
    faults: tuple[Failing, ...]
    onsets: tuple[float, ...]
    criteria: tuple[Criterion, ...]
    residuals: tuple[Residual, ...]
    varied: tuple[Varied, ...] = ()
    healthy: int = 64
    false_alarms: float = 0.01
    seed: int = 1
    correlations: Mapping[tuple[str, str], float] = field(default_factory=dict)
    rates: Mapping[str, float] = field(default_factory=dict)
    reaction: Reaction | None = None

    def with_step(self, progress: Progress | None = None) -> CampaignPlan:
        """Return the campaign with the step for the error that its bench states, if it states one.

        The key figures of fault-free runs decide: of the bench itself, and at the quantiles of the
        quantities that scatter.

        Raises
        ------
        StepError
            When no step meets the error.
        RunError
            When the bench fails.
        """
        study = StudyPlan(self.name, self.bench, self.varied, correlations=self.correlations)
        cases = probing_cases(study) if self.varied else ()
        bench = with_chosen_step(self.bench, cases, progress)
        return self if bench is self.bench else replace(self, bench=bench)

    @property
    def tuning(self) -> int:
        """Number of fault-free runs that tune thresholds: the first ones."""
        return self.healthy // 2

    @property
    def total(self) -> int:
        """Number of runs with a fault."""
        return len(self.faults) * len(self.onsets)

    def onsets_of(self, failing: Failing) -> tuple[float, ...]:
        """Return the start times for measuring a fault's times [s]."""
        return (0.0,) * len(self.onsets) if failing.is_present else self.onsets

    def sample_of(self, number: int) -> int:
        """Return the fault-free run that provides the scatter, excluding those for thresholds."""
        return self.tuning + number % (self.healthy - self.tuning)

    @cached_property
    def benches(self) -> tuple[Bench, ...]:
        """The bench of every fault-free run, with its scatter and its noise."""
        study = StudyPlan(
            self.name, self.bench, self.varied, seed=self.seed, correlations=self.correlations
        )
        drawn: dict[str, list[Any]] = {each.name: [] for each in self.varied}
        for chunk in range(-(-self.healthy // CHUNK)) if self.varied else ():
            for name, values in study.values(chunk).items():
                drawn.setdefault(name, []).extend(values.tolist())
        made = []
        for k in range(self.healthy):
            given = {name: column[k] for name, column in drawn.items()}
            parameters, options = split_options(given)
            made.append(self.bench.varied(parameters, options, self.bench.seed + k))
        return tuple(made)

    def case(self, sample: int) -> Case:
        """Return the fault-free run of a sample."""
        return self.benches[sample].cases()[0]

    @cached_property
    def taps(self) -> tuple[tuple[Tap, ...], tuple[str, ...]]:
        """Taps and resting tasks of the model that fault-free runs and most faults share."""
        answer = () if self.reaction is None else (self.reaction.failing,)
        shared = [each for each in (*self.faults, *answer) if not self.is_apart(each)]
        return taps_of([fault for each in shared for fault in each.at(0.0, 0)])

    @cached_property
    def _choices(self) -> Mapping[str, Any]:
        return self.case(0).par.choices()

    def is_apart(self, failing: Failing) -> bool:
        """Return whether a fault needs a separate model, because laws change or a drive is late."""
        if failing.latent is not None and self.is_apart(failing.latent):
            return True
        mode = failing.mode
        if mode.changes is None:
            return mode.corrupted == "late"
        par = self.case(0).par
        changed = mode.changes(par, failing.value)
        lengths = [name for name, value in changed.items() if isinstance(value, tuple)]
        return bool(lengths) or any(name in self._choices for name in changed)

    @cached_property
    def watched(self) -> tuple[Residual, ...]:
        """All residuals: the declared ones, and a watchdog of every task that can fail."""
        model, par = self.case(0).model, self.case(0).par
        tasks = {task.name: task.period for task in model.tasks(par)}
        dogs = [missed_ticks(name, model.name, tasks[name]) for name in self.taps[1]]
        return (*self.residuals, *dogs)

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """Recorded signals that criteria and residuals use."""
        wanted = [criterion.signal for criterion in self.criteria]
        wanted += [name for residual in self.residuals for name in residual.signals]
        return tuple(dict.fromkeys(wanted))

    def rate(self, failing: Failing) -> float:
        """Return the failure rate of a fault; by default that of its place, or 1."""
        mode = failing.mode
        return self.rates.get(mode.name, self.rates.get(mode.place, 1.0))

    @property
    def _functions(self) -> list[Any]:
        """Taps of its faults, and signals of its residuals."""
        return [*(each.mode.changes for each in self.faults), *self.residuals]

    @cached_property
    def digest(self) -> str:
        """Digest that identifies the campaign."""
        return digest_of(self.identity)

    @cached_property
    def identity(self) -> Mapping[str, Any]:
        """Everything that affects the figures of its runs."""
        bench, reaction = self.bench, self.reaction
        return as_json(
            {
                "version": __version__,
                "computed": computation(bench, beside=self._functions),
                "experiment": bench.experiment,
                "parameters": bench.par.flat(),
                "options": bench.chosen_options.flat(),
                **files_identity(bench),
                "stimulus": str(dict(bench.stimulus)),
                "step": None if math.isnan(bench.step) else bench.step,
                "record": bench.record,
                "noise": bench.seed,
                **({} if bench.error is None else {"error": float(bench.error)}),
                "varied": {v.name: [v.distribution.text, v.together] for v in self.varied},
                "correlation": {" and ".join(pair): r for pair, r in self.correlations.items()},
                "faults": [[each.name, each.value, each.is_present] for each in self.faults],
                "onsets": self.onsets,
                "criteria": [repr(each) for each in self.criteria],
                "residuals": [each.name for each in self.residuals],
                "healthy": self.healthy,
                "false_alarms": self.false_alarms,
                "seed": self.seed,
                "reaction": None
                if reaction is None
                else [reaction.failing.name, reaction.failing.value, reaction.delay],
            }
        )


def evenly(first: float, spread: float, count: int) -> tuple[float, ...]:
    """Return evenly spaced onsets over a span [s], without its end, since it may be a period."""
    return tuple(float(f"{first + k * spread / count:.12g}") for k in range(count))


def touch_alike(first: Failing, second: Failing, par: ParameterSet) -> bool:
    """Return whether two faults change the same value, so that they cannot both be present."""
    one, other = (touched(each.mode, each.value, par) for each in (first, second))
    return bool(one & other)
