"""Wedge brake drive train: peak power over wedge slope and screw lead at equal response."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
import xarray as xr
from pydantic import model_validator

from bywire.bench.kpis.kpi import Kpi
from bywire.brakes.wedge.case import Coefficients
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.laws.moment_control import SomeMoment, SpeedLimit
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.sizing import Answer, Count, Demand, Efficiency, Slope, answer, redesigned
from bywire.core.interrupts import thread_pool
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Length
from bywire.core.typing import Array, Progress
from bywire.data.labeled import Labeled, labeled
from bywire.synthesis.study import (
    Cut,
    Findings,
    Map,
    Mark,
    Study,
    edge_warnings,
    require_ranges,
    variable,
)

_ASSUMPTIONS = (
    "The wedge's slope and the screws' lead vary; motors, drives, bearings, stiffnesses, clearance "
    "and the travel that preloads the screws are constant.",
    "The screws' friction angle is constant: their efficiency grows with the lead, and a small "
    "lead is self-locking. With efficiency 'as-given' the efficiency is constant.",
    "The controllers use the design's travel per shaft angle and moment per angle.",
    "Equal response: all speeds and accelerations of the reference are scaled so that the pads "
    "close equally fast. With response 'enforced', they have a common factor: the smallest with "
    "which the measured moment reaches 90 % of the demand in time at every friction coefficient.",
    "The bandwidths of the position loops on the shaft and the moment loop's crossover are "
    "constant.",
    "The end stops of the wedge allow the same travel of the pads as before.",
    "A design is infeasible if at any coefficient it is more than 2 % late (with an enforced "
    "response), does not hold 95 % of the demand, does not release, or presses on an end stop.",
    "Power is the power at the drives' input, including standby, during build-up and hold, and "
    "optionally during the release.",
    "Each case runs with the disc at four angles, a quarter turn apart, and the worst counts: "
    "the phase of the run-out at the stop is random, and holding the moment against it takes "
    "power.",
)


class Options(ParameterSet):
    """The stop, the friction coefficients, and the designs to compare."""

    moment: SomeMoment
    """demanded moment, in one step"""
    t_90: Duration
    """time within which the measured moment must reach 90 %"""
    t_hold: Duration
    """length of the moment demand"""
    t_release: Duration
    """time within which the brake must release after the demand"""
    counted: Literal["build-up-and-hold", "whole-pulse"]
    """whether the power of the release also counts"""
    omega_gap: SpeedLimit
    """largest speed of the given drive train while crossing the gap, scaled with all others"""
    mu_B: Coefficients
    """friction coefficients of the pads; the worst case counts"""
    believed: Literal["known", "as-given"]
    """whether the moment controller knows them, or assumes the parameter set's coefficient"""
    response: Literal["enforced", "as-scaled"]
    """whether the time is enforced, or the pads close as fast as with the given drive train"""
    efficiency: Efficiency
    """constant property of the screw over the lead: its friction angle, or its efficiency"""
    power: Literal["filtered", "instantaneous"]
    """power to minimize: with the rig's filter, or without"""
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

_NONE_FEASIBLE = "no design is feasible: increase t_90 or t_hold, or compare other designs"
_NEAR = 1.05
"""designs within this factor of the smallest power count as equally good"""
_ROUNDS = 2  # of the optimum's refinement; each halves the spacing
_TINY = 1e-6  # of the spacing
_BORDER = 0.02  # contour between 0, feasible, and 1, close to the last feasible designs


class _Best(NamedTuple):
    """A design, and its largest power [W] at the worst friction coefficient."""

    tan_alpha: float
    lead: float
    power: float
    at: xr.Dataset


def compute(par: WedgeParameters, options: Options, progress: Progress) -> Findings:
    """Return the map of peak power, its optimum on a finer grid around it, and the given design.

    Raises
    ------
    InputError
        When a design is not valid.
    """
    demand = Demand(
        options.moment,
        options.t_90,
        options.t_hold,
        options.t_release,
        options.mu_B,
        options.believed == "known",
        options.response == "enforced",
        options.counted == "whole-pulse",
    )
    par = par.replace({"control.moment.omega_gap": options.omega_gap})
    given = answer(par, demand)  # first and alone, because it also builds the kernels
    slopes = np.linspace(options.tan_alpha_min, options.tan_alpha_max, options.slopes)
    leads = np.linspace(options.lead_min, options.lead_max, options.leads)
    data = _mapped(par, demand, slopes, leads, partial(progress, "designs"), options.efficiency)
    warnings = _warnings(data)
    if data["infeasible"].values.all():
        warnings += (_NONE_FEASIBLE,)
        return Findings(data, _given(given, options), _ASSUMPTIONS, {}, (), warnings)
    coarse = _smallest(data, options.power)
    grids, best = [data], coarse
    for n in range(1, _ROUNDS + 1):
        near = (_around(slopes, best.tan_alpha, n), _around(leads, best.lead, n))
        report = partial(progress, f"optimum, round {n}")
        grids.append(_mapped(par, demand, *near, report, options.efficiency))
        best = min(best, _smallest(grids[-1], options.power), key=lambda design: design.power)
    here = Mark("given drive train", par.screw.lead, wedge.slope(par.wedge))
    marks = (Mark("optimum", best.lead, best.tan_alpha), here)
    maps = {
        kind: Map(
            f"worst_{kind}",
            "lead",
            "tan_alpha",
            f"Largest {kind} power of the stop at the worst friction coefficient.",
            marks if kind == options.power else (here,),
            {"infeasible": ("infeasible", _BORDER)},
        )
        for kind in (options.power, _other(options.power))
    }
    kpis = (*_optimum(best, grids, options), *_given(given, options))
    limits = (*active(best.at, par, options), *around(grids, best.at, options))
    return Findings(
        data, kpis, _ASSUMPTIONS, maps, _cuts(data, best), warnings + _edges(best, options), limits
    )


def _smallest(data: xr.Dataset, power: str) -> _Best:
    """Return the feasible design of least power; at least one must exist."""
    worst = data[f"worst_{power}"].values
    i, j = np.unravel_index(int(np.nanargmin(worst)), worst.shape)
    at = data.isel(tan_alpha=int(i), lead=int(j))
    return _Best(float(at["tan_alpha"]), float(at["lead"]), float(worst[i, j]), at)


def _around(nodes: Array, middle: float, halvings: int) -> Array:
    """Return up to five finer nodes around a value, within the range."""
    step = (nodes[1] - nodes[0]) / 2**halvings
    near = middle + step * np.arange(-2.0, 3.0)
    inside = (near >= nodes[0] - _TINY * step) & (near <= nodes[-1] + _TINY * step)
    return np.asarray(near[inside])


def _other(power: str) -> str:
    return "instantaneous" if power == "filtered" else "filtered"


def _optimum(best: _Best, grids: Sequence[xr.Dataset], options: Options) -> tuple[Kpi, ...]:
    other = _smallest(grids[0], _other(options.power))
    slopes, leads = [best.tan_alpha], [best.lead]
    for data in grids:
        good = np.argwhere(data[f"worst_{options.power}"].values <= _NEAR * best.power)
        slopes += [float(value) for value in data["tan_alpha"].values[good[:, 0]]]
        leads += [float(value) for value in data["lead"].values[good[:, 1]]]
    share = f"of designs within {100 * (_NEAR - 1):.0f} % of the smallest power"
    return (
        Kpi("optimum_tan_alpha", best.tan_alpha, "1", "Wedge slope with the lowest power."),
        Kpi("optimum_lead", best.lead, "m", "Screw lead with the lowest power."),
        Kpi(
            "optimum_power",
            best.power,
            "W",
            f"Largest {options.power} power of the stop, worst friction coefficient.",
        ),
        Kpi(
            "optimum_mu_B",
            float(best.at[f"mu_B_{options.power}"]),
            "1",
            "Friction coefficient that needs this power.",
        ),
        Kpi(
            "optimum_release",
            float(best.at["release"].max()),
            "W",
            "Largest power during its release, filtered.",
        ),
        Kpi(
            "optimum_t_90",
            float(best.at["t_90"].max()),
            "s",
            "Time to 90 % of the demand, slowest friction coefficient.",
        ),
        Kpi(
            "optimum_closing_speed",
            float(best.at["closing_speed"]),
            "m/s",
            "Largest speed at which its reference closes the pads.",
        ),
        Kpi("optimum_current", float(best.at["current"].max()), "A", "Largest current demand."),
        Kpi("flat_tan_alpha_min", min(slopes), "1", f"Smallest slope {share}."),
        Kpi("flat_tan_alpha_max", max(slopes), "1", f"Largest slope {share}."),
        Kpi("flat_lead_min", min(leads), "m", f"Smallest lead {share}."),
        Kpi("flat_lead_max", max(leads), "m", f"Largest lead {share}."),
        Kpi(
            "other_tan_alpha",
            other.tan_alpha,
            "1",
            f"Slope on the map with the lowest {_other(options.power)} power.",
        ),
        Kpi(
            "other_lead",
            other.lead,
            "m",
            f"Lead on the map with the lowest {_other(options.power)} power.",
        ),
        Kpi(
            "other_power",
            other.power,
            "W",
            f"Largest {_other(options.power)} power there, worst friction coefficient.",
        ),
    )


def _given(given: Answer, options: Options) -> tuple[Kpi, ...]:
    sizes = getattr(given, options.power)
    k, t_90 = int(np.argmax(sizes)), float(given.t_90.max())
    note = "" if math.isfinite(t_90) else "a case does not reach 90 %"
    return (
        Kpi(
            "given_power",
            float(sizes[k]),
            "W",
            f"Largest {options.power} power of the given drive train, worst coefficient.",
        ),
        Kpi(
            "given_mu_B", float(options.mu_B[k]), "1", "Friction coefficient that needs this power."
        ),
        Kpi(
            "given_release",
            float(given.release.max()),
            "W",
            "Largest power during its release, filtered.",
        ),
        Kpi(
            "given_t_90",
            t_90,
            "s",
            "Its time to 90 % of the demand, slowest friction coefficient.",
            note,
        ),
        Kpi(
            "given_closing_speed",
            given.closing_speed,
            "m/s",
            "Largest speed at which its reference closes the pads.",
        ),
    )


def _cuts(data: xr.Dataset, best: _Best) -> tuple[Cut, ...]:
    """Return the dependence on the lead at the map's slope nearest to the optimum."""
    row = data.sel(tan_alpha=best.tan_alpha, method="nearest")
    worst = row[["release", "t_90", "current", "speed", "copper"]].max(dim="mu_B", keep_attrs=True)
    names = ("worst_filtered", "mu_B_filtered", "worst_instantaneous")
    shown = xr.merge([worst, row[list(names)]], compat="override")
    title = (
        f"tan(alpha) = {float(row['tan_alpha']):.3g}, worst friction coefficient; current, speed "
        "and copper loss of the whole pulse"
    )
    return (Cut(title, shown, ("lead", *names, *(str(name) for name in worst))),)


def _warnings(data: xr.Dataset) -> tuple[str, ...]:
    count = data.attrs["unsettled_substeps"]
    return (f"{count} substeps hit the cap of the contact iteration",) if count else ()


def _edges(best: _Best, options: Options) -> tuple[str, ...]:
    """Return a warning if the optimum is at the edge of the range of designs."""
    slopes = (options.tan_alpha_min, options.tan_alpha_max)
    leads = (options.lead_min, options.lead_max)
    return (
        *edge_warnings("tan_alpha", best.tan_alpha, slopes, "1"),
        *edge_warnings("lead", best.lead, leads, "m"),
    )


# --- Many drive trains as a dataset

_LATE = 1.02
"""share of the demanded time up to which a design counts as equally fast"""


_HELD = 0.95
"""share of the demand that counts as held"""


_LEFT = 0.05
"""share of the demand below which the brake counts as released"""


_NEVER = 10.0  # lateness of a moment that is never reached


_PER_CASE = {
    "t_90": ("s", "time to 90 % of the demand"),
    "filtered": ("W", "largest power, filtered"),
    "instantaneous": ("W", "largest power"),
    "release": ("W", "largest power of the release, filtered"),
    "current": ("A", "largest current demand"),
    "speed": ("rad/s", "largest motor speed"),
    "copper": ("J", "copper loss"),
    "friction": ("J", "friction of bearings and screws"),
    "held": ("N*m", "mean moment at the end of the stop"),
    "left": ("N*m", "residual moment at the end"),
    "stop": ("N", "force on the end stops"),
}


def _mapped(
    par: WedgeParameters,
    demand: Demand,
    slopes: Array,
    leads: Array,
    progress: Callable[[float], None],
    efficiency: Efficiency,
) -> xr.Dataset:
    """Return the responses of all designs on a grid, computed on all cores; interruptible.

    ``slopes``, ``leads``: slopes of the wedge, shape (n,), and leads of the screws [m], shape (m,);
    ``progress``: called with the finished share, 0 to 1; ``efficiency``: see `redesigned`.

    Returns
    -------
    xarray.Dataset
        Dimensions ``tan_alpha``, ``lead`` and ``mu_B``. Per case the fields of `Answer`; per
        design ``closing_speed``, ``lateness`` (slowest time over the demanded one), ``infeasible``
        (0 or 1), and ``worst_filtered`` and ``worst_instantaneous``, NaN where infeasible, with
        ``mu_B_filtered`` and ``mu_B_instantaneous``, the coefficients at which they occur.
    """
    designs = [(float(a), float(b)) for a in slopes for b in leads]
    answers: list[Answer] = []
    with thread_pool() as pool:
        every = pool.map(
            lambda design: answer(redesigned(par, design[0], design[1], efficiency), demand),
            designs,
        )
        for k, judged in enumerate(every):
            answers.append(judged)
            progress((k + 1) / len(designs))
    axes = {
        "tan_alpha": (slopes, "1", "slope of the wedge"),
        "lead": (leads, "m", "lead of the screws"),
        "mu_B": (np.asarray(demand.mu_B), "1", "friction coefficient of the pads"),
    }
    return _dataset(answers, demand, axes)


def _dataset(answers: Sequence[Answer], demand: Demand, axes: Mapping[str, Labeled]) -> xr.Dataset:
    plane, shape = ("tan_alpha", "lead"), [len(each[0]) for each in axes.values()]
    cases = {
        name: np.array([getattr(each, name) for each in answers]).reshape(shape)
        for name in _PER_CASE
    }
    data = labeled(axes, {name: (cases[name], *_PER_CASE[name]) for name in _PER_CASE})
    slowest = cases["t_90"].max(axis=2)  # NaN where one case does not reach it
    lateness = np.where(np.isnan(slowest), _NEVER, slowest / demand.t_90)
    in_time = (lateness <= _LATE) if demand.enforced else (lateness < _NEVER)
    holds = cases["held"].min(axis=2) >= _HELD * demand.moment
    released = cases["left"].max(axis=2) <= _LEFT * demand.moment
    feasible = in_time & holds & released & (cases["stop"].max(axis=2) == 0.0)
    speeds = np.array([each.closing_speed for each in answers]).reshape(shape[:2])
    data["closing_speed"] = variable(speeds, plane, "m/s", "closing speed of the pads")
    data["lateness"] = variable(lateness, plane, "1", "slowest time over the demanded time")
    data["infeasible"] = variable(1.0 - feasible, plane, "1", "late, not held, or at a stop")
    for name in ("filtered", "instantaneous"):
        worst = np.where(feasible, cases[name].max(axis=2), np.nan)
        mu_B = np.asarray(demand.mu_B)[cases[name].argmax(axis=2)]
        label = f"largest {name} power, worst mu_B"
        data[f"worst_{name}"] = variable(worst, plane, "W", label)
        data[f"mu_B_{name}"] = variable(mu_B, plane, "1", "worst friction coefficient")
    data.attrs["unsettled_substeps"] = sum(each.unsettled for each in answers)
    return data


# --- Limits of a drive train: active constraints, and failures or costs of its neighbors

_AT = 0.99  # share of a limit at which it counts as reached


def active(at: xr.Dataset, par: WedgeParameters, options: Options) -> list[str]:
    """Return the active constraints of a design.

    Parameters
    ----------
    at
        The design: variables over ``mu_B`` and scalars.
    par
        The given brake.
    options
        Options of the study.
    """
    texts = []
    if options.response == "enforced" and float(at["lateness"]) >= _AT:
        texts.append(
            f"time: {float(at['t_90'].max()) * 1e3:.4g} ms of the {options.t_90 * 1e3:.4g} ms "
            f"demanded, slowest at mu_B = {_where(at['t_90']):g}"
        )
    limits = {"control.position.i_max": par.control.position.i_max, "drive.i_max": par.drive.i_max}
    name, i_max = min(limits.items(), key=lambda limit: limit[1])
    if float(at["current"].max()) >= _AT * i_max:
        reached = at["mu_B"].values[at["current"].values >= _AT * i_max]
        texts.append(f"current: at the limit {name} = {i_max:g} A with mu_B = {_listed(reached)}")
    held = at["held"].min() / options.moment
    if float(held) < _HELD / _AT:
        texts.append(
            f"hold: {100.0 * float(held):.3g} % of the demand is held, least at "
            f"mu_B = {_where(-at['held']):g}"
        )
    if float(at["left"].max()) > _AT * _LEFT * options.moment:
        texts.append(f"release: {float(at['left'].max()):.3g} N·m remain at the end")
    powers = at[options.power]
    near = at["mu_B"].values[powers.values >= _AT * float(powers.max())]
    texts.append(f"power: {float(powers.max()):.3g} W at mu_B = {_listed(near)}")
    return texts


def failures(at: xr.Dataset, options: Options) -> list[str]:
    """Return the reasons why a design is infeasible; empty if it is feasible."""
    reasons = []
    slowest = float(at["t_90"].max(skipna=False))
    if math.isnan(slowest):
        reasons.append("never reaches 90 % of the demand")
    elif options.response == "enforced" and float(at["lateness"]) > _LATE:
        reasons.append(f"late, {slowest * 1e3:.4g} ms at mu_B = {_where(at['t_90']):g}")
    if float(at["held"].min()) < _HELD * options.moment:
        reasons.append("does not hold the demand")
    if float(at["left"].max()) > _LEFT * options.moment:
        reasons.append("does not release")
    if float(at["stop"].max()) > 0.0:
        reasons.append("presses on an end stop")
    return reasons


def around(grids: Sequence[xr.Dataset], best: xr.Dataset, options: Options) -> list[str]:
    """Return the neighbors of the best design, on the finest grid that contains it.

    ``grids``: maps of designs, coarse to fine; ``best``: design of the last grid with it.
    """
    tan_alpha, lead = float(best["tan_alpha"]), float(best["lead"])
    power, texts = float(best[f"worst_{options.power}"]), []
    grid = [g for g in grids if tan_alpha in g["tan_alpha"].values and lead in g["lead"].values][-1]
    i, j = (
        int(np.flatnonzero(grid[name].values == value)[0])
        for name, value in (("tan_alpha", tan_alpha), ("lead", lead))
    )
    steps = {
        "flatter wedge": (-1, 0),
        "steeper wedge": (1, 0),
        "shorter lead": (0, -1),
        "longer lead": (0, 1),
    }
    for label, (di, dj) in steps.items():
        k, m = i + di, j + dj
        if not (0 <= k < grid.sizes["tan_alpha"] and 0 <= m < grid.sizes["lead"]):
            continue
        neighbor = grid.isel(tan_alpha=k, lead=m)
        value = (
            f"tan(alpha) = {float(neighbor['tan_alpha']):.4g}"
            if di
            else f"lead = {1e3 * float(neighbor['lead']):.4g} mm"
        )
        reasons = failures(neighbor, options)
        more = 100.0 * (float(neighbor[options.power].max()) / power - 1.0)
        outcome = f"{more:+.2g} % power, at mu_B = {_where(neighbor[options.power]):g}"
        if reasons:
            outcome = f"infeasible: {'; '.join(reasons)}"
        texts.append(f"{label}, {value}: {outcome}")
    return texts


def _where(values: xr.DataArray) -> float:
    return float(values["mu_B"].values[np.argmax(values.values)])


def _listed(values: Array) -> str:
    return ", ".join(f"{float(value):g}" for value in values)


STUDY = Study(
    name="drive-train",
    assembly="wedge-brake",
    summary="peak power of a large stop over wedge slope and screw lead, at equal response",
    options=Options,
    defaults=DEFAULTS,
    compute=compute,
    ruled={
        "wedge.mu_B": "the study uses several; set its option mu_B, for example mu_B=0.3,0.5",
        "control.moment.omega_gap": "set the study's option omega_gap",
        "command.mode": "the study demands moments",
        "rig": "only the rigs use it",
    },
)
