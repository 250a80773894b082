"""Where the runs of a model's contracts start, and what excites them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bywire.analysis.loop import LOOPS
from bywire.bench.experiment import EXPERIMENTS
from bywire.core.errors import InputError, ParameterError
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of, zeros
from bywire.core.typing import Array
from bywire.simulation.run import Run

STEP = 20e-6
"""substep [s] of the runs, or the next smaller one that divides the sample times"""
ACTIVE = 0.2
"""time [s] of the one wave that excites a run; then the stimulus is what it was before"""
DURATION = 0.3


@dataclass(frozen=True)
class Start:
    """A model ready to run.

    Parameters
    ----------
    model, par
        The system and its parameters.
    state, memory, stimulus
        Where it starts, at rest if anybody says where that is.
    known
        Who says so, for instance ``"loop pressure"``.
    """

    model: Model
    par: ParameterSet
    state: NamedTuple
    memory: NamedTuple
    stimulus: NamedTuple
    known: str

    @property
    def period(self) -> float:
        """Sample time of the fastest task [s]."""
        return min(task.period for task in self.model.tasks(self.par))

    @property
    def step(self) -> float:
        """Substep [s]: at most `STEP`, and a whole number of them in every sample time."""
        periods = [task.period for task in self.model.tasks(self.par)]
        for count in range(int(np.ceil(self.period / STEP - 1e-9)), 100_000):
            step = self.period / count
            if all(abs(p / step - round(p / step)) < 1e-9 * p / step for p in periods):
                return step
        return self.period

    def run(self, share: float, duration: float = DURATION, record: float = 0.0) -> Run:
        """Return a run in which every signal of the stimulus swings once, within its range.

        Parameters
        ----------
        share
            Amplitude, of the signal's usual magnitude.
        record
            Recording interval [s]; the fastest sample time by default.
        """
        base = np.array([float(value) for value in self.stimulus])
        signals = signals_of(type(self.stimulus))
        reach = np.array([0.0 if n.startswith("noise_") else s.nominal for n, s in signals.items()])

        low = np.array([s.low for s in signals.values()])
        high = np.array([s.high for s in signals.values()])

        def stimulus(t: Array) -> Array:
            wave = np.where(t < ACTIVE, np.sin(2.0 * np.pi / ACTIVE * t), 0.0)
            return np.asarray(np.clip(base + share * wave[:, None] * reach, low, high))

        return Run(
            self.model,
            self.par,
            self.state,
            self.memory,
            stimulus,
            duration,
            self.step,
            record or self.period,
        )


def start_of(model: Model, par: ParameterSet) -> Start:
    """Return where the runs of a model with some parameters start.

    The operating point of one of its loops, or the start of one of its experiments, of the same
    choices where there is one; else its rest. A rest is often on a stop, where contacts just touch
    and little can be put to the test.
    """
    known = list(_points(model, par)) or list(_cases(model, par))
    same = [each for each in known if each.par.choices() == par.choices()]
    if known:
        return (same or known)[0]
    state, memory = model.rest(par)
    return Start(model, par, state, memory, zeros(model.Stimulus), "the model's rest")


def start_of_a_rig(model: Model, sets: Iterable[ParameterSet], module: str) -> Start:
    """Return where an experiment starts a model that has no parameter set of its own.

    Parameters
    ----------
    sets
        Parameters to try: those of the model's brake.
    module
        Module of that brake.

    Raises
    ------
    ParameterError
        When none does.
    """
    for par in sets:
        for start in _cases(model, par, module):
            return start
    raise ParameterError(
        f"there is no parameter set for a {model.name}, and no experiment starts one with those of "
        "its brake: declare a bywire.CitedSet of that assembly"
    )


def _points(model: Model, par: ParameterSet) -> Iterator[Start]:
    for loop in LOOPS.all().values():
        if loop.assembly == model.name:
            try:
                point = loop.point(par, loop.at.default)
            except InputError:  # a loop of other choices
                continue
            if type(point.model) is type(model):
                yield Start(
                    point.model,
                    point.par,
                    point.state,
                    point.memory,
                    point.stimulus,
                    f"the operating point of the loop {loop.name}",
                )


def _cases(model: Model, par: ParameterSet, module: str = "") -> Iterator[Start]:
    """Yield the starts of the experiments of a model, or of all experiments of a brake."""
    for experiment in (EXPERIMENTS.of(module) if module else EXPERIMENTS.all()).values():
        if not module and experiment.assembly != model.name:
            continue
        try:
            cases = (experiment.preview or experiment.cases)(par, experiment.defaults, None)
        except (InputError, AttributeError, TypeError):  # it wants other parameters, or a stimulus
            continue
        for case in cases:
            if type(case.model) is type(model):
                at = {n: float(v[0]) for n, v in case.stimulus(np.zeros(1)).items()}
                yield Start(
                    case.model,
                    case.par,
                    case.state,
                    case.memory,
                    zeros(case.model.Stimulus)._replace(**at),
                    f"the start of the experiment {experiment.name}",
                )
                break
