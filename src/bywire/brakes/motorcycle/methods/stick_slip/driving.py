"""A slip's demand, corrected by how far the measured current lies beside the model's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bywire.brakes.motorcycle.methods.stick_slip.overlay import best_shift
from bywire.brakes.motorcycle.methods.stick_slip.shots import BEFORE, Shot
from bywire.brakes.motorcycle.methods.stick_slip.slips import moving_mean
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.core.typing import Array
from bywire.simulation.run import Run, simulate

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
