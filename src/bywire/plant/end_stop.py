"""Pair of stiff, damped end stops, which push but never pull."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Stiffness, TimeConstant
from bywire.core.signals import ContactCompliance, Energy, Role, Signal

Work = Annotated[float, Signal("W", "work on the end stops")]
Loss = Annotated[
    float,
    Signal(
        "W", "loss in the end stops, minus their initial energy", role=Role("sink", "end stops")
    ),
]


class Parameters(ParameterSet):
    """Two equal stops with Kelvin-Voigt damping proportional to stiffness."""

    k_stop: Stiffness
    """stiffness of each stop"""
    tau_stop: TimeConstant
    """ratio of damping to stiffness"""


class Input(NamedTuple):
    """Travel and speed of the body, and positions of the two stops."""

    x: Annotated[float, Signal("m", "travel", 1e-3)]
    v: Annotated[float, Signal("m/s", "speed", 0.02)]
    x_rest: Annotated[float, Signal("m", "position of the near stop", 1e-4)]
    x_end: Annotated[float, Signal("m", "position of the far stop", 1e-3)]


class InputRate(NamedTuple):
    """Derivatives of the inputs that affect the stored energy. The stops do not move."""

    x: Annotated[float, Signal("m/s", "speed", 0.02)]
    x_rest: Annotated[float, Signal("m/s", "speed of the near stop", 0.02)]
    x_end: Annotated[float, Signal("m/s", "speed of the far stop", 0.02)]


class Forces(NamedTuple):
    """Contact forces, both >= 0."""

    near: Annotated[float, Signal("N", "force of the near stop", 100.0)]
    far: Annotated[float, Signal("N", "force of the far stop", 100.0)]


class Overlaps(NamedTuple):
    """Overlaps with damping, d = depth + tau d(depth)/dt. A force acts where d > 0."""

    near: Annotated[float, Signal("m", "overlap at the near stop", 1e-5)]
    far: Annotated[float, Signal("m", "overlap at the far stop", 1e-5)]


def overlaps(u: Input, par: Parameters) -> Overlaps:
    """Return the damped overlaps, affine in travel and speed."""
    return Overlaps(
        near=u.x_rest - u.x - par.tau_stop * u.v,
        far=u.x - u.x_end + par.tau_stop * u.v,
    )


def compliance(par: Parameters) -> ContactCompliance:
    """Return the compliance of one stop."""
    return 1.0 / par.k_stop


def forces(u: Input, par: Parameters) -> Forces:
    """Return the contact forces on a body without other contacts: F >= d / C, F >= 0."""
    d, c = overlaps(u, par), compliance(par)
    return Forces(near=ops.fmax(d.near / c, 0.0), far=ops.fmax(d.far / c, 0.0))


def load(f: Forces) -> Annotated[float, Signal("N", "load on the body", 100.0)]:
    """Return the force of the stops on the body, against positive travel."""
    return f.far - f.near


def input_rate(u: Input) -> InputRate:
    """Return the rate of the travel, which is the port through which the stops store energy."""
    return InputRate(x=u.v, x_rest=0.0, x_end=0.0)


def energy(u: Input, par: Parameters) -> Energy:
    """Return the elastic energy of the stops."""
    near, far = ops.fmax(u.x_rest - u.x, 0.0), ops.fmax(u.x - u.x_end, 0.0)
    return 0.5 * par.k_stop * (near * near + far * far)


def power_in(u: Input, f: Forces) -> Work:
    """Return the work that the body does on the stops."""
    return load(f) * u.v


def power_loss(u: Input, f: Forces, par: Parameters) -> Loss:
    """Return the power that the stops dissipate, >= 0."""
    near, far = ops.fmax(u.x_rest - u.x, 0.0), ops.fmax(u.x - u.x_end, 0.0)
    return (load(f) - par.k_stop * (far - near)) * u.v
