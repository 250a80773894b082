"""A design in words and as a JSON object."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bywire.analysis.design.bench_tuning import Candidate
from bywire.analysis.design.outcome import Design
from bywire.analysis.design.requirement import FIGURES, Requirement
from bywire.analysis.design.verification import Verification
from bywire.cli.loop_choice import Chosen
from bywire.core.parameters import leaf_fields

_PAIRS = 6


def as_object(
    chosen: Chosen,
    requirements: Sequence[Requirement],
    found: Design,
    tried: Verification | None,
    files: Sequence[Path],
) -> dict[str, Any]:
    """Return everything as plain data; null for what is infinite or not defined."""
    final = found.gains if tried is None else tried.final.gains
    return {
        "loop": chosen.loop.name,
        "parameters": chosen.name,
        "operating_point": {chosen.loop.at.name: chosen.value, "unit": chosen.loop.at.unit},
        "requirements": [one.text for one in requirements],
        "status": found.status,
        "gains": dict(final),
        "gain_units": {name: _unit(chosen, name) for name in final},
        "linear": {
            "gains": dict(found.gains),
            "units": {name: kind.unit for name, kind in FIGURES.items()},
            "nominal": _finite(found.nominal),
            "worst": {k: {"value": _number(v), "at": at} for k, (v, at) in found.worst.items()},
            "slack": _number(found.slack),
            "binding": [
                {"requirement": one.requirement.text, "at": one.case,
                 "value": _number(one.value), "slack": _number(one.slack)}
                for one in found.binding
            ],
            "conflicts": [
                {"requirement": one.wanted.text, "best": _number(one.best), "with": one.kept.text,
                 "excluded": one.excludes}
                for one in found.conflicts
            ],
        },
        "bench": None if tried is None else _bench(chosen, tried),
        "files": [str(path) for path in files],
    }  # fmt: skip


def as_text(
    chosen: Chosen,
    requirements: Sequence[Requirement],
    found: Design,
    tried: Verification | None,
) -> str:
    """Return what a person wants to know, in tables."""
    from bywire.report.table_text import table_text
    from bywire.report.tables import text_table
    from bywire.report.wording import amount

    at = chosen.loop.at
    point = f"{at.name} = {amount(chosen.value, at.unit)}"
    parts = [f"loop {chosen.loop.name} of {chosen.name} at {point}: linear design {found.status}"]
    final = found.gains if tried is None else tried.final.gains
    heading = ["gain", "linear design"]
    rows = [[name, _gain(chosen, name, value)] for name, value in found.gains.items()]
    if tried is not None and tried.tuning is not None:
        heading.append("retuned on the bench")
        rows = [[*row, _gain(chosen, row[0], final[row[0]])] for row in rows]
    parts.append(table_text(text_table(heading, rows)))
    wanted = {one.figure: one.text for one in requirements}
    figures = [
        [
            name,
            amount(found.nominal[name], kind.unit, 3),
            amount(found.worst[name][0], kind.unit, 3),
            found.worst[name][1],
            wanted.get(name, "").removeprefix(name).strip(),
        ]
        for name, kind in FIGURES.items()
    ]
    parts.append(table_text(text_table(["linear", "nominal", "worst", "at", "wanted"], figures)))
    parts += [
        f"binds: {one.requirement.text}, {amount(one.value, one.requirement.unit, 3)} at {one.case}"
        for one in found.binding
    ]
    parts += [
        f"{one.wanted.text}: at best {amount(one.best, one.wanted.unit, 3)} with {one.kept.text}"
        for one in found.conflicts
    ]
    if tried is not None:
        parts.append(_bench_text(chosen, found, tried))
    return "\n".join(parts)


def _bench_text(chosen: Chosen, found: Design, tried: Verification) -> str:
    from bywire.report.table_text import table_text
    from bywire.report.tables import text_table
    from bywire.report.wording import amount

    columns = [("linear design", tried.linear)]
    if tried.tuning is not None:
        columns.append(("retuned", tried.tuning.best))
    rows: list[list[str]] = []
    for k, small in enumerate(tried.linear.figures.small):
        size = amount(small.amplitude, _input_unit(chosen), 3)
        for name in ("bandwidth", "phase_margin", "crossover"):
            unit = FIGURES[name].unit
            cells = [
                amount(getattr(one.figures.small[k], name), unit, 3) if one.figures.small else "-"
                for _, one in columns
            ]
            rows.append([f"{name}, sine of {size}", *cells])
    for name in tried.linear.figures.step:
        cells = [amount(one.figures.step.get(name), FIGURES[name].unit, 3) for _, one in columns]
        rows.append([f"{name}, {chosen.loop.proof}", *cells])
    for name in ("phase_margin", "gain_margin", "disk_margin"):
        both = [found.nominal, tried.nominal][: len(columns)]
        cells = [amount(one[name], FIGURES[name].unit, 3) for one in both]
        rows.append([f"{name}, linear model", *cells])
    parts = [table_text(text_table(["nonlinear bench", *(c for c, _ in columns)], rows))]
    if not tried.linear.figures.step and tried.kpis:
        kpis = [[one.name, amount(one.value, one.unit)] for one in tried.kpis]
        parts.append(table_text(text_table([chosen.loop.proof, "final gains"], kpis)))
    for text, slack in tried.final.slacks.items():
        verdict = "met" if slack >= 0.0 else "NOT met"
        parts.append(f"on the bench: {text} {verdict} ({100.0 * slack:+.1f} % of the limit)")
    conflict = tried.conflict()
    if conflict is not None:
        one, other, edge = conflict
        middle = sorted(sorted(edge, key=min)[-_PAIRS:])  # where both are nearly met
        pairs = "; ".join(f"{100 * a:+.1f} % and {100 * b:+.1f} %" for a, b in middle)
        parts.append(f"edge between {one} and {other}, as distance from the limits: {pairs}")
    return "\n".join(parts)


def _bench(chosen: Chosen, tried: Verification) -> dict[str, Any]:
    conflict = tried.conflict()
    return {
        "met": tried.met,
        "retuned": tried.tuning is not None,
        "candidates": 0 if tried.tuning is None else len(tried.tuning.tried),
        "linear_design": _candidate(tried.linear),
        "final": _candidate(tried.final),
        "final_linear": _finite(tried.nominal),
        "experiment": chosen.loop.proof,
        "kpis": {one.name: {"value": _number(one.value), "unit": one.unit} for one in tried.kpis},
        "conflict": None if conflict is None else {
            "requirements": list(conflict[:2]),
            "slacks": [list(pair) for pair in conflict[2]],
        },
    }  # fmt: skip


def _candidate(one: Candidate) -> dict[str, Any]:
    return {
        "gains": dict(one.gains),
        "sines": [
            {"amplitude": s.amplitude, "bandwidth": _number(s.bandwidth),
             "phase_margin": _number(s.phase_margin), "crossover": _number(s.crossover),
             "peak": _number(s.peak), "settled": s.settled}
            for s in one.figures.small
        ],
        "step": _finite(one.figures.step),
        "slacks": _finite(one.slacks),
    }  # fmt: skip


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _finite(values: Mapping[str, float]) -> dict[str, float | None]:
    return {name: _number(value) for name, value in values.items()}


def _unit(chosen: Chosen, name: str) -> str:
    return leaf_fields(type(chosen.par))[name].unit.symbol


def _gain(chosen: Chosen, name: str, value: float) -> str:
    from bywire.report.wording import amount

    return amount(value, _unit(chosen, name))


def _input_unit(chosen: Chosen) -> str:
    from bywire.core.signals import signals_of

    model = chosen.loop.point(chosen.par, chosen.value).model
    return signals_of(model.Stimulus)[chosen.loop.inputs[0]].unit
