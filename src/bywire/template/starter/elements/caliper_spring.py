"""Caliper and pads: no force within the clearance, then a progressive spring."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.authoring import Energy, ParameterSet, Power, Signal, Stiffness, Unit
from bywire.core import ops


class Parameters(ParameterSet):
    """Curve without hysteresis, which neglects losses in pads and housing."""

    x_gap: Annotated[float, Unit("m", 2e-4), Field(ge=0, allow_inf_nan=False)]
    """travel across the clearance"""
    k: Stiffness
    """stiffness at first contact"""
    x_stiff: Annotated[float, Unit("m", 1e-3), Field(gt=0, allow_inf_nan=False)]
    """compression that doubles the secant stiffness"""


class Input(NamedTuple):
    """Travel and velocity of the pads."""

    x: Annotated[float, Signal("m", "travel", 5e-4)]
    v: Annotated[float, Signal("m/s", "velocity", 5e-3)]


class InputRate(NamedTuple):
    """Derivative of the stored energy's argument."""

    x: Annotated[float, Signal("m/s", "velocity", 5e-3)]


def output(u: Input, par: Parameters) -> Annotated[float, Signal("N", "clamp force", 1e4)]:
    r"""Return the clamp force, :math:`F = k s (1 + s / x_{stiff})` of the compression s."""
    s = ops.fmax(u.x - par.x_gap, 0.0)
    return par.k * s * (1.0 + s / par.x_stiff)


def input_rate(u: Input) -> InputRate:
    """Return the rate of the travel."""
    return InputRate(x=u.v)


def energy(u: Input, par: Parameters) -> Energy:
    """Return the elastic energy."""
    s = ops.fmax(u.x - par.x_gap, 0.0)
    return par.k * s * s * (0.5 + s / (3.0 * par.x_stiff))


def power_in(u: Input, par: Parameters) -> Power:
    """Return the power into the caliper."""
    return output(u, par) * u.v
