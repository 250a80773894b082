r"""Piston seal of a caliper, which shears with the piston and retracts it after braking.

The seal sticks to the piston and shears up to its roll-back, and then slips (one spring that
slips, see `pad_hysteresis`):

.. math:: F = k z, \quad dz = dx, \quad |z| \le z_{max}

After a release without residual force, the piston is retracted by the roll-back from its farthest
travel. The running clearance is therefore :math:`z_{max} - n`, where n is the travel by which pads
and caliper had yielded. If they yield by more, the pads keep dragging with at most k times the
difference.

The deflection is a stop operator (see ``docs/modeling.md``). The force has a corner where the seal
begins to slip, and where the motion reverses while it slips. At the roll-back, a linear model
requires a side.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Stiffness, Unit
from bywire.core.signals import Energy, Role, Signal

Rollback = Annotated[float, Unit("m", 2e-4), Field(ge=0, allow_inf_nan=False)]
Speed = Annotated[float, Signal("m/s", "speed of the piston", 0.01)]
Work = Annotated[float, Signal("W", "work on the seal")]
Loss = Annotated[
    float, Signal("W", "friction of the caliper's seal", role=Role("sink", "caliper seal"))
]


class Parameters(ParameterSet):
    """Elastic seal with constant slip force, without dependence on speed and pressure."""

    k: Stiffness
    """shear stiffness of the seal"""
    z_max: Rollback
    """roll-back, at which the seal slips"""


FAULTS = (
    ParameterFault(
        "hardened", "the seal retracts the piston less (value: factor)", ("z_max",), 0.2
    ),
    ParameterFault("swollen", "the seal holds the piston harder (value: factor)", ("k",), 5.0),
)


class State(NamedTuple):
    """Deflection, positive while the seal pulls the piston back."""

    z: Annotated[float, Signal("m", "deflection of the caliper's seal", 1e-4)]


class Input(NamedTuple):
    """Speed of the piston."""

    v: Speed


class Speeds(NamedTuple):
    """Speed of the seal's lip, or slip speed."""

    z: Speed


class Output(NamedTuple):
    """Force."""

    F_seal: Annotated[float, Signal("N", "force of the caliper's seal", 100.0)]


def rate(u: Input) -> Speeds:
    """Return the speed of the piston, which the seal follows."""
    return Speeds(z=u.v)


def slip_width(par: Parameters) -> State:
    """Return the deflection at which the seal slips."""
    return State(z=par.z_max)


def output(x: State, par: Parameters) -> Output:
    """Return the force against the piston."""
    return Output(F_seal=par.k * x.z)


def energy(x: State, par: Parameters) -> Energy:
    """Return the elastic energy of the seal."""
    return 0.5 * par.k * x.z * x.z


def power_in(x: State, u: Input, par: Parameters) -> Work:
    """Return the power with which the piston shears the seal."""
    return par.k * x.z * u.v


def power_loss(slip: Speeds, par: Parameters) -> Loss:
    """Return the friction loss of the slipping seal, >= 0."""
    return par.k * par.z_max * ops.fabs(slip.z)
