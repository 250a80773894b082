"""What the nonlinear bench says of a design, in words and as a JSON object."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bywire.analysis.loop_figures import LOOP_FIGURES
from bywire.api.loop_case import LoopCase
from bywire.bench.requirements import Limit
from bywire.report.tables import Cell, Table, amount_cell, text_table
from bywire.report.wording import amount
from bywire.synthesis.bench_figures import BenchFigures
from bywire.synthesis.bench_tuning import Candidate
from bywire.synthesis.verification import Verification

Part = str | Table
"""a sentence or a table of a result"""
_PAIRS = 6


def verification_parts(
    case: LoopCase, nominal: Mapping[str, float], tried: Verification
) -> list[Part]:
    """Return tables and sentences on the linear design, and on the retuned gains, on the bench.

    ``nominal`` are the figures of the linear design's nominal model.
    """
    columns = [("linear design", tried.linear)]
    if tried.tuning is not None:
        columns.append(("retuned", tried.tuning.best))
    shown = [candidate for _, candidate in columns]
    rows = _figure_rows(case, "", [candidate.figures for candidate in shown])
    for label in tried.final.corners:
        rows += _figure_rows(
            case, f" at {label}", [candidate.corners.get(label) for candidate in shown]
        )
    for name in ("phase_margin", "gain_margin", "lower_gain_margin", "disk_margin"):
        both = [nominal, tried.nominal][: len(columns)]
        cells = [figure_cell(name, figures[name]) for figures in both]
        rows.append([f"{name}, linear model", *cells])
    parts: list[Part] = [text_table(["nonlinear bench", *(c for c, _ in columns)], rows)]
    tries = [candidate.figures for candidate in shown]
    tries += [figures for candidate in shown for figures in candidate.corners.values()]
    parts += _reasons(case, tries)
    if not tried.linear.figures.step and tried.kpis:
        kpis = [[kpi.name, amount(kpi.value, kpi.unit)] for kpi in tried.kpis]
        parts.append(text_table([case.loop.proof, "final gains"], kpis))
        parts += [f"{k.name} is not defined: {k.note}" for k in tried.kpis if math.isnan(k.value)]
    labels = tried.final.corners
    if labels:
        worst = f" (worst of {tried.corners} corners)" if len(labels) < tried.corners else ""
        parts.append(f"tried on the bench: at the nominal point, and at {'; '.join(labels)}{worst}")
    kept = {str(requirement) for requirement in tried.kept}
    for text, slack in tried.final.slacks.items():
        verdict = "met" if slack >= 0.0 else "NOT met"
        room = 100.0 * tried.final.room(text)
        also = "also kept, " if text in kept else ""
        where = judged_on(tried.final, text)
        parts.append(f"{also}{where}: {text} {verdict} ({room:+.1f} % of the limit)")
    conflict = tried.conflict()
    if conflict is not None:
        first, other, edge = conflict
        middle = sorted(sorted(edge, key=min)[-_PAIRS:])  # where both are nearly met
        pairs = "; ".join(f"{100 * a:+.1f} % and {100 * b:+.1f} %" for a, b in middle)
        parts.append(f"edge between {first} and {other}, as distance from the limits: {pairs}")
    return parts


def judged_on(candidate: Candidate, text: str) -> str:
    """Return where a requirement was judged, in words."""
    shown, possible = candidate.shown[text]
    if not shown:
        return "on the linear model"
    both = " and the linear model" if text.startswith("phase_margin") else ""
    part = "" if shown == possible else f" ({shown} of {possible} sines show it)"
    return f"on the bench{both}{part}"


def verdict_text(requirements: Sequence[Limit], tried: Verification) -> str:
    """Return whether requirements are met, and which part of them the bench shows."""
    final = tried.final
    on_bench = [str(each) for each in requirements if final.shown[str(each)][0]]
    linear = [str(each) for each in requirements if not final.shown[str(each)][0]]
    parts = ((on_bench, "on the nonlinear bench"), (linear, "on the linear model alone"))
    texts = []
    for names, where in parts:
        missed = sum(final.slacks[name] < 0.0 for name in names)
        if missed:
            texts.append(f"{missed} of {len(names)} not met {where}")
        elif names:
            texts.append(f"{len(names)} met {where}")
    if len(texts) == 1 and not any(final.slacks[str(each)] < 0.0 for each in requirements):
        return f"requirements met {parts[0][1] if on_bench else parts[1][1]}"
    return f"requirements: {', '.join(texts)}"


def figure_cell(name: str, value: float) -> Cell:
    """Return the cell of a figure; see `figure_text`."""
    return Cell(figure_text(name, value), value=value, unit=LOOP_FIGURES[name].unit)


def figure_text(name: str, value: float) -> str:
    """Return a figure with its unit; a gain margin as a factor and in dB."""
    text = amount(value, LOOP_FIGURES[name].unit, 3)
    if LOOP_FIGURES[name].in_decibel and math.isfinite(value) and value > 0.0:
        text += f" ({20.0 * math.log10(value):.3g} dB)"
    return text


def _figure_rows(
    case: LoopCase, where: str, columns: list[BenchFigures | None]
) -> list[list[str | Cell]]:
    """Return rows of one trial: what the sines and the step show, a column for each design."""

    def cell(figures: BenchFigures | None, k: int, name: str) -> Cell:
        if figures is None or not figures.small:
            return Cell("-")
        return amount_cell(getattr(figures.small[k], name), LOOP_FIGURES[name].unit, 3)

    sizes = next(
        ([s.amplitude for s in figures.small] for figures in columns if figures and figures.small),
        [],
    )
    rows: list[list[str | Cell]] = [
        [
            f"{name}, sine of {amount(size, case.input_unit, 3)}{where}",
            *(cell(figures, k, name) for figures in columns),
        ]
        for k, size in enumerate(sizes)
        for name in ("bandwidth", "phase_margin", "crossover")
    ]
    steps = next((tuple(figures.step) for figures in columns if figures and figures.step), ())
    for name in steps:
        cells = [
            amount_cell(figures.step.get(name) if figures else None, LOOP_FIGURES[name].unit, 3)
            for figures in columns
        ]
        rows.append([f"{name}, {case.loop.proof}{where}", *cells])
    return rows


def _reasons(case: LoopCase, tries: Sequence[BenchFigures]) -> list[Part]:
    """Return why figures are not defined, each reason once."""
    texts = [
        f"{n}, {case.loop.proof}, is not defined: {why}"
        for figures in tries
        for n, why in figures.reasons.items()
    ]
    for size in [small for figures in tries for small in figures.small]:
        if not math.isnan(size.phase_margin):
            continue
        if case.loop.laws is None:
            why = "the loop declares no laws"
        elif size.peak == 0.0:
            why = "the output does not move"
        else:
            side = "above" if math.isinf(size.crossover) else "below"
            why = f"the loop gain stays {side} 1 at all frequencies that were measured"
        sine = amount(size.amplitude, case.input_unit, 3)
        names = "phase_margin is" if math.isinf(size.crossover) else "phase_margin, crossover are"
        texts.append(f"sine of {sine}: {names} not defined: {why}")
    return [*dict.fromkeys(texts)]


def verification_object(case: LoopCase, tried: Verification) -> dict[str, Any]:
    """Return the same as plain data."""
    conflict = tried.conflict()
    return {
        "met": tried.met,
        "corners_looked_at": tried.corners,
        "retuned": tried.tuning is not None,
        "candidates": 0 if tried.tuning is None else tried.tuning.count,
        "linear_design": _candidate(tried.linear),
        "final": _candidate(tried.final),
        "final_linear": dict(tried.nominal),
        "kept": [str(requirement) for requirement in tried.kept],
        "experiment": case.loop.proof,
        "kpis": {kpi.name: {"value": kpi.value, "unit": kpi.unit} for kpi in tried.kpis},
        "conflict": None
        if conflict is None
        else {
            "requirements": list(conflict[:2]),
            "slacks": [list(pair) for pair in conflict[2]],
        },
    }


def _candidate(candidate: Candidate) -> dict[str, Any]:
    return {
        "gains": dict(candidate.gains),
        **_figures(candidate.figures),
        "corners": {label: _figures(corner) for label, corner in candidate.corners.items()},
        "slacks": {text: candidate.room(text) for text in candidate.slacks},
        "judged_on": {text: judged_on(candidate, text) for text in candidate.slacks},
    }


def _figures(figures: BenchFigures) -> dict[str, Any]:
    return {
        "sines": [
            {
                "amplitude": s.amplitude,
                "bandwidth": s.bandwidth,
                "phase_margin": s.phase_margin,
                "crossover": s.crossover,
                "peak": s.peak,
                "settled": s.settled,
            }
            for s in figures.small
        ],
        "step": dict(figures.step),
    }
