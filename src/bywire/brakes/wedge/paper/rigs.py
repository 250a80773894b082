"""The drive train: current loop, efficiency, stiffness, position control, force fight."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from bywire.brakes.wedge.paper.statements import FACTS, MAIN, parameters
from bywire.plant import roller_screw
from bywire.report.time_traces import time_traces
from bywire.reproduction.item import Fact, Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part, Runs, kpis

if TYPE_CHECKING:
    import xarray as xr

_MICRON = 1e6
"""[N/m] in one N/um"""


def current_loop(runs: Runs) -> Part:
    """Return the current-loop bandwidth for several windings and gains."""
    result = runs.bench("current-loop", MAIN)
    values = kpis(result)
    bandwidths = [value for name, value in values.items() if name.startswith("bandwidth")]
    usual, position = values["bandwidth_parallel_usual"], parameters().control.position.f_n
    items = [
        compared(
            "current_loop.bandwidth",
            FACTS["fast_current"],
            usual / position,
            note=f"{usual:.0f} Hz compared with {position:g} Hz of the high-bandwidth position "
            "control. We chose both",
        ),
        found(
            "current_loop.slowest",
            "Hz",
            min(bandwidths),
            "minimum bandwidth for stators in parallel, single and in series, with half to twice "
            "the gains",
        ),
        found(
            "current_loop.fastest",
            "Hz",
            max(bandwidths),
            "maximum bandwidth for the same windings and gains",
        ),
    ]
    text = (
        "As in the paper, the current steps with the shaft clamped, for several windings and "
        "gains. The drive data come from the manufacturer and are not printed."
    )
    return Part("Motor current loop", text, tuple(items))


def efficiency(runs: Runs) -> Part:
    """Return the screw's efficiency as the rig measures it."""
    result = runs.bench("screw-efficiency", MAIN)
    values = {name: 100.0 * value for name, value in kpis(result).items() if "eta" in name}
    put_in = replace(FACTS["measurable"], value=values["eta_f_true"])
    bearing = f"{kpis(result)['bearing_torque']:.3g} N·m"
    items = [
        compared(
            "efficiency.driving",
            FACTS["eta"],
            values["eta_f"],
            note="as the rig measures it",
            tuned="an input",
        ),
        compared(
            "efficiency.recovered",
            put_in,
            values["eta_f"],
            note=f"after subtracting the bearing torque: {bearing} without load, and its growth "
            "with force",
        ),
        compared(
            "efficiency.no_load",
            put_in,
            values["eta_f_no_load"],
            note="after subtracting only the no-load bearing torque. Friction that grows with the "
            "force squared is then included in the screw loss",
        ),
        compared(
            "efficiency.raw", put_in, values["eta_f_raw"], note="motor torque and force alone"
        ),
        found(
            "efficiency.back_driven",
            "%",
            values["eta_b"],
            f"the same for a back-driven screw. The true value is {values['eta_b_true']:.3g} %, "
            f"and {values['eta_b_no_load']:.3g} % results from the no-load torque alone",
        ),
        found(
            "efficiency.back_driven.raw", "%", values["eta_b_raw"], "motor torque and force alone"
        ),
        found(
            "efficiency.both",
            "%",
            values["eta_f_true"] * values["eta_b_true"] / 100.0,
            "fraction of one motor's torque that reaches the other motor. At full current neither "
            "motor moves the other",
        ),
    ]
    text = (
        "One motor in current control works slowly against the other in position control, with a "
        "force sensor between their screws."
    )
    exhibit = Exhibit(
        "screw-efficiency",
        lambda: time_traces(result.recordings["driving"]),
        "Screw efficiency: motor 1 drives at constant current while motor 2 gives way.",
    )
    return Part("Roller-screw efficiency", text, tuple(items), (exhibit,))


def stiffness(runs: Runs) -> Part:
    """Return stiffnesses and free play as the two stages of the test measure them."""
    result = runs.bench("stiffness", MAIN)
    values = kpis(result)
    items = [
        _recovered("stiffness.K_S", FACTS["sets_stiffness"], values, "K_S", _MICRON),
        _recovered("stiffness.K_W", FACTS["sets_stiffness"], values, "K_W", _MICRON),
        _recovered("stiffness.free_play", FACTS["measures_play"], values, "free_play", 1e-6),
        *_directions(values),
    ]
    text = (
        "The motors work against each other in two stages. The first stage has a force sensor "
        "between the screws and also gives the force per current. The second stage uses the brake "
        "heart, where tension acts through the wedge. The test results are compared with the "
        "values in the model."
    )
    exhibits = tuple(
        Exhibit(f"stiffness-{label}", partial(time_traces, result.recordings[label]), caption)
        for label, caption in (
            ("sensor", "Stiffness, first stage: a force sensor between the screws."),
            ("heart", "Stiffness, second stage: the screws in the brake heart."),
        )
    )
    return Part("Drive-train stiffness", text, tuple(items), exhibits)


def _recovered(name: str, fact: Fact, values: dict[str, float], key: str, size: float) -> Item:
    """Return a measured quantity and its true value, in the unit of the statement."""
    put_in = replace(fact, value=values[f"{key}_true"] / size)
    return compared(name, put_in, values[key] / size)


def _directions(values: dict[str, float]) -> list[Item]:
    """Return the comparison of compression and tension."""
    K_F = parameters().rig.sensor.K_F
    line = 1.0 / (1.0 / values["K_line_compression"] - 1.0 / K_F)
    same = replace(FACTS["same_compression"], value=line / _MICRON)
    compression = values["K_heart_compression"]
    return [
        compared(
            "stiffness.compression",
            same,
            compression / _MICRON,
            note="tip to tip, with the force from the motor currents",
        ),
        compared(
            "stiffness.tension",
            FACTS["softer_tension"],
            values["K_heart_tension"] / compression,
            note="ratio of tension to compression",
        ),
        found(
            "stiffness.force_per_current",
            "N/A",
            values["force_per_current"],
            "calibration for the second stage, for rising current",
        ),
    ]


# --- Position control of the wedge, and the force fight

_MOTIONS = ("step", "ramp", "sine")
_WEAKER = 0.95
"""ratio of the torque constant of motor 2 to that of motor 1 where they differ"""


def position(runs: Runs) -> Part:
    """Return the effect of the wedge on the position response of the screws."""
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
                note=f"{controller} bandwidth: maximum difference over time and amplitudes",
            ),
            found(
                f"position.motors.{controller}",
                "%",
                values[f"difference_motors_{controller}"],
                f"{controller} bandwidth: maximum difference from motors whose screws touch "
                "nothing",
            ),
            found(
                f"position.dead_band.{controller}",
                "rad",
                bands[f"dead_band_{controller}"],
                f"{controller} bandwidth: error that friction and cogging can hold at rest",
            ),
        ]
    text = (
        "Position steps within the clearance, with and without the wedge. The paper compares "
        "frequency responses."
    )
    return Part("Position control of the wedge", text, tuple(items))


def force_fight(runs: Runs) -> Part:
    """Return the forces between two motors that follow one reference."""
    result = runs.bench("force-fight", MAIN)
    values = kpis(result)
    equal = max(values[f"peak_force_{motion}_equal"] for motion in _MOTIONS)
    o = result.bench.chosen_options.flat()
    unequal = ", ".join(f"{100 * o[f'more_{key}']:+g} % {key}" for key in ("K", "J", "R", "D"))
    items = [
        compared(
            "force_fight.equal",
            FACTS["differences_fight"],
            equal,
            note="equal motors: maximum force in step, ramp and sine",
        ),
        *(
            found(
                f"force_fight.{motion}",
                "N",
                values[f"peak_force_{motion}_unequal"],
                f"maximum force, motor 2 with {unequal} (our choice)",
            )
            for motion in _MOTIONS
        ),
        found(
            "force_fight.static",
            "N",
            values["static_force_unequal"],
            "remaining force after the step. Friction holds the screws apart",
        ),
        *_speed(runs),
    ]
    text = (
        "Both motors follow one reference, with a force sensor between their screws. The paper "
        "prints no forces. It says that the rate limit is needed because higher speeds widen the "
        "angle between the motors. The pulse of Fig. 9 with a weaker second motor tests this "
        "claim."
    )
    exhibit = Exhibit(
        "force-fight",
        lambda: time_traces(result.recordings["step_unequal"]),
        "Force fight: step of both motors, with a different second motor.",
    )
    return Part("Force fight", text, tuple(items), (exhibit,))


def _speed(runs: Runs) -> list[Item]:
    """Return the effect of a doubled rate limit on the angle between the motors."""
    par = parameters()
    weaker = {"motor_2.K_ref": _WEAKER * par.motor_2.K_ref}
    rate = par.control.moment.rate_max
    swings = []
    for limit in (rate, 2.0 * rate):
        changed = {**weaker, "control.moment.rate_max": limit}
        result = runs.bench("moment-pulse-950", MAIN, changed, {"omega_gap": limit})
        swings.append(_swing(result.recordings["run"]))
    # Both screws and both interfaces to the wedge are in series from nut to nut.
    stiffness = 0.5 / (1.0 / par.heart.K_S + 1.0 / par.heart.K_W)
    per_angle = stiffness * roller_screw.slope(par.screw)
    return [
        compared(
            "force_fight.speed",
            FACTS["faster_fights"],
            swings[1] / swings[0],
            note=f"swings of {1e3 * swings[0]:.3g} mrad at {rate:g} rad/s, {1e3 * swings[1]:.3g} "
            f"mrad at {2 * rate:g} rad/s. The torque constant of motor 2 is {_WEAKER:g} times that "
            "of motor 1",
        ),
        found(
            "force_fight.force_per_angle",
            "N/rad",
            per_angle,
            "force through the wedge per angle between the motors. The drive train is stiff",
        ),
    ]


def _swing(run: xr.Dataset) -> float:
    """Return the peak-to-peak angle between the motors [rad], without their offset."""
    return float(np.ptp(run["theta_1"].values - run["theta_2"].values))
