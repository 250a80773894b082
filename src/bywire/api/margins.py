"""Margins and bandwidth of a sampled loop, at a point or over a range."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from bywire.analysis.linear.corners import CornerError
from bywire.analysis.margins import (
    MARGINS,
    NO_LOOP,
    Family,
    LoopMargins,
    figures_at,
    loop_curve,
    margins_of,
    worst,
)
from bywire.api.linear_texts import corner_notes
from bywire.api.loop_case import LoopCase
from bywire.bench.kpis.kpi import Kpi
from bywire.core.parameters import ParameterSet
from bywire.report.answer import Answer, FigureAt, Outcome
from bywire.report.document import (
    Banner,
    Block,
    Details,
    Document,
    FigureBlock,
    Listing,
    Paragraph,
    Section,
    TableBlock,
)
from bywire.report.tables import Cell, Column, Table, amount_cell
from bywire.report.wording import amount, clean

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEGEND = (
    "Linear sampled loop without dry friction. The gain margins are the factors by which the loop "
    "gain can be multiplied before the loop becomes unstable. The delay margin is the additional "
    "dead time that the loop tolerates. "
    "The best disk margin is 2, and the worst is 0. S and T are the sensitivity and the "
    "complementary sensitivity. Unstable loops and loops without gain have no margins."
)
"""caption that explains the headings"""
_CAPTIONS = {
    "loop-gain": "Loop gain of the sampled loop. Spans show the phase and gain margins.",
    "nyquist": "Nyquist plot near -1. The shaded disk shows the disk margin.",
    "nichols": "Nichols chart with contours of |T|. The shaded area shows the disk margin.",
    "sensitivity": "Sensitivity S = 1/(1 + L) and complementary sensitivity T = L/(1 + L), with "
    "the usual limits (Skogestad and Postlethwaite, section 2.4.3).",
}


@dataclass(frozen=True)
class Margins(Answer):
    """Margins of a loop.

    Parameters
    ----------
    case
        The loop, its parameters and its operating point.
    margins
        Margins for each value of the range. Without a range, a single entry.
    name, unit, values
        Varied parameter or operating quantity, its SI unit and its values. Empty without a range.
    """

    case: LoopCase
    margins: tuple[LoopMargins, ...]
    name: str = ""
    unit: str = "1"
    values: tuple[float, ...] = ()

    @property
    def notes(self) -> list[str]:
        """Notes on the side of a kink that the linear models use."""
        return corner_notes(margins.corners for margins in self.margins)

    @property
    def key_figures(self) -> list[FigureAt]:
        """The margins at every value. Unstable loops and loops without gain have none."""
        values = self.values or (math.nan,)
        return [
            FigureAt(
                Kpi(
                    figure.name,
                    getattr(margins, field) if margins.is_sound else math.nan,
                    figure.unit,
                    figure.meaning,
                    "" if margins.is_sound else f"the loop is {margins.state}",
                ),
                f"{self.name} = {amount(value, self.unit)}" if self.name else "",
            )
            for value, margins in zip(values, self.margins, strict=True)
            for field, figure in MARGINS.items()
        ]

    @property
    def outcome(self) -> Outcome:
        """``met`` if the loop is stable at every value."""
        return "met" if all(margins.is_sound for margins in self.margins) else "missed"

    @cached_property
    def family(self) -> Family:
        """The loop gains with their margins, for figures. Loops without gain have none."""
        case, values = self.case, self.values or (math.nan,)
        cases = [(self.case.par, self.case.value)]
        if self.name:
            cases = case.loop.varied(case.par, case.value, self.name, self.values)
        kept = [k for k, margins in enumerate(self.margins) if margins.has_loop]
        curves = [loop_curve(case.loop, figures_at(case.loop, *cases[k])) for k in kept]
        return Family(tuple(curves), self.name, self.unit, tuple(values[k] for k in kept))

    def document(self) -> Document:
        """Return table, worst cases and figures."""
        loop = self.case.loop
        table = TableBlock(margins_table(self.margins, self.name, self.unit, self.values))
        texts = worst_texts(self.margins, self.name, self.unit, self.values) if self.name else []
        worst_of = [Listing(texts, "Worst value of each margin:")] if self.name else []
        ranged = (
            " Bold curves have the smallest disk margin or are unstable. Unstable ones are dashed."
        )
        is_drawn = any(margins.has_loop for margins in self.margins)
        figures: list[Block] = [] if is_drawn else [Paragraph(f"{NO_LOOP}.")]
        figures += [
            FigureBlock(
                lambda kind=kind: _drawn(kind, self.family),  # type: ignore[misc]
                caption + (ranged if self.name else ""),
                f"{loop.name}-{kind}",
            )
            for kind, caption in _CAPTIONS.items()
            if is_drawn
        ]
        head = f"loop {loop.name} of {self.case.name} at {self.case.point}, cut at {loop.cut}"
        none = [] if self.name or self.margins[0].has_loop else [NO_LOOP]
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
            brief=[head, table, *none, *worst_line, Details("", [Paragraph(LEGEND)])],
            data=self._data(),
            banner=self._banner(),
            changes=self.case.subject.changes,
        )

    def _data(self) -> dict[str, Any]:
        rows = [asdict(margins) for margins in self.margins]
        units = {name: figure.unit for name, figure in MARGINS.items()} | {"phase_at": "Hz"}
        shared = {**self.case.heading, "units": units}
        if not self.name:
            return {**shared, "margins": rows[0]}
        least = {
            key: {"value": value, self.name: at}
            for key, (value, at) in worst(self.margins, self.values).items()
        }
        cases = [{self.name: v, **row} for v, row in zip(self.values, rows, strict=True)]
        return {**shared, "over": self.name, "cases": cases, "worst": least}

    def _banner(self) -> Banner:
        states = [margins.state for margins in self.margins]
        if not self.name:
            (state,) = states
            text = NO_LOOP if state == "no loop" else state
            return Banner(text, "good" if state == "stable" else "bad")
        lost = [(states.count(state), state) for state in ("unstable", "no loop")]
        texts = [
            f"{count} of {len(states)} {words}"
            for count, words in (
                (lost[0][0], "loops unstable"),
                (lost[1][0], "values without a loop"),
            )
            if count
        ]
        if texts:
            return Banner(", ".join(texts), "bad")
        return Banner("stable over the entire range", "good")


def margins_over(
    case: LoopCase, name: str, unit: str, values: Sequence[float]
) -> tuple[LoopMargins, ...]:
    """Return the margins at each value of a range, or at the operating point without one."""
    if not name:
        return (margins_of(figures_at(case.loop, case.par, case.value)),)
    cases = case.loop.varied(case.par, case.value, name, values)
    return tuple(
        _margins_at(case, point, f"{name} = {amount(at, unit)}")
        for point, at in zip(cases, values, strict=True)
    )


def _margins_at(case: LoopCase, point: tuple[ParameterSet, float], label: str) -> LoopMargins:
    """Return the margins at one value of a range. An error message states the value."""
    try:
        return margins_of(figures_at(case.loop, *point))
    except CornerError as error:
        raise CornerError(f"{label}: {error}") from None


def margins_table(
    margins_at: Sequence[LoopMargins], name: str = "", unit: str = "1", values: Sequence[float] = ()
) -> Table:
    """Return the table, with the values of the varied parameter in the first column.

    Parameters
    ----------
    margins_at
        Margins, one per row.
    name, unit, values
        Varied parameter, its SI unit and its values. Empty without a range.
    """
    heading = [*(figure.heading for figure in MARGINS.values()), "stable"]
    rows = [
        (
            *(amount_cell(getattr(margins, k), figure.unit, 3) for k, figure in MARGINS.items()),
            _state_cell(margins),
        )
        for margins in margins_at
    ]
    if name:
        heading = [clean(name), *heading]
        rows = [(amount_cell(v, unit), *row) for v, row in zip(values, rows, strict=True)]
    return Table(tuple(map(Column, heading)), tuple(rows))


def _state_cell(margins: LoopMargins) -> Cell:
    if margins.is_sound:
        return Cell("yes", value=True)
    return Cell("NO" if margins.has_loop else "no loop", "bad", value=False)


def worst_texts(
    margins_at: Sequence[LoopMargins], name: str, unit: str, values: Sequence[float]
) -> list[str]:
    """Return the values without a stable loop, and the worst value of each margin elsewhere."""
    pairs = list(zip(values, margins_at, strict=True))
    kept = [(margins, value) for value, margins in pairs if margins.is_sound]
    texts = []
    for state in ("unstable", "no loop"):
        lost = [amount(value, unit) for value, margins in pairs if margins.state == state]
        if lost:
            where = lost[0] if len(lost) == 1 else f"{lost[0]} to {lost[-1]}"
            count = f"{len(lost)} of {len(margins_at)} values of {name} ({where})"
            texts.append(f"{state} at {count}")
    if kept:
        least = worst([margins for margins, _ in kept], [value for _, value in kept])
        texts += [
            f"{MARGINS[k].heading} {amount(v, MARGINS[k].unit, 3)} at {name} = {amount(at, unit)}"
            for k, (v, at) in least.items()
        ]
    return texts


def _drawn(kind: str, family: Family) -> Figure:
    from bywire.report.loop_curves import loop_gain, nichols, nyquist, sensitivity

    draw = {"loop-gain": loop_gain, "nyquist": nyquist, "nichols": nichols}
    return draw.get(kind, sensitivity)(family)
