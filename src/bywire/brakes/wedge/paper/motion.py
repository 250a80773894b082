"""Position control of the wedge, and the force fight between two motors on one shaft."""

from __future__ import annotations

import numpy as np
import xarray as xr

from bywire.brakes.wedge.paper.facts import FACTS
from bywire.brakes.wedge.paper.runs import MAIN, parameters
from bywire.plant import roller_screw
from bywire.report.time_traces import time_traces
from bywire.reproduction.item import Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part, Runs, kpis

MOTIONS = ("step", "ramp", "sine")
WEAKER = 0.95
"""torque constant of motor 2 over that of motor 1 where they differ"""


def position(runs: Runs) -> Part:
    """Return how little the wedge changes the position response of the screws."""
    result = runs.bench("position-step", MAIN)
    values = kpis(result)
    bands = kpis(runs.bench("screw-position", MAIN))
    items: list[Item] = []
    for controller in ("high", "low"):
        items += [
            compared(
                f"position.wedge.{controller}",
                FACTS["little"],
                values[f"difference_screws_{controller}"],
                note=f"{controller} bandwidth: largest difference over time and amplitudes",
            ),
            found(
                f"position.motors.{controller}",
                "%",
                values[f"difference_motors_{controller}"],
                f"{controller} bandwidth: the same against motors whose screws touch nothing",
            ),
            found(
                f"position.dead_band.{controller}",
                "rad",
                bands[f"dead_band_{controller}"],
                f"{controller} bandwidth: error that friction and cogging can hold at rest",
            ),
        ]
    text = (
        "Steps of the position within the clearance, with the wedge and without it. The paper "
        "compares frequency responses."
    )
    return Part("Position control of the wedge", text, tuple(items))


def force_fight(runs: Runs) -> Part:
    """Return the forces between two motors that follow one reference."""
    result = runs.bench("force-fight", MAIN)
    values = kpis(result)
    equal = max(values[f"peak_force_{motion}_equal"] for motion in MOTIONS)
    o = result.bench.chosen_options.flat()
    unequal = ", ".join(f"{100 * o[f'more_{key}']:+g} % {key}" for key in ("K", "J", "R", "D"))
    items = [
        compared(
            "force_fight.equal",
            FACTS["differences_fight"],
            equal,
            note="equal motors: largest force of step, ramp and sine",
        ),
        *(
            found(
                f"force_fight.{motion}",
                "N",
                values[f"peak_force_{motion}_unequal"],
                f"largest force, motor 2 with {unequal}, our choice",
            )
            for motion in MOTIONS
        ),
        found(
            "force_fight.static",
            "N",
            values["static_force_unequal"],
            "left after the step: friction holds the screws apart",
        ),
        *_speed(runs),
    ]
    text = (
        "Both motors follow one reference, a force sensor between their screws. The paper prints "
        "no forces. The rate limit's reason, higher speeds widen the angle between the motors, is "
        "looked for in Fig. 9's pulse with a weaker second motor."
    )
    exhibit = Exhibit(
        "force-fight",
        lambda: time_traces(result.recordings["step_unequal"]),
        "Force fight: step of both motors, of which the second one differs.",
    )
    return Part("Force fight", text, tuple(items), (exhibit,))


def _speed(runs: Runs) -> list[Item]:
    """Return how a doubled rate limit widens the angle between the motors."""
    par = parameters()
    weaker = {"motor_2.K_ref": WEAKER * par.motor_2.K_ref}
    rate = par.control.moment.rate_max
    swings = []
    for limit in (rate, 2.0 * rate):
        changed = {**weaker, "control.moment.rate_max": limit}
        result = runs.bench("moment-pulse-950", MAIN, changed, {"omega_gap": limit})
        swings.append(_swing(result.recordings["run"]))
    # From nut to nut the screws and both interfaces to the wedge are in series.
    stiffness = 0.5 / (1.0 / par.heart.K_S + 1.0 / par.heart.K_W)
    per_angle = stiffness * roller_screw.slope(par.screw)
    return [
        compared(
            "force_fight.speed",
            FACTS["faster_fights"],
            swings[1] / swings[0],
            note=f"swings of {1e3 * swings[0]:.3g} mrad at {rate:g} rad/s, {1e3 * swings[1]:.3g} "
            f"mrad at {2 * rate:g} rad/s; torque constant of motor 2 {WEAKER:g} times",
        ),
        found(
            "force_fight.force_per_angle",
            "N/rad",
            per_angle,
            "force through the wedge per angle between the motors: the drive train is stiff",
        ),
    ]


def _swing(run: xr.Dataset) -> float:
    """Return the peak-to-peak angle between the motors [rad]; their offset does not count."""
    return float(np.ptp(run["theta_1"].values - run["theta_2"].values))
