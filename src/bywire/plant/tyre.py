"""Longitudinal tire model: deflection that relaxes while rolling, and slides at the limit."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt
from pydantic import Field

from bywire.core import ops
from bywire.core.quantities import Duration, Length, Unit
from bywire.core.signals import Power, Signal
from bywire.plant import adhesion

Slip = Annotated[float, Signal("1", "slip", 0.1)]


class Parameters(adhesion.Parameters):
    """Carcass and tread as one deflection. The surface determines the adhesion."""

    sigma: Length
    """relaxation length"""
    c_t: Annotated[float, Unit("s/m", 1.0), Field(ge=0, allow_inf_nan=False)]
    """damping of the sticking tire near standstill, relative to the wheel load"""
    v_low: Annotated[float, Unit("m/s", 2.0), Field(gt=0, allow_inf_nan=False)]
    """speed above which the damping c_t is zero"""
    tau_slide: Duration
    """time constant with which a sliding tire loses deflection beyond its limit"""


class State(NamedTuple):
    """Deflection."""

    u: Annotated[float, Signal("m", "tire deflection", 5e-3)]


class Contact(NamedTuple):
    """Vehicle and tread speeds, and the surface below."""

    v: Annotated[float, Signal("m/s", "vehicle speed", 20.0)]
    v_wheel: Annotated[float, Signal("m/s", "speed of the tread", 20.0)]
    c1: adhesion.C1
    c2: adhesion.C2
    c3: adhesion.C3
    B: adhesion.Stiffness
    C: adhesion.Shape
    D: adhesion.Largest
    E: adhesion.Curvature


class Limits(NamedTuple):
    """Limits of a tire's force at its slip."""

    mu: Annotated[float, Signal("1", "maximum adhesion", 1.0)]
    u: Annotated[float, Signal("m", "maximum deflection", 1e-2)]


class Input(NamedTuple):
    """Speeds, load, surface, and `limits`, which are values only."""

    v: Annotated[float, Signal("m/s", "vehicle speed", 20.0)]
    v_wheel: Annotated[float, Signal("m/s", "speed of the tread", 20.0)]
    N: Annotated[float, Signal("N", "load", 1e3), Ge(0)]
    c1: adhesion.C1
    c2: adhesion.C2
    c3: adhesion.C3
    B: adhesion.Stiffness
    C: adhesion.Shape
    D: adhesion.Largest
    E: adhesion.Curvature
    mu_max: Annotated[float, Signal("1", "maximum adhesion", 1.0), Ge(0)]
    u_max: Annotated[float, Signal("m", "maximum deflection", 1e-2), Gt(0)]


class Output(NamedTuple):
    """Force of the tire."""

    F: Annotated[float, Signal("N", "braking force of the tire", 1e3)]


def braking_slip(u: Contact, par: Parameters) -> Slip:
    """Return the slip relative to the faster of vehicle and tread, 0 at standstill.

    The slip is always between -1 and 1. It is 1 for a locked wheel on a moving vehicle.
    """
    faster = ops.fmax(ops.fabs(u.v), ops.fabs(u.v_wheel))
    slip = (u.v - u.v_wheel) / ops.where(faster > 0, faster, par.v_low)
    return ops.clip(slip, -1.0, 1.0)


def limits(u: Contact, par: Parameters) -> Limits:
    """Return the force limits, which are the peak below its slip and the curve beyond.

    The deflection follows from the slip with the same adhesion on the curve's rising branch.
    """
    mu, slip = adhesion.held(ops.fabs(braking_slip(u, par)), _ground(u), par)
    return Limits(mu, par.sigma * slip)


def _ground(u: Contact | Input) -> adhesion.Surface:
    return adhesion.Surface(u.c1, u.c2, u.c3, u.B, u.C, u.D, u.E)


def rate(x: State, u: Input, par: Parameters) -> Annotated[float, Signal("m/s", "rate", 0.5)]:
    r"""Return the rate of the deflection, :math:`\dot u = v - \omega r - |v| u/\sigma`.

    While the tire slides, the deflection returns to its limit.
    """
    beyond = x.u - ops.clip(x.u, -u.u_max, u.u_max)
    return u.v - u.v_wheel - ops.fabs(u.v) * x.u / par.sigma - beyond / par.tau_slide


def sliding(x: State, u: Input) -> Annotated[float, Signal("1", "tire slides")]:
    """Return 1 if the tire slides, 0 if it sticks to the road."""
    return ops.where(ops.fabs(x.u) < u.u_max, 0.0, 1.0)


def force_over_load(
    x: State, u: Input, par: Parameters
) -> Annotated[float, Signal("1", "braking force relative to load", 1.0)]:
    """Return the ratio of force to load, from limited deflection and damping near standstill.

    Damping does not increase the force limit.
    """
    slides = sliding(x, u)
    # An absolute value has no slope at zero, where a freely rolling wheel operates.
    bent = ops.where(x.u < 0, -x.u, x.u)
    held = adhesion.adhesion(bent / par.sigma, _ground(u), par)
    size = ops.where(slides > 0, u.mu_max, ops.fmin(held, u.mu_max))
    elastic = ops.where(x.u < 0, -size, size)
    slow = ops.fmin(ops.fabs(u.v) / par.v_low, 1.0)
    faded = par.c_t * (u.v - u.v_wheel) * 0.5 * (1.0 + ops.cos(math.pi * slow))
    damping = ops.where(
        slow < 1.0, faded, 0.0
    )  # becomes a branch in the kernel, which most of a stop skips
    return ops.clip(elastic + (1.0 - slides) * damping, -u.mu_max, u.mu_max)


def output(x: State, u: Input, par: Parameters) -> Output:
    """Return the braking force."""
    return Output(F=u.N * force_over_load(x, u, par))


def work(x: State, u: Input, par: Parameters) -> Power:
    """Return the power into the tire: sliding, damping, and recoverable deflection."""
    return output(x, u, par).F * (u.v - u.v_wheel)
