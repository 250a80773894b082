"""Adjuster of a brake's clearance, which measures the pads' travel and turns by whole teeth.

It acts only while the brake is parked. Its faults are parameters that affect the turning. Teeth are
positive if they reduce the clearance.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length, Unit
from bywire.core.signals import Signal

WAITS, APPLIED, TURNS = 0.0, 1.0, 2.0

_WHOLE = 1e-9  # share of a tooth: rounding error of a whole tooth
Flag = Annotated[float, Signal("1", "flag")]
Teeth = Annotated[float, Signal("1", "teeth")]


class Parameters(ParameterSet):
    """Thresholds and steps of the adjuster, and its fault.

    ``ways``: ``"closing"`` only reduces clearance; ``"both"`` also increases a clearance below
    ``gap_min``.
    ``fault``: ``"none"``; ``"stuck"``: nothing turns; ``"one-way"``: the adjuster does not increase
    clearance; ``"slips"``: every second tooth has no effect; ``"over-adjusts"``: one tooth too
    many; ``"blind-to-heat"``: the adjuster treats a hot disc as a cold one. It does not detect any
    of these faults and continues its count.
    """

    gap_nominal: Length
    """clearance that the adjuster restores"""
    band: Length
    """tolerated excess of the clearance"""
    gap_min: Length
    """clearance of the cold brake below which the adjuster never turns; a hot disc reduces it"""
    tooth: Length
    """clearance removed by a tooth"""
    applications: Annotated[float, Unit("1", 3.0), Field(ge=1, allow_inf_nan=False)]
    """number of consecutive applications with the same deviation before the adjuster turns"""
    growth: Annotated[float, Unit("m/K", 3e-7), Field(ge=0, allow_inf_nan=False)]
    """clearance lost per kelvin of the disc"""
    T_cold: Annotated[float, Unit("K", 300.0), Field(gt=0, allow_inf_nan=False)]
    """temperature of a cold disc"""
    ways: Literal["closing", "both"]
    """directions in which the adjuster turns"""
    fault: Literal["none", "stuck", "one-way", "slips", "over-adjusts", "blind-to-heat"]
    """fault"""


class State(NamedTuple):
    """Memory."""

    applied: Annotated[float, Signal("1", "the brake was applied since it was last parked")]
    wide: Annotated[float, Signal("1", "applications in a row with too much gap; < 0: too little")]
    teeth: Annotated[float, Signal("1", "teeth turned, by the adjuster's count")]


class Input(NamedTuple):
    """Signals that the wear log needs."""

    gap: Annotated[
        float, Signal("m", "clearance from the travel between parking and contact", 2e-4)
    ]
    T: Annotated[float, Signal("K", "temperature of the disc, estimated", 350.0)]
    touching: Annotated[float, Signal("1", "the pads press on the disc")]
    parked: Annotated[float, Signal("1", "the brake is parked")]
    wanted: Annotated[float, Signal("1", "braking is demanded")]


class Output(NamedTuple):
    """Intended and actual teeth to turn now, and the state of the adjuster."""

    teeth: Teeth
    turned: Teeth
    mode: Annotated[float, Signal("1", "adjuster: 0 waits, 1 brake applied, 2 turns", 2.0)]


def cold_gap(u: Input, par: Parameters) -> Annotated[float, Signal("m", "clearance when cold")]:
    """Return the clearance of the cold brake, from the travel to contact and the disc's growth."""
    if par.fault == "blind-to-heat":
        return u.gap
    return u.gap + par.growth * (u.T - par.T_cold)


def due(gap: Annotated[float, Signal("m", "clearance when cold", 2e-4)], par: Parameters) -> Teeth:
    """Return the teeth that restore a clearance, not below the nominal or the least clearance.

    Below the least clearance, the result is the smallest sufficient number if the direction is
    allowed, otherwise zero.
    """
    spare = gap - ops.fmax(par.gap_nominal, par.gap_min)
    closing = ops.fmax(ops.floor(spare / par.tooth + _WHOLE), 0.0)
    if par.ways == "closing":
        return closing
    return closing + ops.fmin(ops.floor((gap - par.gap_min) / par.tooth + _WHOLE), 0.0)


def turned(teeth: Teeth, before: Teeth, par: Parameters) -> Teeth:
    """Return the teeth that actually turn, from the intended ones and the previous count."""
    if par.fault == "stuck":
        return 0.0 * teeth
    if par.fault == "one-way":
        return ops.fmax(teeth, 0.0)
    if par.fault == "slips":  # only the odd ones of the intended teeth have an effect
        return ops.floor(0.5 * (before + teeth + 1.0)) - ops.floor(0.5 * (before + 1.0))
    if par.fault == "over-adjusts":
        return teeth + ops.where(teeth > 0, 1.0, 0.0)
    return teeth


def output(x: State, u: Input, par: Parameters) -> tuple[State, Output]:
    """Advance the adjuster by one sample.

    An application counts if the pads have touched the disc. It counts once, when the brake is
    parked without a demand afterward.
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
