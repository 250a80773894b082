"""Fig. 9: a pulse of 950 N m on the software rate limit."""

from __future__ import annotations

import numpy as np
import xarray as xr

from bywire.bench.result import Result
from bywire.brakes.wedge.case import mean
from bywire.brakes.wedge.laws.moment_control import RETRACTING
from bywire.brakes.wedge.paper.facts import FACTS
from bywire.brakes.wedge.paper.runs import (
    IDEAL,
    MAIN,
    WITHOUT_RUNOUT,
    settled,
    stacked,
    standby,
)
from bywire.reproduction.item import Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part, Runs, kpis, peak

SHORT, LONGER = 0.11, 1.0
"""lengths [s] of a pulse that ends as soon as the moment is there, and of a longer braking"""
THRESHOLDS = (8.0, 20.0)
"""moments [N m] below which the controller leaves the moment mode: our 12 N m lies between"""
FIRST = 0.2
"""time [s] in which the effect of friction is compared, the length of the pulse"""


def part(runs: Runs) -> Part:
    """Return the pulse, its power, and what limits it."""
    result = runs.bench("moment-pulse-950", MAIN)
    items = [*_moment(result), *_limits(runs, result), *_power(runs, result), *_tail(runs)]
    text = (
        "The length of the pulse is not printed; ours is 0.2 s. Standby power, the filter of the "
        "power and the rate limit were tuned to the paper's 60 W: that number is no evidence. "
        "The disc gives nearly all of the energy that the caliper stores."
    )
    run = result.recordings["run"]
    exhibit = Exhibit(
        "fig9", lambda: stacked(run), "Fig. 9: 950 Nm step pulse in moment: demand and simulation."
    )
    return Part("Figure 9: large pulse", text, tuple(items), (exhibit,), {"fig9": run})


def _moment(result: Result) -> list[Item]:
    values = kpis(result)
    return [
        compared("fig9.peak_moment", FACTS["pulse"], values["peak_moment"], note="largest moment"),
        found("fig9.time_to_90", "s", values["time_to_90"], "the sensor shows 90 % of the demand"),
        found("fig9.normal_force", "N", values["peak_normal_force"], "largest normal force"),
        found("fig9.caliper_energy", "J", values["caliper_energy"], "largest energy stored"),
        found(
            "fig9.disc_share",
            "%",
            values["disc_share"],
            "work of the disc on the wedge until then, over that energy: self-reinforcement",
        ),
        found(
            "fig9.energy_in",
            "J",
            values["energy_in"],
            "at the drives' input, standby included; "
            f"the disc loses {values['energy_braked']:.4g} J",
        ),
    ]


def limited(result: Result, target: float) -> tuple[float, float]:
    """Return the shares of the time to 90 % on the rate limit [%]: from contact, from the step."""
    run, values = result.recordings["run"], kpis(result)
    end = run["time"].values[int(np.argmax(run["y_M"].values > 0.9 * target))]
    return (
        100.0 * mean(run, "sat_rate", values["contact_time"], end),
        100.0 * mean(run, "sat_rate", 0.0, end),
    )


def _limits(runs: Runs, result: Result) -> list[Item]:
    """Return what dominates at either amplitude: friction, or limits."""
    small = runs.bench("moment-pulses", MAIN)
    build_up, whole = limited(result, FACTS["pulse"].value)
    _, whole_small = limited(small, FACTS["held"].value)
    effects = {
        M: _friction_effect(runs, name, M)
        for name, M in (
            ("moment-pulses", FACTS["held"].value),
            ("moment-pulse-950", FACTS["pulse"].value),
        )
    }
    at_200, at_950 = effects.values()
    return [
        compared(
            "fig9.rate_limited",
            FACTS["long"],
            build_up,
            note="the limit of 60 rad/s is ours, tuned to the power",
        ),
        found(
            "fig9.rate_limited_pulse", "%", kpis(result)["rate_limited"], "share of the whole pulse"
        ),
        compared(
            "fig9.limits_dominate",
            FACTS["large_limited"],
            whole - whole_small,
            note=f"share at 950 Nm less that at 200 Nm ({whole_small:.3g} %)",
        ),
        compared(
            "fig9.friction_dominates",
            FACTS["small_friction"],
            at_200 / at_950,
            note=f"root mean square over {FIRST:g} s of what friction changes: "
            f"{100 * at_200:.3g} % of 200 Nm, {100 * at_950:.3g} % of 950 Nm",
        ),
    ]


def _friction_effect(runs: Runs, experiment: str, M: float) -> float:
    """Return what friction changes in the moment, root mean square over the demand."""
    changed = [
        runs.bench(experiment, MAIN, overrides).recordings["run"]["M_B"].sel(time=slice(0, FIRST))
        for overrides in ({**WITHOUT_RUNOUT, "encoder.law": "ideal"}, IDEAL)
    ]
    with_friction, without = (moment.values for moment in changed)
    return float(np.sqrt(np.mean((with_friction - without) ** 2))) / M


def _power(runs: Runs, result: Result) -> list[Item]:
    run, values = result.recordings["run"], kpis(result)
    contact, end = values["contact_time"], result.bench.chosen_options.flat()["t_pulse"]
    fig7 = runs.bench("moment-pulses", MAIN)
    t_hold = fig7.bench.chosen_options.flat()["t_hold"]
    hold = settled(fig7.recordings["run"], "P_meas", t_hold) - standby()
    before = _largest(run, 0.0, contact) - standby()
    after = _largest(run, contact, end) - standby()
    longer = runs.bench("moment-pulse-950", MAIN, None, {"t_pulse": LONGER}).recordings["run"]
    short = runs.bench("moment-pulse-950", MAIN, None, {"t_pulse": SHORT}).recordings["run"]
    steady = settled(longer, "P_meas", LONGER) - standby()
    late = float(run["P_meas"].sel(time=end - 1e-3, method="nearest")) - standby()
    return [
        compared(
            "fig9.power",
            FACTS["power"],
            peak(run, "P_meas"),
            note="largest filtered power; standby, filter and rate limit are tuned to it",
            tuned="calibrated",
        ),
        compared(
            "fig9.no_initial_peak",
            FACTS["no_peak"],
            before / after,
            note=f"{before:.3g} W before contact, {after:.3g} W after it; a hump remains",
        ),
        compared(
            "fig9.lowest_power",
            FACTS["not_low"],
            _lowest(run, contact, end) / hold,
            note=f"pulse of {end:g} s; Fig. 7's hold takes {hold:.3g} W above standby",
        ),
        found(
            "fig9.lowest_power.short",
            "1",
            _lowest(short, contact, SHORT) / hold,
            f"the same for a pulse of {SHORT:g} s",
        ),
        compared(
            "fig9.power_reduces",
            FACTS["reduces"],
            steady / late,
            note=f"{steady:.3g} W after {LONGER:g} s, {late:.3g} W at the end of the pulse",
        ),
        found("fig9.steady_power", "W", steady, "above standby, last revolution of 1 s at 950 Nm"),
    ]


def _largest(run: xr.Dataset, begin: float, end: float) -> float:
    return float(run["P_meas"].sel(time=slice(begin, end)).max())


def _lowest(run: xr.Dataset, begin: float, end: float) -> float:
    """Return the lowest filtered power above standby [W] during braking."""
    return float(run["P_meas"].sel(time=slice(begin, end)).min()) - standby()


def _tail(runs: Runs) -> list[Item]:
    """Return how far the end of the release moves with the gap mode's threshold."""
    low, high = (
        runs.bench("moment-pulse-950", MAIN, {"control.moment.M_contact": M}) for M in THRESHOLDS
    )
    times = [_switches(result.recordings["run"]) for result in (low, high)]
    parking = [kpis(result)["parking_time"] for result in (low, high)]
    between = f"between thresholds of {THRESHOLDS[0]:g} and {THRESHOLDS[1]:g} Nm"
    why = "the paper puts its difference at the end of Fig. 9 down to the time of this switch"
    return [
        found(
            "fig9.switch_shift",
            "s",
            times[0] - times[1],
            f"switch from moment to retracting, {between}; {why}",
        ),
        found(
            "fig9.tail_shift", "s", parking[0] - parking[1], f"time of parking, {between}; {why}"
        ),
    ]


def _switches(run: xr.Dataset) -> float:
    retracting = run["mode"].values == RETRACTING
    return float(run["time"].values[int(np.argmax(retracting))]) if retracting.any() else np.nan
