"""Road surface and slope as functions of position."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Factor, Unit
from bywire.core.signals import Signal
from bywire.core.units import shown
from bywire.plant.adhesion import Surface, SurfaceParameters, surface_of

Distance = Annotated[float, Unit("m", 15.0), Field(ge=0, allow_inf_nan=False)]
Ramp = Annotated[float, Unit("m", 0.1), Field(gt=0, allow_inf_nan=False)]
Gradient = Annotated[float, Unit("1", 0.05), Field(gt=-1, lt=1, allow_inf_nan=False)]

SurfaceName = Literal[
    "dry-asphalt", "wet-asphalt", "dry-concrete", "dry-cobble", "wet-cobble", "snow", "ice", "own"
]
"""names of surfaces in experiments; ``own`` is the surface from the parameters"""


class Slope(NamedTuple):
    """Angle of the road, uphill positive."""

    sine: Annotated[float, Signal("1", "sine of the slope", 0.05)]
    cosine: Annotated[float, Signal("1", "cosine of the slope", 1.0)]


SURFACES = {
    "dry-asphalt": Surface(1.2801, 23.99, 0.52, 9.121, 1.841, 1.17, 0.7324),
    "wet-asphalt": Surface(0.857, 33.822, 0.347, 12.82, 1.826, 0.8013, 0.7988),
    "dry-concrete": Surface(1.1973, 25.168, 0.5373, 9.146, 1.887, 1.09, 0.741),
    "dry-cobble": Surface(1.3713, 6.4565, 0.6691, 2.565, 2.117, 1.0, 0.4782),
    "wet-cobble": Surface(0.4004, 33.708, 0.1204, 14.82, 1.719, 0.38, 0.8168),
    "snow": Surface(0.1946, 94.129, 0.0646, 39.04, 1.754, 0.19, 0.9312),
    "ice": Surface(0.05, 306.39, 1e-4, 148.1, 1.653, 0.05, 1.0),
}
"""values for car tires from open code, which attributes them to M. Burckhardt,
Fahrwerktechnik: Radschlupf-Regelsysteme (1993). Published values of c3 for ice are 0, but then the
curve has no peak. The Magic Formulas are fitted to these curves. They have the same peak at the
same slip, and are least-squares fits from zero slip to a locked wheel"""


class Parameters(ParameterSet):
    """Two successive road sections, followed by the first one again."""

    first: SurfaceParameters
    """surface of the first section"""
    further: SurfaceParameters
    """surface from x_change on"""
    grip: Factor
    """scale factor for the adhesion of all surfaces"""
    x_change: Distance
    """start of the second surface, from the front wheel's position at time zero"""
    x_back: Distance
    """end of the second surface, from the same origin"""
    ramp: Ramp
    """length of the transition between surfaces and slopes"""
    gradient: Gradient
    """rise over run, uphill positive"""
    gradient_further: Gradient
    """rise over run on the second section"""

    @model_validator(mode="after")
    def _has_no_gap(self) -> Parameters:
        if not self.x_back >= self.x_change + self.ramp:
            raise RuleError(
                "x_back",
                shown(self.x_back, "m"),
                f">= x_change + ramp = {shown(self.x_change + self.ramp, 'm')}",
                "the second surface must start before it ends",
            )
        return self


Place = Annotated[float, Signal("m", "position along the road", 30.0)]


def share(x: Place, par: Parameters) -> Annotated[float, Signal("1", "weight of second section")]:
    """Return the weight of the second section at a position, 0 to 1."""
    begun = ops.clip((x - par.x_change) / par.ramp, 0.0, 1.0)
    return begun - ops.clip((x - par.x_back) / par.ramp, 0.0, 1.0)


def surface(x: Place, par: Parameters) -> Surface:
    """Return the adhesion coefficients at a position."""
    part, first, further = share(x, par), surface_of(par.first), surface_of(par.further)
    blend = Surface(*(a + part * (b - a) for a, b in zip(first, further, strict=True)))
    return blend._replace(c1=par.grip * blend.c1, c3=par.grip * blend.c3, D=par.grip * blend.D)


def slope(x: Place, par: Parameters) -> Slope:
    """Return sine and cosine of the slope angle at a position."""
    rise = par.gradient + share(x, par) * (par.gradient_further - par.gradient)
    cosine = 1.0 / ops.sqrt(1.0 + rise * rise)
    return Slope(rise * cosine, cosine)
