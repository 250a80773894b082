"""Holding without power, on a stopped disc, and with motors that work together."""

from __future__ import annotations

from typing import TYPE_CHECKING

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

if TYPE_CHECKING:
    import xarray as xr

_AWAY = 0.2
"""friction coefficient far from the neutral point"""
_LOADED = {"M_high": 500.0, "t_hold": 2.0}


def part(runs: Runs) -> Part:
    """Return what holds the brake, and the power that it needs."""
    off = runs.bench("power-off-hold", MAIN)
    items = [*_power_off(runs), *_standing(runs), *_together(runs)]
    text = (
        "Near its neutral point the brake keeps its moment without power. Dry friction in "
        "bearings, screws and wedge holds the small actuation force, and nothing creeps. Far "
        "below the neutral point the wedge pushes the motors back until friction holds the wedge."
    )
    run = off.recordings["run"]
    exhibit = Exhibit(
        "power-off-hold",
        lambda: stacked(run),
        "Power off at 500 N·m. Only the ripple due to runout remains.",
    )
    return Part("Holding", text, tuple(items), (exhibit,), {"power-off-hold": run})


def _power_off(runs: Runs) -> list[Item]:
    neutral = {**with_friction(parameters(), tan_alpha(), known=True), **WITHOUT_RUNOUT}
    kept = kpis(runs.bench("power-off-hold", MAIN, neutral))
    usual = kpis(runs.bench("power-off-hold", MAIN))
    low = {**with_friction(parameters(), _AWAY, known=True), **WITHOUT_RUNOUT}
    far = kpis(runs.bench("power-off-hold", MAIN, low))
    still = Fact(
        0.0, "m", "physical bound: a body held by dry friction does not creep", "physical bound"
    )
    return [
        compared(
            "hold.neutral",
            FACTS["remains"],
            _share(kept),
            note="moment 2 s after power-off, in % of the moment before power-off, without "
            "runout and with friction",
        ),
        compared(
            "hold.drift",
            still,
            usual["drift"],
            "<=",
            "change in wedge travel in the 2 s after all bodies stick, with runout",
        ),
        found(
            "hold.relaxation",
            "m",
            usual["relaxation"],
            "change in wedge travel from power-off until all bodies stick",
        ),
        found("hold.preload", "N", usual["preload_end"], "remaining preload"),
        found(
            "hold.far",
            "%",
            _share(far),
            f"like hold.neutral at mu_B = {_AWAY:g}. The motors are back-driven until friction "
            "holds them",
        ),
    ]


def _share(values: dict[str, float]) -> float:
    return 100.0 * values["moment_end"] / values["moment_start"]


def _standing(runs: Runs) -> list[Item]:
    """Return the wedge's force balance on a stopped disc, for both readings of the paper."""
    result = runs.bench("disc-stop", MAIN)
    values = kpis(result)
    shares = {name: _self_reinforcement(run) for name, run in result.recordings.items()}
    return [
        compared(
            "hold.standing",
            FACTS["only_turning"],
            shares["drop"],
            note="(tan(alpha) F_N - F_M)/(tan(alpha) F_N) on a stopped disc, without the pad term, "
            "as in the paper",
        ),
        found(
            "hold.standing.stick",
            "1",
            shares["stick"],
            "the same ratio if the pad sticks to the stopped disc (our other interpretation)",
        ),
        found(
            "hold.force_held",
            "N",
            values["force_held_drop"],
            "normal force on the stopped "
            f"disc; {values['force_before_stop_drop']:.4g} N before the stop",
        ),
    ]


def _self_reinforcement(run: xr.Dataset) -> float:
    """Return the fraction of the wedge reaction that the motors do not supply, disc at rest."""
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
            note=f"500 N·m at mu_B = {_AWAY:g}: {above['scheduled']:.3g} W if the motors work "
            f"together, {above['preload']:.3g} W with preload",
        ),
    ]
