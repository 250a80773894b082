"""Check valve, an orifice that opens in one direction above its cracking pressure."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import Pressure
from bywire.plant import brake_fluid, orifice

CrackingPressure = Annotated[float, Unit("Pa", 2e4), Field(ge=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Massless ball on a seat. Its spring uses up the cracking pressure of the pressure drop."""

    seat: orifice.Parameters
    """orifice of the open valve"""
    p_crack: CrackingPressure
    """pressure drop at which the valve opens"""


FAULTS = (
    ParameterFault("clogged", "narrower seat", ("seat.d",), 0.5),
    ParameterFault(
        "stuck", "closed ball (value: cracking pressure)", replaced="p_crack", value=5e7
    ),
)


class Input(NamedTuple):
    """Pressures at inlet and outlet."""

    p_a: Pressure
    p_b: Pressure


def flow(u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> orifice.Flow:
    r"""Return the flow from inlet to outlet, >= 0.

    .. math:: q = q_{orifice}(\max(\Delta p - p_{crack}, 0))

    Notes
    -----
    The flow has a kink where the pressure drop equals the cracking pressure. A linear model at this
    point uses the slope on one side. The closed valve is tight.
    """
    drop = ops.fmax(u.p_a - u.p_b - par.p_crack, 0.0)
    return orifice.flow(orifice.Input(p_a=drop, p_b=0.0 * drop, opening=1.0), par.seat, fluid)


def pressure_drop(q: orifice.Flow, par: Parameters, fluid: brake_fluid.Parameters) -> Pressure:
    """Return the pressure drop of a flow > 0, which includes the cracking pressure."""
    return par.p_crack + orifice.pressure_drop(q, par.seat, fluid)


def power_loss(u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> orifice.Loss:
    """Return the heat from the flow through seat and spring, >= 0."""
    h = brake_fluid.flow_energy
    return flow(u, par, fluid) * (h(u.p_a, fluid) - h(u.p_b, fluid))
