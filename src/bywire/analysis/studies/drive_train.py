"""Drive train of the wedge brake: peak power over wedge slope and screw lead at equal response."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from pydantic import Field, model_validator

from bywire.analysis.drive_train_design import Answer, Demand, answer
from bywire.analysis.drive_train_map import mapped
from bywire.analysis.study import Cut, Found, Map, Mark, Progress, Study
from bywire.assemblies.wedge_parameters import WedgeParameters
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.wedge_series import Coefficients
from bywire.control.moment_control import SomeMoment, SpeedLimit
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Length, Unit
from bywire.plant import wedge

Array = NDArray[np.float64]
Slope = Annotated[float, Unit("1", 0.3), Field(gt=0, le=2, allow_inf_nan=False)]
Count = Annotated[int, Unit("1", 11.0), Field(ge=3, le=101)]

NEAR = 1.05
"""designs within this factor of the smallest power count as equally good"""
_REFINED = 4  # grid of the optimum against that of the map
_BORDER = 0.02  # between 0, feasible, and 1: drawn close to the last feasible designs

ASSUMPTIONS = (
    "The wedge's slope and the screws' lead vary; motors, drives, bearings, screw efficiency, "
    "stiffnesses, clearance and the travel that preloads the screws stay.",
    "The controllers know the design: travel per shaft angle and moment per angle follow it.",
    "Equal response: all speeds and accelerations of the reference are scaled so that the pads "
    "close equally fast; with response 'enforced' they get a common factor, the smallest at which "
    "the sensor shows 90 % of the demand in time at every friction coefficient.",
    "Bandwidths stay: those of the position loops on the shaft, the crossover of the moment loop.",
    "The end stops of the wedge stand where the pads have travelled as far as before.",
    "Infeasible are designs that at any coefficient are more than 2 % late (where the response is "
    "enforced), do not hold 95 % of the demand to the end, or press on an end stop.",
    "Power counts at the drives' input, standby included, from the demand to the end of the stop.",
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
    """time after it that counts too"""
    omega_gap: SpeedLimit
    """largest speed of the given drive train while crossing the gap, scaled with all others"""
    mu_B: Coefficients
    """friction coefficients of the pads; the worst counts"""
    believed: Literal["known", "as-given"]
    """whether the moment controller knows them, or believes in that of the parameter set"""
    response: Literal["enforced", "as-scaled"]
    """whether the time is enforced, or the pads close as fast as with the given drive train"""
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
        ranges = (
            ("tan_alpha_min", "tan_alpha_max", ""),
            ("lead_min", "lead_max", " m"),
            ("t_90", "t_hold", " s"),
        )
        for low, high, unit in ranges:
            a, b = getattr(self, low), getattr(self, high)
            if not a < b:
                raise ValueError(f"{low} = {a:g}{unit} must be below {high} = {b:g}{unit}")
        return self


class Best(NamedTuple):
    """A design, and its largest power [W] at the worst friction coefficient."""

    tan_alpha: float
    lead: float
    power: float
    at: xr.Dataset


def compute(par: WedgeParameters, options: Options, progress: Progress) -> Found:
    """Return the map of peak power, its optimum on a finer grid around it, and the given design.

    Raises
    ------
    InputError
        When a design does not exist.
    """
    demand = Demand(
        options.moment, options.t_90, options.t_hold, options.t_release, options.mu_B,
        options.believed == "known", options.response == "enforced",
    )  # fmt: skip
    par = par.replace({"control.moment.omega_gap": options.omega_gap})
    given = answer(par, demand)  # first and alone: it also builds the kernels
    slopes = np.linspace(options.tan_alpha_min, options.tan_alpha_max, options.slopes)
    leads = np.linspace(options.lead_min, options.lead_max, options.leads)
    data = mapped(par, demand, slopes, leads, lambda share: progress("designs", share))
    here = Mark("given drive train", par.screw.lead, wedge.slope(par.wedge))
    warnings = _warnings(data)
    if data["infeasible"].values.all():
        warnings += ("no design answers in time: allow more (t_90), or compare other designs",)
        return Found(data, _given(given, options), ASSUMPTIONS, {}, (), warnings)
    coarse = smallest(data, options.power)
    near = (_around(slopes, coarse.tan_alpha), _around(leads, coarse.lead))
    fine = mapped(par, demand, *near, lambda share: progress("optimum", share))
    best = min(coarse, smallest(fine, options.power), key=lambda one: one.power)
    marks = (Mark("optimum", best.lead, best.tan_alpha), here)
    maps = {
        kind: Map(
            f"worst_{kind}", "lead", "tan_alpha",
            f"Largest {kind} power of the stop at the worst friction coefficient.",
            marks if kind == options.power else (here,),
            {"infeasible": ("infeasible", _BORDER)},
        )
        for kind in (options.power, _other(options.power))
    }  # fmt: skip
    kpis = (*_optimum(best, (data, fine), options), *_given(given, options))
    return Found(data, kpis, ASSUMPTIONS, maps, _cuts(data, best), warnings + _edges(best, options))


def smallest(data: xr.Dataset, power: str) -> Best:
    """Return the feasible design of least power; there must be one."""
    worst = data[f"worst_{power}"].values
    i, j = np.unravel_index(int(np.nanargmin(worst)), worst.shape)
    at = data.isel(tan_alpha=int(i), lead=int(j))
    return Best(float(at["tan_alpha"]), float(at["lead"]), float(worst[i, j]), at)


def _around(nodes: Array, middle: float) -> Array:
    """Return finer nodes from the one before to the one after a node, within the range."""
    k = int(np.argmin(np.abs(nodes - middle)))
    low, high = nodes[max(k - 1, 0)], nodes[min(k + 1, nodes.size - 1)]
    step = (nodes[1] - nodes[0]) / _REFINED
    return np.asarray(np.linspace(low, high, round((high - low) / step) + 1))


def _other(power: str) -> str:
    return "instantaneous" if power == "filtered" else "filtered"


def _optimum(best: Best, grids: tuple[xr.Dataset, ...], options: Options) -> tuple[Kpi, ...]:
    other = smallest(grids[0], _other(options.power))
    slopes, leads = [best.tan_alpha], [best.lead]
    for data in grids:
        good = np.argwhere(data[f"worst_{options.power}"].values <= NEAR * best.power)
        slopes += [float(one) for one in data["tan_alpha"].values[good[:, 0]]]
        leads += [float(one) for one in data["lead"].values[good[:, 1]]]
    share = f"of designs within {100 * (NEAR - 1):.0f} % of the smallest power"
    return (
        Kpi("optimum_tan_alpha", best.tan_alpha, "1", "Slope of the wedge of least power."),
        Kpi("optimum_lead", best.lead, "m", "Lead of the screws of least power."),
        Kpi("optimum_power", best.power, "W",
            f"Largest {options.power} power of the stop, worst friction coefficient."),
        Kpi("optimum_mu_B", float(best.at[f"mu_B_{options.power}"]), "1",
            "Friction coefficient that needs this power."),
        Kpi("optimum_t_90", float(best.at["t_90"].max()), "s",
            "Time to 90 % of the demand reached, slowest friction coefficient."),
        Kpi("optimum_closing_speed", float(best.at["closing_speed"]), "m/s",
            "Largest speed at which its reference closes the pads."),
        Kpi("optimum_current", float(best.at["current"].max()), "A", "Largest current demand."),
        Kpi("flat_tan_alpha_min", min(slopes), "1", f"Smallest slope {share}."),
        Kpi("flat_tan_alpha_max", max(slopes), "1", f"Largest slope {share}."),
        Kpi("flat_lead_min", min(leads), "m", f"Smallest lead {share}."),
        Kpi("flat_lead_max", max(leads), "m", f"Largest lead {share}."),
        Kpi("other_tan_alpha", other.tan_alpha, "1",
            f"Slope on the map of least {_other(options.power)} power."),
        Kpi("other_lead", other.lead, "m",
            f"Lead on the map of least {_other(options.power)} power."),
        Kpi("other_power", other.power, "W",
            f"Largest {_other(options.power)} power there, worst friction coefficient."),
    )  # fmt: skip


def _given(given: Answer, options: Options) -> tuple[Kpi, ...]:
    sizes = getattr(given, options.power)
    k, t_90 = int(np.argmax(sizes)), float(given.t_90.max())
    note = "" if math.isfinite(t_90) else "a case never gets there"
    return (
        Kpi("given_power", float(sizes[k]), "W",
            f"Largest {options.power} power of the given drive train, worst coefficient."),
        Kpi("given_mu_B", float(options.mu_B[k]), "1",
            "Friction coefficient that needs this power."),
        Kpi("given_t_90", t_90, "s",
            "Time to 90 % of the demand reached by it, slowest coefficient.", note),
        Kpi("given_closing_speed", given.closing_speed, "m/s",
            "Largest speed at which its reference closes the pads."),
    )  # fmt: skip


def _cuts(data: xr.Dataset, best: Best) -> tuple[Cut, ...]:
    """Return what changes along the lead at the map's slope nearest to the optimum."""
    row = data.sel(tan_alpha=best.tan_alpha, method="nearest")
    worst = row[["t_90", "current", "speed", "copper", "friction"]].max(dim="mu_B", keep_attrs=True)
    names = ("worst_filtered", "mu_B_filtered", "worst_instantaneous")
    shown = xr.merge([worst, row[list(names)]], compat="override")
    title = f"tan(alpha) = {float(row['tan_alpha']):.3g}, largest over the friction coefficients"
    return (Cut(title, shown, ("lead", *names, *(str(name) for name in worst))),)


def _warnings(data: xr.Dataset) -> tuple[str, ...]:
    if not data.attrs["unsettled_substeps"]:
        return ()
    count = data.attrs["unsettled_substeps"]
    return (f"{count} substeps of all cases hit the cap of the contact iteration",)


def _edges(best: Best, options: Options) -> tuple[str, ...]:
    """Return whether the optimum lies at the edge of the designs compared."""
    return tuple(
        f"the optimum lies at the edge of the designs, {name} = {edge:g}: widen the range"
        for name, value in (("tan_alpha", best.tan_alpha), ("lead", best.lead))
        for edge in (getattr(options, f"{name}_min"), getattr(options, f"{name}_max"))
        if math.isclose(value, edge)
    )


STUDY = Study(
    name="drive-train",
    assembly="wedge-brake",
    summary="peak power of a large stop over wedge slope and screw lead, at equal response",
    options=Options,
    defaults=Options(
        moment=950.0, t_90=0.1, t_hold=0.2, t_release=0.2, omega_gap=60.0,
        mu_B=(0.25, 0.3, 0.35, 0.4, 0.45), believed="known", response="enforced", power="filtered",
        tan_alpha_min=0.2, tan_alpha_max=0.45, slopes=11, lead_min=1e-3, lead_max=8e-3, leads=15,
    ),
    compute=compute,
)
