"""Single-stage planetary gear with the sun as input, the carrier as output, and a fixed ring."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Fraction, Unit
from bywire.core.signals import Power, Signal

Teeth = Annotated[float, Unit("1", 30.0), Field(ge=6, le=500, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Rigid and massless, with tooth friction proportional to the load.

    Each stage is a separate part. Inertias belong to the shafts.
    """

    z_sun: Teeth
    """teeth of the sun"""
    z_ring: Teeth
    """teeth of the ring"""
    eta: Fraction
    """efficiency when the sun drives"""

    @model_validator(mode="after")
    def _planets_fit(self) -> Parameters:
        if not self.z_sun < self.z_ring:
            reason = "the planets are between sun and ring"
            raise RuleError("z_ring", f"{self.z_ring:g}", f"> z_sun = {self.z_sun:g}", reason)
        return self


class Input(NamedTuple):
    """Motion of the sun, and the opposing load at the carrier."""

    theta: Annotated[float, Signal("rad", "sun angle", 50.0)]
    omega: Annotated[float, Signal("rad/s", "sun speed", 100.0)]
    load: Annotated[float, Signal("N*m", "load on the carrier", 5.0)]


class Output(NamedTuple):
    """Motion of the carrier, and load on the sun, without friction."""

    theta: Annotated[float, Signal("rad", "carrier angle", 10.0)]
    omega: Annotated[float, Signal("rad/s", "carrier speed", 20.0)]
    load: Annotated[float, Signal("N*m", "load on the sun", 1.0)]


def ratio(par: Parameters) -> Annotated[float, Signal("1", "speed ratio", 5.0)]:
    r"""Return the ratio of sun to carrier speed, :math:`i = 1 + z_{ring}/z_{sun}`."""
    return 1.0 + par.z_ring / par.z_sun


def output(u: Input, par: Parameters) -> Output:
    """Return the carrier's motion and the load on the sun. Input power equals output power."""
    i = ratio(par)
    return Output(theta=u.theta / i, omega=u.omega / i, load=u.load / i)


def friction(u: Input, par: Parameters) -> Annotated[float, Signal("N*m", "gear friction", 0.05)]:
    r"""Return the magnitude of the friction torque on the sun, for set-valued friction.

    .. math:: T = (1/\eta - 1) |T_{load}| / i

    in both directions. The back-driven efficiency is 2 - 1/eta, and the gear holds at rest.
    """
    return (1.0 / par.eta - 1.0) * ops.fabs(output(u, par).load)


def power_loss(u: Input, par: Parameters) -> Power:
    """Return the heat from sliding teeth, >= 0."""
    return friction(u, par) * ops.fabs(u.omega)
