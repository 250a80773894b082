"""Section 4.2: the dither's waveform, of which the paper chose the sine for its low distortion."""

from __future__ import annotations

import numpy as np

from bywire.analysis.response.sweep import total_distortion
from bywire.brakes.motorcycle.paper.fig5 import WITH, Loops
from bywire.brakes.motorcycle.paper.runs import BAR, MAIN, Runs, parameters
from bywire.report.friction_figures import hysteresis_loop
from bywire.reproduction.item import Item, found
from bywire.reproduction.reproduction import Exhibit, Part

WAVEFORMS = ("sine", "square", "triangle")
P_START = 25e5
"""pressure from whose equilibrium the brake is left alone under dither [Pa]"""


def part(runs: Runs) -> Part:
    """Return loop, distortion and ripple for the three waveforms."""
    items: list[Item] = []
    for waveform in WAVEFORMS:
        items += _items(runs, waveform)
    text = (
        "The paper prefers the sine for its low total harmonic distortion. Compared at equal "
        "amplitude: the 80 Hz filter and the current loop leave little of the harmonics, so that "
        "at the motor all three differ less by distortion than by how much of them arrives. The "
        "square's fundamental is larger than the sine's (4/pi), the triangle's smaller (8/pi^2): "
        "the square frees the piston best and shakes the pressure most."
    )
    loops = {
        waveform: runs.bench("friction-ramp", MAIN, _chosen(waveform)).recordings[WITH]
        for waveform in WAVEFORMS
    }
    exhibit = Exhibit(
        "dither-waveforms",
        lambda: hysteresis_loop(loops, "p_mc", "i_filtered", "i_star", average=0.02),
        "The ramp of eq. (17) with dither of three waveforms, averaged over one dither period.",
    )
    return Part("Section 4.2: waveform of the dither", text, tuple(items), (exhibit,))


def _chosen(waveform: str) -> dict[str, str]:
    return {"ecu.dither.waveform": waveform}


def _items(runs: Runs, waveform: str) -> list[Item]:
    chosen = _chosen(waveform)
    loops = Loops(runs.bench("friction-ramp", MAIN, chosen))
    rest = runs.bench(
        "pressure-step", MAIN, chosen, {"p_start": P_START, "i_step": 1e-9, "settle": 3.0}
    ).recordings["run"]
    f = parameters(MAIN).ecu.dither.f_dit
    window = rest.isel(time=slice(-1001, -1))  # one second: whole periods of the dither
    t = window["time"].values
    sent, got = (100.0 * total_distortion(t, window[name].values, f) for name in ("i_dit", "i"))
    prefix = f"dither.{waveform}"
    return [
        found(f"{prefix}.thd", "%", sent, "harmonic distortion of the dither as sampled"),
        found(f"{prefix}.thd.motor", "%", got, "harmonic distortion of the motor current"),
        found(
            f"{prefix}.ripple",
            "bar",
            float(np.ptp(window["p_mc"].values)) / BAR,
            "pressure, peak to peak, at rest at the current that holds 25 bar without friction",
        ),
        found(f"{prefix}.p_max", "bar", loops.p_max(WITH), "on the ramp of eq. (17)"),
        found(
            f"{prefix}.loop_area_ratio",
            "%",
            loops.area_ratio,
            "area with dither over that without, on the ramp of eq. (17)",
        ),
        found(
            f"{prefix}.share_stuck",
            "%",
            100.0 * loops.values["share_stuck_dithered"],
            "of the time, on the ramp of eq. (17)",
        ),
    ]
