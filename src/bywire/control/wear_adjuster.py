"""Adjuster of a brake's clearance: it counts how far the pads travel, and turns by whole teeth.

It acts only when the brake is parked again. Its faults are parameters of what it turns.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length, Unit
from bywire.core.signals import Signal

_WHOLE = 1e-9  # of a tooth: what is short of a whole one by rounding alone
Flag = Annotated[float, Signal("1", "flag")]
Teeth = Annotated[float, Signal("1", "teeth")]


class Parameters(ParameterSet):
    """When it turns, by how much, and what may be wrong with it.

    ``fault``: ``"none"``; ``"stuck"``: nothing turns; ``"slips"``: every second tooth turns
    nothing; ``"over-adjusts"``: one tooth too many; ``"blind-to-heat"``: it takes a hot disc for a
    cold one. The adjuster knows of none of them: its count goes on.
    """

    gap_nominal: Length
    """clearance that it restores"""
    band: Length
    """clearance beyond the nominal one that it lets pass"""
    gap_min: Length
    """clearance of the cold brake below which it never turns; a hot disc takes some of it"""
    tooth: Length
    """clearance that a tooth takes away"""
    applications: Annotated[float, Unit("1", 3.0), Field(ge=1, allow_inf_nan=False)]
    """applications one after the other that have to show too much before it turns"""
    growth: Annotated[float, Unit("m/K", 3e-7), Field(ge=0, allow_inf_nan=False)]
    """clearance that each kelvin of the disc takes away"""
    T_cold: Annotated[float, Unit("K", 300.0), Field(gt=0, allow_inf_nan=False)]
    """temperature of a cold disc"""
    fault: Literal["none", "stuck", "slips", "over-adjusts", "blind-to-heat"]
    """what is wrong with it"""


class State(NamedTuple):
    """What it remembers."""

    applied: Annotated[float, Signal("1", "the brake was applied since it was parked last")]
    wide: Annotated[float, Signal("1", "applications that showed too much, one after the other")]
    teeth: Annotated[float, Signal("1", "teeth turned, as it counts them")]


class Input(NamedTuple):
    """What it sees: its wear log needs no more."""

    gap: Annotated[float, Signal("m", "clearance by the way from parking to contact", 2e-4)]
    T: Annotated[float, Signal("K", "temperature of the disc, estimated", 350.0)]
    parked: Annotated[float, Signal("1", "the brake is parked")]
    wanted: Annotated[float, Signal("1", "braking is demanded")]


class Output(NamedTuple):
    """Teeth to be turned now, as it means to, and as they turn."""

    teeth: Teeth
    turned: Teeth


def cold_gap(u: Input, par: Parameters) -> Annotated[float, Signal("m", "clearance when cold")]:
    """Return the clearance of the cold brake, by the way to contact and the disc's growth."""
    if par.fault == "blind-to-heat":
        return u.gap
    return u.gap + par.growth * (u.T - par.T_cold)


def due(gap: Annotated[float, Signal("m", "clearance when cold", 2e-4)], par: Parameters) -> Teeth:
    """Return the teeth that bring a clearance back, never below the nominal nor the least one."""
    spare = gap - ops.fmax(par.gap_nominal, par.gap_min)
    return ops.fmax(ops.floor(spare / par.tooth + _WHOLE), 0.0)


def turned(teeth: Teeth, before: Teeth, par: Parameters) -> Teeth:
    """Return the teeth that really turn, of those that are to, by what was turned before."""
    if par.fault == "stuck":
        return 0.0 * teeth
    if par.fault == "slips":  # the odd ones of all that were ever to be turned hold
        return ops.floor(0.5 * (before + teeth + 1.0)) - ops.floor(0.5 * (before + 1.0))
    if par.fault == "over-adjusts":
        return teeth + ops.where(teeth > 0, 1.0, 0.0)
    return teeth


def output(x: State, u: Input, par: Parameters) -> tuple[State, Output]:
    """Advance the adjuster by one sample.

    Each application counts once, when the brake is parked behind it and nothing is demanded.
    """
    rests = ops.where(u.parked > 0.5, ops.where(u.wanted > 0.5, 0.0, 1.0), 0.0)
    finished = rests * x.applied
    gap = cold_gap(u, par)
    is_wide = ops.where(gap > par.gap_nominal + par.band, 1.0, 0.0)
    wide = ops.where(finished > 0.5, is_wide * (x.wide + 1.0), x.wide)
    acts = finished * ops.where(wide >= par.applications, 1.0, 0.0)
    teeth = acts * due(gap, par)
    state = State(
        applied=ops.where(rests > 0.5, 0.0, ops.where(u.parked > 0.5, x.applied, 1.0)),
        wide=ops.where(teeth > 0, 0.0, wide),
        teeth=x.teeth + teeth,
    )
    return state, Output(teeth=teeth, turned=turned(teeth, x.teeth, par))
