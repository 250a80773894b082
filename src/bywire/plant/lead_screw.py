"""Lead screw: a sliding thread whose geometry determines its friction. It may be self-locking."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Length, Unit
from bywire.core.signals import Power, Signal, Torque

FlankAngle = Annotated[float, Unit("rad", 0.25), Field(ge=0, lt=1.2, allow_inf_nan=False)]
Friction = Annotated[float, Unit("1", 0.1), Field(ge=0, lt=1, allow_inf_nan=False)]
ClampForce = Annotated[float, Signal("N", "clamp force", 1e4)]


class Parameters(ParameterSet):
    """Massless screw with a constant friction coefficient on its flanks."""

    lead: Length
    """travel per revolution"""
    d_m: Length
    """mean thread diameter"""
    mu: Friction
    """flank friction coefficient"""
    beta: FlankAngle
    """flank angle, half the thread angle"""

    @model_validator(mode="after")
    def _turns_under_load(self) -> Parameters:
        steepest = math.cos(self.beta) * math.pi * self.d_m / self.lead
        if not self.mu < steepest:
            raise RuleError(
                "mu", f"{self.mu:g}", f"< {steepest:.3g}", "otherwise no torque can drive the load"
            )
        return self


FAULTS = (ParameterFault("dry", "thread without grease", ("mu",), 2.0),)


class Input(NamedTuple):
    """Axial force on the screw, positive toward clamping, and shaft speed."""

    force: Annotated[float, Signal("N", "axial force on the screw", 1e4)]
    omega: Annotated[float, Signal("rad/s", "speed of the screw", 20.0)]


class Output(NamedTuple):
    """Magnitudes of the friction torque in both directions."""

    T_p: Annotated[float, Signal("N*m", "screw friction, toward clamping", 5.0)]
    T_n: Annotated[float, Signal("N*m", "screw friction, releasing", 5.0)]


class Efficiencies(NamedTuple):
    """Efficiencies in both directions of the power flow."""

    eta_f: Annotated[float, Signal("1", "efficiency when the screw drives the load", 0.5)]
    eta_b: Annotated[float, Signal("1", "efficiency when the load drives the screw", 0.5)]


def slope(par: Parameters) -> Annotated[float, Signal("m/rad", "travel per angle", 3e-4)]:
    r"""Return the travel per shaft angle, :math:`L / 2\pi`."""
    return par.lead / (2.0 * math.pi)


def tangents(
    par: Parameters,
) -> tuple[
    Annotated[float, Signal("1", "tangent of the lead angle", 0.1)],
    Annotated[float, Signal("1", "tangent of the friction angle", 0.1)],
]:
    r"""Return the tangents of lead angle and friction angle.

    .. math:: \tan\lambda = \frac{L}{\pi d_m}, \quad \tan\rho = \frac{\mu}{\cos\beta}
    """
    return par.lead / (math.pi * par.d_m), par.mu / ops.cos(par.beta)


def efficiencies(par: Parameters) -> Efficiencies:
    r"""Return the efficiencies in both directions.

    .. math::
        \eta_f = \frac{\tan\lambda}{\tan(\lambda + \rho)}, \quad
        \eta_b = \frac{\tan(\lambda - \rho)}{\tan\lambda}

    A screw with :math:`\eta_b \le 0` is self-locking. Only a torque on the shaft releases its load.

    References
    ----------
    Budynas and Nisbett, Shigley's Mechanical Engineering Design, "The Mechanics of Power Screws".
    """
    a, f = tangents(par)
    return Efficiencies(eta_f=a * (1.0 - a * f) / (a + f), eta_b=(a - f) / (a * (1.0 + a * f)))


def load_torque(u: Input, par: Parameters) -> Torque:
    r"""Return the torque of the axial force without friction, :math:`T = F L / 2\pi`."""
    return slope(par) * u.force


def friction(u: Input, par: Parameters) -> Output:
    r"""Return the friction torque for motion in either direction.

    .. math::
        T = (1/\eta_f - 1) |F| L/2\pi \text{ (load opposes)}, \quad
        T = (1 - \eta_b) |F| L/2\pi \text{ (load aids)}

    At rest, the friction can have any value between these bounds. A self-locking screw therefore
    holds its load exactly and indefinitely.
    """
    load, eta = load_torque(u, par), efficiencies(par)
    opposing = (1.0 / eta.eta_f - 1.0) * ops.fabs(load)
    aiding = (1.0 - eta.eta_b) * ops.fabs(load)
    return Output(
        T_p=ops.where(load < 0, opposing, aiding),
        T_n=ops.where(load > 0, opposing, aiding),
    )


def release_torque(F: ClampForce, par: Parameters) -> Torque:
    r"""Return the torque that releases a clamp force, > 0 if the screw is self-locking.

    .. math:: T = F \frac{d_m}{2} \tan(\rho - \lambda)
    """
    return -efficiencies(par).eta_b * slope(par) * F


def apply_torque(F: ClampForce, par: Parameters) -> Torque:
    r"""Return the torque that applies a clamp force.

    .. math:: T = F \frac{d_m}{2} \tan(\rho + \lambda)
    """
    return slope(par) * F / efficiencies(par).eta_f


def power_loss(u: Input, par: Parameters) -> Power:
    """Return the heat from the sliding thread, >= 0."""
    T = friction(u, par)
    return ops.where(u.omega > 0, T.T_p, T.T_n) * ops.fabs(u.omega)
