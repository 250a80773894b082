"""Floating caliper with running clearance, and pads and bridge as one stiffening spring."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops, validity
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length, Stiffness, TimeConstant, Unit
from bywire.core.signals import ContactCompliance, Energy, Overlap, Role, Signal
from bywire.core.typing import Array

Quadratic = Annotated[float, Unit("N/m**2", 3e10), Field(ge=0, allow_inf_nan=False)]
Cubic = Annotated[float, Unit("N/m**3", 7e12), Field(allow_inf_nan=False)]
Clearance = Annotated[float, Unit("m", 3e-4), Field(ge=0, allow_inf_nan=False)]
ClampForce = Annotated[float, Signal("N", "clamp force", 1e4)]
Work = Annotated[float, Signal("W", "work on the caliper")]
Loss = Annotated[float, Signal("W", "caliper damping loss", role=Role("sink", "caliper damping"))]


class Parameters(ParameterSet):
    """Pads, disc and bridge in series along the piston travel. The caliper never pulls.

    The floating body centers itself without friction, so a single travel closes both sides.
    """

    k_1: Stiffness
    """stiffness at first contact"""
    k_2: Quadratic
    """coefficient of the overlap squared"""
    k_3: Cubic
    """coefficient of the overlap cubed; negative if the curve straightens toward high forces"""
    n_max: Length
    """maximum measured overlap; the curve must rise up to it"""
    tau: TimeConstant
    """ratio of damping to stiffness"""
    clearance: Clearance
    """running clearance, sum over both sides of the disc"""

    @model_validator(mode="after")
    def _rises(self) -> Parameters:
        # The slope is a parabola. Its minimum is at an end, or at the vertex if k_3 > 0 > k_2
        # (excluded).
        slope = self.k_1 + (2.0 * self.k_2 + 3.0 * self.k_3 * self.n_max) * self.n_max
        if not slope > 0.0:
            raise ValueError(
                f"the force must increase up to n_max = {self.n_max:g} m, but its slope there is "
                f"{slope:.3g} N/m. Reduce n_max or increase k_3 = {self.k_3:g} N/m**3"
            )
        return self


FAULTS = (ParameterFault("soft", "softer pads, or a cracked bridge", ("k_1", "k_2", "k_3"), 0.5),)


class Input(NamedTuple):
    """Piston motion."""

    x: Annotated[float, Signal("m", "piston travel", 1e-3)]
    v: Annotated[float, Signal("m/s", "piston speed", 3e-3)]


class InputRate(NamedTuple):
    """Derivatives of the arguments of the stored energy."""

    x: Annotated[float, Signal("m/s", "piston speed", 3e-3)]


class Forces(NamedTuple):
    """Clamp force, >= 0."""

    F_cl: ClampForce


def depth(u: Input, par: Parameters) -> Overlap:
    """Return the overlap of pads and disc, negative in the clearance."""
    return u.x - par.clearance


def overlaps(u: Input, par: Parameters) -> Overlap:
    """Return the damped overlap, n + tau dn/dt, affine in the motion."""
    return depth(u, par) + par.tau * u.v


def compliance(par: Parameters) -> ContactCompliance:
    """Return the compliance at first contact, which determines whether the pads touch."""
    return 1.0 / par.k_1


def elastic(n: Overlap, par: Parameters) -> ClampForce:
    r"""Return the clamp force of an overlap n >= 0.

    .. math:: F_{cl} = k_1 n + k_2 n^2 + k_3 n^3
    """
    return n * (par.k_1 + n * (par.k_2 + n * par.k_3))


def stiffness(
    n: Overlap, par: Parameters
) -> Annotated[float, Signal("N/m", "stiffness of the caliper", 2e7)]:
    """Return the slope of clamp force versus overlap at n >= 0."""
    return par.k_1 + n * (2.0 * par.k_2 + n * 3.0 * par.k_3)


def bent(f: Forces, par: Parameters) -> Forces:
    """Return the clamp force for a contact force with constant compliance.

    Contacts have constant compliances. The contact force f is the initial slope times the overlap,
    and the curve maps it to the clamp force. The curve rises, so the contact never pulls, and the
    damping never adds energy.
    """
    return Forces(F_cl=elastic(f.F_cl * compliance(par), par))


def forces(u: Input, par: Parameters) -> Forces:
    """Return the clamp force of the pads without other contacts."""
    return Forces(F_cl=elastic(ops.fmax(overlaps(u, par), 0.0), par))


def input_rate(u: Input) -> InputRate:
    """Return the rate of the travel, which is the port of the caliper's stored energy."""
    return InputRate(x=u.v)


def energy(u: Input, par: Parameters) -> Energy:
    """Return the elastic energy."""
    n = ops.fmax(depth(u, par), 0.0)
    return n * n * (0.5 * par.k_1 + n * (par.k_2 / 3.0 + 0.25 * n * par.k_3))


def power_in(u: Input, f: Forces) -> Work:
    """Return the work of the piston on the caliper."""
    return f.F_cl * u.v


def power_loss(u: Input, f: Forces, par: Parameters) -> Loss:
    """Return the damping loss, >= 0."""
    return (f.F_cl - elastic(ops.fmax(depth(u, par), 0.0), par)) * u.v


def watch(u: Input, par: Parameters, t: Array) -> list[str]:
    """Warn if the pads exceed the measured curve, with the time when they first do."""
    text = f"the pads exceed the measured curve, caliper.n_max = {1e3 * par.n_max:g} mm,"
    return validity.first(t, validity.outside(depth(u, par), -math.inf, par.n_max), text)
