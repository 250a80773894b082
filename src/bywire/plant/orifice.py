"""Sharp-edged orifice for brake fluid: turbulent flow, and laminar flow near zero."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length, Unit
from bywire.core.signals import Pressure, Role, Signal
from bywire.plant import brake_fluid

DischargeCoefficient = Annotated[float, Unit("1", 0.65), Field(gt=0, le=1, allow_inf_nan=False)]
CriticalReynolds = Annotated[float, Unit("1", 100.0), Field(gt=0, allow_inf_nan=False)]
Opening = Annotated[float, Signal("1", "opened fraction of the area", 1.0, low=0.0, high=1.0)]
Lift = Annotated[float, Signal("m", "lift of the cone", 1e-4, low=0.0)]
HalfAngle = Annotated[float, Unit("rad", 0.8), Field(gt=0, le=math.pi / 2, allow_inf_nan=False)]
"""half of the angle of a cone that closes an orifice"""
ConeAngle = Annotated[float, Signal("rad", "half of the cone's angle", 0.8)]
Flow = Annotated[float, Signal("m**3/s", "flow", 1e-5)]
Loss = Annotated[float, Signal("W", "throttling loss", role=Role("sink", "throttling"))]


class Parameters(ParameterSet):
    """Sharp-edged orifice without fluid inertia and without cavitation."""

    d: Length
    """diameter"""
    C_d: DischargeCoefficient
    """discharge coefficient of turbulent flow"""
    Re_cr: CriticalReynolds
    """Reynolds number at the transition from laminar to turbulent flow"""


FAULTS = (ParameterFault("clogged", "narrower orifice", ("d",), 0.5),)


class Input(NamedTuple):
    """Pressures at both ends, and the opened fraction of the area."""

    p_a: Pressure
    p_b: Pressure
    opening: Opening


def area(par: Parameters) -> Annotated[float, Signal("m**2", "area", 2e-7)]:
    r"""Return the area of the open orifice, :math:`A = \pi d^2 / 4`."""
    return 0.25 * math.pi * par.d * par.d


def conical_opening(x: Lift, alpha: ConeAngle, par: Parameters) -> Opening:
    r"""Return the opened fraction of an orifice that a cone closes.

    .. math:: \frac{A(x)}{A} = \min\left(\frac{\pi d x \sin\alpha}{\pi d^2 / 4}, 1\right)

    Notes
    -----
    It has a kink at the lift :math:`d / (4 \sin\alpha)`, where the conical gap becomes as large as
    the orifice. Linear models of a fully open valve have no kink if the full lift is larger.
    """
    return ops.fmin(4.0 * x * ops.sin(alpha) / par.d, 1.0)


def coefficient(
    par: Parameters, fluid: brake_fluid.Parameters
) -> Annotated[float, Signal("m**3/(s*Pa**0.5)", "flow coefficient", 5e-9)]:
    r"""Return the turbulent flow coefficient, :math:`K = C_d A \sqrt{2/\rho}`."""
    return par.C_d * area(par) * ops.sqrt(2.0 / fluid.rho)


def critical_pressure(
    par: Parameters, fluid: brake_fluid.Parameters
) -> Annotated[float, Signal("Pa", "pressure drop at the transition", 1e4)]:
    r"""Return the pressure drop at the transition from laminar to turbulent flow.

    .. math:: p_{cr} = \frac{\rho}{2} \left(\frac{Re_{cr} \nu}{C_d d}\right)^2
    """
    v = par.Re_cr * fluid.nu / (par.C_d * par.d)
    return 0.5 * fluid.rho * v * v


def flow(u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Flow:
    r"""Return the flow from a to b.

    .. math:: q = C_d A \sqrt{\frac{2}{\rho}} \frac{\Delta p}{(\Delta p^2 + p_{cr}^2)^{1/4}}

    Notes
    -----
    The square root alone has an infinite slope at zero pressure drop. The formula above has the
    slope :math:`K/\sqrt{p_{cr}}` there. Far from zero, its relative deviation from the square root
    is :math:`p_{cr}^2 / (4 \Delta p^2)`. Linear models at a small pressure drop have this finite
    slope. The transition uses the diameter of the open orifice for all openings.

    References
    ----------
    The MathWorks, Simscape Fluids, Orifice (IL), "Laminar and turbulent flow".
    """
    drop, p_cr = u.p_a - u.p_b, critical_pressure(par, fluid)
    K = u.opening * coefficient(par, fluid)
    return K * drop / ops.sqrt(ops.sqrt(drop * drop + p_cr * p_cr))


def pressure_drop(q: Flow, par: Parameters, fluid: brake_fluid.Parameters) -> Pressure:
    r"""Return the pressure drop of a flow, the inverse of `flow` for the open orifice.

    .. math:: \Delta p = \frac{q}{K} \sqrt{\tfrac{1}{2} (z + \sqrt{z^2 + 4 p_{cr}^2})},
        \quad z = (q/K)^2
    """
    ratio, p_cr = q / coefficient(par, fluid), critical_pressure(par, fluid)
    z = ratio * ratio
    return ratio * ops.sqrt(0.5 * (z + ops.sqrt(z * z + 4.0 * p_cr * p_cr)))


def power_loss(u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Loss:
    """Return the heat from the flow, including released compression energy, >= 0."""
    h = brake_fluid.flow_energy
    return flow(u, par, fluid) * (h(u.p_a, fluid) - h(u.p_b, fluid))
