"""Wheel motor that brakes and recovers energy within the limits of the motor and the battery."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Ge
from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Duration, Fraction, Unit
from bywire.core.signals import Role, Signal

MotorTorque = Annotated[float, Unit("N*m", 500.0), Field(gt=0, allow_inf_nan=False)]
MotorPower = Annotated[float, Unit("W", 25e3), Field(gt=0, allow_inf_nan=False)]
FadeSpeed = Annotated[float, Unit("m/s", 3.0), Field(ge=0, allow_inf_nan=False)]
Torque = Annotated[float, Signal("N*m", "braking torque of the motor", 300.0)]
WheelSpeed = Annotated[float, Signal("rad/s", "wheel speed", 60.0)]
Recovered = Annotated[
    float,
    Signal("W", "recovered power", role=Role("sink", "recovered", returns="taken", book="vehicle")),
]
Loss = Annotated[
    float,
    Signal(
        "W",
        "loss of motor and inverter",
        role=Role("sink", "motor and inverter", returns="taken", book="vehicle"),
    ),
]


class Parameters(ParameterSet):
    """Braking torque with a first-order lag; the motor's inertia belongs to the wheel."""

    T_max: MotorTorque
    """maximum torque at the wheel"""
    P_max: MotorPower
    """maximum power of the motor at the wheel"""
    eta: Fraction
    """efficiency from the wheel to the battery"""
    v_1: FadeSpeed
    """speed below which the torque fades out"""
    v_2: FadeSpeed
    """speed at which the torque reaches zero"""
    tau: Duration
    """time constant of the torque"""

    @model_validator(mode="after")
    def _torque_fades(self) -> Parameters:
        if not self.v_1 > self.v_2:
            raise RuleError("v_1", f"{self.v_1:g} m/s", f"> v_2 = {self.v_2:g} m/s")
        return self


FAULTS = (ParameterFault("weak", "derated motor", ("T_max", "P_max"), 0.5),)


class State(NamedTuple):
    """Braking torque."""

    T: Torque


class Input(NamedTuple):
    """Commanded torque, and speed of the wheel."""

    T_ref: Torque
    omega: WheelSpeed


def mass(x: State, par: Parameters) -> Annotated[float, Signal("s", "time constant", 1e-2)]:
    """Return the factor of the torque's derivative, the time constant."""
    return par.tau


def balance(
    x: State, u: Input, par: Parameters
) -> Annotated[float, Signal("N*m", "missing torque", 300.0)]:
    r"""Return the missing torque, :math:`\tau \dot T = T_{ref} - T`."""
    return u.T_ref - x.T


def limit(
    omega: WheelSpeed,
    v: Annotated[float, Signal("m/s", "vehicle speed", 20.0)],
    P_bat: Annotated[float, Signal("W", "maximum charging power of the battery", 25e3), Ge(0)],
    par: Parameters,
) -> Torque:
    r"""Return the largest braking torque at a speed.

    .. math::
        \min\left(T_{max}, \frac{P_{max}}{|\omega|}, \frac{P_{bat}}{\eta |\omega|}\right)
        \cdot \mathrm{clip}\left(\frac{v - v_2}{v_1 - v_2}, 0, 1\right)

    It has kinks where the smallest of the limits changes, and at both ends of the fade.
    """
    power = ops.fmin(par.P_max, P_bat / par.eta)
    least = 1e-9 * par.P_max  # a full battery at standstill has no limit by power, but no torque
    at_speed = ops.fmax(ops.fmax(par.T_max * ops.fabs(omega), power), least)
    torque = par.T_max * power / at_speed
    fade = ops.clip((v - par.v_2) / (par.v_1 - par.v_2), 0.0, 1.0)
    return torque * fade


def recovered_power(x: State, u: Input, par: Parameters) -> Recovered:
    r"""Return the power at the battery's terminals, :math:`\eta T \omega`."""
    return par.eta * x.T * u.omega


def power_loss(x: State, u: Input, par: Parameters) -> Loss:
    r"""Return the loss of motor and inverter, :math:`(1 - \eta) T \omega`.

    It is signed like the braking power, so a wheel that rolls back on its tire returns a little.
    """
    return (1.0 - par.eta) * x.T * u.omega
