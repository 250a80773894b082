"""Ideal stops, without delay: every wheel at its peak adhesion, or the most recovered energy."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from bywire.core.quantities import Unit
from bywire.plant import adhesion, road, traction_battery, wheel_motor
from bywire.vehicle import regeneration
from bywire.vehicle.corner import CornerParameters
from bywire.vehicle.two_wheeler import VehicleParameters

_SPEEDS = 4001

RidingSpeed = Annotated[float, Unit("m/s", 28.0), Field(gt=0, allow_inf_nan=False)]


def peak_adhesion(par: VehicleParameters) -> tuple[float, float]:
    """Return each wheel's maximum adhesion on the first section of the road."""
    ground = road.surface(0.0, par.road)
    front, rear = (
        float(adhesion.adhesion(adhesion.peak_slip(ground, rubber), ground, rubber))
        for rubber in (par.front_tyre, par.rear_tyre)
    )
    return front, rear


def ideal_deceleration(par: VehicleParameters, *, front_only: bool = False) -> float:
    r"""Return the maximum deceleration without air drag [m/s^2].

    Both wheels are at their peak adhesion while the rear wheel stays on the ground,
    :math:`a \le g\, l_f/h`:

    .. math:: a = g \frac{\mu_f^* (1 - l_f/L) + \mu_r^* l_f/L}{1 - (\mu_f^* - \mu_r^*) h/L}

    which is :math:`\mu^* g` for tires with the same curve. With :math:`\mu_r^* = 0`, only the front
    wheel brakes. On a slope, the component of gravity is added.
    """
    body, (mu, rear) = par.body, peak_adhesion(par)
    slope = road.slope(0.0, par.road)
    pressed = body.g * slope.cosine
    if front_only:
        rear = 0.0
    if rear == mu:
        share = mu
    else:
        left = 1.0 - (mu - rear) * body.h / body.L
        carried = mu * (1.0 - body.l_f / body.L) + rear * body.l_f / body.L
        share = carried / left if left > 0 else math.inf
    return float(min(share, body.l_f / body.h) * pressed + body.g * slope.sine)


def ideal_distance(v: float, par: VehicleParameters, *, front_only: bool = False) -> float:
    r"""Return the shortest stopping distance from a speed [m/s], in m.

    .. math:: x = \frac{\ln(1 + k v^2/a)}{2 k}, \quad k = \frac{\rho\, C_d A}{2 m}

    The distance is infinite if the tires cannot hold the vehicle on the slope.
    """
    a, body = ideal_deceleration(par, front_only=front_only), par.body
    if a <= 0:
        return math.inf
    k = 0.5 * body.rho * body.CdA / body.m
    return math.log1p(k * v * v / a) / (2.0 * k) if k > 0 else v * v / (2.0 * a)


def ideal_corner_distance(v: float, par: CornerParameters) -> float:
    r"""Return the shortest stopping distance of a quarter car from a speed [m/s], in m.

    .. math:: x = \frac{v^2}{2 g (\mu^* \cos\gamma + \sin\gamma)}

    The tire is at its peak adhesion from the demand on. The distance is infinite if the tire cannot
    hold the car on the slope.
    """
    ground, slope = road.surface(0.0, par.road), road.slope(0.0, par.road)
    mu = adhesion.adhesion(adhesion.peak_slip(ground, par.tyre), ground, par.tyre)
    a = float(par.body.g * (mu * slope.cosine + slope.sine))
    return v * v / (2.0 * a) if a > 0 else math.inf


def ideal_recovery(
    v: float, demand: float, r: float, par: regeneration.Parameters, soc: float
) -> float:
    r"""Return the share of the kinetic energy that an ideal stop from a speed [m/s] recovers.

    Motor and friction brake meet a constant demand [N m] at a wheel of radius r [m] without delay,
    and the motor is always at the limit of motor and battery, at a constant state of charge:

    .. math:: \frac{2 \eta}{v_0^2} \int_0^{v_0} \min\left(\frac{T_{lim}(v)}{T}, 1\right) v\, dv
    """
    motor, battery = par.motor, par.battery
    P_bat = traction_battery.charging_limit(traction_battery.State(soc), battery)
    speeds = np.linspace(0.0, v, _SPEEDS)
    limits = np.array([wheel_motor.limit(each / r, each, P_bat, motor) for each in speeds])
    share = np.minimum(limits / demand, 1.0)
    return float(motor.eta * 2.0 * np.trapezoid(share * speeds, speeds) / (v * v))
