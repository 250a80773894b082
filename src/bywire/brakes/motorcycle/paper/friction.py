"""Friction and dither: Table 3, Figs. 4 and 5, section 4.2, eq. (19)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.response.sweep import amplitudes, total_distortion
from bywire.bench.bench import Bench
from bywire.bench.experiment import as_run
from bywire.bench.kpis import hysteresis
from bywire.bench.kpis.hysteresis import closed_above
from bywire.bench.kpis.samples import smoothed
from bywire.bench.running import Result
from bywire.brakes.motorcycle.methods import friction_ramp
from bywire.brakes.motorcycle.paper.facts import ALLOWANCES, FACTS
from bywire.brakes.motorcycle.paper.runs import BAR, MAIN, SETS, Runs, parameters
from bywire.control import dither
from bywire.core.typing import Array
from bywire.identification.method import Effort, Identified
from bywire.plant import ball_screw_gear, seal_friction
from bywire.report.estimate_figures import method_curve
from bywire.report.friction_figures import hysteresis_loop, stribeck_curve
from bywire.reproduction.item import Fact, Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part, kpis, peak, selected
from bywire.simulation.run import simulate

if TYPE_CHECKING:
    import xarray as xr

P_EQ19 = 25e5
"""pressure at which eq. (19) is checked [Pa], as in Fig. 6"""
SEED = 1
OFF = {"k_brk_p": 0.9, "f_cfr_p": 0.8, "c": 1.2, "f_cfr_n": 1.2, "k_brk_n": 1.1, "T_pr": 1.2}
"""starting values of the search, relative to the true values"""


def table3(runs: Runs) -> Part:
    """Return the friction parameters in use, Fig. 4's extremes, and two disagreements."""
    par = parameters(MAIN)
    used = par.seal.flat()
    items: list[Item] = [
        compared(f"table3.{name}", fact, used[name], None, "used as published", tuned="an input")
        for name, fact in FACTS.table("table3").items()
    ]
    curve = runs.bench("seal-stribeck", MAIN).recordings["curve"]
    torque = curve["T_fr"].values
    bare = par.seal.k_brk_p * par.seal.f_cfr_p * float(curve["p_mc"].values[-1])
    items += [
        compared(
            "fig4.top_tick",
            FACTS["fig4_top"],
            float(np.max(torque)),
            note="breakaway torque at 40 bar from Table 3 with the chosen T_pr = "
            f"{par.seal.T_pr:g} N·m; "
            f"{bare:.3g} N·m without T_pr. The curves do not come from the printed values",
        ),
        compared(
            "fig4.bottom_tick",
            FACTS["fig4_bottom"],
            float(np.min(torque)),
            note="release side at 40 bar",
        ),
        _viscous(par.seal.mu_T / par.gear.k_g),
        _eq19(),
        *_identified_items(),
    ]
    text = (
        "We use Table 3 as published. Only the preload T_pr, which Table 3 omits, is our choice. "
        "Where the curves are vertical, the piston sticks, and the torque can have any value "
        "between both ends."
    ) + _undetermined()
    exhibit = Exhibit(
        "fig4",
        lambda: stribeck_curve(curve),
        "Fig. 4: friction torque at the motor shaft versus speed.",
    )
    return Part(
        "Table 3 and Figure 4: friction", text, tuple(items), (exhibit, _identified_exhibit())
    )


def _viscous(mu_F: float) -> Item:
    """Compare the text's viscous coefficient with Table 3's."""
    return compared(
        "section3.mu",
        FACTS["mu_text"],
        mu_F,
        note="two values for one effect: Table 3's torque per shaft speed mu_T gives the force per "
        "shaft speed mu_F = mu_T/k_g. Both are negligible compared with k_damp. The models use "
        "Table 3's value",
    )


def _eq19() -> Item:
    """Compare the breakaway current according to eq. (8) with eq. (19)'s."""
    bare = {"seal.T_pr": 0.0, "ecu.est_par.T_pr": 0.0}  # not printed
    par = parameters(MAIN).replace(bare)
    seal = seal_friction.output(seal_friction.Input(0.0, P_EQ19), par.seal)
    bounds = ball_screw_gear.friction_bounds(seal.T_p, seal.T_n, 0.0, par.gear)
    needed = -bounds.low / (par.gear.eta_g * par.motor.K_e)
    stated = dither.breakaway_current(P_EQ19, par.ecu.est_par)
    return compared(
        "eq19.A_dit",
        Fact(stated, "A", "eq. (19) at 25 bar with Tables 1 and 3, T_pr = 0"),
        needed,
        ALLOWANCES["printed"],
        "breakaway current above the holding current according to eq. (8): eq. (19) omits eta_g",
    )


@cache
def _identified() -> Identified:
    """Identify the friction from a simulated ramp (17), starting away from the true values."""
    par = parameters(MAIN)
    seal = par.seal.flat()
    start = par.replace({f"seal.{name}": share * seal[name] for name, share in OFF.items()})
    options = friction_ramp.METHOD.defaults
    data = friction_ramp.METHOD.synthetic(par, options, SEED)
    return friction_ramp.METHOD.identify(data, start, options, Effort(starts=1))


def _identified_items() -> list[Item]:
    """Compare the estimates with Table 3's values, which the simulation uses."""
    estimate = _identified().estimates["seal friction"]
    ends = dict(zip(estimate.names, estimate.intervals().tolist(), strict=True))
    rows: list[Item] = []
    for name, fact in FACTS.table("table3").items():
        label = f"seal.{name}"
        if label not in ends:
            continue
        low, high = ends[label]
        rows.append(
            compared(
                f"table3.identified.{name}",
                fact,
                estimate[label],
                None,
                "identified from our own ramp, simulated with this value. 95 % interval "
                f"{low:.4g} to {high:.4g}. The search started "
                f"{100.0 * (OFF[name] - 1.0):+.0f} % off",
            )
        )
    return rows


def _undetermined() -> str:
    """Return a sentence on the parameters that the ramp does not determine."""
    kept = _identified().estimates["seal friction"].kept
    if not kept:
        return ""
    names = " and ".join(k.unknown.name.removeprefix("seal.") for k in kept)
    return f" The ramp of eq. (17), identified on our own brake, does not determine {names}."


def _identified_exhibit() -> Exhibit:
    """Return Fig. 4 as identified, with its confidence bands."""
    curve = next(c for c in _identified().curves if c.name == "stribeck")
    widest = float((curve.data["high"] - curve.data["value"]).max())
    return Exhibit(
        "fig4-identified",
        lambda: method_curve(curve),
        "Fig. 4 as identified on our own brake from one ramp with sensor noise. Bands: 95 % "
        f"confidence, at most {widest:.1g} N·m on either side.",
    )


# --- Fig. 5 and section 4.2: the slow ramp, and the dither's waveform

_WITHOUT, _WITH = "without-dither", "with-dither"
_REMOVED = 0.1
"""width below which a loop is treated as removed, relative to the undithered loop's at
mid-height"""
_SLOWER = 10.0
"""how many times slower than eq. (17) the slow ramp is"""
_LEVELS = np.arange(ALLOWANCES["level"].size, 45.0, 0.1) * BAR
_LEAST_RISE = (
    0.1e5  # Pa: smaller steps, for example from the converter's resolution, are creep, not jumps
)
_DAMPINGS = (0.5, 1.0)
"""other damping ratios of the 80 Hz filter, because the paper prints none"""


@dataclass(frozen=True)
class _Loops:
    """The two loops of a parameter set, and their key figures."""

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
        """Return the maximum pressure [bar]."""
        return peak(self.result.recordings[label], "p_mc") / BAR

    @property
    def removed_above(self) -> float:
        """Pressure [bar] above which the dithered loop is treated as removed."""
        setting = hysteresis.Setting("i_filtered", "p_mc", smoothing=0.02)
        loop = hysteresis.select(self.result.recordings[_WITH], setting)
        width = _REMOVED * self.values["loop_width_mid_undithered"]
        return closed_above(loop, width, _LEVELS) / BAR

    @property
    def dither_passed(self) -> float:
        """Motor current amplitude relative to the dither amplitude [%], halfway up the ramp."""
        recording = self.result.recordings[_WITH]
        t = recording["time"].values
        inside = (t > 12.0 - 1e-9) & (t < 12.5 - 1e-9)
        sent, got = (
            np.abs(_ripple(t[inside], recording[name].values[inside])) for name in ("i_dit", "i")
        )
        return float(100.0 * got / sent)


def fig5(runs: Runs) -> Part:
    """Return the ramp of eq. (17) for both parameter sets."""
    items: list[Item] = []
    for name, suffix in SETS.items():
        items += _set_items(name, suffix, _Loops(runs.bench("friction-ramp", name)))
    for zeta in _DAMPINGS:
        other = _Loops(runs.bench("friction-ramp", MAIN, {"ecu.filter.zeta": zeta}))
        note = f"with a damping ratio of {zeta:g} for the 80 Hz filter; ours is 1/sqrt(2)"
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
            "without dither, with converters of infinite resolution: the jumps are slightly higher",
        )
    )
    text = (
        "Without dither the pressure climbs in stick-slip jumps. With dither the loop shrinks to "
        "a fraction. Most of the remaining loop is delay, not friction hysteresis: on a ramp that "
        "is ten times slower, almost nothing remains. Dither turns dry friction into damping, "
        "which makes the brake slower. It also lowers the gain, because the seals have more "
        "friction while applying. The maximum pressure depends on how much of the dither reaches "
        "the motor, and therefore on the damping of the 80 Hz filter, which the paper does not "
        "print."
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
        "Fig. 5 with the axes swapped: pressure versus measured current (20 Hz low-pass filter) "
        "during the slow ramp, averaged over one dither period. Pale lines include the ripple. "
        f"Parameter set {name}.",
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
            note="ratio of the loop area with dither to the area without, averaged over one dither "
            "period: mostly delay",
        ),
        compared(
            f"fig5.loop_area_ratio.slow{suffix}",
            FACTS["fig5_loop"],
            slow,
            note=f"the same ratio on a ramp that is {_SLOWER:g} times slower: friction alone",
        ),
        compared(
            f"fig5.removed_above{suffix}",
            FACTS["fig5_removed"],
            loops.removed_above,
            note=f"pressure above which the width stays below {100 * _REMOVED:g} % of the "
            "undithered loop's at mid-height. The lowest evaluated level is "
            f"{ALLOWANCES['level'].size:g} bar",
        ),
        compared(
            f"fig5.i_max.dither{suffix}",
            FACTS["fig5_current"],
            peak(loops.result.recordings[_WITH], "i_filtered"),
            note="measured current after the 20 Hz low-pass filter: the ripple from eq. (20)'s "
            "dither exceeds the range of the figure",
        ),
        found(f"fig5.jumps{suffix}", "1", float(jumps.size), f"ending at {levels} bar"),
        found(
            f"fig5.share_stuck{suffix}",
            "%",
            100.0 * values["share_stuck_undithered"],
            "fraction of time stuck, without dither",
        ),
        found(
            f"fig5.share_stuck.dither{suffix}",
            "%",
            100.0 * values["share_stuck_dithered"],
            "fraction of time stuck, with dither",
        ),
        found(
            f"fig5.dither_passed{suffix}",
            "%",
            loops.dither_passed,
            "motor current at 50 Hz relative to the dither, through the 80 Hz filter and the "
            "current loop. Section 4.2 states without a number that the loop tracks the dither "
            "correctly",
        ),
    ]


def _slow_area(name: str) -> float:
    """Return the dithered loop's area [A Pa] on a slower ramp from only two signals."""
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
    """Return the pressures [Pa] at which slips between two sticking phases ended, shape (n,)."""
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
"""equilibrium pressure at which the brake starts and rests with dither [Pa]"""


def waveforms(runs: Runs) -> Part:
    """Return loop area, distortion and ripple for the three waveforms."""
    items: list[Item] = []
    for waveform in _WAVEFORMS:
        items += _items(runs, waveform)
    text = (
        "The paper prefers the sine for its low total harmonic distortion. Here the waveforms "
        "have equal amplitudes. The 80 Hz filter and the current loop remove most of the "
        "harmonics, so at the motor the waveforms differ less in distortion than in amplitude. "
        "The fundamental of the square wave is 4/pi times that of the sine, and the triangle's is "
        "8/pi^2 times. The square wave frees the piston best and causes the most pressure ripple."
    )
    loops = {
        waveform: runs.bench("friction-ramp", MAIN, _chosen(waveform)).recordings[_WITH]
        for waveform in _WAVEFORMS
    }
    exhibit = Exhibit(
        "dither-waveforms",
        lambda: hysteresis_loop(loops, "p_mc", "i_filtered", "i_star", average=0.02),
        "The ramp of eq. (17) with three dither waveforms, averaged over one dither period.",
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
        found(f"{prefix}.thd", "%", sent, "harmonic distortion of the sampled dither"),
        found(f"{prefix}.thd.motor", "%", got, "harmonic distortion of the motor current"),
        found(
            f"{prefix}.ripple",
            "bar",
            float(np.ptp(window["p_mc"].values)) / BAR,
            "peak-to-peak pressure ripple at the current that holds 25 bar without friction",
        ),
        found(f"{prefix}.p_max", "bar", loops.p_max(_WITH), "on the ramp of eq. (17)"),
        found(
            f"{prefix}.loop_area_ratio",
            "%",
            loops.area_ratio,
            "ratio of the loop area with dither to the area without, on the ramp of eq. (17)",
        ),
        found(
            f"{prefix}.share_stuck",
            "%",
            100.0 * loops.values["share_stuck_dithered"],
            "fraction of time stuck, on the ramp of eq. (17)",
        ),
    ]
