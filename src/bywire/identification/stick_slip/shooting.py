"""Every slip of a ramp shot from its own rest and laid over the measured one.

A fit to the whole pressure curve fails from starts a few per cent off: a slip that begins too
early or too late costs as much as one that is not there. So each slip is run by itself, from the
rest that was measured, beginning where the model breaks away, and moved in time to where it lies
best on the measured one. What breaking away tells, the current at which it happened, is a residual
of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bywire.assemblies.motorcycle_brake import MotorcycleBrake
from bywire.assemblies.motorcycle_parameters import MotorcycleParameters
from bywire.assemblies.motorcycle_trim import memory_at, state_at
from bywire.identification.equation import Equation, EquationError
from bywire.identification.stick_slip.shots import LEAD, Shot
from bywire.identification.stick_slip.slips import Slip
from bywire.identification.unknown import Unknown
from bywire.simulation.run import Run, simulate
from bywire.simulation.sensitivity import simulate_with_sensitivities

Array = NDArray[np.float64]

_ROUNDS = 12  # of Newton for the shift in time
_SMOOTHED = 0.006  # s: the converter's noise on the current
_BEGUN = 0.02  # of a slip: before, that noise would decide when the model breaks away
_BEGUN_AT = 2e3  # Pa: of a long one


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
        Derivative of the residuals by an offset of the current [Pa/A], shape (n,).
    answer, speed
        The same with the shift kept [Pa/A], and how fast the pressure moves [Pa/s], shape (n,).
    breakaway, breakaway_slopes
        Measured less computed current at the instant of breaking away [A], and its
        derivatives, shape (p,).
    current
        At which the model breaks away [A].
    onset
        When, on the measurement's clock [s].
    """

    residuals: Array
    slopes: Array
    by_current: Array
    answer: Array
    speed: Array
    breakaway: float
    breakaway_slopes: Array
    current: float
    onset: float


class Shooting:
    """Runs slips of the motorcycle brake for values of the unknowns.

    Parameters
    ----------
    par
        Everything that is known.
    unknowns
        Friction parameters.
    step
        Substep [s].
    """

    def __init__(
        self, par: MotorcycleParameters, unknowns: Sequence[Unknown], step: float = 20e-6
    ) -> None:
        self.par = par.replace({"drive.mode": "current-source"})
        self.names = tuple(u.name for u in unknowns)
        self.count = len(self.names)
        self.model, self.step = MotorcycleBrake(), step
        self._error = EquationError(Equation(self.model, "omega", "alpha"), self.par, unknowns)

    def breakaway(self, rest: float, direction: int, values: Array) -> tuple[float, Array]:
        """Return the current [A] that breaks away from a rest [Pa], and its derivatives.

        Where motor, pressure and breakaway torque balance: the equation of motion without
        motion, which is affine in the current.
        """
        columns = self._error.at(
            state_at(max(rest, 0.0), self.par)._replace(omega=direction * 1e-12),
            memory_at(max(rest, 0.0), self.par), "i_source", (0.0, 1.0),
        )  # fmt: skip
        e, slopes = self._error(columns, values)
        per_ampere = e[1] - e[0]
        return -e[0] / per_ampere, -slopes[0] / per_ampere

    def run(self, shot: Shot, values: Array) -> tuple[Run, float, Array]:
        """Return the run of one slip, the current [A] it breaks away at, and its derivatives.

        The current grows as it did before the slip; once the slip has begun it follows the
        measured one, which dips where the shaft turns quickly.
        """
        slip, interval, t = shot.slip, _interval(shot), _clock(shot)
        current, current_slopes = self.breakaway(slip.rest, slip.direction, values)
        rate, level = shot.line
        middle = t + 0.5 * interval  # what is held over an interval, without lag
        ramp = current + rate * middle
        par = self.par.replace(dict(zip(self.names, values.tolist(), strict=True)))
        rest = max(slip.rest, 0.0)
        run = Run(
            self.model, par, state_at(rest, par), memory_at(rest, par),
            partial(_held, ramp, interval), (t.size - 1) * interval, self.step, interval,
        )  # fmt: skip
        alone = simulate(run, ("p_mc",))["p_mc"]
        shift = _best_shift(shot, alone)
        dip = _dip(np.interp(middle + shift, t, shot.current - level - rate * t), interval)
        travel = np.abs(alone - alone[0])
        dip[travel < min(_BEGUN * travel.max(), _BEGUN_AT)] = 0.0
        return replace(run, stimulus=partial(_held, ramp + dip, interval)), current, current_slopes

    def fit(self, shot: Shot, values: Array) -> Fitted:
        """Run one slip and lay it over the measured one."""
        run, current, current_slopes = self.run(shot, values)
        found = simulate_with_sensitivities(run, [*self.names, "stimulus.i_set"], ("p_mc",))
        slopes, by_current = found.derivatives[:, 0, :-1], found.derivatives[:, 0, -1:]
        slopes = np.hstack((slopes + by_current * current_slopes, by_current))
        r, v, shift = overlaid(shot, found.trajectory["p_mc"])
        t, (rate, level) = _clock(shot), shot.line
        at = t - shift
        J = np.column_stack([np.interp(at, t, column) for column in slopes.T])
        J[at < 0.0] = 0.0
        shift_slopes = (v @ J) / max(float(v @ v), 1e-300)
        answer, J = J[:, -1], J - np.outer(v, shift_slopes)
        return Fitted(
            residuals=r, slopes=J[:, :-1], by_current=J[:, -1], answer=answer, speed=v,
            breakaway=level + rate * shift - current,
            breakaway_slopes=rate * shift_slopes[:-1] - current_slopes,
            current=current, onset=float(shot.time[0] + shift),
        )  # fmt: skip


def overlaid(shot: Shot, p: Array) -> tuple[Array, Array, float]:
    """Return computed less measured pressure, the computed speed, and the shift between them.

    Parameters
    ----------
    p
        Computed pressure [Pa], shape (n,); moved in time to where it lies best.
    """
    shift = _best_shift(shot, p)
    r, v = _laid_over(shot, p, shift)
    return r, v, shift


def _interval(shot: Shot) -> float:
    return float(f"{shot.time[1] - shot.time[0]:.9g}")


def _clock(shot: Shot) -> Array:
    """Return the time since the first row [s], shape (n,)."""
    return np.arange(shot.time.size, dtype=float) * _interval(shot)


def _held(ramp: Array, interval: float, at: Array) -> Array:
    fields = MotorcycleBrake().Stimulus._fields
    rows = np.zeros((at.size, len(fields)))
    index = np.clip(np.floor(at / interval + 1e-6).astype(int), 0, ramp.size - 1)
    rows[:, fields.index("i_set")] = ramp[index]
    return rows


def _dip(beside: Array, interval: float) -> Array:
    """Return how far the current leaves its ramp, smoothed over a few samples."""
    width = 2 * int(0.5 * _SMOOTHED / interval) + 1
    padded = np.pad(beside, width // 2, mode="edge")
    return np.convolve(padded, np.ones(width) / width, mode="valid")


def _best_shift(shot: Shot, p: Array) -> float:
    """Return by how much later the computed slip lies on the measured one [s] (Gauss, Newton)."""
    t = _clock(shot)
    shift = _half_way(t, shot.pressure, shot.slip) - _half_way(t, p, shot.slip)
    for _ in range(_ROUNDS):
        r, v = _laid_over(shot, p, shift)
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
    t = _clock(shot)
    at = t - shift
    v = np.interp(at, t, np.gradient(p, _interval(shot)))
    v[(at <= 0.0) | (at >= t[-1])] = 0.0
    return np.interp(at, t, p) - shot.pressure, v


def _half_way(t: Array, p: Array, slip: Slip) -> float:
    """Return when a slip has gone half of its way [s]."""
    middle = 0.5 * (p[0] + p[-1])
    beyond = np.flatnonzero(slip.direction * (p - middle) > 0.0)
    return float(t[beyond[0]]) if beyond.size else float(t[-1])
