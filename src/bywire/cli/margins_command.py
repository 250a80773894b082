"""``bywire margins``."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from textwrap import fill
from typing import Any

from bywire.analysis.robustness import LoopMargins, margins, over, worst
from bywire.cli import output
from bywire.cli.loop_choice import Chosen, choose, over_range, subject
from bywire.cli.output_folder import require_folder
from bywire.report.margins_table import LEGEND, UNITS, margins_table, worst_texts

_WIDTH = 100  # characters of a line


def execute(
    loop: str,
    parameters: str,
    at: str,
    changes: Mapping[str, str],
    range_: str,
    out: Path | None,
    as_json: bool,
) -> None:
    """Print the margins of a loop, at a point or over a range with the worst case."""
    if out is not None:
        require_folder(out)
    chosen = choose(loop, parameters, at, changes)
    if not range_:
        found, values, name = [margins(chosen.loop, chosen.par, chosen.value)], [math.nan], ""
        unit = "1"
    else:
        name, unit, values = over_range(range_, chosen)
        found = over(chosen.loop, chosen.par, chosen.value, name, values)
    files = [] if out is None else _written(chosen, (name, unit), values, found, out)
    if as_json:
        shown = _as_object(chosen, name, values, found)
        output.result(json.dumps({**shown, "files": [str(path) for path in files]}))
    else:
        output.result(_text(chosen, (name, unit), values, found))
    for path in files:
        output.message(f"written: {path}")


def _written(
    chosen: Chosen,
    range_: tuple[str, str],
    values: Sequence[float],
    found: Sequence[LoopMargins],
    out: Path,
) -> list[Path]:
    from bywire.analysis.loop_curves import Family, loop_curve, varied
    from bywire.report.margins_report import write_margins

    name, unit = range_
    loop = chosen.loop
    cases = [(chosen.par, chosen.value)]
    if name:
        cases = varied(loop, chosen.par, chosen.value, name, values)
    curves = [loop_curve(loop, *case, one) for case, one in zip(cases, found, strict=True)]
    family = Family(tuple(curves), name, unit, tuple(values))
    return write_margins(out, subject(chosen), loop.cut, family)


def _as_object(
    chosen: Chosen, name: str, values: Sequence[float], found: Sequence[LoopMargins]
) -> dict[str, Any]:
    rows = [_finite(asdict(one)) for one in found]
    shared = {
        "loop": chosen.loop.name,
        "parameters": chosen.name,
        "operating_point": {chosen.loop.at.name: chosen.value, "unit": chosen.loop.at.unit},
        "units": {**UNITS, "phase_at": "Hz"},
    }
    if not name:
        return {**shared, "margins": rows[0]}
    cases = [{name: value, **row} for value, row in zip(values, rows, strict=True)]
    least = {
        k: {"value": v if math.isfinite(v) else None, name: at}
        for k, (v, at) in worst(found, values).items()
    }
    return {**shared, "over": name, "cases": cases, "worst": least}


def _finite(row: dict[str, Any]) -> dict[str, Any]:
    """Return figures with null for what is infinite or not defined: JSON has no such numbers."""
    return {k: v if isinstance(v, bool) or math.isfinite(v) else None for k, v in row.items()}


def _text(
    chosen: Chosen, range_: tuple[str, str], values: Sequence[float], found: Sequence[LoopMargins]
) -> str:
    from bywire.report.table_text import table_text
    from bywire.report.wording import amount

    name, unit = range_
    at = chosen.loop.at
    point = f"{at.name} = {amount(chosen.value, at.unit)}"
    head = f"loop {chosen.loop.name} of {chosen.name} at {point}"
    table = table_text(margins_table(found, name, unit, values), _WIDTH)
    text = f"{head}, cut at {chosen.loop.cut}\n{table}"
    if name:
        text += "\nworst: " + "; ".join(worst_texts(found, name, unit, values))
    return f"{text}\n{fill(LEGEND, _WIDTH)}"
