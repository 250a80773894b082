"""Margins and bandwidth of a loop as it is sampled, at a point or over a range."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from bywire.analysis.loop_curves import Family, loop_curve
from bywire.analysis.margins import LoopMargins, figures_at, margins_of, worst
from bywire.api.loop_case import LoopCase, loop_case, over_range
from bywire.report.answer import Answer, use_case
from bywire.report.document import (
    Banner,
    Document,
    FigureBlock,
    Listing,
    Paragraph,
    Section,
    TableBlock,
)
from bywire.report.tables import Cell, Column, Table
from bywire.report.wording import amount, clean

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
_CAPTIONS = {
    "loop-gain": "Loop gain as it is sampled; phase and gain margin as the spans in which they "
    "are read.",
    "nyquist": "Nyquist plot near -1; the shaded disk is what the disk margin keeps free.",
    "nichols": "Nichols chart with contours of |T|; shaded, what the disk margin keeps free.",
    "sensitivity": "Sensitivity S = 1/(1 + L) and complementary sensitivity T = L/(1 + L), with "
    "the limits that are usually asked for (Skogestad and Postlethwaite, section 2.4.3).",
}


@dataclass(frozen=True)
class Margins(Answer):
    """Margins of a loop.

    Parameters
    ----------
    case
        The loop, its parameters and its operating point.
    margins
        One for each value of the range; a single one without a range.
    name, unit, values
        Parameter that was varied, or the operating quantity, its SI unit and its values; empty
        without a range.
    """

    case: LoopCase
    margins: tuple[LoopMargins, ...]
    name: str = ""
    unit: str = "1"
    values: tuple[float, ...] = ()

    @cached_property
    def family(self) -> Family:
        """The loop gains with their margins, for figures."""
        case, cases = self.case, [(self.case.par, self.case.value)]
        if self.name:
            cases = case.loop.varied(case.par, case.value, self.name, self.values)
        curves = [loop_curve(case.loop, figures_at(case.loop, *each)) for each in cases]
        return Family(tuple(curves), self.name, self.unit, self.values or (math.nan,))

    def document(self) -> Document:
        """Return table, worst cases and figures."""
        loop = self.case.loop
        table = TableBlock(margins_table(self.margins, self.name, self.unit, self.values))
        texts = worst_texts(self.margins, self.name, self.unit, self.values) if self.name else []
        worst_of = [Listing(texts, "Worst of each:")] if self.name else []
        ranged = " Emphasized: the least disk margin, or what is unstable. Dashed: unstable loops."
        figures = [
            FigureBlock(
                lambda kind=kind: _drawn(kind, self.family),  # type: ignore[misc]
                caption + (ranged if self.name else ""), f"{loop.name}-{kind}",
            )
            for kind, caption in _CAPTIONS.items()
        ]  # fmt: skip
        head = f"loop {loop.name} of {self.case.name} at {self.case.point}, cut at {loop.cut}"
        worst_line = ["worst: " + "; ".join(texts)] if self.name else []
        provenance = self.case.subject.provenance(
            f"Exact linear model of the sampled loop, cut at {loop.cut}."
        )
        return Document(
            f"Margins of loop {loop.name}",
            self.case.subject.line,
            sections=[
                Section("Margins", [*worst_of, table, Paragraph(LEGEND)]),
                Section("Figures", figures),
                provenance,
            ],
            brief=[head, table, *worst_line, Paragraph(LEGEND)],
            data=self._data(),
            banner=self._banner(),
            changes=self.case.subject.changes,
        )

    def _data(self) -> dict[str, Any]:
        rows = [asdict(margins) for margins in self.margins]
        shared = {**self.case.heading, "units": {**UNITS, "phase_at": "Hz"}}
        if not self.name:
            return {**shared, "margins": rows[0]}
        least = {
            key: {"value": value, self.name: at}
            for key, (value, at) in worst(self.margins, self.values).items()
        }
        cases = [{self.name: v, **row} for v, row in zip(self.values, rows, strict=True)]
        return {**shared, "over": self.name, "cases": cases, "worst": least}

    def _banner(self) -> Banner:
        unstable = sum(not margins.stable for margins in self.margins)
        if unstable:
            count = f"{unstable} of {len(self.margins)} loops unstable"
            return Banner(count if self.name else "unstable", "bad")
        return Banner("stable over the whole range" if self.name else "stable", "good")


@use_case
def margins(
    loop: str,
    parameters: str = "",
    at: str = "",
    overrides: Mapping[str, Any] = MappingProxyType({}),
    over: str = "",
) -> Margins:
    """Return margins and bandwidth of a loop as it is sampled.

    Parameters
    ----------
    loop
        Name of the loop.
    parameters
        Parameter set; the main one of the loop's brake by default.
    at
        Operating point with its unit, for instance ``"20 bar"``; the loop's own by default.
    overrides
        Other parameters by dotted name: SI numbers, or texts with units.
    over
        Range, for instance ``"motor.R_m=0.2 ohm:0.6 ohm:9"``, or ``"at=5 bar:35 bar:7"``.

    Returns
    -------
    Margins
        Gain margin as a factor, phase margin in degree, crossover and bandwidth in Hz, delay margin
        in s: at the operating point, or at each value of the range with the worst.

    Raises
    ------
    InputError
        For names that are unknown, values out of range, and sets of another brake.

    Examples
    --------
    >>> import bywire
    >>> found = bywire.margins("pressure", at="20 bar")
    >>> round(found.margins[0].phase)  # degree
    76
    """
    case = loop_case(loop, parameters, at, overrides)
    if not over:
        return Margins(case, (margins_of(figures_at(case.loop, case.par, case.value)),))
    name, unit, values = over_range(over, case)
    cases = case.loop.varied(case.par, case.value, name, values)
    each = tuple(margins_of(figures_at(case.loop, *point)) for point in cases)
    return Margins(case, each, name, unit, tuple(values))


def margins_table(
    margins_at: Sequence[LoopMargins], name: str = "", unit: str = "1", values: Sequence[float] = ()
) -> Table:
    """Return the table, with the values of the parameter that is varied in the first column.

    Parameters
    ----------
    margins_at
        Margins, one row each.
    name, unit, values
        Parameter, its SI unit and its values; empty where nothing is varied.
    """
    heading = [*(TITLES.get(k, k) for k in UNITS), "stable"]
    rows = [
        (*(_cell(getattr(margins, k), unit, 3) for k, unit in UNITS.items()),
         Cell("yes", value=True) if margins.stable else Cell("NO", "bad", value=False))
        for margins in margins_at
    ]  # fmt: skip
    if name:
        heading = [clean(name), *heading]
        rows = [(_cell(v, unit), *row) for v, row in zip(values, rows, strict=True)]
    return Table(tuple(map(Column, heading)), tuple(rows))


def _cell(value: float, unit: str, digits: int = 4) -> Cell:
    return Cell(amount(value, unit, digits), value=value)


def worst_texts(
    margins_at: Sequence[LoopMargins], name: str, unit: str, values: Sequence[float]
) -> list[str]:
    """Return where the loop is unstable, and the worst of each margin where it is stable."""
    pairs = list(zip(values, margins_at, strict=True))
    lost = [amount(value, unit) for value, margins in pairs if not margins.stable]
    kept = [(margins, value) for value, margins in pairs if margins.stable]
    texts = []
    if lost:
        where = lost[0] if len(lost) == 1 else f"{lost[0]} to {lost[-1]}"
        texts.append(f"unstable at {len(lost)} of {len(margins_at)} values of {name} ({where})")
    if kept:
        least = worst([margins for margins, _ in kept], [value for _, value in kept])
        texts += [
            f"{TITLES.get(k, k)} {amount(v, UNITS[k], 3)} at {name} = {amount(at, unit)}"
            for k, (v, at) in least.items()
        ]
    return texts


def _drawn(kind: str, family: Family) -> Figure:
    from bywire.report.loop_gain import loop_gain
    from bywire.report.nichols import nichols
    from bywire.report.nyquist import nyquist
    from bywire.report.sensitivity import sensitivity

    draw = {"loop-gain": loop_gain, "nyquist": nyquist, "nichols": nichols}
    return draw.get(kind, sensitivity)(family)
