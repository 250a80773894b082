"""A linear design on the nonlinear bench, and gains retuned there where it falls short."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from bywire.analysis.design.bench_figures import BenchFigures, bench_figures, has_step
from bywire.analysis.design.bench_tuning import (
    GENERATIONS,
    Candidate,
    Tuning,
    bench_slacks,
    linear_slacks,
    tune,
)
from bywire.analysis.design.linear_case import LinearCase
from bywire.analysis.design.optimizer import Problem, Progress
from bywire.analysis.design.requirement import FIGURES, Requirement
from bywire.analysis.loop import Loop
from bywire.bench.bench import Bench
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.running import run
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet


@dataclass(frozen=True)
class Verification:
    """What the nonlinear bench says of a design.

    Parameters
    ----------
    linear
        The linear design's gains there.
    tuning
        The search for better ones; None where the linear design's meet everything.
    kpis
        Key figures of the loop's experiment with the final gains.
    nominal
        All figures of the nominal linear model with the final gains.
    """

    linear: Candidate
    tuning: Tuning | None
    kpis: tuple[Kpi, ...]
    nominal: Mapping[str, float]

    @property
    def final(self) -> Candidate:
        """The gains to use."""
        return self.linear if self.tuning is None else self.tuning.best

    @property
    def met(self) -> bool:
        """Whether the final gains meet every requirement on the bench."""
        return self.final.slack >= 0.0

    def conflict(self) -> tuple[str, str, list[tuple[float, float]]] | None:
        """Return the two requirements that are worst off, and the edge between their slacks.

        None where everything is met, or only one requirement counts.
        """
        if self.met or self.tuning is None:
            return None
        order = sorted(self.final.slacks, key=lambda text: self.final.slacks[text])
        if len(order) < 2:
            return None
        one, other = order[:2]
        return one, other, self.tuning.curve(one, other)


@dataclass(frozen=True)
class Trial:
    """What a design is tried on.

    Parameters
    ----------
    loop, par, value
        Loop, parameters and operating point; nothing switched off.
    amplitudes
        Of the sines, SI.
    bench
        The loop's experiment with the same parameters; None where it has none.
    """

    loop: Loop
    par: ParameterSet
    value: float
    amplitudes: tuple[float, ...]
    bench: Bench | None

    def measure(
        self, gains: Mapping[str, Sequence[float]], target: float, *, rough: bool = False
    ) -> tuple[BenchFigures, ...]:
        """Return the figures of sets of gains, see `bench_figures`."""
        own = self.bench if self.bench is not None and has_step(self.bench) else None
        return bench_figures(
            self.loop, self.par, self.value, self.amplitudes, gains, own, target, rough=rough
        )  # fmt: skip


def verify(
    gains: Mapping[str, float],
    requirements: Sequence[Requirement],
    tunables: Mapping[str, tuple[float, float]],
    cases: Sequence[LinearCase],
    trial: Trial,
    *,
    seed: int = 0,
    generations: int = GENERATIONS,
    progress: Progress | None = None,
) -> Verification:
    """Try a design on the nonlinear bench, and retune there what falls short.

    Parameters
    ----------
    gains
        The linear design's.
    requirements, tunables, cases
        As in `designer.design`.
    trial
        What it is tried on.
    seed, generations
        Of the search, see `bench_tuning.tune`; no generation: only try.
    progress
        Called with a label and the finished share.

    Raises
    ------
    ParameterError
        When no amplitude is given.
    """
    if not trial.amplitudes:
        raise ParameterError(f"loop {trial.loop.name!r}: no amplitude is given to try it with")
    problem = Problem(tunables, tuple(requirements), tuple(cases))
    target = _target(requirements, cases[0], gains)
    if progress is not None:
        progress("trial on the bench", 0.0)

    def judged(own: Mapping[str, float]) -> Candidate:
        (found,) = trial.measure({name: [value] for name, value in own.items()}, target)
        slacks = bench_slacks(requirements, found, linear_slacks(problem, own))
        return Candidate(dict(own), found, slacks)

    first = judged(gains)
    if progress is not None:
        progress("trial on the bench", 1.0)
    tuning = None
    if first.slack < 0.0 and generations > 0:
        tuning = tune(
            problem, gains, lambda sets: trial.measure(sets, target, rough=True), seed=seed,
            generations=generations, progress=progress,
        )  # fmt: skip
        tuning = replace(tuning, best=judged(tuning.best.gains))
    final = gains if tuning is None else tuning.best.gains
    kpis: tuple[Kpi, ...] = ()
    if trial.bench is not None:
        kpis = run(trial.bench.with_overrides(dict(final))).kpis
    loop = cases[0].figures(final, 4000)
    nominal = {name: float(getattr(loop, name)) for name in FIGURES}
    return Verification(first, tuning, kpis, nominal)


def _target(
    requirements: Sequence[Requirement], case: LinearCase, gains: Mapping[str, float]
) -> float:
    """Return the frequency around which to measure: that required, or that of the linear loop."""
    for figure in ("bandwidth", "crossover"):
        wanted = [one.limit for one in requirements if one.figure == figure and one.sense > 0]
        if wanted:
            return wanted[0]
    return case.figures(gains).crossover
