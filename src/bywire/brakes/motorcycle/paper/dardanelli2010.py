"""Dardanelli, Alli, Savaresi (2010), reproduced, and the root causes of disagreements."""

from __future__ import annotations

from collections.abc import Iterable

from bywire.brakes.motorcycle.paper import control, friction, gear, transfer_functions
from bywire.brakes.motorcycle.paper.facts import ALLOWANCES, CITATION, FACTS
from bywire.brakes.motorcycle.paper.runs import MAIN, Runs
from bywire.reproduction.item import Item, Quoted, RootCause, causes_of
from bywire.reproduction.reproduction import Reproduction, Source, reproduced


def _causes(items: Iterable[Item]) -> tuple[RootCause, ...]:
    """Return the root causes, with numbers from the items."""
    return causes_of(items, _tables, _gear, _gain, _bandwidth, _slow_pair, _hysteresis, _single)


def _tables(q: Quoted) -> RootCause:
    t1 = [q(f"table2.{key}@table1") for key in ("K", "zero", "pole1", "pole2")]
    t2 = [q.stated(f"table2.{key}") for key in ("K", "zero", "pole1", "pole2")]
    return RootCause(
        "Tables 1 and 2 contradict each other: Table 1 in eq. (15) gives a gain of "
        f"{t1[0]}, a zero of {t1[1]} and slow poles of {t1[2]} and {t1[3]}, where "
        f"Table 2 prints {t2[0]}, {t2[1]}, {t2[2]} and {t2[3]}. The calibrated set "
        f"changes five values, such as A_mc from {q.stated('calibrated.A_mc')} to "
        f"{q('calibrated.A_mc')}. With Table 1's light rotor, free to move, the "
        f"current loop's bandwidth falls from {q.stated('fig3.bandwidth.free')} to "
        f"{q('fig3.bandwidth.free@table1')}.",
        ("table2.*@table1", "fig3.bandwidth.free@table1"),
        is_within_source=True,
    )


def _gear(q: Quoted) -> RootCause:
    paper, ours = "gear.returned.paper", "gear.returned.directional"
    return RootCause(
        "Eq. (8) lets the gear create energy when the load drives it: a slow release "
        f"from 37 bar returns {q(paper)} of {q.stated(paper)} stored "
        f"({q.share(paper)}; with Table 1 {q.share(f'{paper}@table1')}), whereas a loss "
        f"that depends on direction returns {q(ours)} ({q.share(ours)}).",
        ("gear.returned.paper*",),
        is_within_source=True,
    )


def _gain(q: Quoted) -> RootCause:
    low, high = q("table4.low.K"), q("table4.high.K")
    return RootCause(
        "Table 3's friction under eq. (20)'s dither contradicts Table 4's gain, "
        f"because f_cfr,p exceeds f_cfr,n: {low} at low and {high} at high pressure "
        f"({q('table4.medium.K@table1')} with Table 1) instead of "
        f"{q.stated('table4.low.K')} and {q.stated('table4.high.K')}. With Table 4's gain, "
        f"Fig. 5's ramp would reach {q('table4.medium.p_ramp')}, but its axis "
        f"ends at {q.stated('table4.medium.p_ramp')}.",
        ("table4.*.K", "table4.*.K@table1"),
        is_within_source=True,
    )


def _bandwidth(q: Quoted) -> RootCause:
    return RootCause(
        "Dither turns friction into damping, which Table 4's models lack: on the full nonlinear "
        f"model with dither the small-signal bandwidth is {q('fig7.bandwidth')} "
        f"({q('fig7.bandwidth@table1')} with Table 1) instead of the required "
        f"{q.stated('fig7.bandwidth')}, and without control {q('table4.medium.corner')} instead "
        f"of {q.stated('table4.medium.corner')}. On Table 4's linear model, on which our gains "
        f"are tuned, the crossover is {q('fig7.crossover')} and the phase margin "
        f"{q('fig7.phase_margin')} (required {q.stated('fig7.crossover')}, "
        f"{q.stated('fig7.phase_margin')}), but the -3 dB bandwidth is only "
        f"{q('fig7.bandwidth.table4')}. Gains tuned on the nonlinear bench itself meet "
        f"all four requirements, with an overshoot of {q('requirements.overshoot@retuned')}.",
        (
            "fig7.bandwidth*",
            "table4.medium.corner*",
            "requirements.bandwidth*",
            "table4.*.identified.T[12]",
        ),
    )


def _slow_pair(q: Quoted) -> RootCause:
    zero, pole = q.stated("table4.medium.zero"), q.stated("table4.medium.T_L")
    return RootCause(
        f"Table 4 has the zero of its slow pair below the pole ({zero} and {pole} at "
        f"medium pressure), so its step response overshoots by {q.stated('table4.air')} "
        "and then falls. The paper attributes this to air, but 1 ml of air gives "
        f"{q('table4.air')}. On our brake, without air, the paper's two-step fit gives "
        f"{q('table4.medium.identified.zero')} and "
        f"{q('table4.medium.identified.T_L')}.",
        ("table4.air", "table4.*.identified.zero", "table4.*.identified.T_L"),
        is_within_source=True,
    )


def _hysteresis(q: Quoted) -> RootCause:
    ratio, slow = "fig5.loop_area_ratio", "fig5.loop_area_ratio.slow"
    return RootCause(
        "Some hysteresis remains with dither, although the paper calls it 'totally "
        f"removed'. It is mostly delay: {q(ratio)} of the loop's area without dither "
        f"({q(f'{ratio}@table1')} with Table 1), but {q(slow)} "
        f"({q(f'{slow}@table1')}) on a ramp ten times slower.",
        ("fig5.loop_area_ratio*", "fig5.removed_above*"),
    )


def _single(q: Quoted) -> RootCause:
    top, end, ripple = "fig4.top_tick", "fig5.p_max.dither", "fig5.i_max.dither"
    textbook = f"{FACTS['k_lf'].value:g}, whereas Hagen and Poiseuille's law has "
    return RootCause(
        f"Individual numbers: eq. (12)'s laminar coefficient is {textbook}"
        f"{q('laminar.coefficient')}. The text's mu of {q.stated('section3.mu')} is "
        f"{q('section3.mu')} according to Table 3. Eq. (19)'s {q.stated('eq19.A_dit')} at 25 bar "
        f"omits eta_g ({q('eq19.A_dit')}). The axes of Figs. 4 and 5 are too short for Table 3's "
        f"friction and dither ({q(top)} of {q.stated(top)}, {q(end)} of {q.stated(end)}, "
        f"{q(ripple)} of {q.stated(ripple)}).",
        ("laminar.*", "section3.mu", "eq19.*", "fig4.*", "fig5.p_max.dither", "fig5.i_max.*"),
        is_within_source=True,
    )


# --- The reproduction

PARTS = {
    "Table 1": transfer_functions.table1,
    "Table 2": transfer_functions.table2,
    "repair of Table 1": transfer_functions.repair,
    "Table 3, Fig. 4": friction.table3,
    "Fig. 3": control.fig3,
    "Fig. 5": friction.fig5,
    "waveforms": friction.waveforms,
    "Table 4": transfer_functions.table4,
    "Fig. 6": transfer_functions.fig6,
    "Fig. 7": control.fig7,
    "requirements": control.requirements,
    "gear": gear.part,
}
NAMES = {
    "": "Calibrated set, and results without a set",
    "table1": "Table 1 as printed (ids with @table1)",
    "retuned": "Gains retuned on the bench (ids with @retuned)",
}
"""titles of the parameter sets, keyed by the text after @ in an item's id"""

_ADVICE = (
    "Use the calibrated set, which is the default. Table 1 as printed is for comparison only. Tune "
    "gains on the nonlinear model with dither, because gains that are tuned on Table 4's linear "
    "models give a lower bandwidth on the brake. If the energy of a release matters, "
    'use the gear with law = "directional".'
)
SOURCE = Source(
    name=MAIN,
    summary="electro-mechanical brake-by-wire actuator for a sport motorbike, IFAC 2010",
    reproduce=lambda progress: reproduced(
        Reproduction(
            MAIN, CITATION, allowances=tuple(ALLOWANCES.values()), sets=NAMES, advice=_ADVICE
        ),
        Runs(progress),
        PARTS,
        _causes,
    ),
)
reproduce = SOURCE.reproduce
