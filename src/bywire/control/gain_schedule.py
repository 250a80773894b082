"""Gain schedule of the pressure PID: its gains as a continuous function of pressure."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import model_validator

from bywire.control import pressure_pid
from bywire.core import ops
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import (
    CurrentPerPressure,
    CurrentPerPressureTime,
    CurrentTimePerPressure,
    Pressure,
)
from bywire.core.signals import Signal
from bywire.core.units import shown


class Gains(ParameterSet):
    """Gains in a pressure region; filter and set-point weights are the same in all regions."""

    k_p: CurrentPerPressure
    """proportional gain in this region"""
    k_i: CurrentPerPressureTime
    """integral gain in this region"""
    k_d: CurrentTimePerPressure
    """derivative gain in this region"""


class Parameters(ParameterSet):
    """Pressure regions; the medium region uses the PID's own gains."""

    law: Literal["off", "regions"]
    """whether the gains depend on pressure"""
    p_1: Pressure
    """boundary between low and medium pressure"""
    p_2: Pressure
    """boundary between medium and high pressure"""
    p_blend: Pressure
    """width of the blend around each boundary"""
    low: Gains
    high: Gains

    @model_validator(mode="after")
    def _blends_are_apart(self) -> Parameters:
        if not self.p_1 + self.p_blend <= self.p_2:
            raise RuleError(
                "p_1",
                shown(self.p_1, "Pa"),
                f"<= p_2 - p_blend = {shown(self.p_2 - self.p_blend, 'Pa')}",
                "otherwise the blends overlap. Move a boundary, or use a narrower blend",
            )
        return self


class Output(NamedTuple):
    """Gains at a pressure."""

    k_p: Annotated[float, Signal("A/Pa", "proportional gain", 1e-5)]
    k_i: Annotated[float, Signal("A/(Pa*s)", "integral gain", 1e-4)]
    k_d: Annotated[float, Signal("A*s/Pa", "derivative gain", 1e-7)]


def output(
    p: Annotated[float, Signal("Pa", "measured pressure", 2e6)],
    medium: pressure_pid.Parameters,
    par: Parameters,
) -> Output:
    r"""Return the gains at a pressure: constant in each region, linear over the blends.

    .. math:: k(p) = k_l + s_1 (k_m - k_l) + s_2 (k_h - k_m), \quad
        s_j = \mathrm{sat}_0^1 \left( \frac{p - p_j}{p_{blend}} + \frac{1}{2} \right)

    The schedule alone is not bumpless. For a bumpless transfer, see ``pressure_pid.transferred``.

    Parameters
    ----------
    medium
        The PID with the gains of medium pressure.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), Table 4, for the three regions; W. J. Rugh, J. S. Shamma,
    Research on gain scheduling, Automatica 36 (2000), for the validity of such a schedule near each
    equilibrium and for slow motion between equilibria.
    """
    if par.law == "off":
        return Output(k_p=medium.k_p, k_i=medium.k_i, k_d=medium.k_d)
    s_1 = ops.clip((p - par.p_1) / par.p_blend + 0.5, 0.0, 1.0)
    s_2 = ops.clip((p - par.p_2) / par.p_blend + 0.5, 0.0, 1.0)

    def between(low: float, middle: float, high: float) -> float:
        return low + s_1 * (middle - low) + s_2 * (high - middle)

    return Output(
        k_p=between(par.low.k_p, medium.k_p, par.high.k_p),
        k_i=between(par.low.k_i, medium.k_i, par.high.k_i),
        k_d=between(par.low.k_d, medium.k_d, par.high.k_d),
    )
