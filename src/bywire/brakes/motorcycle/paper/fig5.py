"""Fig. 5 and section 4.2: the slow ramp with and without dither, and the dither's waveform."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.analysis.response.sweep import amplitudes, total_distortion
from bywire.bench.bench import Bench
from bywire.bench.experiment import as_run
from bywire.bench.kpis import hysteresis
from bywire.bench.kpis.hysteresis import closed_above
from bywire.bench.kpis.samples import smoothed
from bywire.bench.running import Result
from bywire.brakes.motorcycle.paper.facts import ALLOWANCES, FACTS
from bywire.brakes.motorcycle.paper.runs import BAR, MAIN, SETS, Runs, parameters
from bywire.core.typing import Array
from bywire.report.friction_figures import hysteresis_loop
from bywire.reproduction.item import Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part, kpis, peak, selected
from bywire.simulation.run import simulate

_WITHOUT, _WITH = "without-dither", "with-dither"
_REMOVED = 0.1
"""width, as a share of the undithered loop's at mid-height, below which a loop counts as removed"""
_SLOWER = 10.0
"""how many times slower than eq. (17) the slow ramp is"""
_LEVELS = np.arange(ALLOWANCES["level"].size, 45.0, 0.1) * BAR
_LEAST_RISE = (
    0.1e5  # Pa: smaller steps, for example from the converter's resolution, are creep, not jumps
)
_DAMPINGS = (0.5, 1.0)
"""other damping ratios of the 80 Hz filter: the paper prints none"""


@dataclass(frozen=True)
class _Loops:
    """The two loops of a parameter set, and figures measured on them."""

    result: Result

    @property
    def values(self) -> dict[str, float]:
        """KPIs, SI."""
        return kpis(self.result)

    @property
    def area_ratio(self) -> float:
        """Area with dither in % of the area without."""
        return 100.0 * self.values["loop_area_ratio"]

    def p_max(self, label: str) -> float:
        """Return the largest pressure [bar]."""
        return peak(self.result.recordings[label], "p_mc") / BAR

    @property
    def removed_above(self) -> float:
        """Pressure [bar] above which the dithered loop counts as removed."""
        setting = hysteresis.Setting("i_filtered", "p_mc", smoothing=0.02)
        loop = hysteresis.select(self.result.recordings[_WITH], setting)
        width = _REMOVED * self.values["loop_width_mid_undithered"]
        return closed_above(loop, width, _LEVELS) / BAR

    @property
    def dither_passed(self) -> float:
        """Motor current's share [%] of the dither amplitude, halfway up the ramp."""
        recording = self.result.recordings[_WITH]
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
        items += _set_items(name, suffix, _Loops(runs.bench("friction-ramp", name)))
    for zeta in _DAMPINGS:
        other = _Loops(runs.bench("friction-ramp", MAIN, {"ecu.filter.zeta": zeta}))
        note = f"with the 80 Hz filter's damping ratio {zeta:g}; ours is 1/sqrt(2)"
        items += [
            found(f"fig5.p_max.dither.zeta{zeta:g}", "bar", other.p_max(_WITH), note),
            found(f"fig5.loop_area_ratio.zeta{zeta:g}", "%", other.area_ratio, note),
        ]
    ideal = _Loops(runs.bench("friction-ramp", MAIN, {"adc.law": "ideal"}))
    items.append(
        found(
            "fig5.p_max.ideal_adc",
            "bar",
            ideal.p_max(_WITHOUT),
            "without dither, converters of infinite resolution: the jumps are a little higher",
        )
    )
    text = (
        "Without dither the pressure climbs in stick-slip jumps. With dither the loop shrinks to "
        "a fraction. Most of the remaining loop is not friction hysteresis but delay: with a ramp "
        "ten times slower almost nothing remains. Dither turns dry friction into damping, which "
        "makes the brake slower. It also lowers the gain, because seals rub more while applying. "
        "The largest pressure depends on how much of the dither reaches the motor, and so on the "
        "damping of the 80 Hz filter, which the paper does not print."
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
        for label in (_WITHOUT, _WITH)
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
        "ramp, averaged over one dither period; pale: with ripple. Parameter set "
        f"{name}.",
    )


def _set_items(name: str, suffix: str, loops: _Loops) -> list[Item]:
    values = loops.values
    jumps = _jump_levels(loops.result.recordings[_WITHOUT])
    levels = ", ".join(f"{level / BAR:.2f}" for level in jumps)
    slow = 100.0 * _slow_area(name) / values["loop_area_undithered"]
    return [
        compared(
            f"fig5.p_max{suffix}", FACTS["fig5_top"], loops.p_max(_WITHOUT), note="without dither"
        ),
        compared(
            f"fig5.p_max.dither{suffix}", FACTS["fig5_top"], loops.p_max(_WITH), note="with dither"
        ),
        compared(
            f"fig5.loop_area_ratio{suffix}",
            FACTS["fig5_loop"],
            loops.area_ratio,
            note="area with dither over the area without, averaged over one dither period; mostly "
            "delay",
        ),
        compared(
            f"fig5.loop_area_ratio.slow{suffix}",
            FACTS["fig5_loop"],
            slow,
            note=f"the same with dither, on a ramp {_SLOWER:g} times slower: friction alone",
        ),
        compared(
            f"fig5.removed_above{suffix}",
            FACTS["fig5_removed"],
            loops.removed_above,
            note=f"pressure above which the width stays below {100 * _REMOVED:g} % of the "
            f"undithered loop's at mid-height; {ALLOWANCES['level'].size:g} bar is the lowest "
            "level evaluated",
        ),
        compared(
            f"fig5.i_max.dither{suffix}",
            FACTS["fig5_current"],
            peak(loops.result.recordings[_WITH], "i_filtered"),
            note="measured current after the 20 Hz low-pass: the ripple from eq. (20)'s dither "
            "exceeds the range of the figure",
        ),
        found(f"fig5.jumps{suffix}", "1", float(jumps.size), f"ending at {levels} bar"),
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
    slope = FACTS["ramp_peak"].value / 25.0 / _SLOWER
    bench = Bench("friction-ramp", name, options={"slope": slope})
    case = next(c for c in bench.cases() if c.label == _WITH)
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


def _jump_levels(recording: xr.Dataset) -> Array:
    """Return the pressures [Pa] at which slips between two phases of stick ended, shape (n,)."""
    p, stuck = recording["p_mc"].values, recording["stuck"].values > 0.5
    begins = np.flatnonzero(stuck[:-1] & ~stuck[1:])
    ends = np.flatnonzero(~stuck[:-1] & stuck[1:]) + 1
    following = np.searchsorted(ends, begins, side="right")
    begins, ends = begins[following < ends.size], ends[following[following < ends.size]]
    levels: Array = p[ends][p[ends] - p[begins] >= _LEAST_RISE]
    return levels


# --- Section 4.2: waveforms

_WAVEFORMS = ("sine", "square", "triangle")
_P_START = 25e5
"""pressure of the equilibrium at which the brake starts and rests under dither [Pa]"""


def waveforms(runs: Runs) -> Part:
    """Return loop, distortion and ripple for the three waveforms."""
    items: list[Item] = []
    for waveform in _WAVEFORMS:
        items += _items(runs, waveform)
    text = (
        "The paper prefers the sine for its low total harmonic distortion. Here the waveforms "
        "have equal amplitude. The 80 Hz filter and the current loop remove most of the harmonics, "
        "so at the motor the waveforms differ less in distortion than in amplitude. The square's "
        "fundamental is larger than the sine's (4/pi), the triangle's smaller (8/pi^2): "
        "the square frees the piston best and causes the largest pressure ripple."
    )
    loops = {
        waveform: runs.bench("friction-ramp", MAIN, _chosen(waveform)).recordings[_WITH]
        for waveform in _WAVEFORMS
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
    loops = _Loops(runs.bench("friction-ramp", MAIN, chosen))
    rest = runs.bench(
        "pressure-step", MAIN, chosen, {"p_start": _P_START, "i_step": 1e-9, "settle": 3.0}
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
            "pressure ripple, peak to peak, at the current that holds 25 bar without friction",
        ),
        found(f"{prefix}.p_max", "bar", loops.p_max(_WITH), "on the ramp of eq. (17)"),
        found(
            f"{prefix}.loop_area_ratio",
            "%",
            loops.area_ratio,
            "area with dither over the area without, on the ramp of eq. (17)",
        ),
        found(
            f"{prefix}.share_stuck",
            "%",
            100.0 * loops.values["share_stuck_dithered"],
            "of the time, on the ramp of eq. (17)",
        ),
    ]
