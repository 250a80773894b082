"""Options and assumptions of the study of the wedge brake's drive train."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from bywire.brakes.wedge.laws.moment_control import SomeMoment, SpeedLimit
from bywire.brakes.wedge.series import Coefficients
from bywire.brakes.wedge.sizing.design import Efficiency
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Length, Unit
from bywire.synthesis.study import require_ranges

Slope = Annotated[float, Unit("1", 0.3), Field(gt=0, le=2, allow_inf_nan=False)]
Count = Annotated[int, Unit("1", 11.0), Field(ge=3, le=101)]

ASSUMPTIONS = (
    "The wedge's slope and the screws' lead vary; motors, drives, bearings, stiffnesses, clearance "
    "and the travel that preloads the screws stay.",
    "The screws' friction angle stays, so that their efficiency grows with the lead and a small "
    "lead locks itself; with efficiency 'as-given' the efficiency stays.",
    "The controllers know the design: travel per shaft angle and moment per angle follow it.",
    "Equal response: all speeds and accelerations of the reference are scaled so that the pads "
    "close equally fast; with response 'enforced' they get a common factor, the smallest at which "
    "the sensor shows 90 % of the demand in time at every friction coefficient.",
    "Bandwidths stay: those of the position loops on the shaft, the crossover of the moment loop.",
    "The end stops of the wedge stand where the pads have traveled as far as before.",
    "Infeasible are designs that at any coefficient are more than 2 % late (where the response is "
    "enforced), do not hold 95 % of the demand, do not release, or press on an end stop.",
    "Power counts at the drives' input, standby included, in build-up and hold, and in the release "
    "where that is asked for.",
    "Each case runs with the disc at four angles, a quarter turn apart, and the worst counts: "
    "where the run-out meets the stop is chance, and holding the moment against it takes power.",
)


class Options(ParameterSet):
    """The stop, the friction coefficients, and the designs to compare."""

    moment: SomeMoment
    """moment demanded in one step"""
    t_90: Duration
    """time in which the sensor must show 90 % of it"""
    t_hold: Duration
    """length of the demand"""
    t_release: Duration
    """time in which the brake must release after it"""
    counted: Literal["build-up-and-hold", "whole-pulse"]
    """whether the power of the release counts too"""
    omega_gap: SpeedLimit
    """largest speed of the given drive train while crossing the gap, scaled with all others"""
    mu_B: Coefficients
    """friction coefficients of the pads; the worst counts"""
    believed: Literal["known", "as-given"]
    """whether the moment controller knows them, or believes in that of the parameter set"""
    response: Literal["enforced", "as-scaled"]
    """whether the time is enforced, or the pads close as fast as with the given drive train"""
    efficiency: Efficiency
    """what stays of the screw over the lead: its friction angle, or its efficiency"""
    power: Literal["filtered", "instantaneous"]
    """which power is minimized: as the rig measures it, or as it is"""
    tan_alpha_min: Slope
    """smallest slope of the wedge"""
    tan_alpha_max: Slope
    """largest slope of the wedge"""
    slopes: Count
    """number of slopes"""
    lead_min: Length
    """smallest lead of the screws"""
    lead_max: Length
    """largest lead of the screws"""
    leads: Count
    """number of leads"""

    @model_validator(mode="after")
    def _ordered(self) -> Options:
        slopes, leads = ("tan_alpha_min", "tan_alpha_max", "1"), ("lead_min", "lead_max", "m")
        require_ranges(self, (slopes, leads, ("t_90", "t_hold", "s")))
        return self


DEFAULTS = Options(
    moment=950.0,
    t_90=0.1,
    t_hold=0.2,
    t_release=0.2,
    counted="build-up-and-hold",
    omega_gap=60.0,
    mu_B=(0.25, 0.3, 0.35, 0.4, 0.45),
    believed="known",
    response="enforced",
    efficiency="friction-angle",
    power="filtered",
    tan_alpha_min=0.2,
    tan_alpha_max=0.45,
    slopes=11,
    lead_min=1e-3,
    lead_max=8e-3,
    leads=15,
)
"""the pulse of Fig. 9 in Roberts et al. (2003), around the catalog's design"""
