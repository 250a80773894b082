"""Planetary gear of two stages: ring at rest, the sun drives, the carrier is driven."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field, model_validator

from bywire.authoring import ParameterSet, Signal, Unit

Teeth = Annotated[float, Unit("1", 30.0), Field(ge=6, le=500, allow_inf_nan=False)]
Speed = Annotated[float, Signal("rad/s", "speed", 100.0)]
Angle = Annotated[float, Signal("rad", "angle", 20.0)]
Torque = Annotated[float, Signal("N*m", "torque", 0.5)]


class Parameters(ParameterSet):
    """Teeth of both stages; rigid and without loss: the motor shaft carries all friction."""

    z_sun_1: Teeth
    """teeth of the first sun"""
    z_ring_1: Teeth
    """teeth of the first ring"""
    z_sun_2: Teeth
    """teeth of the second sun, which the first carrier turns"""
    z_ring_2: Teeth
    """teeth of the second ring"""

    @model_validator(mode="after")
    def _planets_fit(self) -> Parameters:
        stages = ((1, self.z_sun_1, self.z_ring_1), (2, self.z_sun_2, self.z_ring_2))
        for stage, sun, ring in stages:
            if not sun < ring:
                raise ValueError(
                    f"z_ring_{stage} = {ring:g} must be above z_sun_{stage} = {sun:g}: the planets "
                    "run between them"
                )
        return self


class Input(NamedTuple):
    """Motion of the sun, load of the carrier."""

    theta: Annotated[float, Signal("rad", "motor angle", 50.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 100.0)]
    load: Annotated[float, Signal("N*m", "load on the carrier", 10.0)]


class Output(NamedTuple):
    """Motion of the carrier, load of the sun."""

    theta: Annotated[float, Signal("rad", "carrier angle", 2.0)]
    omega: Annotated[float, Signal("rad/s", "carrier speed", 3.0)]
    load: Annotated[float, Signal("N*m", "load on the sun", 0.5)]


def ratio(par: Parameters) -> Annotated[float, Signal("1", "speed ratio", 30.0)]:
    r"""Return the speed of the sun over that of the carrier.

    .. math:: i = \left(1 + \frac{z_{r1}}{z_{s1}}\right) \left(1 + \frac{z_{r2}}{z_{s2}}\right)

    Notes
    -----
    Willis' relation for a ring at rest, stage by stage.
    """
    return (1.0 + par.z_ring_1 / par.z_sun_1) * (1.0 + par.z_ring_2 / par.z_sun_2)


def output(u: Input, par: Parameters) -> Output:
    """Return motion of the carrier and load of the sun; power in equals power out."""
    i = ratio(par)
    return Output(theta=u.theta / i, omega=u.omega / i, load=u.load / i)
