"""Stick-slip in a measured signal: simulation of every slip from its rest, aligned in time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.core.callers import option
from bywire.core.errors import ParameterError, not_valid
from bywire.core.typing import Array
from bywire.identification.equation import Equation, EquationError
from bywire.identification.measured import noise_of
from bywire.identification.unknown import Unknown
from bywire.simulation.run import Run, simulate
from bywire.simulation.sensitivity import simulate_with_sensitivities

_WINDOW = 0.02  # s: span of the differences that detect motion
_SURE = 6.0  # standard deviations of such a difference
_OVER_NOISE = 6.0  # standard deviations of the preceding rest: smaller changes are noise
_PAUSE = 0.05  # s: shorter rests belong to the slip around them


@dataclass(frozen=True)
class Slip:
    """A period of motion between two rests.

    ``begin``, ``end``: samples at which the motion (or the record) begins and ends;
    ``direction``: 1 for rising, -1 for falling; ``rest``: level of the preceding rest.
    """

    begin: int
    end: int
    direction: int
    rest: float


def find_slips(values: Array, interval: float, least: float) -> list[Slip]:
    """Return the slips in a signal.

    ``values``: shape (n,); ``interval``: sample time [s]; ``least``: minimum change that counts,
    provided that it exceeds the noise of the preceding rest.
    """
    width = max(round(_WINDOW / interval), 1)
    smooth = _moving_mean(values, width)
    change = np.zeros(values.size)
    change[width:-width] = smooth[2 * width :] - smooth[: -2 * width]
    threshold = max(_SURE * noise_of(values) * np.sqrt(2.0 / width), 0.01 * least)
    moving = np.abs(change) > threshold
    slips = []
    for begin, end in _stretches(moving, int(_PAUSE / interval)):
        for first, last in _one_way(smooth, begin, end, least):
            before = values[max(first - 5 * width, 0) : max(first - width, 1)]
            if before.size < width:
                continue  # the record does not show the level of the rest
            travel = smooth[min(last, values.size - 1)] - before.mean()
            if abs(travel) >= max(least, _OVER_NOISE * float(before.std())):
                direction = 1 if travel > 0 else -1
                slips.append(Slip(first, last, direction, float(before.mean())))
    return slips


def _moving_mean(values: Array, width: int) -> Array:
    """Return the moving mean over a number of samples, shape (n,)."""
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.ones(width) / width, mode="valid")


def _stretches(moving: NDArray[np.bool_], pause: int) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], moving.astype(int), [0]))))
    stretches: list[tuple[int, int]] = []
    for begin, end in edges.reshape(-1, 2).tolist():
        if stretches and begin - stretches[-1][1] <= pause:
            stretches[-1] = (stretches[-1][0], end)
        else:
            stretches.append((begin, end))
    return stretches


def _one_way(values: Array, begin: int, end: int, least: float) -> list[tuple[int, int]]:
    """Split a period of motion where it reverses by more than the minimum change of a slip."""
    part = values[begin:end]
    top, low = int(np.argmax(part)), int(np.argmin(part))
    rise, fall = part[top] - part[0], part[0] - part[low]
    if top > 0 and rise > least and part[top] - part[-1] > least:
        return [(begin, begin + top), *_one_way(values, begin + top, end, least)]
    if low > 0 and fall > least and part[-1] - part[low] > least:
        return [(begin, begin + low), *_one_way(values, begin + low, end, least)]
    return [(begin, end)]


# --- Shots: slips with their surroundings in the record

_LEAD = 0.05
"""rest before the measured onset [s]"""
BEFORE = 0.01
"""rest before the model breaks away [s]"""
_LEAST = 8  # samples
_COARSEST = 4e-3  # s
_RESTED = 1.0  # s of rest that determine the rest pressure and the current's ramp
_COMPARED = 0.9  # fraction of a slip's travel: current ripple decides when it begins and ends
_SMOOTHED = 0.02  # s
_SEEN = 0.016  # s: span of the line through the current, short because of the ripple


@dataclass(frozen=True)
class Shot:
    """A measured slip.

    Parameters
    ----------
    slip
        Its rows and direction.
    time, pressure, current
        Measured signals, starting shortly before the onset; shape (n,), SI.
    rate
        Slope of the current ramp while the piston rests [A/s].
    unrest
        Standard deviation of the current from that ramp [A].
    before, slope
        Level [A] and rate [A/s] of the current at each time, from a line through the samples
        shortly before it; shape (n,).
    seen
        Number of samples of that line.
    steep
        Number of rows in the first half of the travel.
    """

    slip: Slip
    time: Array
    pressure: Array
    current: Array
    rate: float
    unrest: float
    before: Array
    slope: Array
    seen: int
    steep: int

    @cached_property
    def interval(self) -> float:
        """Sample time [s]."""
        return float(f"{self.time[1] - self.time[0]:.9g}")

    @cached_property
    def clock(self) -> Array:
        """Time since the first row [s], shape (n,)."""
        return np.arange(self.time.size, dtype=float) * self.interval

    @cached_property
    def half_way(self) -> float:
        """Time since the first row [s] at which the slip has covered half of its travel."""
        return _half_way(self.clock, self.pressure, self.slip)


def cut_out(
    time: Array, pressure: Array, current: Array, slips: Sequence[Slip], longest: float
) -> list[Shot]:
    """Return the measured slips with their surroundings, up to the next onset.

    The function skips slips that have too few samples, no preceding rest, or no current ramp in
    their direction.

    Raises
    ------
    ParameterError
        When no slip remains, or the sample time is too long.
    """
    interval = float(time[1] - time[0])
    if interval > _COARSEST:
        raise not_valid(
            "sample time",
            f"{1e3 * interval:.3g} ms",
            f"<= {1e3 * _COARSEST:g} ms",
            "so that the record shows how slips begin",
        )
    shots = []
    lead, most, rested = (int(span / interval) for span in (_LEAD, longest, _RESTED))
    seen = max(round(_SEEN / interval), 4)
    smooth = _moving_mean(pressure, max(round(_SMOOTHED / interval), 1))
    for k, slip in enumerate(slips):
        first = max(slip.begin - lead, 0)
        until = slips[k + 1].begin - lead if k + 1 < len(slips) else time.size
        compared, half = (_passed(smooth, slip, 2 * lead, share) for share in (_COMPARED, 0.5))
        last = min(compared, slip.begin + most, until)
        rest = slice(max(slip.begin - rested, slips[k - 1].end + lead if k else 0), slip.begin)
        if min(last - first, rest.stop - rest.start) < _LEAST:
            continue
        rows = slice(first, last)
        level, slope = _lines_before(current, first, last, seen)
        line = np.polynomial.Polynomial.fit(time[rest], current[rest], 1)
        unrest = float(np.std(current[rest] - line(time[rest])))
        rate = float(line.deriv()(time[first]))
        if rate * slip.direction <= 0.0:
            continue
        from_rest = replace(slip, rest=float(pressure[rest].mean()))
        shot = Shot(
            from_rest,
            time[rows],
            pressure[rows],
            current[rows],
            rate,
            unrest,
            level,
            slope / interval,
            seen,
            min(half, last) - first,
        )
        shots.append(shot)
    if not shots:
        raise ParameterError(
            f"none of the {len(slips)} slips has {_LEAST} samples, a preceding rest and a current "
            "ramp in its direction. Either they are noise or the signal's unit is wrong. Check the "
            "unit, and increase the minimum pressure change of a slip "
            f"({option('options', {'least': '...'})})",
            name="least",
        )
    return shots


def _passed(values: Array, slip: Slip, rest: int, share: float) -> int:
    """Return the sample at which a slip has covered a fraction of its travel.

    The values must be smooth: noise would exceed the fraction too early.
    """
    end = float(values[slip.end : slip.end + rest].mean())
    beyond = slip.direction * (values[slip.begin :] - slip.rest) > share * abs(end - slip.rest)
    return slip.begin + int(np.argmax(beyond))


def _lines_before(values: Array, first: int, last: int, seen: int) -> tuple[Array, Array]:
    """Return level and change per sample at each sample, from a line through preceding samples."""
    at = np.arange(1 - seen, 1, dtype=float)
    centered = at - at.mean()
    slope = centered / (centered @ centered)
    level = 1.0 / seen - at.mean() * slope
    padded = np.concatenate((np.full(max(seen - 1 - first, 0), values[0]), values[:last]))
    windows = np.lib.stride_tricks.sliding_window_view(padded[-(last - first + seen - 1) :], seen)
    return np.asarray(windows @ level), np.asarray(windows @ slope)


def onset_of(shot: Shot, shift: float) -> tuple[float, float]:
    """Return level [A] and rate [A/s] of the measured current at one time of a shot.

    The rate is at least the ramp's rate, because the ramp drives the piston past breakaway.
    """
    level, slope = (float(np.interp(shift, shot.clock, v)) for v in (shot.before, shot.slope))
    way = float(np.sign(shot.rate)) or float(shot.slip.direction)
    return level, way * max(way * slope, way * shot.rate)


def require_calm(shots: Sequence[Shot], noise: float, most: float) -> None:
    """Reject a current that does not follow its ramp while the piston rests.

    ``noise``: standard deviation of the measurement noise [A]; ``most``: maximum standard
    deviation of the current itself [A].
    """
    unrest = float(np.median([np.sqrt(max(s.unrest**2 - noise**2, 0.0)) for s in shots]))
    if unrest > most:
        raise ParameterError(
            f"between the slips, the current deviates from its ramp by {unrest:.3g} A (standard "
            f"deviation). The deviation must be <= {most:.3g} A. Switch off the dither, and check "
            "the unit of i",
            name="i",
            value=f"{unrest:.3g} A",
            valid=f"<= {most:.3g} A",
        )


def require_reachable(shots: Sequence[Shot], par: MotorcycleParameters) -> None:
    """Reject rests at pressures that the brake cannot hold with these parameters."""
    highest = max(shot.slip.rest for shot in shots)
    try:
        state_at(max(highest, 0.0), par)
    except ParameterError as error:
        raise ParameterError(
            f"the measured pressure rests at {highest / 1e5:.4g} bar, but this brake cannot "
            f"hold that pressure. Check the unit of p_mc, and the parameters ({error})",
            name="p_mc",
            value=f"{highest / 1e5:.4g} bar",
            valid=error.valid,
        ) from None


# --- Shooting

_ROUNDS = 12  # of Newton


def overlaid(shot: Shot, p: Array) -> tuple[Array, Array, float]:
    """Return computed minus measured pressure, the computed speed, and the shift between them.

    Parameters
    ----------
    p
        Computed pressure [Pa], shape (n,); shifted in time for the best fit.
    """
    rate = np.gradient(p, shot.interval)
    shift = _best_shift(shot, p, rate, shot.time.size)
    r, v = _laid_over(shot, p, rate, shift, shot.time.size)
    return r, v, shift


def _best_shift(shot: Shot, p: Array, rate: Array, rows: int) -> float:
    """Return the delay [s] of the computed slip that fits the measured one best (Gauss-Newton).

    ``rate``: rate of the computed pressure [Pa/s]; ``rows``: number of rows to compare, starting
    with the first.
    """
    shift = shot.half_way - _half_way(shot.clock, p, shot.slip)
    for _ in range(_ROUNDS):
        r, v = _laid_over(shot, p, rate, shift, rows)
        size = float(v @ v)
        if size == 0.0:
            break
        change = float(v @ r) / size
        shift += min(max(change, -_LEAD), _LEAD)
        if abs(change) < 1e-9:
            break
    return shift


def _laid_over(shot: Shot, p: Array, rate: Array, shift: float, rows: int) -> tuple[Array, Array]:
    """Return computed (delayed by ``shift``) minus measured pressure, and the computed speed."""
    t = shot.clock
    at = t[:rows] - shift
    v = np.interp(at, t, rate)
    v[(at <= 0.0) | (at >= t[-1])] = 0.0
    return np.interp(at, t, p) - shot.pressure[:rows], v


def _half_way(t: Array, p: Array, slip: Slip) -> float:
    """Return the time [s] at which a slip has covered half of its travel."""
    middle = 0.5 * (p[0] + p[-1])
    beyond = np.flatnonzero(slip.direction * (p - middle) > 0.0)
    return float(t[beyond[0]]) if beyond.size else float(t[-1])


# --- Shooting
# A fit to the whole pressure curve fails if it starts a few percent off: a slip at the wrong time
# costs as much as a missing one. So each slip is simulated alone, starting at the measured rest and
# the model's breakaway, and shifted in time until it fits the measured slip best. The current at
# breakaway is a separate residual.
#
# The run's demand ramps through the model's own breakaway current. The modeled controller responds
# to the motor's back-EMF, so the current dips as on the bench, at the right time. Once the slip
# has begun, the demand is corrected by the difference between measured and computed
# current.

_SMOOTHED_SHOT = 0.01  # s: moving average of the measured current
_BEGUN = 0.02  # of a slip: earlier, current noise would decide when the model breaks away
_BEGUN_AT = 2e3  # Pa: the same for a long slip
_ALIGNED = 2  # iterations that align the measured current with the slip that it drives
_DIP = 0.1  # s: duration of the current's dip as a slip begins
_LEAST_LATE = 20  # samples needed to fit a line
_I_SET = MotorcycleBrake().Stimulus._fields.index("i_set")


@dataclass(frozen=True)
class Driven:
    """Simulations of a slip with the measured current.

    Parameters
    ----------
    calm
        Run driven by a line through the current after its dip. Its derivatives are therefore free
        of the current's noise, which would bias the estimates.
    sampled
        Run driven by the measured current.
    first
        First row with the measured current.
    onset
        Time at which the model breaks away [s].
    """

    calm: Run
    sampled: Run
    first: int
    onset: float


def _driven_by(ramp: Run, shot: Shot, current: float, zero: float) -> Driven:
    """Return a slip's run with the measured current in place of its ramp.

    ``ramp``: run whose demand ramps through the model's breakaway current; ``shot``: the measured
    slip; ``current``: the model's breakaway current [A]; ``zero``: zero offset of the current
    sensor [A].
    """
    middle = shot.clock + 0.5 * shot.interval
    width = 2 * int(0.5 * _SMOOTHED_SHOT / shot.interval) + 1
    measured = _moving_mean(shot.current - zero, width)
    sampled, more, first, onset = ramp, np.zeros(middle.size), 0, BEFORE
    for _ in range(_ALIGNED):
        computed = simulate(sampled, ("p_mc", "i", "omega"))
        p, i = computed["p_mc"], _moving_mean(computed["i"], width)
        shift = _best_shift(shot, p, np.gradient(p, shot.interval), shot.steep)
        rests = max(int(np.argmax(computed["omega"] != 0.0)) - 1, 0)
        onset = float(shot.clock[rests] + (current - computed["i"][rests]) / shot.rate)
        travel = np.abs(p - p[0])
        first = int(np.argmax(travel > min(_BEGUN * travel.max(), _BEGUN_AT)))
        target = np.interp(np.asarray(middle + shift), shot.clock, measured)
        more = more + target - np.interp(middle, shot.clock, i)
        more[:first] = 0.0
        sampled = replace(ramp, stimulus=_with_more(ramp, more))
    dipped = first + round(_DIP / shot.interval)
    calm, late = sampled, slice(dipped, int((shot.clock[-1] - shift) / shot.interval))
    if late.stop - late.start >= _LEAST_LATE:
        line = np.polynomial.Polynomial.fit(middle[late], more[late], 1)
        more[dipped:] = line(middle[dipped:])
        calm = replace(ramp, stimulus=_with_more(ramp, more))
    return Driven(calm, sampled, first, onset)


def _with_more(run: Run, more: Array) -> Callable[[Array], Array]:
    """Return the run's stimulus with additional demand in each of its intervals."""
    interval = run.record
    demand = run.stimulus(np.arange(more.size, dtype=np.float64) * interval)[:, _I_SET]
    return partial(held, demand + more, interval)


def held(ramp: Array, interval: float, at: Array) -> Array:
    """Return a stimulus that holds its demand over each interval."""
    fields = MotorcycleBrake().Stimulus._fields
    rows = np.zeros((at.size, len(fields)))
    index = np.clip(np.floor(at / interval + 1e-6).astype(int), 0, ramp.size - 1)
    rows[:, _I_SET] = ramp[index]
    return rows


_MORE = 1e-3  # A: offset for computing the response to an offset


@dataclass(frozen=True)
class Fitted:
    """A simulated slip, time-aligned with the measured one.

    Parameters
    ----------
    residuals
        Computed minus measured pressure [Pa], shape (n,).
    slopes
        Derivatives of the residuals by the unknowns, at the best shift, shape (n, p).
    by_current
        Derivative of the residuals by an offset of the current along the slip [Pa/A], shape (n,).
    answer, speed
        The same derivative at a fixed shift [Pa/A], and the rate of the pressure [Pa/s], shape
        (n,).
    breakaway, breakaway_slopes
        Measured minus computed current at breakaway [A], and its derivatives, shape (p,).
    """

    residuals: Array
    slopes: Array
    by_current: Array
    answer: Array
    speed: Array
    breakaway: float
    breakaway_slopes: Array


class Shooting:
    """Simulation of slips of the motorcycle brake for values of the unknowns.

    ``par``: known parameters; ``unknowns``: friction parameters; ``step``: substep [s].
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
        self._at_breakaway: dict[tuple[float, int], Array] = {}

    def breakaway(self, rest: float, direction: int, values: Array) -> tuple[float, Array]:
        """Return the breakaway current [A] from a rest [Pa], and its derivatives.

        At this current, the motor, pressure and breakaway torques balance. The equation of motion
        at standstill is affine in the current.
        """
        columns = self._at_breakaway.get((rest, direction))
        if columns is None:  # the same in every evaluation
            columns = self._at_breakaway[rest, direction] = self._error.at(
                state_at(max(rest, 0.0), self._source)._replace(omega=direction * 1e-12),
                memory_at(max(rest, 0.0), self._source),
                "i_source",
                (0.0, 1.0),
            )
        e, slopes = self._error(columns, values)
        per_ampere = e[1] - e[0]
        return -e[0] / per_ampere, -slopes[0] / per_ampere

    def run(self, shot: Shot, values: Array) -> tuple[Run, float, Array]:
        """Return the run of a slip, its breakaway current [A], and that current's derivatives.

        The demand ramps past that current at the measured rate. The controller responds to the
        motor's back-EMF, as on the bench.
        """
        slip, interval = shot.slip, shot.interval
        current, current_slopes = self.breakaway(slip.rest, slip.direction, values)
        par = self.par.replace(dict(zip(self.names, values.tolist(), strict=True)))
        after = shot.clock + 0.5 * interval - BEFORE  # middle of each held interval: no lag
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
        """Simulate a slip and align it with the measured one.

        Parameters
        ----------
        values
            Values of the unknowns.
        zero
            Zero offset of the current sensor [A]. If given, the measured current drives the slip
            once the slip has begun; otherwise only the ramp does.
        """
        run, current, current_slopes = self.run(shot, values)
        driven = None if zero is None else _driven_by(run, shot, current, zero)
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
            more = simulate(replace(run, stimulus=_with_more(run, offset)), ("p_mc",))["p_mc"]
            answer = (more - p) / _MORE
            p = simulate(driven.sampled, ("p_mc",))["p_mc"]
        r, v, shift = overlaid(shot, p)
        # The demand starts at the breakaway current and continues as measured.
        by_parameters, all_along = computed.derivatives[:, 0, :-1], computed.derivatives[:, 0, -1]
        slopes = by_parameters + np.outer(all_along - answer, current_slopes)
        at = shot.clock - shift
        kept = np.zeros((p.size, self.count + 1))
        for k, slope in enumerate((*slopes.T, answer) if driven is not None else slopes.T):
            kept[:, k] = np.interp(at, shot.clock, slope)
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
        """Return derivatives of the initial state by the unknowns and by a demand offset."""
        rest, start = max(shot.slip.rest, 0.0), float(run.state.i)

        def at(current: float) -> Array:
            both = (*state_at(rest, self.par, current), *memory_at(rest, self.par, current))
            return np.array(both)

        slopes = np.zeros((len(run.state) + len(run.memory), self.count + 1))
        slopes[:, -1] = (at(start + _MORE) - at(start - _MORE)) / (2.0 * _MORE)
        return slopes[: len(run.state)], slopes[len(run.state) :]
