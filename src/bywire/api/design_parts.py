"""Texts, tables and JSON objects of designs, gain schedules and their verification."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from bywire.analysis.loop_figures import LOOP_FIGURES
from bywire.analysis.margins import NO_LOOP
from bywire.api.loop_case import LoopCase
from bywire.bench.requirements import Limit
from bywire.core.callers import option
from bywire.core.parameters import leaf_fields
from bywire.core.units import shown
from bywire.report.document import Block, Flat, Listing, TableBlock
from bywire.report.tables import OUTCOMES, Cell, Table, amount_cell, text_table
from bywire.report.wording import amount
from bywire.studies.statistics import Outcome
from bywire.synthesis.bench_figures import BenchFigures
from bywire.synthesis.outcome import Across, Design, ScheduleDesign
from bywire.synthesis.schedules import scheduled
from bywire.synthesis.verification import Candidate, Verification

Part = str | Table
"""text line or table of a result"""
_PAIRS = 6


def verification_parts(
    case: LoopCase,
    nominal: Mapping[str, float],
    tried: Verification,
    with_probability: Collection[str] = (),
) -> list[Part]:
    """Return tables and text lines on the linear design and the retuned gains on the bench.

    ``nominal`` contains the figures of the linear design's nominal model, and ``with_probability``
    the texts of requirements that must also be met over distributions.
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
        parts.append(f"tested on the bench at the nominal point and at {'; '.join(labels)}{worst}")
    kept = {str(requirement) for requirement in tried.kept}
    for text, slack in tried.final.slacks.items():
        verdict = "met" if slack >= 0.0 else "NOT met"
        room = 100.0 * tried.final.room(text)
        also = "also enforced, " if text in kept else ""
        where = judged_on(tried.final, text)
        where += ", without random variation" if text in with_probability else ""
        parts.append(f"{also}{where}: {text} {verdict} ({room:+.1f} % of the limit)")
    conflict = tried.conflict()
    if conflict is not None:
        first, other, edge = conflict
        middle = sorted(sorted(edge, key=min)[-_PAIRS:])  # where both requirements are almost met
        pairs = "; ".join(f"{100 * a:+.1f} % and {100 * b:+.1f} %" for a, b in middle)
        parts.append(f"tradeoff between {first} and {other}, as margins to the limits: {pairs}")
    return parts


def judged_on(candidate: Candidate, text: str) -> str:
    """Return a text that states where a requirement was judged."""
    shown, possible = candidate.shown[text]
    if not shown:
        return "on the linear model"
    both = " and the linear model" if text.startswith("phase_margin") else ""
    part = "" if shown == possible else f" ({shown} of {possible} sines show it)"
    return f"on the bench{both}{part}"


def verdict_text(requirements: Sequence[Limit], tried: Verification) -> str:
    """Return the verdict on the requirements on the bench and on the linear model."""
    final = tried.final
    on_bench = [str(each) for each in requirements if final.shown[str(each)][0]]
    linear = [str(each) for each in requirements if not final.shown[str(each)][0]]
    parts = ((on_bench, "on the nonlinear bench"), (linear, "only on the linear model"))
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
    """Return the cell of a figure (see `_figure_text`)."""
    return Cell(_figure_text(name, value), value=value, unit=LOOP_FIGURES[name].unit)


def _figure_text(name: str, value: float) -> str:
    """Return a figure with its unit, and a gain margin also in dB."""
    text = amount(value, LOOP_FIGURES[name].unit, 3)
    if LOOP_FIGURES[name].in_decibel and math.isfinite(value) and value > 0.0:
        text += f" ({20.0 * math.log10(value):.3g} dB)"
    return text


def _figure_rows(
    case: LoopCase, where: str, columns: list[BenchFigures | None]
) -> list[list[str | Cell]]:
    """Return a trial's rows: figures of the sines and the step, with a column for each design."""

    def cell(figures: BenchFigures | None, k: int, name: str) -> Cell:
        if figures is None or not figures.small:
            return Cell("-")
        value, unit = getattr(figures.small[k], name), LOOP_FIGURES[name].unit
        if name == "crossover" and math.isinf(value):
            return Cell("none", value=value, unit=unit)
        return amount_cell(value, unit, 3)

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
    """Return the reasons for undefined figures, each reason once."""
    texts = [
        f"{n}, {case.loop.proof}, is not defined: {why}"
        for figures in tries
        for n, why in figures.reasons.items()
    ]
    for size in [small for figures in tries for small in figures.small]:
        if not math.isnan(size.phase_margin):
            continue
        if case.loop.laws is None:
            why = "the loop declares no control laws"
        elif size.peak == 0.0:
            why = "the output does not move"
        else:
            side = "above" if math.isinf(size.crossover) else "below"
            why = f"the loop gain stays {side} 1 at all measured frequencies"
        sine = amount(size.amplitude, case.input_unit, 3)
        names = "phase_margin is" if math.isinf(size.crossover) else "phase_margin, crossover are"
        texts.append(f"sine of {sine}: {names} not defined: {why}")
    return [*dict.fromkeys(texts)]


def _verification_object(case: LoopCase, tried: Verification) -> dict[str, Any]:
    """Return a verification as plain data."""
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


# --- A design


def as_object(
    case: LoopCase,
    requirements: Sequence[Limit],
    design: Design,
    tried: Verification | None,
) -> dict[str, Any]:
    """Return everything as plain data."""
    final = design.gains if tried is None else tried.final.gains
    return {
        "loop": case.loop.name,
        "parameters": case.name,
        "operating_point": {case.loop.at.name: case.value, "unit": case.loop.at.unit},
        "requirements": [str(requirement) for requirement in requirements],
        "status": design.status,
        "gains": dict(final),
        "gain_units": {name: _unit_of(case, name) for name in final},
        "linear": {
            "gains": dict(design.gains),
            "units": {name: figure.unit for name, figure in LOOP_FIGURES.items()},
            "nominal": dict(design.nominal),
            "worst": {k: {"value": v, "at": at} for k, (v, at) in design.worst.items()},
            "slack": design.slack,
            "kept": [str(requirement) for requirement in design.kept],
            "binding": [
                {
                    "requirement": str(binding.requirement),
                    "at": binding.case,
                    "value": binding.value,
                    "slack": binding.slack,
                }
                for binding in design.binding
            ],
            "unsound": dict(design.unsound),
            **({"missed_by_models": dict(design.missed)} if design.missed else {}),
            "conflicts": [
                {
                    "requirement": str(conflict.wanted),
                    "best": conflict.best,
                    "with": str(conflict.kept),
                    "excluded": conflict.excludes,
                }
                for conflict in design.conflicts
            ],
        },
        "bench": None if tried is None else _verification_object(case, tried),
    }


def as_parts(
    case: LoopCase,
    requirements: Sequence[Limit],
    design: Design,
    tried: Verification | None,
) -> list[Part]:
    """Return a design's tables and text lines."""
    at = case.loop.at
    point = f"{at.name} = {amount(case.value, at.unit)}"
    parts: list[Part] = [
        f"loop {case.loop.name} of {case.name} at {point}: linear design {design.status}"
    ]
    final = design.gains if tried is None else tried.final.gains
    heading = ["gain", "linear design"]
    rows = [[name, _gain_text(case, name, value)] for name, value in design.gains.items()]
    if tried is not None and tried.tuning is not None:
        heading.append("retuned on the bench")
        rows = [[*row, _gain_text(case, row[0], final[row[0]])] for row in rows]
    parts.append(text_table(heading, rows))
    wanted = {requirement.figure: str(requirement) for requirement in (*requirements, *design.kept)}
    figures = [
        [
            name,
            figure_cell(name, design.nominal[name]),
            figure_cell(name, design.worst[name][0]),
            design.worst[name][1],
            wanted.get(name, "").removeprefix(name).strip(),
        ]
        for name in sorted(LOOP_FIGURES, key=lambda name: name not in wanted)
    ]
    parts.append(text_table(["linear model", "nominal", "worst", "at", "limit"], figures))
    parts += _kept_lines(design) + _unsound_lines(design) + _missed_lines(design)
    parts += [
        f"{'binds' if design.binds else 'tightest'}: {binding.requirement}, "
        f"{_figure_text(binding.requirement.figure, binding.value)} at {binding.case}"
        for binding in design.binding
    ]
    parts += [
        f"{conflict.wanted}: at best {amount(conflict.best, conflict.wanted.unit, 3)} "
        f"with {conflict.kept}"
        for conflict in design.conflicts
    ]
    if tried is not None:
        probable = {str(each) for each in requirements if each.probability is not None}
        parts += verification_parts(case, design.nominal, tried, probable)
    return parts


def _kept_lines(design: Design) -> list[str]:
    """Return a line about figures that are enforced in addition to the requirements, if any."""
    if not design.kept:
        return []
    texts = ", ".join(str(requirement) for requirement in design.kept)
    return [f"also enforced: {texts} (to change a limit, add a requirement)"]


def _missed_lines(design: Design) -> list[str]:
    """Return a line for each requirement with a probability that some models miss."""
    return [
        f"{text}: {count} of the models for choosing the gains miss this limit, as its probability "
        "permits. The worst value above does not include them"
        for text, count in design.missed.items()
        if count and design.status == "met"
    ]


def _unsound_lines(design: Design) -> list[str]:
    """Return a line for each reason why models have no figures."""
    states = dict.fromkeys(design.unsound.values())
    return [
        f"{state}, at {', '.join(k for k, why in design.unsound.items() if why == state)}"
        for state in states
    ]


def limit_lines(case: LoopCase, limits: Mapping[str, tuple[float, float]]) -> list[str]:
    """Return a line about the limits that an ECU needs, if any."""
    if not limits:
        return []
    texts = [
        f"{name} = {_gain_text(case, name, low)}"
        if low == high
        else f"{name} >= {_gain_text(case, name, low)}"
        for name, (low, high) in limits.items()
    ]
    return [f"{_LIMITED}: {', '.join(texts)} ({option('free_derivative')} removes the limit)"]


def _unit_of(case: LoopCase, name: str) -> str:
    """Return the unit of a gain."""
    return leaf_fields(type(case.par))[name].unit.symbol


def _gain_text(case: LoopCase, name: str, value: float) -> str:
    """Return a gain with its unit as text."""
    return amount(value, _unit_of(case, name))


def requirement_table(
    requirements: Sequence[Limit],
    worst: Callable[[str], float],
    tried: Verification | None,
    outcomes: Mapping[str, Outcome],
) -> Table:
    """Return a row for each requirement and each figure also enforced, with the verdict first.

    ``worst(figure)``: worst value on the linear model, which decides if the bench was skipped;
    ``outcomes``: verdicts over distributions by requirement, which only limit a met requirement.
    """
    every = [*requirements, *(() if tried is None else tried.kept)]
    rows = []
    for each in every:
        text, value = str(each), worst(each.figure) if each.figure in LOOP_FIGURES else math.nan
        linear = "-" if math.isnan(value) else figure_cell(each.figure, value)
        if tried is None:
            is_met, room, where = bool(each.is_met(value)), "-", "on the linear model"
        else:
            is_met = tried.final.slacks[text] >= 0.0
            room = f"{100.0 * tried.final.room(text):+.1f} %"
            where = judged_on(tried.final, text)
        verdict = OUTCOMES["met" if is_met else "missed"]
        if is_met and outcomes.get(text, "met") != "met":
            verdict, where = OUTCOMES[outcomes[text]], "over the distributions"
        rows.append([verdict, text, linear, room, where])
    heading = ["verdict", "requirement", "linear model, worst", "margin to the limit", "judged"]
    return text_table(heading, rows)


def is_brief(part: Part) -> bool:
    """Return whether a terminal shows a part without ``--verbose``: gains, limits, conflicts.

    A missing loop explains why no requirement is met.
    """
    if isinstance(part, str):
        return ": at best " in part or part.startswith((_LIMITED, NO_LOOP))
    return part.columns[0].heading in _GAINS


_LIMITED = "limited for an ECU"
_GAINS = ("gain", "linear design", "retuned on the bench")
"""first headings of tables of gains: of one point, and of regions"""


def as_brief(parts: Sequence[Part]) -> list[str | Block]:
    """Return parts for a terminal."""
    return [part if isinstance(part, str) else TableBlock(part) for part in parts]


def as_blocks(parts: Sequence[Part]) -> list[Flat]:
    """Return the tables, and the text lines between them as lists."""
    blocks: list[Flat] = []
    lines: list[str] = []
    for part in [*parts, None]:
        if isinstance(part, str):
            lines.append(part.strip())
            continue
        if lines:
            blocks.append(Listing(lines))
            lines = []
        if part is not None:
            blocks.append(TableBlock(part))
    return blocks


# --- A gain schedule

_SEEN = (
    "bandwidth",
    "crossover",
    "phase_margin",
    "gain_margin",
    "lower_gain_margin",
    "disk_margin",
    "overshoot",
)


def schedule_as_object(
    case: LoopCase,
    requirements: Sequence[Limit],
    design: ScheduleDesign,
    tried: Verification | None,
    retuned: Sequence[Across],
) -> dict[str, Any]:
    """Return everything as plain data."""
    final = design.gains if tried is None else tried.final.gains
    at = case.loop.at
    return {
        "loop": case.loop.name,
        "parameters": case.name,
        "operating_points": {"unit": at.unit, **{k: list(v) for k, v in design.points.items()}},
        "borders": {name: case.par.leaves()[name] for name in scheduled(case.loop).borders},
        "requirements": [str(requirement) for requirement in requirements],
        "status": design.status,
        "gains": dict(final),
        "gain_units": {name: _unit_of(case, name) for name in final},
        "regions": {
            region: {
                "status": regional.status,
                "gains": dict(regional.gains),
                "slack": regional.slack,
                "binding": [
                    {
                        "requirement": str(b.requirement),
                        "at": b.case,
                        "value": b.value,
                        "slack": b.slack,
                    }
                    for b in regional.binding
                ],
            }
            for region, regional in design.regions.items()
        },
        "across": {
            "units": {name: figure.unit for name, figure in LOOP_FIGURES.items()},
            "cases": [_case(across, at.name) for across in design.across],
            "worst": _case(design.worst, at.name),
            "retuned": [_case(across, at.name) for across in retuned],
        },
        "bench": None if tried is None else _verification_object(case, tried),
    }


def _case(across: Across, name: str) -> dict[str, Any]:
    return {name: across.at, "region": across.region, "slack": across.slack, **dict(across.figures)}


def schedule_as_parts(
    case: LoopCase,
    design: ScheduleDesign,
    tried: Verification | None,
    retuned: Sequence[Across],
) -> list[Part]:
    """Return a gain schedule's tables and text lines.

    ``retuned`` is the loop across the regions with the bench's gains. It is empty if these gains
    equal those of the linear design.
    """
    at, leaves = case.loop.at, case.par.leaves()
    borders = " and ".join(
        shown(leaves[border], at.unit) for border in scheduled(case.loop).borders
    )
    parts: list[Part] = [
        f"gain schedule of loop {case.loop.name} of {case.name}, boundaries at {at.name} = "
        f"{borders}: linear design {design.status}",
        _gains(case, design, design.gains, "linear design"),
    ]
    if tried is not None and tried.tuning is not None:
        parts.append(_gains(case, design, tried.final.gains, "retuned on the bench"))
    for region, regional in design.regions.items():
        where = ", ".join(shown(point, at.unit) for point in design.points[region])
        bound = ", ".join(
            f"{b.requirement} ({_figure_text(b.requirement.figure, b.value)})"
            for b in regional.binding
        )
        word = "binds" if regional.binds else "tightest"
        parts.append(f"{region}, designed at {where}: {regional.status}; {word}: {bound}")
        parts += [f"  {line}" for line in _kept_lines(regional)]
        parts += [
            f"  {c.wanted}: at best {amount(c.best, c.wanted.unit, 3)} with {c.kept}"
            for c in regional.conflicts
        ]
    for title, across in (("linear design", design.across), ("retuned gains", retuned)):
        if across:
            parts.append(f"{title}, frozen gains, linear model, margin in % of the limit:")
            parts += _frozen(case, across)
    if tried is not None:
        parts += verification_parts(case, design.nominal, tried)
    return parts


def _frozen(case: LoopCase, across: Sequence[Across]) -> list[Part]:

    at = case.loop.at
    rows = [
        [
            f"{shown(row.at, at.unit)}",
            row.region,
            *(figure_cell(name, row.figures[name]) for name in _SEEN),
            f"{100.0 * row.slack:+.1f} %",
        ]
        for row in across
    ]
    worst = min(across, key=lambda row: row.slack)
    where = f"{at.name} = {shown(worst.at, at.unit)}"
    return [
        text_table([at.name, "region", *_SEEN, "least room"], rows),
        f"worst at {where}: {100.0 * worst.slack:+.1f} % of a limit",
    ]


def _gains(case: LoopCase, design: ScheduleDesign, gains: Mapping[str, float], title: str) -> Table:
    """Return a table of gains with one column for each region."""
    regions = scheduled(case.loop).regions
    cells: dict[str, dict[str, str]] = {}
    for region, spans in regions.items():
        for name in spans:
            if name in gains:
                cells.setdefault(name.rpartition(".")[2], {})[region] = _gain_text(
                    case, name, gains[name]
                )
    rows = [[name, *(row.get(region, "") for region in regions)] for name, row in cells.items()]
    return text_table([title, *regions], rows)
