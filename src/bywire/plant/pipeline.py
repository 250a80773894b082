"""Brake pipeline: laminar flow between master cylinder and caliper."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Factor, Length
from bywire.core.signals import FlowResistance, Role, Signal
from bywire.core.typing import Array
from bywire.core.validity import highest, largest, row_by_row
from bywire.plant import brake_fluid

Loss = Annotated[float, Signal("W", "loss in the pipeline", role=Role("sink", "pipeline"))]


class Parameters(ParameterSet):
    """Rigid round pipe without fluid inertia, valid for Re < Re_max."""

    d_pl: Length
    """inner diameter"""
    L_pl: Length
    """length"""
    k_lf: Factor
    """coefficient of the laminar resistance, 32 in the paper, 8 in textbooks"""
    Re_max: Factor
    """Reynolds number above which the flow is not laminar and bywire warns"""


FAULTS = (ParameterFault("kinked", "narrower pipe", ("d_pl",), 0.3),)


class Input(NamedTuple):
    """Pressures at both ends."""

    p_a: Annotated[float, Signal("Pa", "pressure at the master cylinder", 2e6)]
    p_b: Annotated[float, Signal("Pa", "pressure at the caliper", 2e6)]


class Output(NamedTuple):
    """Flow toward the caliper and Reynolds number."""

    q: Annotated[float, Signal("m**3/s", "flow toward the caliper", 1e-6)]
    Re: Annotated[float, Signal("1", "Reynolds number", 10.0)]


def resistance(par: Parameters, fluid: brake_fluid.Parameters) -> FlowResistance:
    r"""Return the laminar flow resistance.

    .. math:: K_{lf} = 32 \nu \rho \pi L_{pl} / A_{pl}^2, \quad A_{pl} = \pi d_{pl}^2 / 4

    Notes
    -----
    The Hagen-Poiseuille law has 8 instead of 32. Therefore the coefficient is a parameter.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (12).
    """
    A_pl = math.pi / 4.0 * par.d_pl * par.d_pl
    return par.k_lf * fluid.nu * fluid.rho * math.pi * par.L_pl / (A_pl * A_pl)


def output(u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Output:
    r"""Return flow and Reynolds number.

    .. math:: q = (p_{mc} - p_{pd}) / K_{lf}, \quad Re = \frac{4 |q|}{\pi d_{pl} \nu}
    """
    q = (u.p_a - u.p_b) / resistance(par, fluid)
    return Output(q=q, Re=4.0 / math.pi * ops.fabs(q) / (par.d_pl * fluid.nu))


def power_loss(u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Loss:
    """Return the heat from the flow, including released compression energy, >= 0."""
    q = output(u, par, fluid).q
    return q * (brake_fluid.flow_energy(u.p_a, fluid) - brake_fluid.flow_energy(u.p_b, fluid))


@row_by_row
def watch(t: Array, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> list[str]:
    """Warn if the flow was too fast to be laminar."""
    # Re rises with the pressure difference, so that only the largest one matters.
    drop = largest(u.p_a - u.p_b)
    Re = highest(output(Input(p_a=drop, p_b=0.0), par, fluid).Re)
    if not Re > par.Re_max:
        return []
    return [f"Re = {Re:.0f} in the pipeline is above {par.Re_max:g}, so the flow is not laminar"]
