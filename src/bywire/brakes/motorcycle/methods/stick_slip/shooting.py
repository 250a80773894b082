"""Every slip of a ramp shot from its own rest and laid over the measured one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bywire.brakes.motorcycle.methods.stick_slip.slips import (
    BEFORE,
    LEAD,
    Shot,
    Slip,
    moving_mean,
    onset_of,
)
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.core.typing import Array
from bywire.identification.equation import Equation, EquationError
from bywire.identification.unknown import Unknown
from bywire.simulation.run import Run, simulate
from bywire.simulation.sensitivity import simulate_with_sensitivities

_ROUNDS = 12  # of Newton


def overlaid(shot: Shot, p: Array) -> tuple[Array, Array, float]:
    """Return computed less measured pressure, the computed speed, and the shift between them.

    Parameters
    ----------
    p
        Computed pressure [Pa], shape (n,); moved in time to where it lies best.
    """
    shift = best_shift(shot, p, shot.time.size)
    r, v = _laid_over(shot, p, shift)
    return r, v, shift


def best_shift(shot: Shot, p: Array, rows: int) -> float:
    """Return by how much later the computed slip lies on the measured one [s] (Gauss, Newton).

    Compared are the first rows.
    """
    t = shot.clock
    shift = _half_way(t, shot.pressure, shot.slip) - _half_way(t, p, shot.slip)
    for _ in range(_ROUNDS):
        r, v = (part[:rows] for part in _laid_over(shot, p, shift))
        size = float(v @ v)
        if size == 0.0:
            break
        change = float(v @ r) / size
        shift += float(np.clip(change, -LEAD, LEAD))
        if abs(change) < 1e-9:
            break
    return shift


def _laid_over(shot: Shot, p: Array, shift: float) -> tuple[Array, Array]:
    """Return computed less measured pressure with the computed one later, and its speed."""
    t = shot.clock
    at = t - shift
    v = np.interp(at, t, np.gradient(p, shot.interval))
    v[(at <= 0.0) | (at >= t[-1])] = 0.0
    return np.interp(at, t, p) - shot.pressure, v


def _half_way(t: Array, p: Array, slip: Slip) -> float:
    """Return when a slip has gone half of its way [s]."""
    middle = 0.5 * (p[0] + p[-1])
    beyond = np.flatnonzero(slip.direction * (p - middle) > 0.0)
    return float(t[beyond[0]]) if beyond.size else float(t[-1])


# --- Shooting
# A fit to the whole pressure curve fails from starts a few percent off: a slip that begins too
# early or too late costs as much as one that is not there. So each slip is run by itself, from the
# rest that was measured, beginning where the model breaks away, and moved in time to where it lies
# best on the measured one. What breaking away tells, the current at which it happened, is a
# residual of its own.
#
# The run's demand ramps through the model's own breakaway current, and the modeled control answers
# to the motor's induced voltage: the current dips as it did on the bench, at the right time. From
# where the slip has begun, the demand is corrected by how far the measured current lies beside
# that.

# A slip's demand, corrected by how far the measured current lies beside the model's.

_SMOOTHED = 0.01  # s: over which the measured current is
_BEGUN = 0.02  # of a slip: before, the current's noise would decide when the model breaks away
_BEGUN_AT = 2e3  # Pa: of a long one
_ALIGNED = 2  # times that the measured current is laid over the slip which it drives
_DIP = 0.1  # s: how long the current dips as a slip begins
_LEAST_LATE = 20  # samples that a line is laid through
_I_SET = MotorcycleBrake().Stimulus._fields.index("i_set")


@dataclass(frozen=True)
class Driven:
    """A slip's runs with the measured current.

    Parameters
    ----------
    calm
        Driven by a line through the current once it no longer dips: its derivatives do not know
        the current's noise, which would bias what they estimate.
    sampled
        Driven by the current as it was measured.
    first
        Row from which both are driven.
    onset
        When the model breaks away [s].
    """

    calm: Run
    sampled: Run
    first: int
    onset: float


def driven_by(ramp: Run, shot: Shot, current: float, zero: float) -> Driven:
    """Return a slip's run, driven by its ramp, as the measured current drives it.

    ``ramp``: its demand ramps through the current that breaks the model away; ``shot``: the
    measured slip; ``current``: that breaks the model away [A]; ``zero``: reading of the current's
    sensor without current [A].
    """
    middle = shot.clock + 0.5 * shot.interval
    width = 2 * int(0.5 * _SMOOTHED / shot.interval) + 1
    measured = moving_mean(shot.current - zero, width)
    sampled, more, first, onset = ramp, np.zeros(middle.size), 0, BEFORE
    for _ in range(_ALIGNED):
        computed = simulate(sampled, ("p_mc", "i", "omega"))
        p, i = computed["p_mc"], moving_mean(computed["i"], width)
        shift = best_shift(shot, p, shot.steep)
        rests = max(int(np.argmax(computed["omega"] != 0.0)) - 1, 0)
        onset = float(shot.clock[rests] + (current - computed["i"][rests]) / shot.rate)
        travel = np.abs(p - p[0])
        first = int(np.argmax(travel > min(_BEGUN * travel.max(), _BEGUN_AT)))
        wanted = np.interp(np.asarray(middle + shift), shot.clock, measured)
        more = more + wanted - np.interp(middle, shot.clock, i)
        more[:first] = 0.0
        sampled = replace(ramp, stimulus=with_more(ramp, more))
    dipped = first + round(_DIP / shot.interval)
    calm, late = sampled, slice(dipped, int((shot.clock[-1] - shift) / shot.interval))
    if late.stop - late.start >= _LEAST_LATE:
        line = np.polynomial.Polynomial.fit(middle[late], more[late], 1)
        more[dipped:] = line(middle[dipped:])
        calm = replace(ramp, stimulus=with_more(ramp, more))
    return Driven(calm, sampled, first, onset)


def with_more(run: Run, more: Array) -> Callable[[Array], Array]:
    """Return the run's stimulus with more demand at each of its intervals."""
    interval = run.record
    demand = run.stimulus(np.arange(more.size, dtype=np.float64) * interval)[:, _I_SET]
    return partial(held, demand + more, interval)


def held(ramp: Array, interval: float, at: Array) -> Array:
    """Return the stimulus whose demand is held over each interval."""
    fields = MotorcycleBrake().Stimulus._fields
    rows = np.zeros((at.size, len(fields)))
    index = np.clip(np.floor(at / interval + 1e-6).astype(int), 0, ramp.size - 1)
    rows[:, _I_SET] = ramp[index]
    return rows


_MORE = 1e-3  # A: with which the answer to an offset is computed


@dataclass(frozen=True)
class Fitted:
    """A slip of the model, laid over the measured one.

    Parameters
    ----------
    residuals
        Computed less measured pressure [Pa], shape (n,).
    slopes
        Their derivatives by the unknowns with the shift at its best, shape (n, p).
    by_current
        Derivative of the residuals by an offset of the current along the slip [Pa/A], shape (n,).
    answer, speed
        The same with the shift kept [Pa/A], and how fast the pressure moves [Pa/s], shape (n,).
    breakaway, breakaway_slopes
        Measured less computed current at the instant of breaking away [A], and its
        derivatives, shape (p,).
    """

    residuals: Array
    slopes: Array
    by_current: Array
    answer: Array
    speed: Array
    breakaway: float
    breakaway_slopes: Array


class Shooting:
    """Runs slips of the motorcycle brake for values of the unknowns.

    ``par``: everything that is known; ``unknowns``: friction parameters; ``step``: substep [s].
    """

    def __init__(
        self,
        par: MotorcycleParameters,
        unknowns: Sequence[Unknown],
        step: float = 20e-6,
    ) -> None:
        self.par = par.replace(
            {
                "drive.mode": "current",
                "ecu.dither.waveform": "off",
                "adc.law": "ideal",
                "adc.noise": 0.0,
            }
        )
        self._source = par.replace({"drive.mode": "current-source"})
        self.names = tuple(u.name for u in unknowns)
        self.count = len(self.names)
        self.model, self.step = MotorcycleBrake(), step
        self._error = EquationError(Equation(self.model, "omega", "alpha"), self._source, unknowns)

    def breakaway(self, rest: float, direction: int, values: Array) -> tuple[float, Array]:
        """Return the current [A] that breaks away from a rest [Pa], and its derivatives.

        Where motor, pressure and breakaway torque balance: the equation of motion without
        motion, which is affine in the current.
        """
        columns = self._error.at(
            state_at(max(rest, 0.0), self._source)._replace(omega=direction * 1e-12),
            memory_at(max(rest, 0.0), self._source),
            "i_source",
            (0.0, 1.0),
        )
        e, slopes = self._error(columns, values)
        per_ampere = e[1] - e[0]
        return -e[0] / per_ampere, -slopes[0] / per_ampere

    def run(self, shot: Shot, values: Array) -> tuple[Run, float, Array]:
        """Return the run of one slip, the current [A] it breaks away at, and its derivatives.

        The demand ramps past that current as the measured one did; the control answers to what
        the motor induces, as it did on the bench.
        """
        slip, interval = shot.slip, shot.interval
        current, current_slopes = self.breakaway(slip.rest, slip.direction, values)
        par = self.par.replace(dict(zip(self.names, values.tolist(), strict=True)))
        after = shot.clock + 0.5 * interval - BEFORE  # what is held over an interval, without lag
        demand = current + shot.rate * after
        rest, start = max(slip.rest, 0.0), float(demand[0])
        run = Run(
            self.model,
            par,
            state_at(rest, par, start),
            memory_at(rest, par, start),
            partial(held, demand, interval),
            (demand.size - 1) * interval,
            self.step,
            interval,
        )
        return run, current, current_slopes

    def fit(self, shot: Shot, values: Array, zero: float | None = None) -> Fitted:
        """Run one slip and lay it over the measured one.

        Parameters
        ----------
        values
            Of the unknowns.
        zero
            Reading of the current's sensor without current [A]. The slip is then driven by the
            measured current once it has begun; without, by its ramp alone.
        """
        run, current, current_slopes = self.run(shot, values)
        driven = None if zero is None else driven_by(run, shot, current, zero)
        if driven is not None:
            run = driven.calm
        state, memory = self._start_slopes(run, shot)
        computed = simulate_with_sensitivities(
            run, [*self.names, "stimulus.i_set"], ("p_mc",), state, memory
        )
        p = computed.trajectory["p_mc"]
        answer = np.zeros(p.size)
        if driven is not None:
            offset = np.where(np.arange(p.size) >= driven.first, _MORE, 0.0)
            more = simulate(replace(run, stimulus=with_more(run, offset)), ("p_mc",))["p_mc"]
            answer = (more - p) / _MORE
            p = simulate(driven.sampled, ("p_mc",))["p_mc"]
        r, v, shift = overlaid(shot, p)
        # the demand begins at the breakaway current, and goes on as measured
        by_parameters, all_along = computed.derivatives[:, 0, :-1], computed.derivatives[:, 0, -1]
        slopes = by_parameters + np.outer(all_along - answer, current_slopes)
        at = shot.clock - shift
        kept = np.column_stack([np.interp(at, shot.clock, c) for c in (*slopes.T, answer)])
        kept[at < 0.0] = 0.0
        shift_slopes = (v @ kept) / max(float(v @ v), 1e-300)
        J = kept - np.outer(v, shift_slopes)
        onset = shift + (BEFORE if driven is None else driven.onset)
        level, rate = onset_of(shot, onset)
        return Fitted(
            residuals=r,
            slopes=J[:, :-1],
            by_current=J[:, -1],
            answer=kept[:, -1],
            speed=v,
            breakaway=level - current,
            breakaway_slopes=rate * shift_slopes[:-1] - current_slopes,
        )

    def _start_slopes(self, run: Run, shot: Shot) -> tuple[Array, Array]:
        """Return derivatives of the start by the unknowns, and by an offset of the demand."""
        rest, start = max(shot.slip.rest, 0.0), float(run.state.i)

        def at(current: float) -> Array:
            both = (*state_at(rest, self.par, current), *memory_at(rest, self.par, current))
            return np.array(both)

        slopes = np.zeros((len(run.state) + len(run.memory), self.count + 1))
        slopes[:, -1] = (at(start + _MORE) - at(start - _MORE)) / (2.0 * _MORE)
        return slopes[: len(run.state)], slopes[len(run.state) :]
