"""Fig. 5: quasi-static characteristic, with and without dither, and the dither's waveform."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.response.sweep import amplitudes
from bywire.bench.bench import Bench
from bywire.bench.experiment import as_run
from bywire.bench.kpis import hysteresis
from bywire.bench.kpis.hysteresis import closed_above
from bywire.bench.kpis.samples import smoothed
from bywire.bench.running import Result
from bywire.brakes.motorcycle.paper.facts import ALLOWANCES, FACTS
from bywire.brakes.motorcycle.paper.runs import BAR, MAIN, SETS, Runs, parameters
from bywire.brakes.motorcycle.staircase import jumps
from bywire.report.friction_figures import hysteresis_loop
from bywire.reproduction.item import Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part
from bywire.reproduction.runs import kpis, peak, selected
from bywire.simulation.run import simulate

WITHOUT, WITH = "without-dither", "with-dither"
REMOVED = 0.1
"""width, as a share of the undithered loop's at mid-height, below which a loop counts as removed"""
SLOWER = 10.0
"""how many times slower than eq. (17) the slow ramp is"""
LEVELS = np.arange(ALLOWANCES["level"].size, 45.0, 0.1) * BAR
DAMPINGS = (0.5, 1.0)
"""other damping ratios of the 80 Hz filter: the paper prints none"""


@dataclass(frozen=True)
class Loops:
    """The two loops of a parameter set, and what is measured on them."""

    result: Result

    @property
    def values(self) -> dict[str, float]:
        """KPIs, SI."""
        return kpis(self.result)

    @property
    def area_ratio(self) -> float:
        """Area with dither in % of that without."""
        return 100.0 * self.values["loop_area_ratio"]

    def p_max(self, label: str) -> float:
        """Return the largest pressure [bar]."""
        return peak(self.result.recordings[label], "p_mc") / BAR

    @property
    def removed_above(self) -> float:
        """Pressure [bar] above which the dithered loop counts as removed."""
        setting = hysteresis.Setting("i_filtered", "p_mc", smoothing=0.02)
        loop = hysteresis.select(self.result.recordings[WITH], setting)
        width = REMOVED * self.values["loop_width_mid_undithered"]
        return closed_above(loop, width, LEVELS) / BAR

    @property
    def dither_passed(self) -> float:
        """Share [%] of the dither's amplitude that the motor current has, half-way up."""
        recording = self.result.recordings[WITH]
        t = recording["time"].values
        inside = (t > 12.0 - 1e-9) & (t < 12.5 - 1e-9)
        sent, got = (
            np.abs(_ripple(t[inside], recording[name].values[inside])) for name in ("i_dit", "i")
        )
        return float(100.0 * got / sent)


def part(runs: Runs) -> Part:
    """Return the ramp of eq. (17) for both parameter sets."""
    items: list[Item] = []
    for name, suffix in SETS.items():
        items += _set_items(name, suffix, Loops(runs.bench("friction-ramp", name)))
    for zeta in DAMPINGS:
        other = Loops(runs.bench("friction-ramp", MAIN, {"ecu.filter.zeta": zeta}))
        note = f"with the 80 Hz filter's damping ratio {zeta:g}; ours is 1/sqrt(2)"
        items += [
            found(f"fig5.p_max.dither.zeta{zeta:g}", "bar", other.p_max(WITH), note),
            found(f"fig5.loop_area_ratio.zeta{zeta:g}", "%", other.area_ratio, note),
        ]
    ideal = Loops(runs.bench("friction-ramp", MAIN, {"adc.law": "ideal"}))
    items.append(
        found(
            "fig5.p_max.ideal_adc",
            "bar",
            ideal.p_max(WITHOUT),
            "without dither, converters of infinite resolution: the jumps are a little higher",
        )
    )
    text = (
        "Without dither the pressure climbs in stick-slip jumps. With dither the loop shrinks to "
        "a fraction. Most of what is left is no friction hysteresis but delay: a ramp ten times "
        "slower leaves next to nothing. Dither turns dry friction into damping, which "
        "makes the brake slower; and because seals rub more while applying, it lowers the gain. "
        "The largest pressure depends on how much of the dither reaches the motor, hence on the "
        "damping of the 80 Hz filter, which is not printed."
    )
    recordings = {
        f"fig5-{label}{suffix}": selected(
            runs.bench("friction-ramp", name).recordings[label],
            "i",
            "i_meas",
            "i_filtered",
            "i_star",
            "i_dit",
            "p_mc",
            "omega",
            "x_mc",
            "stuck",
        )
        for name, suffix in SETS.items()
        for label in (WITHOUT, WITH)
    }
    exhibits = tuple(_exhibit(runs, name, suffix) for name, suffix in SETS.items())
    return Part("Figure 5: friction and dither", text, tuple(items), exhibits, recordings)


def _exhibit(runs: Runs, name: str, suffix: str) -> Exhibit:
    """Return Fig. 5 for one parameter set."""
    recordings = runs.bench("friction-ramp", name).recordings
    return Exhibit(
        f"fig5{suffix.replace('@', '-')}",
        lambda: hysteresis_loop(recordings, "p_mc", "i_filtered", "i_star", average=0.02),
        "Fig. 5: measured current (low-passed at 20 Hz) over pressure during the slow "
        "ramp, averaged over one dither period; pale: with its ripple. Parameter set "
        f"{name}.",
    )


def _set_items(name: str, suffix: str, loops: Loops) -> list[Item]:
    values = loops.values
    stairs = jumps(loops.result.recordings[WITHOUT])
    levels = ", ".join(f"{level / BAR:.2f}" for level in stairs.levels)
    slow = 100.0 * _slow_area(name) / values["loop_area_undithered"]
    return [
        compared(
            f"fig5.p_max{suffix}", FACTS["fig5_top"], loops.p_max(WITHOUT), note="without dither"
        ),
        compared(
            f"fig5.p_max.dither{suffix}", FACTS["fig5_top"], loops.p_max(WITH), note="with dither"
        ),
        compared(
            f"fig5.loop_area_ratio{suffix}",
            FACTS["fig5_loop"],
            loops.area_ratio,
            note="area with dither over that without, averaged over one dither period; mostly "
            "delay",
        ),
        compared(
            f"fig5.loop_area_ratio.slow{suffix}",
            FACTS["fig5_loop"],
            slow,
            note=f"the same with dither on a ramp {SLOWER:g} times slower: friction alone",
        ),
        compared(
            f"fig5.removed_above{suffix}",
            FACTS["fig5_removed"],
            loops.removed_above,
            note=f"pressure above which the width stays below {100 * REMOVED:g} % of the "
            f"undithered loop's at mid-height; {ALLOWANCES['level'].size:g} bar is the lowest "
            "level looked at",
        ),
        compared(
            f"fig5.i_max.dither{suffix}",
            FACTS["fig5_current"],
            peak(loops.result.recordings[WITH], "i_filtered"),
            note="measured current behind the 20 Hz low-pass: dither of eq. (20) leaves more "
            "ripple than the figure has room for",
        ),
        found(f"fig5.jumps{suffix}", "1", float(stairs.levels.size), f"ending at {levels} bar"),
        found(
            f"fig5.share_stuck{suffix}",
            "%",
            100.0 * values["share_stuck_undithered"],
            "of the time, without dither",
        ),
        found(
            f"fig5.share_stuck.dither{suffix}",
            "%",
            100.0 * values["share_stuck_dithered"],
            "of the time, with dither",
        ),
        found(
            f"fig5.dither_passed{suffix}",
            "%",
            loops.dither_passed,
            "motor current at 50 Hz "
            "over the dither, through the 80 Hz filter and the current loop; section 4.2, "
            "without a number: the loop correctly tracks the dither",
        ),
    ]


def _slow_area(name: str) -> float:
    """Return the dithered loop's area [A Pa] on a slower ramp, from two signals only."""
    slope = FACTS["ramp_peak"].value / 25.0 / SLOWER
    bench = Bench("friction-ramp", name, options={"slope": slope})
    case = next(c for c in bench.cases() if c.label == WITH)
    slow = simulate(as_run(case, bench.step), signals=("i", "p_mc"))
    if slow.status == "interrupted":
        raise KeyboardInterrupt
    t = slow.time
    period = 1.0 / parameters(name).ecu.dither.f_dit
    i, p = (smoothed(t, slow[signal], period) for signal in ("i", "p_mc"))
    return hysteresis.loop_area(hysteresis.Loop(t, i, p)).value


def _ripple(t: NDArray[np.float64], y: NDArray[np.float64]) -> complex:
    """Return the complex amplitude at 50 Hz without the ramp's trend."""
    return complex(amplitudes(t, y - np.polyval(np.polyfit(t, y, 1), t), 50.0, 1)[0])
