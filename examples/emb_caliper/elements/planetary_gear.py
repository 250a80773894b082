"""Two-stage planetary gear with a fixed ring, the sun as input, and the carrier as output."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field, model_validator

from bywire.authoring import ParameterSet, Signal, Unit

Teeth = Annotated[float, Unit("1", 30.0), Field(ge=6, le=500, allow_inf_nan=False)]
Speed = Annotated[float, Signal("rad/s", "speed", 100.0)]
Angle = Annotated[float, Signal("rad", "angle", 20.0)]
Torque = Annotated[float, Signal("N*m", "torque", 0.5)]


class Parameters(ParameterSet):
    """Teeth of both rigid, lossless stages. All friction acts on the motor shaft."""

    z_sun_1: Teeth
    """teeth of the first sun"""
    z_ring_1: Teeth
    """teeth of the first ring"""
    z_sun_2: Teeth
    """teeth of the second sun, which the first carrier drives"""
    z_ring_2: Teeth
    """teeth of the second ring"""

    @model_validator(mode="after")
    def _planets_fit(self) -> Parameters:
        stages = ((1, self.z_sun_1, self.z_ring_1), (2, self.z_sun_2, self.z_ring_2))
        for stage, sun, ring in stages:
            if not sun < ring:
                raise ValueError(
                    f"z_ring_{stage} = {ring:g} must be > z_sun_{stage} = {sun:g}, because the "
                    "planets are between sun and ring"
                )
        return self


class Input(NamedTuple):
    """Sun motion and load on the carrier."""

    theta: Annotated[float, Signal("rad", "motor angle", 50.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 100.0)]
    load: Annotated[float, Signal("N*m", "load on the carrier", 10.0)]


class Output(NamedTuple):
    """Carrier motion and load on the sun."""

    theta: Annotated[float, Signal("rad", "carrier angle", 2.0)]
    omega: Annotated[float, Signal("rad/s", "carrier speed", 3.0)]
    load: Annotated[float, Signal("N*m", "load on the sun", 0.5)]


def ratio(par: Parameters) -> Annotated[float, Signal("1", "speed ratio", 30.0)]:
    r"""Return the ratio of sun speed to carrier speed.

    .. math:: i = \left(1 + \frac{z_{r1}}{z_{s1}}\right) \left(1 + \frac{z_{r2}}{z_{s2}}\right)

    Notes
    -----
    This is Willis' relation for a fixed ring, stage by stage.
    """
    return (1.0 + par.z_ring_1 / par.z_sun_1) * (1.0 + par.z_ring_2 / par.z_sun_2)


def output(u: Input, par: Parameters) -> Output:
    """Return carrier motion and load on the sun. Input power equals output power."""
    i = ratio(par)
    return Output(theta=u.theta / i, omega=u.omega / i, load=u.load / i)
