"""Section "Initial tests": current loop, screw efficiency, drive-train stiffness."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from bywire.brakes.wedge.paper.facts import FACTS
from bywire.brakes.wedge.paper.runs import MAIN, parameters
from bywire.report.time_traces import time_traces
from bywire.reproduction.item import Fact, Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part, Runs, kpis

MICRON = 1e6
"""[N/m] in one N/um"""


def current_loop(runs: Runs) -> Part:
    """Return how fast the current loop is, over windings and gains."""
    result = runs.bench("current-loop", MAIN)
    values = kpis(result)
    bandwidths = [value for name, value in values.items() if name.startswith("bandwidth")]
    usual, position = values["bandwidth_parallel_usual"], parameters().control.position.f_n
    items = [
        compared(
            "current_loop.bandwidth",
            FACTS["fast_current"],
            usual / position,
            note=f"{usual:.0f} Hz against {position:g} Hz of the high-bandwidth position control; "
            "both are ours",
        ),
        found(
            "current_loop.slowest",
            "Hz",
            min(bandwidths),
            "over stators in parallel, alone and in series, and half to twice the gains",
        ),
        found("current_loop.fastest", "Hz", max(bandwidths), "over the same"),
    ]
    text = (
        "As in the paper, steps with the shaft clamped for several windings and gains. The data "
        "of the drive are the manufacturer's and not printed."
    )
    return Part("Motor current loop", text, tuple(items))


def efficiency(runs: Runs) -> Part:
    """Return the screw's efficiency as the rig measures it."""
    result = runs.bench("screw-efficiency", MAIN)
    values = {name: 100.0 * value for name, value in kpis(result).items() if "eta" in name}
    put_in = replace(FACTS["measurable"], value=values["eta_f_true"])
    bearing = f"{kpis(result)['bearing_torque']:.3g} N m"
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
            note=f"with the bearings' torque, {bearing} without load and its growth with the "
            "force, taken off",
        ),
        compared(
            "efficiency.no_load",
            put_in,
            values["eta_f_no_load"],
            note="with the torque without load alone taken off: what grows with the square of the "
            "force counts as loss of the screw",
        ),
        compared(
            "efficiency.raw", put_in, values["eta_f_raw"], note="motor torque and force alone"
        ),
        found(
            "efficiency.back_driven",
            "%",
            values["eta_b"],
            f"the same for a screw that is driven back; {values['eta_b_true']:.3g} % put in, "
            f"{values['eta_b_no_load']:.3g} % with the torque without load alone",
        ),
        found(
            "efficiency.back_driven.raw", "%", values["eta_b_raw"], "motor torque and force alone"
        ),
        found(
            "efficiency.both",
            "%",
            values["eta_f_true"] * values["eta_b_true"] / 100.0,
            "of one motor's torque arrive at the other: at full current neither moves the other",
        ),
    ]
    text = (
        "One motor in current control against the other in position control, a force sensor "
        "between their screws, in slow motion."
    )
    exhibit = Exhibit(
        "screw-efficiency",
        lambda: time_traces(result.recordings["driving"]),
        "Screw efficiency: motor 1 drives with constant current while motor 2 gives way.",
    )
    return Part("Roller-screw efficiency", text, tuple(items), (exhibit,))


def stiffness(runs: Runs) -> Part:
    """Return stiffnesses and free-play as the two stages of the test measure them."""
    result = runs.bench("stiffness", MAIN)
    values = kpis(result)
    items = [
        _recovered("stiffness.K_S", FACTS["sets_stiffness"], values, "K_S", MICRON),
        _recovered("stiffness.K_W", FACTS["sets_stiffness"], values, "K_W", MICRON),
        _recovered("stiffness.free_play", FACTS["measures_play"], values, "free_play", 1e-6),
        *_directions(values),
    ]
    text = (
        "The motors are driven against each other: first with a force sensor between the screws, "
        "which also tells the force per current, then in the brake heart, where tension flows "
        "through the wedge. What the test finds is compared with what was put into the model."
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
    """Return a quantity as measured beside what was put in, in the unit of the statement."""
    put_in = replace(fact, value=values[f"{key}_true"] / size)
    return compared(name, put_in, values[key] / size)


def _directions(values: dict[str, float]) -> list[Item]:
    """Return how compression and tension compare."""
    K_F = parameters().rig.sensor.K_F
    line = 1.0 / (1.0 / values["K_line_compression"] - 1.0 / K_F)
    same = replace(FACTS["same_compression"], value=line / MICRON)
    compression = values["K_heart_compression"]
    return [
        compared(
            "stiffness.compression",
            same,
            compression / MICRON,
            note="tip to tip, the force by the motors' current",
        ),
        compared(
            "stiffness.tension",
            FACTS["softer_tension"],
            values["K_heart_tension"] / compression,
            note="tension over compression",
        ),
        found(
            "stiffness.force_per_current",
            "N/A",
            values["force_per_current"],
            "the calibration that the second stage needs, for rising current",
        ),
    ]
