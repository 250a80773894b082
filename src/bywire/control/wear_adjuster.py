"""Adjuster of a brake's clearance: it counts how far the pads travel, and turns by whole teeth.

It acts only while the brake is parked. Its faults are parameters of the turning. Teeth are
positive where they take clearance away.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length, Unit
from bywire.core.signals import Signal

WAITS, APPLIED, TURNS = 0.0, 1.0, 2.0

_WHOLE = 1e-9  # of a tooth: rounding error of a whole one
Flag = Annotated[float, Signal("1", "flag")]
Teeth = Annotated[float, Signal("1", "teeth")]


class Parameters(ParameterSet):
    """Thresholds and steps of the adjuster, and its fault.

    ``ways``: ``"closing"`` takes clearance away only; ``"both"`` also gives it back where there is
    less than ``gap_min``.
    ``fault``: ``"none"``; ``"stuck"``: nothing turns; ``"one-way"``: nothing turns that would give
    clearance back; ``"slips"``: every second tooth turns nothing; ``"over-adjusts"``: one tooth too
    many; ``"blind-to-heat"``: it takes a hot disc for a cold one. The adjuster knows of none of
    them: its count goes on.
    """

    gap_nominal: Length
    """clearance that it restores"""
    band: Length
    """excess of the clearance that it tolerates"""
    gap_min: Length
    """clearance of the cold brake below which it never turns; a hot disc takes some of it"""
    tooth: Length
    """clearance that a tooth takes away"""
    applications: Annotated[float, Unit("1", 3.0), Field(ge=1, allow_inf_nan=False)]
    """applications one after the other that have to show the same before it turns"""
    growth: Annotated[float, Unit("m/K", 3e-7), Field(ge=0, allow_inf_nan=False)]
    """clearance that each kelvin of the disc takes away"""
    T_cold: Annotated[float, Unit("K", 300.0), Field(gt=0, allow_inf_nan=False)]
    """temperature of a cold disc"""
    ways: Literal["closing", "both"]
    """which ways it turns"""
    fault: Literal["none", "stuck", "one-way", "slips", "over-adjusts", "blind-to-heat"]
    """fault"""


class State(NamedTuple):
    """Memory."""

    applied: Annotated[float, Signal("1", "the brake was applied since it was parked last")]
    wide: Annotated[float, Signal("1", "applications in a row with too much gap; < 0: too little")]
    teeth: Annotated[float, Signal("1", "teeth turned, by its own count")]


class Input(NamedTuple):
    """Signals, all that the wear log needs."""

    gap: Annotated[float, Signal("m", "clearance by the way from parking to contact", 2e-4)]
    T: Annotated[float, Signal("K", "temperature of the disc, estimated", 350.0)]
    touching: Annotated[float, Signal("1", "the pads press on the disc")]
    parked: Annotated[float, Signal("1", "the brake is parked")]
    wanted: Annotated[float, Signal("1", "braking is demanded")]


class Output(NamedTuple):
    """Teeth to be turned now, as it means to, and as they turn; what it is at."""

    teeth: Teeth
    turned: Teeth
    mode: Annotated[float, Signal("1", "adjuster: 0 waits, 1 brake applied, 2 turns", 2.0)]


def cold_gap(u: Input, par: Parameters) -> Annotated[float, Signal("m", "clearance when cold")]:
    """Return the clearance of the cold brake, by the way to contact and the disc's growth."""
    if par.fault == "blind-to-heat":
        return u.gap
    return u.gap + par.growth * (u.T - par.T_cold)


def due(gap: Annotated[float, Signal("m", "clearance when cold", 2e-4)], par: Parameters) -> Teeth:
    """Return the teeth that bring a clearance back, never below the nominal nor the least one.

    Below the least one as few as make it up, if they may turn that way; else none.
    """
    spare = gap - ops.fmax(par.gap_nominal, par.gap_min)
    closing = ops.fmax(ops.floor(spare / par.tooth + _WHOLE), 0.0)
    if par.ways == "closing":
        return closing
    return closing + ops.fmin(ops.floor((gap - par.gap_min) / par.tooth + _WHOLE), 0.0)


def turned(teeth: Teeth, before: Teeth, par: Parameters) -> Teeth:
    """Return the teeth that really turn, of those that are to, by what was turned before."""
    if par.fault == "stuck":
        return 0.0 * teeth
    if par.fault == "one-way":
        return ops.fmax(teeth, 0.0)
    if par.fault == "slips":  # the odd ones of all that were ever to be turned hold
        return ops.floor(0.5 * (before + teeth + 1.0)) - ops.floor(0.5 * (before + 1.0))
    if par.fault == "over-adjusts":
        return teeth + ops.where(teeth > 0, 1.0, 0.0)
    return teeth


def output(x: State, u: Input, par: Parameters) -> tuple[State, Output]:
    """Advance the adjuster by one sample.

    An application is one in which the pads touched; it counts once, when the brake is parked behind
    it and nothing is demanded.
    """
    rests = ops.where(u.parked > 0.5, ops.where(u.wanted > 0.5, 0.0, 1.0), 0.0)
    finished = rests * x.applied
    gap = cold_gap(u, par)
    is_wide = ops.where(gap > par.gap_nominal + par.band, 1.0, 0.0)
    row = is_wide * (ops.fmax(x.wide, 0.0) + 1.0)
    if par.ways == "both":
        row = row - ops.where(gap < par.gap_min, 1.0, 0.0) * (ops.fmax(-x.wide, 0.0) + 1.0)
    wide = ops.where(finished > 0.5, row, x.wide)
    acts = finished * ops.where(ops.fabs(wide) >= par.applications, 1.0, 0.0)
    teeth = acts * due(gap, par)
    turns = ops.fabs(teeth) > 0.5
    state = State(
        applied=ops.where(rests > 0.5, 0.0, ops.where(u.touching > 0.5, 1.0, x.applied)),
        wide=ops.where(turns, 0.0, wide),
        teeth=x.teeth + teeth,
    )
    mode = ops.where(turns, TURNS, ops.where(state.applied > 0.5, APPLIED, WAITS))
    return state, Output(teeth=teeth, turned=turned(teeth, x.teeth, par), mode=mode)
