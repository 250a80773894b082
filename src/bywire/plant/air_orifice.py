"""Air orifice according to ISO 6358: choked flow, subsonic flow, and laminar flow near zero."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Unit
from bywire.core.signals import Role, Signal
from bywire.plant import air

SonicConductance = Annotated[float, Unit("m**3/(s*Pa)", 4e-8), Field(gt=0, allow_inf_nan=False)]
CriticalRatio = Annotated[float, Unit("1", 0.3), Field(gt=0, lt=1, allow_inf_nan=False)]
LaminarRatio = Annotated[float, Unit("1", 0.999), Field(gt=0, lt=1, allow_inf_nan=False)]
MassFlow = Annotated[float, Signal("kg/s", "mass flow", 1e-2)]
Loss = Annotated[float, Signal("W", "throttling loss", role=Role("sink", "throttling"))]


class Parameters(ParameterSet):
    """Restriction without air inertia. Conductances of orifices in series do not add."""

    C: SonicConductance
    """sonic conductance"""
    b: CriticalRatio
    """critical ratio of absolute pressures, below which the flow is choked"""
    r_lam: LaminarRatio
    """ratio of absolute pressures above which the flow is laminar, typically 0.995 to 0.999"""

    @model_validator(mode="after")
    def _laminar_flow_is_subsonic(self) -> Parameters:
        if not self.r_lam > self.b:
            raise RuleError("r_lam", f"{self.r_lam:g}", f"> the critical ratio b = {self.b:g}")
        return self


FAULTS = (ParameterFault("clogged", "narrower restriction", ("C",), 0.3),)


class Input(NamedTuple):
    """Absolute pressures and temperatures at both ends, and the opened fraction."""

    p_a: air.AbsolutePressure
    p_b: air.AbsolutePressure
    T_a: air.Kelvin
    T_b: air.Kelvin
    opening: Annotated[float, Signal("1", "opened fraction", 1.0, low=0.0, high=1.0)]


class Output(NamedTuple):
    """Flows from a to b."""

    mdot: MassFlow
    H: Annotated[float, Signal("W", "enthalpy flow", 1e3)]


def output(u: Input, par: Parameters, gas: air.Parameters) -> Output:
    r"""Return the flows from a to b.

    .. math::
        \dot m = C \rho_0 p_1 \sqrt{T_0/T_1}\, \psi(r), \quad r = p_2/p_1, \quad
        \psi = \begin{cases} 1 & r \le b \\
        \sqrt{1 - \left(\frac{r - b}{1 - b}\right)^2} & b < r \le r_{lam} \\
        \psi(r_{lam}) \frac{1 - r}{1 - r_{lam}} & r > r_{lam} \end{cases}

    with index 1 upstream, and the enthalpy flow :math:`\dot m c_p T_1`.

    Notes
    -----
    Without the linear part, the slope at equal pressures would be infinite, and a volume would fill
    in finite time. The slope has kinks at ``r_lam``, and at equal pressures if the temperatures
    differ.

    References
    ----------
    ISO 6358-1:2013, equations for the mass flow rate. The linear part follows The MathWorks,
    Simscape Fluids, Orifice (G), "laminar flow pressure ratio".
    """
    forward = u.p_a > u.p_b
    p_1, p_2 = ops.fmax(u.p_a, u.p_b), ops.fmin(u.p_a, u.p_b)
    T_1 = ops.where(forward, u.T_a, u.T_b)
    r = p_2 / p_1
    # The laminar flow uses the pressure difference, which has no corner at equal pressures.
    turbulent = ops.where(forward, 1.0, -1.0) * p_1 * _flow_function(ops.fmin(r, par.r_lam), par)
    laminar = (u.p_a - u.p_b) * _flow_function(par.r_lam, par) / (1.0 - par.r_lam)
    across = ops.where(r > par.r_lam, laminar, turbulent)
    mdot = u.opening * par.C * gas.rho_0 * ops.sqrt(gas.T_0 / T_1) * across
    return Output(mdot=mdot, H=mdot * gas.gamma * air.heat_capacity(gas) * T_1)


def _flow_function(r: float, par: Parameters) -> float:
    share = (ops.fmax(r, par.b) - par.b) / (1.0 - par.b)
    return ops.sqrt(1.0 - share * share)


def power_loss(u: Input, par: Parameters, gas: air.Parameters) -> Loss:
    """Return the exergy loss due to throttling at ambient temperature, >= 0."""
    drop = air.exergy(u.p_a, gas) - air.exergy(u.p_b, gas)
    return output(u, par, gas).mdot * drop
