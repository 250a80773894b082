"""Friction of a piston's cup seal, a force that increases with pressure and has a Stribeck peak."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import BreakawayFactor, Damping, Force, Unit
from bywire.core.signals import Power, Signal

ForcePerPressure = Annotated[float, Unit("N/Pa", 1e-5), Field(ge=0, allow_inf_nan=False)]
SlidingSpeed = Annotated[float, Unit("m/s", 1e-3), Field(gt=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Asymmetric Stribeck friction on the piston. `seal_friction` is its equivalent at the shaft.

    Valid for pressures >= 0. At rest the friction is set-valued.
    """

    F_pr: Force
    """friction due to preload, at zero pressure"""
    f_p: ForcePerPressure
    """growth of the Coulomb friction with pressure while applying"""
    f_n: ForcePerPressure
    """growth of the Coulomb friction with pressure while releasing"""
    k_brk: BreakawayFactor
    """breakaway friction relative to Coulomb friction"""
    v_S: SlidingSpeed
    """characteristic speed of the Stribeck peak"""
    mu: Damping
    """viscous friction per speed"""


FAULTS = (
    ParameterFault("swollen", "increased friction (value: factor)", ("F_pr", "f_p", "f_n"), 1.9),
)


class Input(NamedTuple):
    """Piston speed and chamber pressure."""

    v: Annotated[float, Signal("m/s", "piston speed", 1e-3)]
    p: Annotated[float, Signal("Pa", "chamber pressure", 2e6)]


class Output(NamedTuple):
    """Magnitudes of the friction force in both directions, at the same speed."""

    F_p: Annotated[float, Signal("N", "seal friction, toward clamping", 30.0)]
    F_n: Annotated[float, Signal("N", "seal friction, releasing", 30.0)]


def output(u: Input, par: Parameters) -> Output:
    r"""Return the magnitudes of the friction force on the piston.

    .. math:: F = (F_{pr} + f p) (1 + (k_{brk} - 1) e^{-|v|/v_S}) + \mu |v|

    with f for each direction. At rest these are the breakaway forces.
    """
    speed, p = ops.fabs(u.v), ops.fmax(u.p, 0.0)
    peak = 1.0 + (par.k_brk - 1.0) * ops.decay(speed / par.v_S)
    viscous = par.mu * speed
    return Output(
        F_p=(par.F_pr + par.f_p * p) * peak + viscous,
        F_n=(par.F_pr + par.f_n * p) * peak + viscous,
    )


def power_loss(u: Input, par: Parameters) -> Power:
    """Return the heat from sliding friction, >= 0."""
    friction = output(u, par)
    return ops.where(u.v > 0, friction.F_p, friction.F_n) * ops.fabs(u.v)
