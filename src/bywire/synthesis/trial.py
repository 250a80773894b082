"""What a design is tried on: the nonlinear bench at the nominal point, and at others beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from bywire.analysis.loop import Loop
from bywire.bench.bench import Bench
from bywire.core.parameters import ParameterSet
from bywire.synthesis.bench_figures import BenchFigures, bench_figures, has_step
from bywire.synthesis.linear_case import NOMINAL, LinearCase


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
    label
        What distinguishes it.
    """

    loop: Loop
    par: ParameterSet
    value: float
    amplitudes: tuple[float, ...]
    bench: Bench | None
    label: str = NOMINAL

    def at(self, case: LinearCase) -> Trial:
        """Return the trial of a model's own parameters and operating point.

        Its experiment is left out where the parameters are the same: so is then its outcome.
        """
        bench = None
        if self.bench is not None and case.changes:
            bench = self.bench.with_overrides(dict(case.changes))
        value = self.value if case.at is None else case.at
        par = self.par.replace(case.changes)
        return Trial(self.loop, par, value, self.amplitudes, bench, case.label)

    def measure(
        self, gains: Mapping[str, Sequence[float]], target: float, *, rough: bool = False
    ) -> tuple[BenchFigures, ...]:
        """Return the figures of sets of gains, see `bench_figures`."""
        own = self.bench if self.bench is not None and has_step(self.bench) else None
        return bench_figures(
            self.loop, self.par, self.value, self.amplitudes, gains, own, target, rough=rough
        )  # fmt: skip


def measured(
    trials: Sequence[Trial],
    gains: Mapping[str, Sequence[float]],
    target: float,
    *,
    rough: bool = False,
) -> list[dict[str, BenchFigures]]:
    """Return the figures of every set of gains, by the label of each trial."""
    found = [one.measure(gains, target, rough=rough) for one in trials]
    return [
        dict(zip((one.label for one in trials), row, strict=True))
        for row in zip(*found, strict=True)
    ]  # fmt: skip
