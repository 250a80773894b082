"""Brake heart: two screws and a wedge that push on each other but never pull."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Stiffness, TimeConstant, Unit
from bywire.core.signals import ContactCompliance, Energy, Role, Signal

Work = Annotated[float, Signal("W", "work on the heart's contacts")]
Loss = Annotated[
    float,
    Signal(
        "W",
        "loss in the heart's contacts, minus their initial energy",
        role=Role("sink", "brake heart"),
    ),
]
FreePlay = Annotated[float, Unit("m", 2e-5), Field(ge=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Massless screws of axial stiffness K_S, wedge interfaces K_W, screw tips K_C.

    Screw 2 pushes the wedge toward positive travel, and screw 1 toward negative travel. Tip to tip,
    screw 1 pushes screw 2 toward positive travel. Damping is proportional to stiffness.
    """

    K_S: Stiffness
    """axial stiffness of each screw with its bearings"""
    K_W: Stiffness
    """stiffness of each interface between screw and wedge"""
    K_C: Stiffness
    """stiffness between the screw tips"""
    g_1: FreePlay
    """free play between screw 1 and wedge"""
    g_2: FreePlay
    """free play between screw 2 and wedge"""
    g_12: FreePlay
    """free play between the screws"""
    tau_heart: TimeConstant
    """ratio of damping to stiffness"""


FAULTS = (ParameterFault("worn", "increased free play on both sides", ("g_1", "g_2"), 5.0),)


class Input(NamedTuple):
    """Travels and velocities of screw 1, screw 2 and wedge."""

    X_1: Annotated[float, Signal("m", "travel of screw 1", 1e-4)]
    X_2: Annotated[float, Signal("m", "travel of screw 2", 1e-4)]
    x: Annotated[float, Signal("m", "travel of the wedge", 1e-4)]
    V_1: Annotated[float, Signal("m/s", "velocity of screw 1", 0.02)]
    V_2: Annotated[float, Signal("m/s", "velocity of screw 2", 0.02)]
    v: Annotated[float, Signal("m/s", "velocity of the wedge", 0.02)]


class InputRate(NamedTuple):
    """Derivatives of the travels."""

    X_1: Annotated[float, Signal("m/s", "velocity of screw 1", 0.02)]
    X_2: Annotated[float, Signal("m/s", "velocity of screw 2", 0.02)]
    x: Annotated[float, Signal("m/s", "velocity of the wedge", 0.02)]


class Overlaps(NamedTuple):
    """Overlaps of the contacts screw 1 - wedge, screw 2 - wedge, screw 1 - screw 2."""

    d_1: Annotated[float, Signal("m", "overlap screw 1 - wedge", 2e-5)]
    d_2: Annotated[float, Signal("m", "overlap screw 2 - wedge", 2e-5)]
    d_12: Annotated[float, Signal("m", "overlap screw 1 - screw 2", 2e-5)]


class Forces(NamedTuple):
    """Contact forces, all >= 0."""

    f_1: Annotated[float, Signal("N", "force screw 1 - wedge", 400.0)]
    f_2: Annotated[float, Signal("N", "force screw 2 - wedge", 400.0)]
    f_12: Annotated[float, Signal("N", "force screw 1 - screw 2", 400.0)]


class Output(NamedTuple):
    """Axial forces on the screws, actuation and squeezing force on the wedge."""

    F_1: Annotated[float, Signal("N", "axial force on screw 1", 400.0)]
    F_2: Annotated[float, Signal("N", "axial force on screw 2", 400.0)]
    F_M: Annotated[float, Signal("N", "actuation force", 400.0)]
    squeeze: Annotated[float, Signal("N", "sum of the forces on the wedge", 800.0)]


class Compliances(NamedTuple):
    """Entries of the symmetric compliance matrix C."""

    wedge: Annotated[float, Signal("m/N", "screw and interface", 4e-8)]
    tips: Annotated[float, Signal("m/N", "both screws and their tips", 4e-8)]
    screw: Annotated[float, Signal("m/N", "one screw, shared by two contacts", 2e-8)]


def compliances(par: Parameters) -> Compliances:
    r"""Return the entries of the compliance matrix.

    .. math::
        C = \begin{pmatrix} 1/K_S + 1/K_W & 0 & -1/K_S \\ 0 & 1/K_S + 1/K_W & -1/K_S \\
        -1/K_S & -1/K_S & 2/K_S + 1/K_C \end{pmatrix}

    References
    ----------
    Roberts et al. (2003), section "Brake heart", Fig. 3, solved for massless screws.
    """
    screw = 1.0 / par.K_S
    return Compliances(wedge=screw + 1.0 / par.K_W, tips=2.0 * screw + 1.0 / par.K_C, screw=screw)


def matrix(
    par: Parameters,
) -> tuple[
    tuple[ContactCompliance, ContactCompliance, ContactCompliance],
    tuple[ContactCompliance, ContactCompliance, ContactCompliance],
    tuple[ContactCompliance, ContactCompliance, ContactCompliance],
]:
    """Return the compliance matrix row by row, shape (3, 3), positive definite."""
    c = compliances(par)
    none = 0.0 * c.screw
    return (
        (c.wedge, none, -c.screw),
        (none, c.wedge, -c.screw),
        (-c.screw, -c.screw, c.tips),
    )


def depths(u: Input, par: Parameters) -> Overlaps:
    """Return the overlaps without damping, which are negative in a gap."""
    return Overlaps(
        d_1=u.x - u.X_1 - par.g_1,
        d_2=u.X_2 - u.x - par.g_2,
        d_12=u.X_1 - u.X_2 - par.g_12,
    )


def overlaps(u: Input, par: Parameters) -> Overlaps:
    """Return the damped overlaps, d = depth + tau d(depth)/dt, affine in the inputs."""
    tau = par.tau_heart
    still = depths(u, par)
    return Overlaps(
        d_1=still.d_1 + tau * (u.v - u.V_1),
        d_2=still.d_2 + tau * (u.V_2 - u.v),
        d_12=still.d_12 + tau * (u.V_1 - u.V_2),
    )


def solve(d: Overlaps, par: Parameters) -> Forces:
    """Return the contact forces: C f - d >= 0, f >= 0, f (C f - d) = 0.

    Notes
    -----
    The two wedge contacts do not share a compliance, so their forces follow from the tip force:
    f_k = max(0, d_k + c_s f_12) / c_w. This leaves one increasing, piecewise linear equation
    in f_12. The solution is on the piece that contains its root, with no, one or both contacts
    closed.
    """
    c = compliances(par)
    w, t, s = c.wedge, c.tips, c.screw
    lower, upper = ops.fmin(d.d_1, d.d_2), ops.fmax(d.d_1, d.d_2)
    # A contact that opens lowers the root, so the largest candidate is the root.
    none = d.d_12 / t
    upper_alone = (d.d_12 + s / w * upper) / (t - s * s / w)
    both = (d.d_12 + s / w * (upper + lower)) / (t - 2.0 * s * s / w)
    f_12 = ops.fmax(ops.fmax(none, 0.0), ops.fmax(upper_alone, both))
    return Forces(
        f_1=ops.fmax(d.d_1 + s * f_12, 0.0) / w,
        f_2=ops.fmax(d.d_2 + s * f_12, 0.0) / w,
        f_12=f_12,
    )


def forces(u: Input, par: Parameters) -> Forces:
    """Return the contact forces, including damping."""
    return solve(overlaps(u, par), par)


def output(f: Forces) -> Output:
    """Return the forces on screws and wedge, positive toward positive travel."""
    return Output(F_1=f.f_1 - f.f_12, F_2=f.f_12 - f.f_2, F_M=f.f_2 - f.f_1, squeeze=f.f_1 + f.f_2)


def input_rate(u: Input) -> InputRate:
    """Return the rates of the travels, which are the ports of the heart's stored energy."""
    return InputRate(X_1=u.V_1, X_2=u.V_2, x=u.v)


def energy(u: Input, par: Parameters) -> Energy:
    """Return the elastic energy of the contacts, f C f / 2 = f d / 2, without damping."""
    d = depths(u, par)
    f = solve(d, par)
    return 0.5 * (f.f_1 * d.d_1 + f.f_2 * d.d_2 + f.f_12 * d.d_12)


def power_in(u: Input, f: Forces) -> Work:
    """Return the work that screws and wedge do on the contacts."""
    return f.f_1 * (u.v - u.V_1) + f.f_2 * (u.V_2 - u.v) + f.f_12 * (u.V_1 - u.V_2)


def power_loss(u: Input, f: Forces, par: Parameters) -> Loss:
    """Return the power that the contacts dissipate, >= 0."""
    return power_in(u, f) - power_in(u, solve(depths(u, par), par))
