"""Line, Manzie and Good (2008): statements on the cascade in title, abstract and index terms."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from bywire.authoring import (
    Exhibit,
    Progress,
    Reproduction,
    Runs,
    Source,
    SourcePart,
    compared,
    found,
    kpis,
    parameters,
    style,
)
from bywire.plant import floating_caliper
from emb_caliper.experiments.power_off import held_force
from emb_caliper.paper import facts
from emb_caliper.sets.emb42v import SOURCE as CITATION

MAIN, MODIFIED = "emb42v", "emb42v-modified"
STEPS = (5e3, 15e3, 25e3)


def _rise(runs: Runs, name: str, low: float) -> float:
    options = {"F_from": low, "F_to": low + 500.0}
    return kpis(runs.bench("clamp-step", name, options=options))["rise_time"]


def _envelope(runs: Runs) -> SourcePart:
    """Return how small steps vary with clamp force, without and with gain scheduling."""
    ratio = {name: _rise(runs, name, 1e3) / _rise(runs, name, 19e3) for name in (MAIN, MODIFIED)}
    uneven = {name: abs(float(np.log(value))) for name, value in ratio.items()}
    items = (
        compared(
            "envelope.rise_ratio",
            facts.UNEVEN,
            ratio[MAIN],
            ">=",
            "ratio of the rise times of 0.5 kN steps from 1 kN and from 19 kN",
        ),
        compared(
            "envelope.scheduled",
            facts.IMPROVED,
            uneven[MODIFIED] / uneven[MAIN],
            "<=",
            "ratio of the logarithms of that ratio, with and without scheduling",
        ),
    )
    return SourcePart(
        "Small steps at different clamp forces",
        "The stiffness increases ninefold while the gains are fixed. Gains that follow the "
        "stiffness make small steps more similar.",
        items,
    )


def _large(runs: Runs) -> SourcePart:
    """Return large steps, their saturation, and a figure."""
    results = [runs.bench("clamp-step", MAIN, options={"F_to": F}) for F in STEPS]
    limit = parameters(MAIN).leaves()["ecu.speed.i_max"]
    least = min(kpis(result)["peak_current"] for result in results)
    items = [
        compared(
            "steps.saturated",
            facts.SATURATES,
            100.0 * least / limit,
            ">=",
            "minimum peak current of three steps, relative to the demand limit",
        )
    ]
    for F, result in zip(STEPS, results, strict=True):
        label = f"steps.{F / 1e3:g}kN"
        items.append(
            found(
                f"{label}.rise_time",
                "s",
                kpis(result)["rise_time"],
                "10 to 90 %, from the parked piston",
            )
        )
    recordings = {
        f"step-{F / 1e3:g}kN": r.recordings["run"] for F, r in zip(STEPS, results, strict=True)
    }
    exhibit = Exhibit("steps", _drawn(recordings), "Steps of the force demand, standard cascade.")
    text = "The steps in the paper were not available, so we chose 5, 15 and 25 kN."
    return SourcePart("Large steps", text, tuple(items), (exhibit,), recordings)


def _drawn(recordings: dict[str, xr.Dataset]) -> Any:
    figure, (upper, lower) = style.new_figure(4.6, (1.4, 1.0))
    for color, run in zip(
        (style.BLUE, style.VERMILLION, style.GREEN), recordings.values(), strict=True
    ):
        upper.plot(run["time"], 1e-3 * run["F_cl"], color=color)
        upper.plot(
            run["time"], 1e-3 * run["F_ref"], color=style.GRAY, linestyle="--", linewidth=0.8
        )
        lower.plot(run["time"], run["i"], color=color)
    upper.set_ylabel(style.axis_label("clamp force", "kN"))
    lower.set_ylabel(style.axis_label("current", "A"))
    lower.set_xlabel(style.axis_label("time", "s"))
    return figure


def _mechanism(runs: Runs) -> SourcePart:
    """Return friction versus load, stiffness curve, and the force held without current."""
    strokes = runs.bench("slow-strokes", MAIN)
    run, par = strokes.recordings["run"], parameters(MAIN)
    half = [_width(run, F) for F in (5e3, 25e3)]
    items = (
        compared(
            "friction.grows",
            facts.STICKS,
            half[1] / half[0],
            ">=",
            "ratio of the branches' current differences at 25 kN and at 5 kN",
        ),
        found("friction.width", "A", kpis(strokes)["loop_width"], "at 15 kN and 20 rad/s"),
        found(
            "friction.held",
            "kN",
            1e-3 * held_force(par),  # type: ignore[arg-type]
            "maximum clamp force that friction holds without current, in closed form",
        ),
    )
    figure, axes = style.new_figure(3.4)
    n = np.linspace(0.0, par.caliper.n_max, 200)  # type: ignore[attr-defined]
    F = floating_caliper.elastic(n, par.caliper)  # type: ignore[attr-defined, arg-type]
    axes[0].plot(1e3 * n, 1e-3 * np.asarray(F), color=style.BLUE)
    axes[0].set_xlabel(style.axis_label("overlap of pads and disc", "mm"))
    axes[0].set_ylabel(style.axis_label("clamp force", "kN"))
    exhibit = Exhibit("stiffness", figure, "Clamp force versus overlap. The caliper stiffens.")
    return SourcePart(
        "Friction and stiffness", "Strokes at three constant speeds.", items, (exhibit,)
    )


def _width(run: xr.Dataset, level: float) -> float:
    """Return the current difference between the slowest stroke's branches at a clamp force."""
    F, i, omega = (run[name].values for name in ("F_cl", "i", "omega"))
    slow = np.abs(omega) < 30.0
    means = [
        float(np.mean(i[slow & (np.sign(omega) == way) & (np.abs(F - level) < 500.0)]))
        for way in (1.0, -1.0)
    ]
    return means[0] - means[1]


def reproduce(progress: Progress | None = None) -> Reproduction:
    """Compare statements in the abstract with the model."""
    runs = Runs(progress)
    parts = []
    for label, part in (
        ("small steps", _envelope),
        ("large steps", _large),
        ("mechanism", _mechanism),
    ):
        runs.report(label, 0.0)
        parts.append(part(runs))
        runs.report(label, 1.0)
    return Reproduction("line2008", CITATION, tuple(parts), sets={"": "Our parameter set"})


SOURCE = Source(
    name="line2008",
    summary="electro-mechanical caliper under cascaded PI control, claims in the abstract",
    reproduce=reproduce,
)
