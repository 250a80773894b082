"""Table of the margins of a loop, at a point or over a range."""

from __future__ import annotations

from collections.abc import Sequence

from bywire.analysis.robustness import LoopMargins, worst
from bywire.report.tables import Cell, Column, Table
from bywire.report.wording import amount, clean

UNITS = {
    "gain": "1", "phase": "deg", "crossover": "Hz", "delay": "s", "disk": "1", "sensitivity": "1",
    "complementary": "1", "bandwidth": "Hz",
}  # fmt: skip
"""unit of each margin"""
TITLES = {
    "gain": "gain margin", "phase": "phase margin", "delay": "delay margin", "disk": "disk margin",
    "sensitivity": "max |S|", "complementary": "max |T|",
}  # fmt: skip
"""headings that say more than the margin's name"""
LEGEND = (
    "Linear loop as it is sampled, dry friction left out. Gain margin as a factor; delay margin: "
    "dead time that may be added; disk margin: 2 is the best, 0 none; S, T: sensitivity and "
    "complementary sensitivity. Nothing is defined for an unstable loop."
)
"""what the headings mean"""


def margins_table(
    found: Sequence[LoopMargins], name: str = "", unit: str = "1", values: Sequence[float] = ()
) -> Table:
    """Return the table, with the values of the parameter that is varied in the first column.

    Parameters
    ----------
    found
        Margins, one row each.
    name, unit, values
        Parameter, its SI unit and its values; empty where nothing is varied.
    """
    heading = [*(TITLES.get(k, k) for k in UNITS), "stable"]
    rows = [
        (*(Cell(amount(getattr(one, k), unit, 3)) for k, unit in UNITS.items()),
         Cell("yes") if one.stable else Cell("NO", "bad"))
        for one in found
    ]  # fmt: skip
    if name:
        heading = [clean(name), *heading]
        rows = [(Cell(amount(v, unit)), *row) for v, row in zip(values, rows, strict=True)]
    return Table(tuple(map(Column, heading)), tuple(rows))


def worst_texts(
    found: Sequence[LoopMargins], name: str, unit: str, values: Sequence[float]
) -> list[str]:
    """Return where the loop is unstable, and the worst of each margin where it is stable."""
    lost = [amount(v, unit) for v, one in zip(values, found, strict=True) if not one.stable]
    kept = [(one, v) for v, one in zip(values, found, strict=True) if one.stable]
    texts = []
    if lost:
        where = lost[0] if len(lost) == 1 else f"{lost[0]} to {lost[-1]}"
        texts.append(f"unstable at {len(lost)} of {len(found)} values of {name} ({where})")
    if kept:
        texts += [
            f"{TITLES.get(k, k)} {amount(v, UNITS[k], 3)} at {name} = {amount(at, unit)}"
            for k, (v, at) in worst([one for one, _ in kept], [v for _, v in kept]).items()
        ]
    return texts
