"""Trial of a model with a parameter set: the start of its runs, and their shared results."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Annotated, Any, NamedTuple

import casadi as ca
import numpy as np

from bywire.analysis.loop import LOOPS
from bywire.bench.experiment import EXPERIMENTS
from bywire.contracts.evidence import NotCheckedError, Place, place_of
from bywire.core.errors import BywireError, InputError, ParameterError, RunError
from bywire.core.model import Bounds, Model, Task, Wrapping
from bywire.core.parameters import ParameterSet
from bywire.core.signals import Signal, signals_of, zeros
from bywire.core.typing import Array
from bywire.simulation.engine import prepare
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.run import Run, Trajectory, simulate

STEP = 20e-6
"""substep [s] of the runs, or the next smaller value that divides the sample times"""
ACTIVE = 0.2
"""duration [s] of the single wave that excites a run, after which the stimulus is constant"""
DURATION = 0.3


@dataclass(frozen=True)
class Start:
    """Model with its parameters and the start of its runs.

    Parameters
    ----------
    model, par
        The system and its parameters.
    state, memory, stimulus
        Initial values of a run, at rest if the model declares a rest.
    known
        Source of the start, for example ``"loop pressure"``.
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
        """Substep [s]: at most `STEP`, and a divisor of each sample time."""
        periods = [task.period for task in self.model.tasks(self.par)]
        for count in range(int(np.ceil(self.period / STEP - 1e-9)), 100_000):
            step = self.period / count
            if all(abs(p / step - round(p / step)) < 1e-9 * p / step for p in periods):
                return step
        return self.period

    def run(self, share: float, duration: float = DURATION, record: float = 0.0) -> Run:
        """Return a run in which each signal of the stimulus makes one wave within its range.

        Parameters
        ----------
        share
            Amplitude, relative to the signal's usual magnitude.
        record
            Recording interval [s]. Default: the fastest sample time.
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
    """Return the start of a model's runs for a parameter set.

    The start is an operating point of one of the model's loops, or the start of an experiment, with
    the same choices if possible. Otherwise, it is the model's rest. This is often at an end stop,
    where contacts just touch and only a few contracts can be checked.
    """
    known = list(_points(model, par)) or list(_cases(model, par))
    same = [each for each in known if each.par.choices() == par.choices()]
    if known:
        return (same or known)[0]
    state, memory = model.rest(par)
    return Start(model, par, state, memory, zeros(model.Stimulus), "the model's rest")


def start_of_a_rig(model: Model, sets: Iterable[ParameterSet], module: str) -> Start:
    """Return the start of a model without a parameter set, from an experiment.

    Parameters
    ----------
    sets
        Parameter sets of the model's brake, which the function tries.
    module
        Module of the brake.

    Raises
    ------
    ParameterError
        When no experiment can start the model.
    """
    for par in sets:
        for start in _cases(model, par, module):
            return start
    raise ParameterError(
        f"there is no parameter set for a {model.name}, and no experiment starts it with a "
        "parameter set of its brake. Declare a bywire.CitedSet for this assembly",
        name=model.name,
    )


def _points(model: Model, par: ParameterSet) -> Iterator[Start]:
    for loop in LOOPS.all().values():
        if loop.is_in(model.name):
            try:
                point = loop.point(par, loop.at.default)
            except InputError:  # the loop is for other choices
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
        if not module and not experiment.tests(model.name):
            continue
        try:
            cases = (experiment.preview or experiment.cases)(par, experiment.defaults, None)
        except (
            InputError,
            AttributeError,
            TypeError,
        ):  # the experiment needs other parameters, or a stimulus
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


# --- Wrapped models that record all states and memory, or run only the plant with given memory


class Clock(NamedTuple):
    """Integral of a wrapped model."""

    t: Annotated[float, Signal("s", "time")]


@cache
def _recorded(model: type[Model], state: type[NamedTuple], memory: type[NamedTuple]) -> Any:
    """Return the signal tuple of all states, then of the whole memory."""
    fields = {f"x_{name}": signal for name, signal in signals_of(state).items()}
    fields |= {f"m_{name}": signal for name, signal in signals_of(memory).items()}
    annotated: list[Any] = [(name, Annotated[float, signal]) for name, signal in fields.items()]
    return NamedTuple("Recorded", annotated)


class Probe(Wrapping):
    """Model that records its states and memory, but no energies.

    Parameters
    ----------
    model
        The model.
    held
        Whether the stimulus is the memory, so that the plant runs without controllers.
    frictions
        Whether to include dry friction.
    """

    def __init__(self, model: Model, held: bool, frictions: bool = True) -> None:
        super().__init__(model)
        self.held, self.rubs = held, frictions

    @property
    def Stimulus(self) -> type[NamedTuple]:
        """Stimulus of the model, or the memory."""
        return self.inner.Memory if self.held else self.inner.Stimulus

    @property
    def Flow(self) -> type[NamedTuple]:
        """Integrals, which contain only time."""
        return Clock

    @property
    def Output(self) -> type[NamedTuple]:
        """All states and the whole memory."""
        output: type[NamedTuple] = _recorded(type(self.inner), self.State, self.Memory)
        return output

    @property
    def frictions(self) -> tuple[str, ...]:
        """Frictions of the model, or none."""
        return self.inner.frictions if self.rubs else ()

    def tasks(self, par: Any) -> tuple[Task, ...]:
        """Return the controllers, or a task that sets the prescribed memory."""
        tasks = self.inner.tasks(par)
        if not self.held:
            return tasks
        return (Task("prescribed", min(task.period for task in tasks), self._prescribed),)

    def _prescribed(self, x: Any, m: Any, u: Any, par: Any) -> Any:
        return u

    def bounds(
        self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return the bounds of the frictions; empty without frictions."""
        return super().bounds(x, xe, memory, par, contact) if self.rubs else ()

    def powers(self, *_: Any) -> Any:
        """Return the rate of time."""
        return Clock(1.0)

    def output(self, x: Any, memory: Any, *_: Any) -> Any:
        """Return all states and the whole memory."""
        return self.Output(*x, *memory)


@dataclass(frozen=True, eq=False)
class Drive:
    """Memory that the controllers write in a run, to prescribe it in other runs.

    Parameters
    ----------
    start
        Start of the run.
    rows
        Difference between the memory and its initial value at each sample time, shape (samples,
        memories).
    """

    start: Start
    rows: Array

    def run(self, share: float = 1.0, step: float = 0.0, frictions: bool = True) -> Run:
        """Return a run of only the plant.

        Parameters
        ----------
        share
            Factor for the memory's changes.
        step
            Substep [s]. Default: the start's.
        frictions
            Whether to include dry friction.
        """
        memory = np.array([float(value) for value in self.start.memory])
        rows = memory + share * self.rows
        period, at = self.start.period, self.start

        def prescribed(t: Array) -> Array:
            row = np.rint(t / period).astype(int)
            return np.asarray(rows[np.minimum(row, len(rows) - 1)])

        return Run(
            Probe(at.model, held=True, frictions=frictions),
            at.par,
            at.state,
            at.memory,
            prescribed,
            (len(rows) - 1) * period,
            step or at.step,
            period,
        )


def drive_of(start: Start, share: float) -> Drive:
    """Return the memory that the controllers write in a run from a start; see `Start.run`."""
    run = start.run(share)
    probe = Run(
        Probe(start.model, held=False),
        run.par,
        run.state,
        run.memory,
        run.stimulus,
        run.duration,
        run.step,
        run.record,
    )
    trajectory = simulate(probe)
    memory = trajectory.values[:, len(start.state) :]
    return Drive(start, np.asarray(memory - memory[0]))


def states(trajectory: Trajectory, names: Sequence[str]) -> Array:
    """Return the recorded states of a probe, shape (rows, states)."""
    return np.asarray(trajectory.values[:, : len(names)])


# --- The trial

LARGE = 0.5
"""amplitude of the stimulus in large runs, relative to each signal's usual magnitude"""


class Trial:
    """Model at its start, with results that its checks share.

    Parameters
    ----------
    kind
        Class of the model.
    find_start
        Function that returns the model with its parameters and the start of its runs.
    """

    def __init__(self, kind: type[Any], find_start: Callable[[], Start]) -> None:
        self.kind, self._find_start = kind, find_start

    @cached_property
    def start(self) -> Start:
        """Model with its parameters and the start of its runs.

        Raises
        ------
        NotCheckedError
            When the model has no start.
        """
        try:
            return self._find_start()
        except BywireError as error:
            raise NotCheckedError(str(error)) from error

    @property
    def model(self) -> Model:
        """The model that is checked."""
        return self.start.model

    @cached_property
    def drive(self) -> Drive:
        """Memory that the controllers write in a large run.

        Raises
        ------
        NotCheckedError
            When the run fails.
        """
        try:
            return drive_of(self.start, LARGE)
        except RunError as error:
            raise NotCheckedError(f"the run from {self.start.known} failed: {error}") from error

    @cached_property
    def rounds(self) -> bool:
        """Whether a controller rounds values, like a converter or an encoder."""
        ticks = prepare(self.model, self.start.par).program.ticks
        return any(
            tick.instruction_id(k) == ca.OP_FLOOR
            for tick in ticks
            for k in range(tick.n_instructions())
        )

    def large_run(self, frictions: bool) -> Run:
        """Return a large run from the start that records states and memory.

        If a controller rounds, the run contains only the plant, because the last digit of a signal
        may change a code, and derivatives do not exist.
        """
        if self.rounds:
            return self.drive.run(frictions=frictions)
        probe = Probe(self.model, held=False, frictions=frictions)
        return replace(self.start.run(LARGE), model=probe)

    def place(self, *members: str) -> Place:
        """Return the place of the model's first member with one of these names, or of its class."""
        for member in members:
            function = vars(self.kind).get(member)
            if inspect.isfunction(function):
                return place_of(function)
        return place_of(self.kind)


def constants(run: Run) -> Iterator[tuple[str, float]]:
    """Yield the numbers that an ensemble of the run may vary, without tables and sample times."""
    periods = [task.period for task in run.model.tasks(run.par)]
    for name, value in run.par.flat().items():
        if name in run.par.leaves():
            try:
                moved = run.par.replace({name: float(np.nextafter(value, np.inf))})
            except ParameterError:  # the number is at an end of its range
                continue
            if [task.period for task in run.model.tasks(moved)] == periods:
                yield name, float(value)


def lanes(run: Run, variations: Mapping[str, Sequence[float]]) -> Array:
    """Return all signals of a run for other parameters, shape (cases, rows, signals)."""
    return simulate_ensemble(run, variations, run.model.Output._fields).values
