"""``bywire margins``."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from bywire.analysis.robustness import LoopMargins, margins, over, worst
from bywire.cli import output
from bywire.cli.loop_choice import Chosen, choose, over_range

UNITS = {
    "gain": "1", "phase": "deg", "crossover": "Hz", "delay": "s", "disk": "1", "sensitivity": "1",
    "complementary": "1", "bandwidth": "Hz",
}  # fmt: skip


TITLES = {
    "gain": "gain margin", "phase": "phase margin", "delay": "delay margin", "disk": "disk margin",
    "sensitivity": "max |S|", "complementary": "max |T|",
}  # fmt: skip
LEGEND = (
    "Linear loop as it is sampled, dry friction left out. Gain margin as a factor; delay margin: "
    "dead time\nthat may be added; disk margin: 2 is the best, 0 none; S, T: sensitivity and "
    "complementary sensitivity.\nNothing is defined for an unstable loop."
)


def execute(
    loop: str, parameters: str, at: str, changes: Mapping[str, str], range_: str, as_json: bool
) -> None:
    """Print the margins of a loop, at a point or over a range with the worst case."""
    chosen = choose(loop, parameters, at, changes)
    if not range_:
        found, values, name = [margins(chosen.loop, chosen.par, chosen.value)], [math.nan], ""
        unit = "1"
    else:
        name, unit, values = over_range(range_, chosen)
        found = over(chosen.loop, chosen.par, chosen.value, name, values)
    if as_json:
        output.result(json.dumps(_as_object(chosen, name, values, found)))
    else:
        output.result(_text(chosen, (name, unit), values, found))


def _as_object(
    chosen: Chosen, name: str, values: Sequence[float], found: Sequence[LoopMargins]
) -> dict[str, Any]:
    rows = [_finite(asdict(one)) for one in found]
    shared = {
        "loop": chosen.loop.name,
        "parameters": chosen.name,
        "operating_point": {chosen.loop.at.name: chosen.value, "unit": chosen.loop.at.unit},
        "units": UNITS,
    }
    if not name:
        return {**shared, "margins": rows[0]}
    cases = [{name: value, **row} for value, row in zip(values, rows, strict=True)]
    least = {k: {"value": v, name: at} for k, (v, at) in worst(found, values).items()}
    return {**shared, "over": name, "cases": cases, "worst": least}


def _finite(row: dict[str, Any]) -> dict[str, Any]:
    """Return figures with null for what is infinite or not defined: JSON has no such numbers."""
    return {k: v if isinstance(v, bool) or math.isfinite(v) else None for k, v in row.items()}


def _text(
    chosen: Chosen, range_: tuple[str, str], values: Sequence[float], found: Sequence[LoopMargins]
) -> str:
    from bywire.report.table_text import table_text
    from bywire.report.tables import text_table
    from bywire.report.wording import amount

    name, own_unit = range_

    def cells(one: LoopMargins) -> list[str]:
        figures = [amount(getattr(one, k), unit, 3) for k, unit in UNITS.items()]
        return [*figures, "yes" if one.stable else "NO"]

    at = chosen.loop.at
    heading = [*(TITLES.get(k, k) for k in UNITS), "stable"]
    rows: list[list[str]] = [cells(one) for one in found]
    if name:
        heading = [name, *heading]
        rows = [[amount(v, own_unit), *row] for v, row in zip(values, rows, strict=True)]
    point = f"{at.name} = {amount(chosen.value, at.unit)}"
    head = f"loop {chosen.loop.name} of {chosen.name} at {point}"
    text = f"{head}, cut at {chosen.loop.cut}\n" + table_text(text_table(heading, rows))
    if name:
        least = worst(found, values)
        lines = [
            f"{TITLES.get(k, k)} {amount(v, UNITS[k], 3)} at {name} = {amount(v_at, own_unit)}"
            for k, (v, v_at) in least.items()
        ]
        text += "\nworst: " + "; ".join(lines)
    return f"{text}\n{LEGEND}"
