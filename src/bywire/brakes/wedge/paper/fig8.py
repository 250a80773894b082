"""Fig. 8: the same step, a reduction to 160 N m, and a slow ramp back."""

from __future__ import annotations

from bywire.bench.result import Result
from bywire.brakes.wedge.paper.facts import ALLOWANCES, FACTS
from bywire.brakes.wedge.paper.runs import MAIN, WITHOUT_RUNOUT, settled, stacked
from bywire.reproduction.item import Item, compared, found, reading
from bywire.reproduction.reproduction import Exhibit, Part, Runs, kpis


def part(runs: Runs) -> Part:
    """Return the reduction and the ramp."""
    result = runs.bench("moment-ramp", MAIN)
    plain = kpis(runs.bench("moment-ramp", MAIN, WITHOUT_RUNOUT))
    items = [
        *_items(result),
        found(
            "fig8.ramp_error_rms.without_runout",
            "N*m",
            plain["ramp_error_rms"],
            "the same without run-out: how well the controller itself follows",
        ),
    ]
    text = (
        "Length and slope of the ramp are ours; 'slow' was read as 1 s. Means over a revolution of "
        "the disc are judged, because the run-out's oscillation passes through any of them."
    )
    exhibit = Exhibit(
        "fig8",
        lambda: stacked(result.recordings["run"]),
        "Fig. 8: 200 Nm step in moment, with ramp: demand and simulation.",
    )
    return Part(
        "Figure 8: step and ramp",
        text,
        tuple(items),
        (exhibit,),
        {"fig8": result.recordings["run"]},
    )


def _items(result: Result) -> list[Item]:
    run, values = result.recordings["run"], kpis(result)
    o = result.bench.chosen_options.flat()
    lowered = o["t_hold"] + o["t_low"]
    end = lowered + o["t_ramp"] + o["t_end"]
    slope = reading(
        (o["M_high"] - o["M_low"]) / o["t_ramp"],
        "N*m/s",
        f"{FACTS['ramped'].where}; read as: within {o['t_ramp']:g} s",
    )
    return [
        compared(
            "fig8.low_moment",
            FACTS["lowered"],
            settled(run, "M_B", lowered),
            note="mean over the last revolution at 160 Nm",
        ),
        compared(
            "fig8.final_moment",
            FACTS["ramped"],
            settled(run, "M_B", end),
            note="mean over the last revolution",
        ),
        compared(
            "fig8.ramp_slope",
            slope,
            values["ramp_slope"],
            ALLOWANCES["followed"],
            "of a line through the moment on the ramp",
        ),
        compared(
            "fig8.ramp_error",
            FACTS["followed"],
            values["ramp_error_mean"],
            note="mean of demand less moment on the ramp",
        ),
        found(
            "fig8.ramp_error_rms",
            "N*m",
            values["ramp_error_rms"],
            "root mean square on the ramp; mostly run-out",
        ),
    ]
