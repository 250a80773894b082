"""Tire adhesion on a surface as a function of slip, from Burckhardt or the Magic Formula."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge, Gt, Le
from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Unit
from bywire.core.signals import Signal

Slip = Annotated[float, Signal("1", "slip", 0.1), Ge(0), Le(1)]
Adhesion = Annotated[float, Signal("1", "adhesion", 1.0)]
Angle = Annotated[float, Signal("rad", "angle of the Magic Formula", 1.0)]
Coefficient = Annotated[float, Unit("1", 1.0), Field(gt=0, allow_inf_nan=False)]
Curve = Literal["burckhardt", "magic-formula"]
C1 = Annotated[float, Signal("1", "adhesion coefficient c1"), Ge(0.5)]
C2 = Annotated[float, Signal("1", "adhesion coefficient c2", 30.0), Ge(10)]
C3 = Annotated[float, Signal("1", "adhesion coefficient c3", 0.5), Gt(0)]
Stiffness = Annotated[float, Signal("1", "stiffness factor", 10.0), Ge(8), Le(40)]
Shape = Annotated[float, Signal("1", "shape factor", 1.6), Ge(1.5), Le(1.9)]
Largest = Annotated[float, Signal("1", "maximum adhesion", 1.0), Gt(0)]
Curvature = Annotated[float, Signal("1", "curvature factor", 0.5), Ge(0), Le(0.9)]
_NEWTON, _LEVEL, _LEAST = 3, 1e-4, 1e-16  # steps; minimum slope, in slip; floor of roots
_MAGIC_NEWTON = 6  # steps, from the tangent at zero; enough up to E = 1 and a peak at 6/B


class SurfaceParameters(ParameterSet):
    """Tire adhesion on a surface, by Burckhardt and by the Magic Formula."""

    c1: Coefficient
    """limit of Burckhardt's adhesion, before c3 is subtracted"""
    c2: Coefficient
    """rate at which Burckhardt's adhesion rises with slip"""
    c3: Coefficient
    """decrease of Burckhardt's adhesion up to a locked wheel"""
    B: Annotated[float, Unit("1", 10.0), Field(gt=0, allow_inf_nan=False)]
    """stiffness factor of the Magic Formula; B C D is the slope at zero slip"""
    C: Annotated[float, Unit("1", 1.6), Field(gt=1, lt=4, allow_inf_nan=False)]
    """shape factor of the Magic Formula, which determines the decrease beyond the peak"""
    D: Coefficient
    """maximum adhesion of the Magic Formula"""
    E: Annotated[float, Unit("1", 0.5), Field(ge=-100, le=1, allow_inf_nan=False)]
    """curvature factor of the Magic Formula, which determines the position of the peak"""

    @model_validator(mode="after")
    def _has_a_peak(self) -> SurfaceParameters:
        if not self.c1 * self.c2 > self.c3:
            reason = "at zero slip, the adhesion must rise with slip"
            raise RuleError("c1 c2", f"{self.c1 * self.c2:g}", f"> c3 = {self.c3:g}", reason)
        locked = angle(1.0, surface_of(self))
        if not 0.5 * math.pi < locked < math.pi:
            raise RuleError(
                "C arctan(B - E (B - arctan B))",
                f"{locked:.4g} rad",
                "between pi/2 and pi",
                "the adhesion must peak below a slip of 1 and be positive at a slip of 1",
            )
        return self


class Surface(NamedTuple):
    """Coefficients of tire adhesion on a surface."""

    c1: C1
    c2: C2
    c3: C3
    B: Stiffness
    C: Shape
    D: Largest
    E: Curvature


class Rising(NamedTuple):
    """Point on the rising branch with the same adhesion as another point on the curve."""

    mu: Annotated[float, Signal("1", "adhesion", 1.0)]
    slip: Annotated[float, Signal("1", "slip", 0.1)]


class Parameters(ParameterSet):
    """Law of adhesion versus slip."""

    curve: Curve
    """``"burckhardt"``, or ``"magic-formula"``, with B, C, D and E of the surface"""


def surface_of(par: SurfaceParameters) -> Surface:
    """Return the coefficients of a surface."""
    return Surface(par.c1, par.c2, par.c3, par.B, par.C, par.D, par.E)


def burckhardt(slip: Slip, ground: Surface) -> Adhesion:
    r"""Return Burckhardt's adhesion, :math:`\mu = c_1 (1 - e^{-c_2 \lambda}) - c_3 \lambda`.

    References
    ----------
    M. Burckhardt, Fahrwerktechnik: Radschlupf-Regelsysteme, 1993.
    """
    return ground.c1 * (1.0 - ops.exp(-ground.c2 * slip)) - ground.c3 * slip


def burckhardt_peak(ground: Surface) -> Slip:
    r"""Return the slip at the peak, :math:`\lambda^* = \ln(c_1 c_2/c_3)/c_2`, <= 1."""
    return ops.fmin(ops.log(ground.c1 * ground.c2 / ground.c3) / ground.c2, 1.0)


def burckhardt_rising(
    mu: Annotated[float, Signal("1", "adhesion", 1.0), Ge(0)], ground: Surface
) -> Slip:
    """Return the slip below the peak at which the adhesion is ``mu``, to within 5e-6.

    Newton's method approaches this slip from below. It starts at the slip without the curve's
    linear decrease or at the parabola through the peak, whichever is closer.
    """
    c1, c2, c3 = ground.c1, ground.c2, ground.c3
    peak = burckhardt_peak(ground)
    bend = c2 * c3
    below = ops.fmax(burckhardt(peak, ground) - mu, 0.0)
    straight = -ops.log(ops.fmax(1.0 - mu / c1, _LEAST)) / c2
    slip = ops.fmax(peak - ops.sqrt(2.0 * below / bend + _LEAST), straight)
    for _ in range(_NEWTON):
        decay = ops.exp(-c2 * slip)
        left = mu - c1 * (1.0 - decay) + c3 * slip
        # The curve is flat at the peak. The lower bound avoids a division of rounding errors by 0.
        slip = slip + left / ops.fmax(c1 * c2 * decay - c3, _LEVEL * bend)
    return ops.fmin(slip, peak)


def angle(slip: Slip, ground: Surface) -> Angle:
    r"""Return the argument of the sine, pi/2 at the peak and more beyond.

    .. math:: \theta = C \arctan(B \lambda - E (B \lambda - \arctan B \lambda))
    """
    z = ground.B * slip
    return ground.C * ops.arctan(z - ground.E * (z - ops.arctan(z)))


def magic_formula(slip: Slip, ground: Surface) -> Adhesion:
    r"""Return the adhesion of the Magic Formula, :math:`\mu = D \sin\theta`.

    References
    ----------
    H. Pacejka, Tire and Vehicle Dynamics, for longitudinal slip only, without shifts.
    """
    return ground.D * ops.sin(angle(slip, ground))


def magic_rising(
    theta: Annotated[float, Signal("rad", "angle", 1.0), Ge(0.1), Le(1.5)], ground: Surface
) -> Slip:
    r"""Return the slip at which the angle is ``theta``, up to pi/2.

    .. math:: (1 - E) z + E \arctan z = \tan(\theta/C), \quad z = B \lambda

    Newton's method from z = tan(theta/C) approaches the root from one side for every E.
    """
    part = theta / ground.C
    target = ops.sin(part) / ops.cos(part)
    z = target
    for _ in range(_MAGIC_NEWTON):
        left = target - (1.0 - ground.E) * z - ground.E * ops.arctan(z)
        z = z + left / (1.0 - ground.E * z * z / (1.0 + z * z))
    return z / ground.B


def adhesion(slip: Slip, ground: Surface, par: Parameters) -> Adhesion:
    """Return the adhesion at a slip >= 0."""
    if par.curve == "magic-formula":
        return magic_formula(slip, ground)
    return burckhardt(slip, ground)


def peak_slip(ground: Surface, par: Parameters) -> Slip:
    """Return the slip at maximum adhesion, <= 1."""
    if par.curve == "magic-formula":
        return magic_rising(0.5 * math.pi, ground)
    return burckhardt_peak(ground)


def held(slip: Slip, ground: Surface, par: Parameters) -> Rising:
    """Return the adhesion limit at a slip, which is the peak below its slip and the curve beyond.

    The second value is the slip on the rising branch with the same adhesion.
    """
    if par.curve == "magic-formula":
        # The sine is symmetric about pi/2, so the rising branch has the mirrored angle.
        theta = ops.fmax(angle(slip, ground), 0.5 * math.pi)
        return Rising(ground.D * ops.sin(theta), magic_rising(math.pi - theta, ground))
    peak = burckhardt_peak(ground)
    mu = ops.where(slip > peak, burckhardt(slip, ground), burckhardt(peak, ground))
    return Rising(mu, ops.where(slip > peak, burckhardt_rising(mu, ground), peak))
