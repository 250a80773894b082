"""Output error: a model is run over measured inputs and fitted to measured outputs.

In open loop, the measured input of the plant drives it. In closed loop, the measured set point
drives model and controller together, so that the fit includes the effect of feedback. Derivatives
are the exact ones of the run, friction and contacts included.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bywire.core.arguments import checked
from bywire.core.errors import ParameterError, SolverError, unknown_name
from bywire.core.model import Model, Task
from bywire.core.parameters import ParameterSet
from bywire.core.signals import Signal, signals_of, zeros
from bywire.core.typing import Array
from bywire.identification.estimate import Part
from bywire.identification.least_squares import Problem
from bywire.identification.measured import require_signals
from bywire.identification.unknown import Unknown
from bywire.simulation.run import Run, simulate
from bywire.simulation.sensitivity import simulate_with_sensitivities

if TYPE_CHECKING:
    import xarray as xr

Start = Callable[[Mapping[str, float]], tuple[Any, Any]]
"""``start(values) -> (state, memory)``: start of a run with changed parameters and start options
(``start.NAME``)"""

_SHIFT = 1e-6  # of an unknown's scale: step for differences of the start
_AFTERWARDS = ("initial.", "stimulus.")  # prefixes of unknowns that do not affect the start


@checked
def moved_run(run: Run, values: Mapping[str, float], start: Start | None = None) -> Run:
    """Return a run with unknowns changed.

    Parameters
    ----------
    run
        The run.
    values
        By name: parameters; ``initial.STATE`` replaces a value, ``stimulus.NAME`` adds to it, and
        ``start.NAME`` is an option of the start.
    start
        Start of the run with other values; by default its own start.

    Raises
    ------
    ParameterError
        When the combination of values is not valid.
    """
    fixed = {n[8:]: v for n, v in values.items() if n.startswith("initial.")}
    shift = {n[9:]: v for n, v in values.items() if n.startswith("stimulus.")}
    rest = {n: v for n, v in values.items() if not n.startswith(_AFTERWARDS)}
    par = {n: v for n, v in rest.items() if not n.startswith("start.")}
    state, memory = (run.state, run.memory) if start is None else start(rest)
    if shift:
        fields, inner = run.model.Stimulus._fields, run.stimulus
        add = np.array([shift.get(name, 0.0) for name in fields])
        run = replace(run, stimulus=lambda t: inner(t) + add)
    return replace(run, par=run.par.replace(par), state=state._replace(**fixed), memory=memory)


def _start_slopes(
    start: Start, run: Run, unknowns: Sequence[Unknown], values: Mapping[str, float]
) -> tuple[Array, Array]:
    """Return derivatives of the initial state and memory, shapes (states, p) and (memories, p).

    They are central differences, one-sided at the end of a range, because equilibria are smooth
    and accurate to rounding. States that ``initial.STATE`` replaces do not move.

    Parameters
    ----------
    start
        Start of the run.
    run
        Run that begins there.
    unknowns
        Unknowns of the run; p of them.
    values
        Values by name.
    """
    rest = {n: v for n, v in values.items() if not n.startswith(_AFTERWARDS)}
    fields = run.model.State._fields
    slopes = np.zeros((len(fields) + len(run.memory), len(unknowns)))

    def at(name: str, shift: float) -> tuple[float, Array]:
        try:
            state, memory = start({**rest, name: rest[name] + shift})
        except ParameterError:
            shift, (state, memory) = 0.0, start(rest)
        return shift, np.array([*state, *memory], dtype=float)

    for k, u in enumerate(unknowns):
        if u.name in rest:
            (a, low), (b, high) = (at(u.name, way * _SHIFT * u.scale) for way in (-1.0, 1.0))
            slopes[:, k] = (high - low) / (b - a) if b > a else 0.0
    fixed = [fields.index(u.name[8:]) for u in unknowns if u.name.startswith("initial.")]
    slopes[fixed] = 0.0
    return slopes[: len(fields)], slopes[len(fields) :]


# --- A model driven by measured inputs alone: no controller, no energy balance


class NoPower(NamedTuple):
    """No power: the model has no energy balance."""

    none: Annotated[float, Signal("W", "no power")]


class Driven(Model):
    """A model with measured inputs; a subclass defines ``name``, ``State`` and ``Input``.

    It also defines ``mass`` and ``balance``, which receives an ``Input`` as its memory. The
    outputs are the states unless it defines its own ``Output`` and ``output``. Inputs are held for
    the sample time ``par.T_s``, or for the time that ``period`` returns.
    """

    Flow: ClassVar = NoPower
    Memory: ClassVar[Any] = NoPower  # these three are replaced if a subclass defines its own types
    Stimulus: ClassVar[Any] = NoPower
    Output: ClassVar[Any] = NoPower

    def __init_subclass__(cls, **options: Any) -> None:
        """Use the inputs as stimuli and as memory, and the states as outputs."""
        super().__init_subclass__(**options)
        for kind, source in (("Memory", "Input"), ("Stimulus", "Input"), ("Output", "State")):
            if source in vars(cls) and kind not in vars(cls):
                setattr(cls, kind, vars(cls)[source])

    def period(self, par: Any) -> float:
        """Return the hold time of an input [s]."""
        return float(par.T_s)

    def tasks(self, par: Any) -> tuple[Task, ...]:
        """Return the task that holds a sample."""
        return (Task("held", self.period(par), lambda x, m, u, par: u),)

    @abstractmethod
    def mass(self, xe: Any, par: Any) -> Any:
        """Return the factor of each state's derivative, a State."""

    @abstractmethod
    def balance(self, x: Any, xe: Any, memory: Any, par: Any, contact: tuple[float, ...]) -> Any:
        """Return the smooth right-hand side, a State; ``memory`` contains the inputs."""

    def powers(
        self,
        x: Any,
        xe: Any,
        rate: Any,
        memory: Any,
        par: Any,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
    ) -> NoPower:
        """Return no power."""
        return NoPower(0.0 * x[0])

    def output(
        self,
        x: Any,
        memory: Any,
        par: Any,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
        flow: Any,
    ) -> Any:
        """Return the states."""
        return x


# --- Residuals of output error

Between = Literal["held", "linear"]
"""measured inputs between samples"""

UNEVEN = 1e-3
"""maximum distance of times from an even grid, as a fraction of its step"""

_DIGITS = (1, 2, 3, 4)  # number of digits of an interval that a person chose


@dataclass(frozen=True)
class Trial:
    """A measured experiment with its model.

    Parameters
    ----------
    run
        The model with its measured inputs, recorded at the times of the measurement.
    measured
        Measured outputs by the model's names, each of shape (rows,), SI; NaN is ignored.
    noise
        Standard deviation of each measured output, SI.
    label
        Label of the trial, if there are several.
    used
        Rows that count, shape (rows,); all by default.
    start
        ``start(values) -> (state, memory)``: start of the run for changed unknowns, by name; by
        default always the start of ``run``. It also accepts ``start.NAME``.
    """

    run: Run
    measured: Mapping[str, Array]
    noise: Mapping[str, float]
    label: str = ""
    used: NDArray[np.bool_] | None = field(default=None)
    start: Start | None = None

    def rows(self, signal: str) -> NDArray[np.bool_]:
        """Return which rows of a signal count."""
        finite = np.isfinite(self.measured[signal])
        return finite if self.used is None else finite & self.used


def trial(
    model: Model,
    par: ParameterSet,
    data: xr.Dataset,
    inputs: Mapping[str, str],
    outputs: Mapping[str, float],
    *,
    state: Any = None,
    memory: Any = None,
    step: float = 20e-6,
    label: str = "",
    between: Between = "held",
) -> Trial:
    """Return a measured experiment with its model.

    Parameters
    ----------
    model, par
        The model.
    data
        Measured signals over ``time`` [s], evenly spaced.
    inputs
        Stimulus of the model -> measured signal; held from one sample to the next.
    outputs
        Output of the model, measured under the same name -> standard deviation of its noise.
    state, memory
        Start of the run; by default zero, or the first sample of a signal with a state's name.
    step
        Substep [s].
    between
        Inputs between samples. A controller holds its demand until it sets a new one. A smooth
        input that is held between slow samples acts half a sample late: ``linear`` replaces every
        held value by the mean, over its hold time, of the line through the samples.

    Raises
    ------
    UnknownNameError
        When a signal is missing, with the nearest ones.
    ParameterError
        When time is not evenly spaced.
    """
    require_signals(data, (*inputs.values(), *outputs))
    for name in inputs:
        if name not in model.Stimulus._fields:
            raise unknown_name("stimulus", name, model.Stimulus._fields)
    t = data["time"].values - data["time"].values[0]
    interval = even_interval(t)
    columns = {
        model.Stimulus._fields.index(name): data[signal].values for name, signal in inputs.items()
    }
    if state is None:
        seen = {n: float(data[n][0]) for n in model.State._fields if n in data}
        state = zeros(model.State)._replace(**seen)
    if between == "linear":
        lead = 0.5 * min(task.period for task in model.tasks(par))
        stimulus = partial(_joined, columns, len(model.Stimulus._fields), t, lead)
    else:
        stimulus = partial(_held, columns, len(model.Stimulus._fields), interval)
    run = Run(
        model,
        par,
        state,
        zeros(model.Memory) if memory is None else memory,
        stimulus,
        (t.size - 1) * interval,
        step,
        interval,
    )
    return Trial(run, {name: data[name].values for name in outputs}, dict(outputs), label)


def initial_states(trial: Trial, names: Sequence[str]) -> tuple[Unknown, ...]:
    """Return initial states of a trial as unknowns that start at its run's values.

    Raises
    ------
    UnknownNameError
        When the model has no such state.
    """
    signals = signals_of(trial.run.model.State)
    unknowns = []
    for name in names:
        if name not in signals:
            raise unknown_name("state", name, tuple(signals))
        start, signal = float(getattr(trial.run.state, name)), signals[name]
        scale = abs(start) or signal.nominal
        unknowns.append(
            Unknown(f"initial.{name}", start, scale=scale, unit=signal.unit, trial=trial.label)
        )
    return tuple(unknowns)


def even_interval(t: Array) -> float:
    """Return the interval of evenly spaced times [s].

    Times may deviate from an even grid by a thousandth of its step, since clocks jitter and round.
    The interval is the number with the fewest digits whose grid fits the times: 24 ns of jitter at
    1 kHz must not result in a step of 0.999999922 ms, which no other step divides.

    Raises
    ------
    ParameterError
        When they are not evenly spaced.
    """
    steps = np.diff(t)
    if not steps.size or not steps.min() > 0.0:
        raise ParameterError(
            "time does not increase from sample to sample. Sort or trim the record", name="time"
        )
    mean, middle = float(t[-1] - t[0]) / steps.size, float(np.median(steps))
    usual = float(f"{middle:.9g}")
    for interval in (*(float(f"{mean:.{k}g}") for k in _DIGITS), usual, float(f"{mean:.9g}")):
        off = t - t[0] - interval * np.arange(t.size)
        if float(np.ptp(off)) <= 2.0 * UNEVEN * interval:
            return interval
    if np.abs(steps - middle).max() <= UNEVEN * middle:  # a clock that drifts
        return usual
    raise ParameterError(
        f"time is not evenly spaced: its steps are {steps.min():g} to {steps.max():g} s, and it "
        f"deviates from an even grid by more than {UNEVEN:g} of the step. Resample it first with "
        f'bywire.resample(data, "{1e3 * float(f"{middle:.3g}"):g} ms")',
        name="time",
    )


def _held(columns: Mapping[int, Array], count: int, interval: float, t: Array) -> Array:
    rows = np.zeros((t.size, count))
    for column, values in columns.items():
        index = np.clip(np.floor(t / interval + 1e-6).astype(int), 0, values.size - 1)
        rows[:, column] = values[index]
    return rows


def _joined(columns: Mapping[int, Array], count: int, times: Array, lead: float, t: Array) -> Array:
    rows = np.zeros((t.size, count))
    for column, values in columns.items():
        rows[:, column] = np.interp(t + lead, times, values)
    return rows


def output_error(trials: Sequence[Trial], unknowns: Sequence[Unknown]) -> Problem:
    """Return the fit of several trials to their measured outputs.

    Parameters
    ----------
    trials
        Trials of models with the same kind of parameters.
    unknowns
        Parameters, which all trials share unless they specify a trial; also ``initial.STATE``,
        ``stimulus.NAME``, ``offset.SIGNAL`` and, for a trial with ``start``, ``start.NAME``.

    Raises
    ------
    UnknownNameError
        When an unknown does not exist in its trial.
    """
    labels = [t.label for t in trials]
    for unknown in unknowns:
        if unknown.trial and unknown.trial not in labels:
            raise unknown_name("trial", unknown.trial, labels)

    def evaluate(share: float, values: Array) -> tuple[Array, Array]:
        runs = [replace(t, run=replace(t.run, step=share * t.run.step)) for t in trials]
        parts = [_residuals(trial, unknowns, values) for trial in runs]
        return np.concatenate([r for r, _ in parts]), np.vstack([J for _, J in parts])

    return Problem(
        tuple(unknowns),
        partial(evaluate, 1.0),
        parts=tuple(_parts(trials)),
        finer=partial(evaluate, 0.5),
    )


def _parts(trials: Sequence[Trial]) -> Iterator[Part]:
    """Yield a description of the residuals of each output and trial, in their order."""
    for trial in trials:
        signals = signals_of(trial.run.model.Output)
        for name, values in trial.measured.items():
            counted = values[trial.rows(name)]
            spread = float(np.std(counted)) if counted.size else 0.0
            size = float(np.abs(counted).max()) if counted.size else 0.0
            yield Part(
                name, trial.label, counted.size, signals[name].unit, trial.noise[name], spread, size
            )


def _residuals(trial: Trial, unknowns: Sequence[Unknown], values: Array) -> tuple[Array, Array]:
    """Return computed minus measured, divided by the noise, and its derivatives."""
    places = [k for k, u in enumerate(unknowns) if u.trial in ("", trial.label)]
    moving = [k for k in places if not unknowns[k].name.startswith("offset.")]
    signals = tuple(trial.measured)
    computed, slopes = _computed(trial, [unknowns[k] for k in moving], values[moving], signals)
    residuals, jacobians = [], []
    for s, signal in enumerate(signals):
        rows, weight = trial.rows(signal), 1.0 / trial.noise[signal]
        J = np.zeros((int(rows.sum()), len(unknowns)))
        J[:, moving] = slopes[rows, s, :] * weight
        r = computed[rows, s] - trial.measured[signal][rows]
        for k in places:
            if unknowns[k].name == f"offset.{signal}":
                r, J[:, k] = r + values[k], weight
        residuals.append(r * weight)
        jacobians.append(J)
    return np.concatenate(residuals), np.vstack(jacobians)


def _computed(
    trial: Trial, unknowns: Sequence[Unknown], values: Array, signals: tuple[str, ...]
) -> tuple[Array, Array]:
    """Return the outputs and their derivatives, shapes (rows, signals), (rows, signals, p)."""
    named = {u.name: float(v) for u, v in zip(unknowns, values, strict=True)}
    try:
        run = moved_run(trial.run, named, trial.start)
    except ParameterError as error:  # the step was too large: it violates a rule between parameters
        raise SolverError(str(error)) from None
    if not unknowns:
        computed = simulate(run, signals).values
        return computed, np.empty((*computed.shape, 0))
    if trial.start is None:
        answer = simulate_with_sensitivities(run, list(named), signals)
    else:
        slopes = _start_slopes(trial.start, run, unknowns, named)
        answer = simulate_with_sensitivities(run, list(named), signals, *slopes)
    return answer.trajectory.values, answer.derivatives
