"""Ground below the rear wheel, which pushes but never pulls. A landing wheel does not rebound."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Stiffness, TimeConstant
from bywire.core.signals import ContactCompliance, Energy, Overlap, Power, Role, Signal

Loss = Annotated[
    float,
    Signal(
        "W",
        "loss in the ground contact, minus its initial energy",
        role=Role("sink", "ground contact", book="vehicle"),
    ),
]


class Parameters(ParameterSet):
    """Vertical stiffness of rear tire and suspension, which supports the load."""

    k: Stiffness
    """stiffness"""
    tau: TimeConstant
    """ratio of damping to stiffness"""


class Input(NamedTuple):
    """Rise of the rear wheel, and its rate."""

    z: Annotated[float, Signal("m", "rise of the rear wheel", 1e-2)]
    v: Annotated[float, Signal("m/s", "speed of the rise", 0.1)]


class InputRate(NamedTuple):
    """Derivative of the input of the stored energy."""

    z: Annotated[float, Signal("m/s", "speed of the rise", 0.1)]


class Forces(NamedTuple):
    """Contact force, >= 0."""

    support: Annotated[float, Signal("N", "force of the ground on the rear wheel", 1e3)]


class Overlaps(NamedTuple):
    """Overlap with damping."""

    support: Overlap


def overlaps(u: Input, par: Parameters) -> Overlaps:
    """Return the damped overlap, affine in rise and speed."""
    return Overlaps(support=-u.z - par.tau * u.v)


def compliance(par: Parameters) -> ContactCompliance:
    """Return the compliance."""
    return 1.0 / par.k


def forces(u: Input, par: Parameters) -> Forces:
    """Return the contact force."""
    return Forces(support=ops.fmax(overlaps(u, par).support * par.k, 0.0))


def input_rate(u: Input) -> InputRate:
    """Return the rate of the rise."""
    return InputRate(z=u.v)


def energy(u: Input, par: Parameters) -> Energy:
    """Return the elastic energy."""
    depth = ops.fmax(-u.z, 0.0)
    return 0.5 * par.k * depth * depth


def power_in(u: Input, f: Forces) -> Power:
    """Return the work that the wheel does on the ground."""
    return -f.support * u.v


def power_loss(u: Input, f: Forces, par: Parameters) -> Loss:
    """Return the power that the contact dissipates, >= 0."""
    return (par.k * ops.fmax(-u.z, 0.0) - f.support) * u.v
