"""The best stop that road, tyres and body allow: every wheel at its peak, no time lost."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from bywire.core.quantities import Unit
from bywire.plant import road, tyre
from bywire.vehicle.two_wheeler import VehicleParameters

RidingSpeed = Annotated[float, Unit("m/s", 28.0), Field(gt=0, allow_inf_nan=False)]


def peak_adhesion(par: VehicleParameters) -> float:
    """Return the largest adhesion on the first stretch of the road."""
    ground = road.surface(0.0, par.road)
    return float(tyre.adhesion(tyre.peak_slip(*ground), *ground))


def ideal_deceleration(par: VehicleParameters, *, front_only: bool = False) -> float:
    r"""Return the largest deceleration, air drag apart [m/s^2].

    Both wheels at their peak, :math:`a = \mu^* g`, as long as the rear wheel stays on the ground,
    :math:`a \le g\, l_f/h`; of the front wheel alone
    :math:`a = \mu^* g (1 - l_f/L)/(1 - \mu^* h/L)`. On a slope, with its share of the weight.
    """
    body, mu = par.body, peak_adhesion(par)
    slope = road.slope(0.0, par.road)
    pressed = body.g * slope.cosine
    if front_only:
        left = 1.0 - mu * body.h / body.L
        share = mu * (1.0 - body.l_f / body.L) / left if left > 0 else math.inf
    else:
        share = mu
    return float(min(share, body.l_f / body.h) * pressed + body.g * slope.sine)


def ideal_distance(v: float, par: VehicleParameters, *, front_only: bool = False) -> float:
    r"""Return the shortest stopping distance from a speed [m/s], in m.

    .. math:: x = \frac{\ln(1 + k v^2/a)}{2 k}, \quad k = \frac{\rho\, C_d A}{2 m}

    Infinite where the road falls more steeply than the tyres hold.
    """
    a, body = ideal_deceleration(par, front_only=front_only), par.body
    if a <= 0:
        return math.inf
    k = 0.5 * body.rho * body.CdA / body.m
    return math.log1p(k * v * v / a) / (2.0 * k) if k > 0 else v * v / (2.0 * a)
