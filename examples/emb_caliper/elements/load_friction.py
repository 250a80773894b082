"""Dry friction of a drive train, which increases with the clamp force."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field, model_validator

from bywire.authoring import ParameterSet, Power, Signal, Torque, Unit
from bywire.core import ops

TorquePerForce = Annotated[float, Unit("N*m/N", 1e-5), Field(ge=0, allow_inf_nan=False)]
StribeckSpeed = Annotated[float, Unit("rad/s", 2.0), Field(gt=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Dry friction, equal in both directions and set-valued at rest. A stuck shaft holds exactly.

    The viscous part belongs to the rotor.
    """

    C: Torque
    """sliding friction without load"""
    G: TorquePerForce
    """friction per clamp force, both sliding and at rest"""
    T_s: Torque
    """breakaway torque without load, not below C"""
    omega_s: StribeckSpeed
    """speed range in which breakaway friction decreases to sliding friction"""

    @model_validator(mode="after")
    def _breaks_away(self) -> Parameters:
        if self.T_s < self.C:
            raise ValueError(
                f"T_s = {self.T_s:g} N*m must be >= C = {self.C:g} N*m, because breakaway "
                "friction is at least sliding friction"
            )
        return self


class Input(NamedTuple):
    """Speed and clamp force."""

    omega: Annotated[float, Signal("rad/s", "motor speed", 5.0)]
    F_cl: Annotated[float, Signal("N", "clamp force", 1e4)]


class Output(NamedTuple):
    """Friction magnitude."""

    torque: Annotated[float, Signal("N*m", "friction torque", 0.1)]


def output(u: Input, par: Parameters) -> Output:
    r"""Return the magnitude of the friction torque at the motor shaft.

    .. math:: T = C + G F_{cl} + (T_s - C)\, e^{-|\omega| / \omega_s}

    Notes
    -----
    Line, Manzie and Good (2008) found that the friction increases with the clamp force and causes
    sticking. We chose the proportional increase, and the transition from breakaway to sliding
    friction.
    """
    pressed = ops.fmax(u.F_cl, 0.0)
    fall = ops.decay(ops.fabs(u.omega) / par.omega_s)
    return Output(torque=par.C + par.G * pressed + (par.T_s - par.C) * fall)


def power_loss(
    torque: Annotated[float, Signal("N*m", "friction torque on the shaft", 0.1)],
    omega: Annotated[float, Signal("rad/s", "motor speed", 5.0)],
) -> Power:
    """Return the friction heat (signed: minus torque times speed)."""
    return -torque * omega
