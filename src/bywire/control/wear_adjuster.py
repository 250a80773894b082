"""Clearance adjuster of a brake, which measures pad travel and turns by whole teeth.

It acts only while the brake is parked. Its faults are parameters that affect the turns. Teeth are
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

_WHOLE = 1e-9  # rounding error of a whole tooth, in teeth
Flag = Annotated[float, Signal("1", "flag")]
Teeth = Annotated[float, Signal("1", "teeth")]


class Parameters(ParameterSet):
    """Thresholds and steps of the adjuster, and its fault.

    ``ways``: ``"closing"`` only reduces the clearance. ``"both"`` also increases a clearance below
    ``gap_min``.
    ``fault``: ``"none"``, ``"stuck"`` (nothing turns), ``"one-way"`` (the adjuster does not
    increase the clearance), ``"slips"`` (every second tooth has no effect), ``"over-adjusts"`` (one
    tooth too many), or ``"blind-to-heat"`` (the adjuster treats a hot disc like a cold disc). The
    adjuster does not detect any of these faults and continues its count.
    """

    gap_nominal: Length
    """clearance that the adjuster restores"""
    band: Length
    """tolerated excess clearance"""
    gap_min: Length
    """cold clearance below which the adjuster never turns; a hot disc reduces the clearance"""
    tooth: Length
    """clearance removed per tooth"""
    applications: Annotated[float, Unit("1", 3.0), Field(ge=1, allow_inf_nan=False)]
    """number of consecutive brake applications with the same deviation before the adjuster turns"""
    growth: Annotated[float, Unit("m/K", 3e-7), Field(ge=0, allow_inf_nan=False)]
    """loss of clearance per kelvin of disc temperature"""
    T_cold: Annotated[float, Unit("K", 300.0), Field(gt=0, allow_inf_nan=False)]
    """temperature of a cold disc"""
    ways: Literal["closing", "both"]
    """directions in which the adjuster turns"""
    fault: Literal["none", "stuck", "one-way", "slips", "over-adjusts", "blind-to-heat"]
    """fault"""


class State(NamedTuple):
    """Memory."""

    applied: Annotated[float, Signal("1", "the brake was applied after it was last parked")]
    wide: Annotated[
        float, Signal("1", "consecutive applications with too much gap; < 0: too little")
    ]
    teeth: Annotated[float, Signal("1", "teeth turned according to the adjuster's count")]


class Input(NamedTuple):
    """Signals that the wear log needs."""

    gap: Annotated[
        float, Signal("m", "clearance computed from the travel between parking and contact", 2e-4)
    ]
    T: Annotated[float, Signal("K", "estimated disc temperature", 350.0)]
    touching: Annotated[float, Signal("1", "the pads press on the disc")]
    parked: Annotated[float, Signal("1", "the brake is parked")]
    wanted: Annotated[float, Signal("1", "braking is demanded")]


class Output(NamedTuple):
    """Intended and actual number of teeth to turn now, and the state of the adjuster."""

    teeth: Teeth
    turned: Teeth
    mode: Annotated[float, Signal("1", "adjuster: 0 waits, 1 brake applied, 2 turns", 2.0)]


def cold_gap(u: Input, par: Parameters) -> Annotated[float, Signal("m", "clearance when cold")]:
    """Return the cold brake's clearance, from the travel to contact and the disc's expansion."""
    if par.fault == "blind-to-heat":
        return u.gap
    return u.gap + par.growth * (u.T - par.T_cold)


def due(gap: Annotated[float, Signal("m", "clearance when cold", 2e-4)], par: Parameters) -> Teeth:
    """Return the number of teeth that restores a clearance, without going below its limits.

    The limits are the nominal and the minimum clearance. Below the minimum clearance, the result is
    the smallest sufficient number if the direction is allowed, and otherwise zero.
    """
    spare = gap - ops.fmax(par.gap_nominal, par.gap_min)
    closing = ops.fmax(ops.floor(spare / par.tooth + _WHOLE), 0.0)
    if par.ways == "closing":
        return closing
    return closing + ops.fmin(ops.floor((gap - par.gap_min) / par.tooth + _WHOLE), 0.0)


def turned(teeth: Teeth, before: Teeth, par: Parameters) -> Teeth:
    """Return the number of teeth that actually turn, from the intended number and the count."""
    if par.fault == "stuck":
        return 0.0 * teeth
    if par.fault == "one-way":
        return ops.fmax(teeth, 0.0)
    if par.fault == "slips":  # only every second intended tooth has an effect
        return ops.floor(0.5 * (before + teeth + 1.0)) - ops.floor(0.5 * (before + 1.0))
    if par.fault == "over-adjusts":
        return teeth + ops.where(teeth > 0, 1.0, 0.0)
    return teeth


def output(x: State, u: Input, par: Parameters) -> tuple[State, Output]:
    """Advance the adjuster by one sample.

    A brake application counts if the pads have touched the disc. It counts once, when the brake is
    parked afterward without a demand.
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
