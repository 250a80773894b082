"""The motorcycle brake as measured: Dardanelli et al.'s (2010) measurements and their best fit."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from bywire.brakes.motorcycle.paper.facts import CITATION, FACTS
from bywire.brakes.motorcycle.paper.measured import (
    FREE,
    HELD,
    PRIOR,
    STATEMENTS,
    Appraisal,
    Statement,
    allowances,
    appraised,
    overshoots,
    predicted,
    stuck_at,
)
from bywire.brakes.motorcycle.paper.runs import MAIN, PRINTED, Runs, parameters
from bywire.identification.estimate import Kept
from bywire.report.tables import Cell, Column, Table, text_table
from bywire.report.wording import amount
from bywire.reproduction.item import Item, Quoted, RootCause, causes_of, compared, found
from bywire.reproduction.reproduction import Part, Reproduction, Source, reproduced

NAME = "dardanelli2010-measured"
SETS = {NAME: "", MAIN: "@calibrated", PRINTED: "@table1"}
"""parameter sets, with the suffix of an item's id"""
TITLES = {
    "": "Estimated from these published values",
    "calibrated": "Calibrated to Table 2",
    "table1": "Table 1 as printed",
}

Values = dict[str, Mapping[str, float]]
_SMALL = 0.05  # A: a seventh of Fig. 6's step


@cache
def _best() -> Appraisal:
    return appraised(parameters(NAME))


def statements(runs: Runs) -> Part:
    """Return every statement with its counterparts from the parameter sets."""
    others = (MAIN, PRINTED)
    values: Values = {NAME: _best().computed}
    values |= dict(zip(others, predicted([parameters(name) for name in others]), strict=True))
    items = [_item(s, name, values[name][s.name]) for name in SETS for s in STATEMENTS]
    text = (
        "We assume that Table 4, Figs. 5 to 7 and the friction in Table 3 were measured on the "
        "real brake. Tables 1 and 2 come from data sheets and theory, so the fit does not use "
        "them. One fit estimates all free parameters. It minimizes the sum of the soft_l1 losses "
        "of the residuals, relative to their tolerances. The published values contradict each "
        "other, so with squares the largest residual would dominate. Agreement with a value proves "
        "nothing, because the fit used it. Disagreement means that the value contradicts the "
        "others, or that the model's structure cannot reproduce it. Here the converter is ideal."
    )
    return Part(
        "Measurements",
        text,
        tuple(items),
        tables={"Residuals in tolerances": _side_by_side(values)},
    )


def _item(s: Statement, name: str, value: float) -> Item:
    """Compare a statement with a set; a fitted statement is not evidence for the set."""
    r = s.residual(value)
    met = abs(r) <= 1.0
    fitted = name == NAME and met
    return compared(
        f"{s.name}{SETS[name]}",
        s.fact,
        value,
        note=f"residual {r:.2g} tolerances",
        tuned="calibrated"
        if fitted
        else "an input"
        if s.name.startswith("table3.") and met
        else "",
    )


def _side_by_side(values: Values) -> Table:
    """Return statements, tolerances, the sets' values, and residuals."""
    numeric = ["stated", "tolerance", MAIN, "this set", "residual"]
    rows = []
    for s in STATEMENTS:
        unit, r = s.fact.unit, s.residual(values[NAME][s.name])
        shown = (s.fact.value, s.tolerance, values[MAIN][s.name], values[NAME][s.name])
        verdict = Cell("explained", "good") if abs(r) <= 1.0 else Cell("unexplained", "bad")
        rows.append(
            (
                Cell(s.name),
                *(Cell(amount(v, unit), value=v) for v in shown),
                Cell(f"{r:.2f}", value=r),
                verdict,
            )
        )
    columns = (
        Column("statement"),
        *(Column(name, numeric=True) for name in numeric),
        Column("verdict"),
    )
    return Table(columns, tuple(rows))


def estimates(runs: Runs) -> Part:
    """Return the parameters with intervals and decisive statements, and the undetermined ones."""
    best = _best()
    names = best.estimate.names
    ends = dict(zip(names, best.estimate.intervals().tolist(), strict=True))
    prior = parameters(PRIOR).leaves()
    items = [
        found(
            f"estimated.{u.name}",
            u.unit,
            best.estimate[u.name],
            f"95 % interval {ends[u.name][0]:.3g} to {ends[u.name][1]:.3g} (Table 1's set: "
            f"{prior[u.name]:.3g}), determined by {' and '.join(best.deciding_statements(u.name))}",
        )
        for u in best.estimate.unknowns
    ]
    kept = [k.unknown.name for k in best.estimate.kept]
    text = (
        "The intervals treat the residuals as random, although most of them are contradictions. "
        "They show how tightly the published values together constrain a parameter, not how "
        "certain the parameter is. No published value determines "
        f"{' or '.join(kept) or 'the others'}, which stay at Table 1's values. In a product with a "
        "free parameter, such as A_mc k_g, the free parameter represents the whole product. A "
        "change of 1 % in any one parameter reduces the misfit by "
        f"at most {100.0 * max(best.gain(), 0.0):.1g} %."
    )
    more = best.estimate.notes
    tables = {
        "Estimated": _estimated(best, ends, prior),
        "Not determined": _undetermined(best.estimate.kept),
    }
    appendix = {
        "Free parameters: bounds": _bounds(),
        "Notes of the estimate": text_table(("note",), [(n,) for n in more]),
    }
    return Part("The estimate", text, tuple(items), tables=tables, appendix=appendix)


def _estimated(
    best: Appraisal, ends: Mapping[str, list[float]], prior: Mapping[str, float]
) -> Table:
    doubts = best.estimate.vague()
    rows = [
        (
            u.name,
            amount(prior[u.name], u.unit),
            amount(best.estimate[u.name], u.unit),
            f"{amount(ends[u.name][0], u.unit, 3)} to {amount(ends[u.name][1], u.unit, 3)}",
            ", ".join(best.deciding_statements(u.name)),
            doubts.get(u.name, ""),
        )
        for u in best.estimate.unknowns
    ]
    heading = ("parameter", "Table 1's set", "estimate", "95 % interval", "determined by", "doubt")
    return text_table(heading, rows)


def _undetermined(kept: tuple[Kept, ...]) -> Table:
    rows = [(k.unknown.name, amount(k.unknown.start, k.unknown.unit), k.reason) for k in kept]
    rows += [(name, "", reason) for name, reason in HELD.items()]
    return text_table(("parameter", "fixed at", "reason"), rows)


def _bounds() -> Table:
    return text_table(
        ("parameter", "from", "to", "reason"),
        [(name, f"{f.low:g}", f"{f.high:g}", f.reason) for name, f in FREE.items()],
    )


def beyond(runs: Runs) -> Part:
    """Return results that the root causes quote but the paper does not state."""
    par = parameters(NAME)
    printed = FACTS["table3.k_brk_p"].value
    softer = par.replace({"seal.k_brk_p": printed, "ecu.est_par.k_brk_p": printed})
    height = FACTS["fig6_step"].value
    small, paper = overshoots(par, "medium", (_SMALL, height))
    (without,) = overshoots(softer, "medium", (height,))
    of = "peak minus final value of a step from 25 bar, dither averaged out"
    items = (
        found("step.small.overshoot", "bar", small, f"{of}: {_SMALL:g} A"),
        found("step.overshoot", "bar", paper, f"{of}: {height:g} A as in Fig. 6"),
        found(
            "step.overshoot_by_table3",
            "bar",
            without,
            f"{of}: {height:g} A with k_brk_p = {printed:g} as printed",
        ),
        found(
            "ramp.p_max_without_dither", "bar", stuck_at(par), "maximum pressure of the ramp (17)"
        ),
    )
    text = (
        "With a slow pair, the overshoot is proportional to the step. This brake overshoots by "
        "nearly the same pressure at any step height. With the printed k_brk_p, from which the "
        "ECU computes the dither, its steps hardly overshoot. At the height of Fig. 6 the "
        "overshoot equals Table 4's, but a slow pair is not its cause."
    )
    return Part("Beyond the published values", text, items)


def _fast_pole(q: Quoted) -> RootCause:
    one, other, slow = "table4.medium.T2", "table4.high.T2", "table4.medium.T1"
    return RootCause(
        "Eq. (20)'s dither turns Table 3's friction into so much damping that the two "
        f"poles are far apart: T2 is {q(one)} instead of {q.stated(one)} at medium pressure, and "
        f"{q(other)} instead of {q.stated(other)} at high pressure. Where more dither reduces "
        "the damping, T2 approaches its stated value and T1 departs from it: T1 is "
        f"{q(slow)} instead of {q.stated(slow)} at medium pressure.",
        ("table4.*.T2*", "table4.medium.T1", "table4.high.T1"),
    )


def _slow_pair(q: Quoted) -> RootCause:
    name = "table4.low.overshoot"
    return RootCause(
        "Eqs. (13) have no slow zero below a slow pole: the step overshoots by "
        f"{q(name)} instead of {q.stated(name)} at low pressure. The overshoot at medium and "
        "high pressure does not come from a slow pair, because it hardly grows with the step: "
        f"{q('step.small.overshoot')} of a step of {_SMALL:g} A from 25 bar, and "
        f"{q('step.overshoot')} of a step seven times as high.",
        ("table4.*.overshoot*",),
        is_within_source=True,
    )


def _break_away(q: Quoted) -> RootCause:
    name = "table3.k_brk_p"
    return RootCause(
        "Overshoot and Table 3 contradict each other. The ECU dithers in proportion "
        f"to k_brk_p, which is {q(name)} instead of {q.stated(name)} and reduces the damping. "
        "With Table 3's value the step of Fig. 6 overshoots by "
        f"{q('step.overshoot_by_table3')} instead of {q('step.overshoot')}.",
        (name,),
        is_within_source=True,
    )


def _braking(q: Quoted) -> RootCause:
    return RootCause(
        "Only dithered friction damps this piston, because k_damp is zero. Therefore "
        f"hard braking reaches {q('fig7.peak')}, whereas Fig. 7a's axis allows "
        f"{q.stated('fig7.peak')} within half a label. More damping would remove the "
        "overshoot of the steps.",
        ("fig7.peak",),
    )


def _ramp(q: Quoted) -> RootCause:
    return RootCause(
        "Table 4's gain contradicts Fig. 5: with this gain the ramp to 5 A ends at "
        f"{q('fig5.p_max')}, whereas the figure's axis allows {q.stated('fig5.p_max')} "
        "within half a label.",
        ("fig5.p_max*",),
        is_within_source=True,
    )


def _ripple(q: Quoted) -> RootCause:
    return RootCause(
        "Eq. (20)'s dither exceeds the range of Fig. 5: after the 20 Hz "
        f"low-pass filter the measured current reaches {q('fig5.i_max')} instead of "
        f"{q.stated('fig5.i_max')}.",
        ("fig5.i_max*",),
        is_within_source=True,
    )


def _stuck(q: Quoted) -> RootCause:
    return RootCause(
        "The remaining loop with dither comes from the dithered brake's delay on the ramp, and "
        f"friction bends its ends. Its area is {q('fig5.loop_area_ratio')} of the loop "
        "without dither, in which the piston jumps, then sticks at "
        f"{q('ramp.p_max_without_dither')} and traces a small loop.",
        ("fig5.loop_area_ratio*",),
    )


_ADVICE = (
    "Use an estimate only together with its interval, and do not use one whose interval contains "
    "zero or that is at its bound. Measure the parameters under 'Not determined' on your own "
    "brake, because the paper's figures and tables do not determine them."
)
SOURCE = Source(
    name=NAME,
    summary="the motorcycle brake as measured: all parameters from Table 4, Figs. 5 to 7 and "
    "Table 3",
    reproduce=lambda progress: reproduced(
        Reproduction(NAME, CITATION, allowances=allowances(), sets=TITLES, advice=_ADVICE),
        Runs(progress),
        {"statements": statements, "estimate": estimates, "beyond": beyond},
        lambda items: causes_of(
            items, _fast_pole, _slow_pair, _break_away, _ramp, _ripple, _stuck, _braking
        ),
    ),
)
reproduce = SOURCE.reproduce
