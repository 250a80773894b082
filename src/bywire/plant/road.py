"""Road: what it is made of and how it rises, along the way."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Factor, Unit
from bywire.core.signals import Signal

Coefficient = Annotated[float, Unit("1", 1.0), Field(gt=0, allow_inf_nan=False)]
Distance = Annotated[float, Unit("m", 15.0), Field(ge=0, allow_inf_nan=False)]
Ramp = Annotated[float, Unit("m", 0.1), Field(gt=0, allow_inf_nan=False)]
Gradient = Annotated[float, Unit("1", 0.05), Field(gt=-1, lt=1, allow_inf_nan=False)]

SurfaceName = Literal[
    "dry-asphalt", "wet-asphalt", "dry-concrete", "dry-cobble", "wet-cobble", "snow", "ice", "own"
]
"""what experiments call a surface; ``own`` is that of the parameters"""


class Surface(NamedTuple):
    """Coefficients of the adhesion of a tyre on a surface, after Burckhardt."""

    c1: Annotated[float, Signal("1", "adhesion coefficient c1")]
    c2: Annotated[float, Signal("1", "adhesion coefficient c2", 30.0)]
    c3: Annotated[float, Signal("1", "adhesion coefficient c3", 0.5)]


class Slope(NamedTuple):
    """Angle of the road, uphill positive."""

    sine: Annotated[float, Signal("1", "sine of the slope", 0.05)]
    cosine: Annotated[float, Signal("1", "cosine of the slope", 1.0)]


SURFACES = {
    "dry-asphalt": Surface(1.2801, 23.99, 0.52),
    "wet-asphalt": Surface(0.857, 33.822, 0.347),
    "dry-concrete": Surface(1.1973, 25.168, 0.5373),
    "dry-cobble": Surface(1.3713, 6.4565, 0.6691),
    "wet-cobble": Surface(0.4004, 33.708, 0.1204),
    "snow": Surface(0.1946, 94.129, 0.0646),
    "ice": Surface(0.05, 306.39, 1e-4),
}
"""values for car tyres as they circulate in open code under the name of M. Burckhardt,
Fahrwerktechnik: Radschlupf-Regelsysteme (1993); c3 of ice circulates as 0, which has no peak"""


class SurfaceParameters(ParameterSet):
    """Adhesion of a tyre on a surface, after Burckhardt."""

    c1: Coefficient
    """what the adhesion tends to, but for c3"""
    c2: Coefficient
    """how fast it rises with slip"""
    c3: Coefficient
    """how much it falls up to a locked wheel"""

    @model_validator(mode="after")
    def _has_a_peak(self) -> SurfaceParameters:
        if not self.c1 * self.c2 > self.c3:
            raise ValueError(
                f"c1 c2 = {self.c1 * self.c2:g} must be above c3 = {self.c3:g}: the adhesion must "
                "rise with slip first"
            )
        return self


class Parameters(ParameterSet):
    """Two stretches of road, one behind the other, and the first one again behind these."""

    first: SurfaceParameters
    """surface of the first stretch"""
    further: SurfaceParameters
    """surface from x_change on"""
    grip: Factor
    """factor on the adhesion of every surface"""
    x_change: Distance
    """where the further surface begins, from where the front wheel is at time zero"""
    x_back: Distance
    """where it ends"""
    ramp: Ramp
    """length over which one surface and slope becomes the other"""
    gradient: Gradient
    """rise over run, uphill positive"""
    gradient_further: Gradient
    """the same on the further stretch"""

    @model_validator(mode="after")
    def _has_no_gap(self) -> Parameters:
        if not self.x_back >= self.x_change + self.ramp:
            raise ValueError(
                f"x_back = {self.x_back:g} m must be at least x_change + ramp = "
                f"{self.x_change + self.ramp:g} m: the further surface begins before it ends"
            )
        return self


Place = Annotated[float, Signal("m", "place along the road", 30.0)]


def share(x: Place, par: Parameters) -> Annotated[float, Signal("1", "share of the further road")]:
    """Return how much of the further stretch there is at a place, 0 to 1."""
    begun = ops.clip((x - par.x_change) / par.ramp, 0.0, 1.0)
    return begun - ops.clip((x - par.x_back) / par.ramp, 0.0, 1.0)


def surface(x: Place, par: Parameters) -> Surface:
    """Return the coefficients of the adhesion at a place."""
    part, first, further = share(x, par), par.first, par.further
    return Surface(
        c1=par.grip * (first.c1 + part * (further.c1 - first.c1)),
        c2=first.c2 + part * (further.c2 - first.c2),
        c3=par.grip * (first.c3 + part * (further.c3 - first.c3)),
    )


def slope(x: Place, par: Parameters) -> Slope:
    """Return the angle of the slope at a place, by its sine and cosine."""
    rise = par.gradient + share(x, par) * (par.gradient_further - par.gradient)
    cosine = 1.0 / ops.sqrt(1.0 + rise * rise)
    return Slope(rise * cosine, cosine)
