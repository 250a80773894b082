"""Periodic operating points, such as of a dithered brake, and exact linear models about them.

They are fixed points of the stroboscopic map, which maps the system's state to the state one period
later. The system must have the same inputs in every period: a dither whose period is a multiple of
the sample times, or a rotating disc. The map acts on all values that the engine passes from one
substep to the next: states, their last increments, and the memory of the controllers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.loop import Loop, Point
from bywire.core.errors import CompilerError, ParameterError, SolverError
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of
from bywire.core.typing import Array, Complex
from bywire.core.units import shown
from bywire.simulation.advance import require_finite, require_unchanged
from bywire.simulation.compiler import Compiler, find_compiler
from bywire.simulation.engine import built_once, prepare
from bywire.simulation.native import Request
from bywire.simulation.program import Program
from bywire.simulation.repetition import window_schedule
from bywire.simulation.run import Run, initial_vector, selected
from bywire.simulation.schedule import Schedule
from bywire.simulation.sensitivity import DIRECTIONS, TangentKernel


@dataclass(frozen=True)
class Period:
    """One period of a system.

    Parameters
    ----------
    end
        Carried vector at the end, before the controllers run there, shape (n,).
    rows
        Recorded signals, without those at the end, shape (rows, signals).
    """

    end: Array
    rows: Array


@dataclass(frozen=True)
class Derivatives:
    """Derivatives of a period.

    Parameters
    ----------
    A
        Of the carried vector at the end, with respect to that at the beginning, shape (n, n).
    B
        Of the carried vector at the end, with respect to the input at every tick, shape (n, ticks).
    C, D
        Of the recorded signals, with respect to both, shapes (rows, signals, n) and (rows,
        signals, ticks).
    """

    A: Array
    B: Array
    C: Array
    D: Array


class Stroboscope:
    """Map of one system over its period.

    Parameters
    ----------
    run
        Run whose duration is the period, a multiple of the sample times and of the recording
        interval. Its stimulus at time zero is held throughout.
    inputs
        Signals of the stimulus that change together, held from one tick of the fastest controller
        to the next.
    signals
        Outputs to record.

    Raises
    ------
    CompilerError
        When there is no compiler.
    StepError
        When the period is not a multiple of the sample times.
    UnknownNameError
        When a signal is unknown.
    ParameterError
        When a controller rounds its samples, so that derivatives through it are zero.
    """

    def __init__(self, run: Run, inputs: Sequence[str], signals: Sequence[str]) -> None:
        compiler = find_compiler()
        if compiler is None:
            raise CompilerError(
                "derivatives need a C compiler. Install the extra bywire[compiler]", name="compiler"
            )
        require_unchanged(run.changes, "derivatives of a stroboscope")
        self._schedule = _by_substeps(window_schedule(run))
        self._open = replace(self._schedule, frames=self._schedule.frames + 1)
        program = prepare(run.model, run.par).program
        self._selection = selected(tuple(program.outputs), signals)
        self._inputs = selected(run.model.Stimulus._fields, inputs)
        self._kernel = _kernel(program, compiler)
        if self._kernel.rounds:
            raise ParameterError(
                "the converter rounds sampled values to whole codes, so derivatives are zero. Use "
                "a converter without rounding (adc.law = 'ideal')",
                name="adc.law",
                valid="'ideal'",
            )
        self._p = np.array(list(run.par.leaves().values()))
        self._layout = self._kernel.layout
        self._u = np.repeat(run.stimulus(np.zeros(1)), self._schedule.stimulus_rows, axis=0)
        first = self._layout.start["x"]
        self._frictions = np.array([first + k for k in program.velocities], int)
        start = initial_vector(self._layout, run.state, run.memory)
        self.start: Array = start[self._carried]
        self.names: tuple[str, ...] = (
            *run.model.State._fields,
            *(f"last increment of {name}" for name in run.model.State._fields),
            *run.model.Memory._fields,
        )

    @cached_property
    def _carried(self) -> NDArray[np.int64]:
        """Places of states, increments and memory in the engine's vector."""
        layout = self._layout
        spans = [(layout.start[kind], layout.length[kind]) for kind in ("x", "d", "m")]
        return np.concatenate([np.arange(first, first + count) for first, count in spans])

    @property
    def ticks(self) -> int:
        """Number of ticks of the fastest controller in a period."""
        return self._schedule.frames // self._schedule.stimulus_frames

    def advance(self, start: Array) -> Period:
        """Return one period from a carried vector, shape (n,)."""
        vector, tangents = self._loaded(start)
        values, _ = self._segment(vector, tangents, self._seeds(()), 0, self._schedule.frames)
        require_finite(self._layout, vector, "the period diverged")
        return Period(vector[self._carried], values)

    def derivatives(self, start: Array) -> Derivatives:
        """Return the derivatives of one period with respect to start and inputs."""
        n, ticks = start.size, self.ticks
        count = n + ticks
        end = np.empty((n, count))
        rows = self._schedule.frames // self._schedule.record_frames
        shown = np.empty((rows, self._selection.size, count))
        for first in range(0, count, DIRECTIONS):
            lanes = range(first, min(first + DIRECTIONS, count))
            vector, tangents = self._loaded(start)
            for lane, k in enumerate(lanes):
                if k < n:
                    tangents[self._carried[k], lane] = 1.0
            for tick in range(ticks):
                begin, stop = (k * self._schedule.stimulus_frames for k in (tick, tick + 1))
                moved = [lane for lane, k in enumerate(lanes) if k - n == tick]
                _, rec_t = self._segment(vector, tangents, self._seeds(moved), begin, stop)
                at = -(-begin // self._schedule.record_frames)
                shown[at : at + len(rec_t), :, first : lanes.stop] = rec_t[:, :, : len(lanes)]
            end[:, first : lanes.stop] = tangents[self._carried, : len(lanes)]
        return Derivatives(end[:, :n], end[:, n:], shown[:, :, :n], shown[:, :, n:])

    def velocities(self, start: Array) -> Array:
        """Return the velocities with dry friction, shape (substeps, frictions)."""
        vector, tangents = self._loaded(start)
        found = np.empty((self._schedule.frames, self._frictions.size))
        if not self._frictions.size:
            return found
        nothing, seeds = np.empty(0), self._seeds(())
        request = Request(self._open, self._p, self._u, self._selection[:0])
        for k in range(self._schedule.frames):
            self._kernel.advance(request, vector, k, k + 1, nothing, seeds, tangents, nothing)
            found[k] = vector[self._frictions]
        return found

    def _seeds(self, lanes: Sequence[int]) -> Array:
        """Return the seeds for the kernel's only parameter, which is constant, and all stimuli."""
        seeds = np.zeros((1 + self._u.shape[1], DIRECTIONS))
        for lane in lanes:
            seeds[1 + self._inputs, lane] = 1.0
        return seeds

    def _loaded(self, start: Array) -> tuple[Array, Array]:
        vector = np.zeros(self._layout.total)
        vector[self._carried] = start
        return vector, np.zeros((vector.size, DIRECTIONS))

    def _segment(
        self, vector: Array, tangents: Array, seeds: Array, begin: int, end: int
    ) -> tuple[Array, Array]:
        """Run frames begin..end, update vector and tangents in place, and return recorded rows."""
        schedule = self._schedule
        every, signals = schedule.record_frames, self._selection.size
        rows = -(-end // every) - -(-begin // every)
        values, rec_t = np.empty((rows, signals)), np.empty((rows, signals, DIRECTIONS))
        # The end of a period is the start of the next, and controllers run only at this start.
        request = Request(self._open, self._p, self._u, self._selection)
        self._kernel.advance(request, vector, begin, end, values, seeds, tangents, rec_t)
        return values, rec_t


def _by_substeps(schedule: Schedule) -> Schedule:
    """Return the same plan in frames of one substep, between which a run can be divided."""
    n = schedule.substeps
    return Schedule(
        schedule.step,
        1,
        schedule.frames * n,
        tuple(n * every for every in schedule.task_frames),
        schedule.record_frames * n,
    )


@built_once
def _kernel(program: Program, compiler: Compiler) -> TangentKernel:
    # Directions are set individually; the kernel has at least one parameter among them.
    return TangentKernel(program, (0,), compiler)


# --- Periodic operating points

TOLERANCE = 1e-5
"""tolerance for the distance from the orbit, relative to the usual magnitude of each signal; with
finite steps, stick-slip motions vary slightly"""
DRIFT = 1e-5
"""tolerance for the drift per period along directions without restoring action, same scale"""
_SETTLE, _ROUNDS, _NEWTON = 50, 12, 8  # simulated periods between trials of Newton's iteration
_NEUTRAL = 1e-7  # of the largest singular value: directions of neighboring orbits


@dataclass(frozen=True, eq=False)
class PeriodicOrbit:
    """Motion that repeats itself.

    Parameters
    ----------
    stroboscope
        The map from period to period.
    start
        Carried vector at the beginning of a period, shape (n,).
    rows
        Recorded signals over the period without its end, shape (rows, signals).
    distance
        Estimated distance of ``start`` from the orbit, relative to the usual magnitude of each
        signal: Newton's next step.
    drift
        Change over a period that no step can remove, on the same scale, along directions without
        restoring action, such as the amount of fluid enclosed.
    stuck
        Fraction of time during which every dry friction sticks; 0 without dry friction.
    periods
        Number of simulated periods.
    """

    stroboscope: Stroboscope
    start: Array
    rows: Array
    distance: float
    drift: float
    stuck: float
    periods: int


def period_of(frequencies: Sequence[float], intervals: Sequence[float], step: float) -> float:
    """Return the shortest time [s] that is a multiple of all sample times and periods.

    Parameters
    ----------
    frequencies
        Frequencies of periodic signals [Hz]; may be empty.
    intervals
        Sample times [s].
    step
        Substep [s].

    Raises
    ------
    ParameterError
        When a frequency's period is not a multiple of the step.
    """
    wanted = [*intervals, *(1.0 / f for f in frequencies)]
    counts = [round(interval / step) for interval in wanted]
    for f in frequencies:
        count = 1.0 / (f * step)
        if abs(count - round(count)) > 1e-6 * count:
            raise ParameterError(
                f"a period of 1/({f:g} Hz) = {shown(1.0 / f, 's')} is not a multiple of the step "
                f"of {shown(step, 's')}. Use a frequency that divides the sample rate",
                name="frequency",
                value=f"{f:g} Hz",
            )
    return math.lcm(*counts) * step


def find_orbit(stroboscope: Stroboscope, run: Run) -> PeriodicOrbit:
    r"""Return the orbit to which the system settles.

    The function simulates period after period. In between, it tries Newton's iteration with the
    exact derivative A of the map P,

    .. math:: (I - A) \Delta z = P(z) - z

    and accepts a step that brings the motion closer to a repetition. A slow loop would need minutes
    to settle, but the iteration needs a few periods. Directions without restoring action (for
    example the amount of fluid enclosed) keep their simulated values.

    Parameters
    ----------
    stroboscope
        The map.
    run
        Run of the map; its signals' usual magnitudes scale all changes.

    Raises
    ------
    SolverError
        When no motion repeats itself: the system hunts, drifts, or has irregular stick-slip.
    """
    scale = magnitudes(run)
    z, periods = stroboscope.start, 0
    for _ in range(_ROUNDS):
        for _ in range(_SETTLE):
            z = stroboscope.advance(z).end
        candidate = _polished(stroboscope, z, scale)
        periods += _SETTLE + candidate.periods
        z = candidate.start
        if candidate.distance <= TOLERANCE and candidate.drift <= DRIFT:
            rows = stroboscope.advance(z).rows
            v = stroboscope.velocities(z)
            stuck = float(np.mean((v == 0.0).all(axis=1))) if v.size else 0.0
            return PeriodicOrbit(
                stroboscope, z, rows, candidate.distance, candidate.drift, stuck, periods
            )
    apart = np.abs((stroboscope.advance(z).end - z) / scale)
    raise SolverError(
        f"{run.model.name}: no motion repeats with the period of {run.duration * 1e3:g} ms. After "
        f"{periods} periods, {stroboscope.names[int(np.argmax(apart))]} still changes by "
        f"{apart.max():.2g} of its usual magnitude per period. The loop hunts or drifts, for "
        "example because its dither is too weak. Increase the dither gain, or choose another "
        "operating point",
        name=stroboscope.names[int(np.argmax(apart))],
    )


@dataclass(frozen=True)
class _Tried:
    """Candidate: distance from the orbit, drift over a period, and simulated periods."""

    start: Array
    distance: float
    drift: float
    periods: int


def _polished(stroboscope: Stroboscope, z: Array, scale: Array) -> _Tried:
    """Return the last point of Newton's iteration that is closer to a repetition."""
    distance, drift, step = _judged(stroboscope, z, scale)
    for taken in range(_NEWTON):
        if distance <= 1e-2 * TOLERANCE:
            return _Tried(z, distance, drift, taken)
        moved = _judged(stroboscope, z + step, scale)
        if not moved[0] < 0.5 * distance:  # NaN also fails
            return _Tried(z, distance, drift, taken + 1)
        z = z + step
        distance, drift, step = moved
    return _Tried(z, distance, drift, _NEWTON)


def _judged(stroboscope: Stroboscope, z: Array, scale: Array) -> tuple[float, float, Array]:
    """Return the distance from the orbit, the drift that no step removes, and Newton's step."""
    residual = stroboscope.advance(z).end - z
    A = stroboscope.derivatives(z).A
    step = restored(A, residual, scale)
    drift = residual - (step - A @ step)
    return float(np.max(np.abs(step / scale))), float(np.max(np.abs(drift / scale))), step


def restored(A: Array, residual: Array, scale: Array) -> Array:
    """Return the smallest x for which (I - A) x is the residual; constant values stay unchanged.

    Parameters
    ----------
    A
        Derivative of a map over one period, shape (n, n).
    residual
        Shape (n,).
    scale
        Usual magnitudes, shape (n,).
    """
    n = len(A)
    eye = np.eye(n)
    moving = np.flatnonzero((eye != A).any(axis=1))  # the others keep their values permanently
    gap = (eye - A)[np.ix_(moving, moving)] * scale[moving] / scale[moving, None]
    step = np.zeros(n)
    scaled = np.linalg.lstsq(gap, residual[moving] / scale[moving], rcond=_NEUTRAL)[0]
    step[moving] = scaled * scale[moving]
    return step


def magnitudes(run: Run) -> Array:
    """Return the usual magnitudes of states, their increments, and memory, shape (n,)."""
    states = [signal.nominal for signal in signals_of(run.model.State).values()]
    held = [signal.nominal for signal in signals_of(run.model.Memory).values()]
    return np.array([*states, *states, *held])


# --- Linear models with active friction and dither

STEPS = (10e-6, 5e-6, 2.5e-6)
"""substeps [s]; each is tried if no motion repeats with the previous one. Longer steps disturb a
piston that barely breaks away. With the first one, the dithered pressure loop's gain is within 2 %
of that with short steps"""


@dataclass(frozen=True, eq=False)
class PeriodicModel:
    r"""Deviations from a periodic orbit, over one period and tick by tick within it.

    .. math:: z_{k+1} = A z_k + \sum_j B_j u_{k,j}, \quad
        y_{k,r} = C_r z_k + \sum_j D_{r,j} u_{k,j}

    with the state z at the beginning of period k, the input u at its ticks j, and the output y at
    its times r: the lifted form of a periodic system. The derivatives are those of the simulation,
    including every change between stick and slip. They are valid for deviations that change only
    the times of these changes.

    Parameters
    ----------
    run
        Run of one period.
    inputs, output
        Signals.
    orbit
        The operating point.
    derivatives
        A, B, C, D over the period.
    """

    run: Run
    inputs: tuple[str, ...]
    output: str
    orbit: PeriodicOrbit
    derivatives: Derivatives

    @property
    def mean(self) -> float:
        """Mean of the output over a period, SI."""
        return float(self.orbit.rows[:, 0].mean())

    @property
    def ripple(self) -> float:
        """Peak-to-peak value of the output over a period, SI."""
        return float(np.ptp(self.orbit.rows[:, 0]))

    @cached_property
    def averaged(self) -> LinearModel:
        """Model from an input held over a period to the output's mean over that period."""
        d = self.derivatives
        return self._model("averaged", d.C[:, 0].mean(axis=0), d.D[:, 0].sum(axis=1).mean())

    @cached_property
    def sampled(self) -> LinearModel:
        """Model from an input held over a period to the output at the start of the period."""
        d = self.derivatives
        return self._model("sampled", d.C[0, 0], d.D[0, 0].sum())

    def _model(self, kind: str, C: Array, D: float) -> LinearModel:
        model = self.run.model
        states, held = signals_of(model.State), signals_of(model.Memory)
        units = [signal.unit for signal in states.values()]
        return LinearModel(
            f"{model.name}, {kind} over {self.run.duration * 1e3:g} ms",
            self.derivatives.A,
            self.derivatives.B.sum(axis=1, keepdims=True),
            C[None, :],
            np.array([[D]]),
            (*states, *(f"d({name})" for name in states), *(f"{name}[k]" for name in held)),
            self.inputs[:1],
            (self.output,),
            (*units, *units, *(signal.unit for signal in held.values())),
            (signals_of(model.Stimulus)[self.inputs[0]].unit,),
            (signals_of(model.Output)[self.output].unit,),
            np.zeros(len(self.derivatives.A)),
            self.run.duration,
        )

    @property
    def steady_gain(self) -> float:
        """Change of the output's mean divided by the change of a constant input, SI."""
        d = self.derivatives
        moved = restored(d.A, d.B.sum(axis=1), magnitudes(self.run))
        return float(d.C[:, 0].mean(axis=0) @ moved + d.D[:, 0].sum(axis=1).mean())

    def response(self, frequencies: Array) -> Complex:
        r"""Return the response at the frequency of a sine in the input, including its sampling.

        A periodic system also responds at f + k/T; the function returns the line at f,

        .. math:: Y = \frac{1}{n_r} \sum_r (C_r Z + D_r U) e^{-j \omega t_r}, \quad
            (e^{j \omega T} I - A) Z = B U, \quad U_j = e^{j \omega t_j}

        which `frequency_response` measures at small amplitude.

        Parameters
        ----------
        frequencies
            Frequencies [Hz], not 0, shape (m,); below the Nyquist frequency of the ticks.

        Returns
        -------
        numpy.ndarray
            Output over input, SI, shape (m,).
        """
        d, T = self.derivatives, self.run.duration
        rows, ticks = d.D.shape[0], d.D.shape[2]
        lines = []
        for f in np.asarray(frequencies, dtype=float):
            # A zero-order hold at the ticks, not the sine, since a controller reads samples.
            U = np.exp(2j * np.pi * f * T / ticks * np.arange(ticks))
            Z = np.linalg.solve(np.exp(2j * np.pi * f * T) * np.eye(len(d.A)) - d.A, d.B @ U)
            wave = np.exp(-2j * np.pi * f * T / rows * np.arange(rows))
            lines.append(wave @ (d.C[:, 0] @ Z + d.D[:, 0] @ U) / rows)
        return np.array(lines, dtype=np.complex128)


def periodic_model(
    point: Point,
    inputs: Sequence[str],
    output: str,
    whole: Sequence[float],
    step: float | None = None,
) -> PeriodicModel:
    """Return the linear model about the orbit to which a system settles.

    Parameters
    ----------
    point
        Start of the simulation, from which the system must settle to the orbit.
    inputs
        Signals of the stimulus that change together.
    output
        Responding signal; its mean is taken over samples at the fastest controller's ticks.
    whole
        Frequencies [Hz] of periodic signals, such as a dither. If empty, the orbit is an
        equilibrium, and the period is the common sample time.
    step
        Substep [s]; by default one of `STEPS`.

    Raises
    ------
    SolverError
        When no motion repeats itself.
    ParameterError
        When a period is not a whole number of substeps, or a controller rounds its samples.
    CompilerError
        When there is no compiler.
    """
    *trials, last = STEPS if step is None else (step,)
    for substep in trials:
        with suppress(SolverError):
            return _about(point, inputs, output, whole, substep)
    return _about(point, inputs, output, whole, last)


def _about(
    point: Point, inputs: Sequence[str], output: str, whole: Sequence[float], step: float
) -> PeriodicModel:
    intervals = [task.period for task in point.model.tasks(point.par)]
    duration = period_of(whole, intervals, step)
    run = replace(point.run(step), duration=duration, record=min(intervals))
    stroboscope = Stroboscope(run, inputs, (output,))
    orbit = find_orbit(stroboscope, run)
    derivatives = stroboscope.derivatives(orbit.start)
    return PeriodicModel(run, tuple(inputs), output, orbit, derivatives)


def dithered_loop(
    loop: Loop, par: ParameterSet, value: float, step: float | None = None
) -> PeriodicModel:
    """Return a closed loop's linear model with friction and dither, about its periodic orbit.

    Parameters
    ----------
    loop, par, value
        The loop and its operating point. Converters and encoders are treated as ideal, because
        rounded values have no derivative.
    step
        As in `periodic_model`.

    Raises
    ------
    InputError, SolverError, CompilerError
        As `periodic_model`, or when the operating point does not exist or every friction sticks.
    """
    ideal = unrounded(loop, par)
    model = periodic_model(
        loop.point(ideal, value), loop.inputs, loop.output, loop.whole(ideal), step
    )
    require_moving(model)
    return model


def require_moving(model: PeriodicModel) -> None:
    """Reject an orbit without motion: a stuck mechanism has no gain.

    Raises
    ------
    SolverError
        When all dry frictions stick during the whole period.
    """
    if model.orbit.stuck == 1.0:
        raise SolverError(
            f"{model.run.model.name} sticks during the whole period, so it does not respond to "
            "small signals. Increase the dither gain",
            name=model.run.model.name,
        )


def unrounded(loop: Loop, par: ParameterSet) -> ParameterSet:
    """Return parameters whose converters and encoders have no resolution."""
    changes = {
        name: law for off in loop.causes.values() for name, law in off.items() if law == "ideal"
    }
    return par.replace(changes)
