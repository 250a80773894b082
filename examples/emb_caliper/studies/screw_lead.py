"""Screw lead: its effect on apply time and holding current."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import xarray as xr
from pydantic import Field, model_validator

from bywire.authoring import (
    Cut,
    Findings,
    Kpi,
    Length,
    Map,
    Mark,
    ParameterError,
    ParameterSet,
    Progress,
    Study,
    Unit,
    as_run,
    require_ranges,
    simulate,
    step_response,
    variable,
)
from emb_caliper.experiments import clamp_step
from emb_caliper.experiments.slow_strokes import TopForce
from emb_caliper.parameters import CaliperBrakeParameters
from emb_caliper.trim import holding_current

Count = Annotated[int, Unit("1", 9.0), Field(ge=2, le=101)]


class Options(ParameterSet):
    """The designs to compare."""

    lead_min: Length
    """minimum lead"""
    lead_max: Length
    """maximum lead"""
    leads: Count
    """number of leads"""
    clearance_min: Length
    """minimum running clearance"""
    clearance_max: Length
    """maximum running clearance"""
    clearances: Count
    """number of clearances"""
    F_to: TopForce
    """clamp force of the step"""

    @model_validator(mode="after")
    def _ordered(self) -> Options:
        ranges = ("lead_min", "lead_max", "m"), ("clearance_min", "clearance_max", "m")
        require_ranges(self, ranges)
        return self


ASSUMPTIONS = (
    "The force demand steps from the parked piston. The brake has friction, and its controllers "
    "are unchanged, so the speed limit is the same for all leads.",
    "A design is infeasible if the brake cannot apply slowly against friction within the current "
    "limit.",
    "Friction per clamp force is constant at the motor shaft. Only the load torque depends on the "
    "lead.",
)


def compute(par: CaliperBrakeParameters, options: Options, progress: Progress) -> Findings:
    """Return apply time, energy and holding current versus lead and clearance."""
    leads = np.linspace(options.lead_min, options.lead_max, options.leads)
    gaps = np.linspace(options.clearance_min, options.clearance_max, options.clearances)
    chosen = clamp_step.EXPERIMENT.defaults.replace({"F_to": options.F_to})
    rows = []
    for k, lead in enumerate(map(float, leads)):
        rows.append(
            [
                _applied(par.replace({"screw.lead": lead, "caliper.clearance": float(gap)}), chosen)
                for gap in gaps
            ]
        )
        progress("leads", (k + 1) / leads.size)
    values = np.array(rows)
    dims = ("lead", "clearance")
    held = [holding_current(options.F_to, par.replace({"screw.lead": float(v)})) for v in leads]
    rubs = (par.friction.C + par.friction.G * options.F_to) / par.motor.K_e
    pressing = np.repeat(np.array(held)[:, None] + rubs, gaps.size, axis=1)
    data = xr.Dataset(
        {
            "t_apply": variable(values[:, :, 0], dims, "s", "time to 90 % of the clamp force"),
            "energy": variable(values[:, :, 1], dims, "J", "electrical energy until then"),
            "i_press": variable(pressing, dims, "A", "current for slow application"),
            "i_hold": variable(np.array(held), ("lead",), "A", "holding current without friction"),
        },
        {
            "lead": variable(leads, ("lead",), "m", "screw lead"),
            "clearance": variable(gaps, ("clearance",), "m", "running clearance"),
        },
    )
    nearest = data.sel(clearance=par.caliper.clearance, method="nearest")
    able = nearest["i_press"].values <= par.ecu.speed.i_max
    times = np.where(able, nearest["t_apply"].values, np.nan)
    if not np.isfinite(times).any():
        raise ParameterError(
            f"no lead reaches {options.F_to / 1e3:g} kN within ecu.speed.i_max = "
            f"{par.ecu.speed.i_max:g} A. Reduce F_to or lead_min"
        )
    best = int(np.nanargmin(times))
    given = Mark("given brake", par.screw.lead, par.caliper.clearance)
    fastest = Mark("fastest", float(leads[best]), float(nearest["clearance"]))
    kpis = (
        Kpi(
            "lead_fastest",
            float(leads[best]),
            "m",
            "Lead with the shortest apply time at the given clearance.",
        ),
        Kpi("t_apply_fastest", float(nearest["t_apply"][best]), "s", "Apply time with this lead."),
        Kpi(
            "i_hold_fastest",
            float(held[best]),
            "A",
            "Current that holds the clamp force with this lead.",
        ),
        Kpi(
            "i_hold_given",
            holding_current(options.F_to, par),
            "A",
            "Current that holds the clamp force with the given lead.",
        ),
    )
    applied = Map(
        "t_apply",
        "lead",
        "clearance",
        "Time from the demand to 90 % of the clamp force, versus lead and running clearance.",
        (fastest, given),
        {"beyond the current limit": ("i_press", par.ecu.speed.i_max)},
    )
    names = ("t_apply", "energy", "i_press", "i_hold")
    cut = Cut("at the clearance nearest to the given one", nearest[list(names)], ("lead", *names))
    return Findings(data, kpis, ASSUMPTIONS, {"apply-time": applied}, (cut,))


def _applied(par: CaliperBrakeParameters, options: ParameterSet) -> tuple[float, float]:
    """Return the time to 90 % of the clamp force [s], and the energy until then [J]."""
    (case,) = clamp_step.cases(par, options)  # type: ignore[arg-type]
    computed = simulate(as_run(case, 20e-6), ("F_cl", "E_source"))
    wanted: step_response.Setting = clamp_step.step(options)  # type: ignore[arg-type]
    reached = np.flatnonzero(computed["F_cl"] >= 0.9 * (wanted.end or 0.0))
    if not reached.size:
        return float("nan"), float("nan")
    k = int(reached[0])
    start = int(np.searchsorted(computed.time, case.settle - 1e-9))
    return float(computed.time[k] - case.settle), float(
        computed["E_source"][k] - computed["E_source"][start]
    )


STUDY = Study(
    name="screw-lead",
    assembly="emb-caliper",
    summary="apply time, energy and holding current versus screw lead and clearance",
    options=Options,
    defaults=Options(
        lead_min=4e-3,
        lead_max=22e-3,
        leads=10,
        clearance_min=1e-4,
        clearance_max=6e-4,
        clearances=6,
        F_to=25e3,
    ),
    compute=compute,
    ruled={
        "screw.lead": "set the study's options lead_min and lead_max",
        "caliper.clearance": "set the study's options clearance_min and clearance_max",
    },
)
