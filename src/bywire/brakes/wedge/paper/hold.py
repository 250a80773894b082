"""Holding: without power, on a standing disc, and with motors that work together."""

from __future__ import annotations

import xarray as xr

from bywire.brakes.wedge.case import parameters_of, with_friction
from bywire.brakes.wedge.paper.statements import (
    FACTS,
    MAIN,
    WITHOUT_RUNOUT,
    parameters,
    settled,
    stacked,
    standby,
    tan_alpha,
)
from bywire.reproduction.item import Fact, Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part, Runs, kpis

_AWAY = 0.2
"""friction coefficient far from the neutral point"""
_LOADED = {"M_high": 500.0, "t_hold": 2.0}


def part(runs: Runs) -> Part:
    """Return the causes that hold the brake, and its power."""
    off = runs.bench("power-off-hold", MAIN)
    items = [*_power_off(runs), *_standing(runs), *_together(runs)]
    text = (
        "Without power the brake near its neutral point keeps its moment: dry friction of "
        "bearings, screws and wedge holds the small actuation force, and nothing creeps. Far "
        "below the neutral point the wedge pushes the motors back until friction holds it."
    )
    run = off.recordings["run"]
    exhibit = Exhibit(
        "power-off-hold",
        lambda: stacked(run),
        "Power off at 500 Nm: only the runout's ripple remains.",
    )
    return Part("Holding", text, tuple(items), (exhibit,), {"power-off-hold": run})


def _power_off(runs: Runs) -> list[Item]:
    neutral = {**with_friction(parameters(), tan_alpha(), known=True), **WITHOUT_RUNOUT}
    kept = kpis(runs.bench("power-off-hold", MAIN, neutral))
    usual = kpis(runs.bench("power-off-hold", MAIN))
    low = {**with_friction(parameters(), _AWAY, known=True), **WITHOUT_RUNOUT}
    far = kpis(runs.bench("power-off-hold", MAIN, low))
    still = Fact(
        0.0, "m", "physical bound: a body that dry friction holds does not creep", "physical bound"
    )
    return [
        compared(
            "hold.neutral",
            FACTS["remains"],
            _share(kept),
            note="moment 2 s after power off in % of that before; runout off, friction on",
        ),
        compared(
            "hold.drift",
            still,
            usual["drift"],
            "<=",
            "change of the wedge's travel in 2 s after all stuck; runout on",
        ),
        found(
            "hold.relaxation",
            "m",
            usual["relaxation"],
            "change of the wedge's travel from power off until all stick",
        ),
        found("hold.preload", "N", usual["preload_end"], "remaining preload"),
        found(
            "hold.far",
            "%",
            _share(far),
            f"as hold.neutral at mu_B = {_AWAY:g}: back-driven until friction holds",
        ),
    ]


def _share(values: dict[str, float]) -> float:
    return 100.0 * values["moment_end"] / values["moment_start"]


def _standing(runs: Runs) -> list[Item]:
    """Return the force balance of the wedge on a standing disc, for both readings."""
    result = runs.bench("disc-stop", MAIN)
    values = kpis(result)
    shares = {name: _self_reinforcement(run) for name, run in result.recordings.items()}
    return [
        compared(
            "hold.standing",
            FACTS["only_turning"],
            shares["drop"],
            note="(tan(alpha) F_N - F_M)/(tan(alpha) F_N) on a standing disc, pad term dropped as "
            "in the paper",
        ),
        found(
            "hold.standing.stick",
            "1",
            shares["stick"],
            "the same where the standing pad sticks to the disc, our other reading",
        ),
        found(
            "hold.force_held",
            "N",
            values["force_held_drop"],
            "normal force on the standing "
            f"disc; {values['force_before_stop_drop']:.4g} N before the stop",
        ),
    ]


def _self_reinforcement(run: xr.Dataset) -> float:
    """Return the share of the wedge's reaction that the motors do not supply, disc at rest."""
    still = parameters_of(run).flywheel.Omega_still
    standing = run.where((abs(run["Omega"]) <= still) & (run["M_set"] > 0.0), drop=True)
    last = standing.isel(time=-1)
    reaction = tan_alpha() * float(last["F_N"])
    return (reaction - float(last["F_M"])) / reaction


def _together(runs: Runs) -> list[Item]:
    away = with_friction(parameters(), _AWAY, known=True)
    above = {}
    for law in ("preload", "scheduled"):
        overrides = {**away, "control.offset.law": law}
        run = runs.bench("moment-pulses", MAIN, overrides, _LOADED).recordings["run"]
        above[law] = settled(run, "P_in", _LOADED["t_hold"]) - standby()
    return [
        compared(
            "hold.together",
            FACTS["together"],
            above["scheduled"] / above["preload"],
            note=f"500 Nm at mu_B = {_AWAY:g}: {above['scheduled']:.3g} W together, "
            f"{above['preload']:.3g} W preloaded",
        ),
    ]
