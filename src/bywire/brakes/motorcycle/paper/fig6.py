"""Fig. 6: current step of 0.35 A at medium pressure; three models compared."""

from __future__ import annotations

import numpy as np
import xarray as xr

from bywire.bench.kpis import step_response
from bywire.bench.kpis.families import evaluate
from bywire.bench.running import Result
from bywire.brakes.motorcycle.linear import Rational, theoretical
from bywire.brakes.motorcycle.methods.region_fit import averaged
from bywire.brakes.motorcycle.paper.facts import FACTS, table4_model
from bywire.brakes.motorcycle.paper.runs import BAR, MAIN, SETS, Runs, before, parameters
from bywire.brakes.motorcycle.paper.table4 import identified_model, step_peak
from bywire.core.typing import Array
from bywire.report.panels import Panel, Role, Trace
from bywire.report.time_traces import time_traces
from bywire.reproduction.item import Fact, Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part, kpis, selected

HEIGHT = FACTS["fig6_step"].value
START = FACTS["fig6_start"].value * BAR


def part(runs: Runs) -> Part:
    """Return the step on the nonlinear, the theoretical and the identified model."""
    model = table4_model("medium")
    final = Fact(HEIGHT * model.gain / BAR, "bar", "eq. (22) with the numbers of Table 4, medium")
    _, high = step_peak(model, HEIGHT)
    items = [
        compared(
            "fig6.peak",
            FACTS["fig6_top"],
            (START + high) / BAR,
            note="highest pressure of Table 4's medium model from 25 bar; paper against paper, not "
            "judged",
        ),
        compared(
            "fig6.change.theoretical",
            final,
            HEIGHT * theoretical(parameters(MAIN)).gain_bar,
            None,
            "final change of pressure by eq. (15)",
            tuned="calibrated",
        ),
        compared(
            "fig6.change.theoretical@table1",
            final,
            HEIGHT * theoretical(parameters("dardanelli2010-table1")).gain_bar,
            None,
            "final change of pressure by eq. (15), Table 1; judged as table2.K@table1",
        ),
    ]
    rise = Fact(_rise_time(model), "s", "eq. (22) with the numbers of Table 4, medium")
    for name, suffix in SETS.items():
        items += _nonlinear(runs, name, suffix, final, rise)
    step = runs.settled_step(MAIN, START, HEIGHT)
    items.append(_misfit(step.recordings["run"], before(step)))
    text = (
        "The nonlinear brake, with dither on, starts settled at 25 bar. Its pressure rises "
        "less and more slowly than that of Table 4's model. Eq. (15), which has no friction, has "
        "Table 4's gain. At the current that holds 25 bar without friction, the dithered brake "
        "settles several bar lower."
    )
    exhibits = tuple(
        _exhibit(runs.settled_step(name, START, HEIGHT), name, f"fig6{suffix.replace('@', '-')}")
        for name, suffix in SETS.items()
    )
    kept = selected(
        step.recordings["run"], "i", "i_star", "i_dit", "p_mc", "p_pd", "omega", "x_mc", "stuck"
    )
    return Part("Figure 6: current step", text, tuple(items), exhibits, {"fig6": kept})


def _nonlinear(runs: Runs, name: str, suffix: str, final: Fact, rise: Fact) -> list[Item]:
    """Return the nonlinear brake's step, and its loss of pressure from dither."""
    values = kpis(runs.settled_step(name, START, HEIGHT))
    frictionless = {"p_start": START, "start": "frictionless"}
    bias = before(runs.bench("pressure-step", name, options=frictionless)) / BAR
    return [
        compared(
            f"fig6.change{suffix}",
            final,
            values["static_gain"] * HEIGHT / BAR,
            None,
            "final change of pressure, nonlinear brake with dither; judged as "
            f"table4.medium.K{suffix}",
        ),
        compared(
            f"fig6.rise_time{suffix}",
            rise,
            values["rise_time"],
            None,
            "10 to 90 % of the change, nonlinear brake with dither; judged as "
            f"table4.medium.corner{suffix}",
        ),
        found(
            f"fig6.bias{suffix}",
            "bar",
            bias,
            "pressure under dither at the current that holds 25 bar without friction",
        ),
    ]


def _rise_time(model: Rational) -> float:
    """Return the rise time (10 to 90 %) of a step on a linear model [s]."""
    t = np.arange(0.0, 20.0, 1e-3)
    response = xr.Dataset({"p": ("time", model.step(t))}, {"time": t})
    setting = step_response.Setting("p", 0.0, 0.0, model.gain)
    return evaluate("step_response", response, setting)["rise_time"].value


def _own(name: str, start: float, t: Array) -> list[tuple[str, Array, str]]:
    """Return the step of the model identified on our brake, which has the main set."""
    if name != MAIN:
        return []
    step = start + HEIGHT * identified_model("medium").step(t)
    return [("identified", step, "identified, our brake")]


def _misfit(run: xr.Dataset, start: float) -> Item:
    """Return the identified model's error for a step that the fit did not use."""
    t = run["time"].values
    error = run["p_mc"].values - (start + HEIGHT * identified_model("medium").step(t))
    means = averaged(
        error[t >= 0.0],
        round(
            1.0
            / (run["time"].values[1] - run["time"].values[0])
            / parameters(MAIN).ecu.dither.f_dit
        ),
    )
    return found(
        "fig6.misfit.identified",
        "bar",
        float(np.sqrt(np.mean(means**2))) / BAR,
        "rms over 4 s, dither averaged: nonlinear brake minus the model identified on it",
    )


def _exhibit(step: Result, name: str, label: str) -> Exhibit:
    """Return Fig. 6 for one parameter set."""
    run = step.recordings["run"]
    t = run["time"].values
    theory = theoretical(parameters(name))
    start = before(step)
    shown = xr.Dataset(
        {
            key: ("time", values, {"units": "Pa", "long_name": long_name})
            for key, values, long_name in (
                ("nonlinear", run["p_mc"].values, "nonlinear brake with dither"),
                ("theory", start + HEIGHT * theory.step(t), "eq. (15)"),
                *_own(name, start, t),
                (
                    "table4",
                    start + HEIGHT * table4_model("medium").step(t),
                    "Table 4, medium pressure",
                ),
            )
        },
        coords={"time": t},
    )
    traces = [Trace("nonlinear"), Trace("theory", Role.SIMULATED), Trace("table4", Role.SECOND)]
    if "identified" in shown:
        traces.append(Trace("identified", Role.SET_POINT))
    panel = Panel(
        "pressure",
        tuple(traces),
        height=2.4,
    )
    return Exhibit(
        label,
        lambda: time_traces(shown, panels=(panel,)),
        f"Fig. 6: step of the current demand by 0.35 A from 25 bar, parameter set {name}.",
    )
