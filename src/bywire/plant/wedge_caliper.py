"""Floating caliper over the wedge: clearance, run-out of the disc, linear stiffness."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length, Stiffness, TimeConstant, Unit
from bywire.core.signals import ContactCompliance, Energy, Overlap, Power, Signal

Clearance = Annotated[float, Unit("m", 2e-4), Field(ge=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Pads, disc and caliper as one spring that presses and never pulls."""

    K_cal: Stiffness
    """stiffness of caliper and pads"""
    tau_cal: TimeConstant
    """damping over stiffness"""
    clearance: Clearance
    """running clearance, both sides of the disc together"""
    r_B: Length
    """effective radius of the pads"""


class Input(NamedTuple):
    """Wedge, its slope and side, and the disc's run-out."""

    x: Annotated[float, Signal("m", "wedge travel", 5e-3)]
    v: Annotated[float, Signal("m/s", "wedge velocity", 0.02)]
    side: Annotated[float, Signal("1", "side of the wedge, +1 or -1")]
    tan_alpha: Annotated[float, Signal("1", "slope of the wedge", 0.4)]
    runout: Annotated[float, Signal("m", "run-out", 4e-6)]
    runout_rate: Annotated[float, Signal("m/s", "rate of the run-out", 2e-4)]


class InputRate(NamedTuple):
    """Derivatives of what the stored energy depends on; slope and side stand still."""

    x: Annotated[float, Signal("m/s", "wedge velocity", 0.02)]
    side: Annotated[float, Signal("1/s", "rate of the side")]
    tan_alpha: Annotated[float, Signal("1/s", "rate of the slope")]
    runout: Annotated[float, Signal("m/s", "rate of the run-out", 2e-4)]


class Forces(NamedTuple):
    """Normal force, >= 0."""

    F_N: Annotated[float, Signal("N", "normal force", 3e3)]


def depth(u: Input, par: Parameters) -> Overlap:
    r"""Return the overlap, :math:`n = |x| \tan\alpha - c + \text{run-out}`; negative in the gap."""
    return u.side * u.x * u.tan_alpha - par.clearance + u.runout


def closing(u: Input) -> Annotated[float, Signal("m/s", "rate of the overlap", 5e-3)]:
    """Return the rate of the overlap."""
    return u.side * u.v * u.tan_alpha + u.runout_rate


def overlap(u: Input, par: Parameters) -> Overlap:
    """Return the damped overlap, n + tau dn/dt."""
    return depth(u, par) + par.tau_cal * closing(u)


def compliance(par: Parameters) -> ContactCompliance:
    """Return the compliance of caliper and pads."""
    return 1.0 / par.K_cal


def forces(u: Input, par: Parameters) -> Forces:
    r"""Return the normal force, :math:`F_N = K_{CAL} \max(0, n + \tau \dot n)`.

    References
    ----------
    Roberts et al. (2003), section "Wedge and calliper", with clearance, run-out and damping.
    """
    return Forces(F_N=par.K_cal * ops.fmax(overlap(u, par), 0.0))


def moment(
    F_N: Annotated[float, Signal("N", "normal force", 3e3)],
    mu_B: Annotated[float, Signal("1", "friction of the pads", 0.35)],
    turning: Annotated[float, Signal("1", "direction of the disc, 0 when stopped")],
    par: Parameters,
) -> Annotated[float, Signal("N*m", "braking moment", 300.0)]:
    r"""Return the braking moment of both pads, :math:`M_B = 2 \mu_B s(\Omega) F_N r_B`."""
    return 2.0 * mu_B * turning * F_N * par.r_B


def input_rate(u: Input) -> InputRate:
    """Return how wedge and disc move."""
    return InputRate(x=u.v, side=0.0, tan_alpha=0.0, runout=u.runout_rate)


def energy(u: Input, par: Parameters) -> Energy:
    """Return the elastic energy."""
    n = ops.fmax(depth(u, par), 0.0)
    return 0.5 * par.K_cal * n * n


def power_in(u: Input, f: Forces) -> Power:
    """Return the work of wedge and run-out on the caliper."""
    return f.F_N * closing(u)


def power_loss(u: Input, f: Forces, par: Parameters) -> Power:
    """Return what the damping takes, >= 0."""
    return (f.F_N - par.K_cal * ops.fmax(depth(u, par), 0.0)) * closing(u)
