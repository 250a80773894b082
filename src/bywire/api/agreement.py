"""Differences between a loop's nonlinear and linear responses, by cause."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bywire.analysis import agreement as measuring
from bywire.analysis.agreement import EVERYTHING, GAIN, LIMITS, NOTHING, PHASE, Agreement
from bywire.analysis.loop_figures import LoopFigures
from bywire.analysis.margins import NO_LOOP
from bywire.analysis.response.frequency_response import require_stable
from bywire.api.linear_texts import corner_notes
from bywire.api.loop_case import LoopCase, spread
from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.report.document import (
    Banner,
    Details,
    Document,
    FigureBlock,
    Paragraph,
    Section,
    TableBlock,
)
from bywire.report.tables import Table, text_table
from bywire.report.wording import amount

if TYPE_CHECKING:
    from matplotlib.figure import Figure


LABELS = {NOTHING: "nothing, small amplitude", LIMITS: "limits", EVERYTHING: "everything"}
"""label of each set of active causes"""
STEP = "step (computed)"
"""label of the numerical error that comes from the simulation's step"""
LEGEND = (
    "Nonlinear response minus exact linear response, by active cause. The first row uses the "
    "small amplitude. All other rows use the large amplitude, where current, voltage and rate "
    "limits also act. A dash (-) means that the output sticks or does not settle. 'Largest' lists "
    "the "
    "cause with the largest effect, or the cause without a number. The effect of the limits is "
    "the full difference. The effect of any other cause is its difference from the limits. 'Step' "
    "is the linear model "
    "of the simulation's midpoint rule minus the exact model."
)
"""caption of the table"""


@dataclass(frozen=True)
class LoopAgreement(Answer):
    """Difference between a loop's nonlinear and exact linear response, by active cause.

    Parameters
    ----------
    case
        The loop, its parameters and its operating point.
    differences
        Nonlinear response minus linear response, by cause and frequency.
    small, large
        Amplitudes [``unit``]: a small one, used without causes, and a large one, used with each
        cause.
    unit
        SI unit of the excited input.
    """

    case: LoopCase
    differences: Agreement
    small: float
    large: float
    unit: str

    @property
    def notes(self) -> list[str]:
        """Notes on the side of a kink that the linear model uses."""
        return corner_notes([self.case.loop.closed(self.case.par, self.case.value).corners])

    @property
    def holds(self) -> bool:
        """Whether both responses agree when no cause is active."""
        return self.differences.holds

    def document(self) -> Document:
        """Return the table, the verdict and the figure."""
        case, compared = self.case, self.differences
        table = TableBlock(agreement_table(compared))
        legend, text = Paragraph(LEGEND), verdict(compared)
        small, large = amount(self.small, self.unit, 3), amount(self.large, self.unit, 3)
        sizes = f"small amplitude {small}, large amplitude {large}"
        figure = FigureBlock(
            self._draw,
            "Size of the difference from the exact linear response. For single causes, the figure "
            "shows "
            "the difference from the limits. Values below the range are drawn at the lower edge.",
            f"{case.loop.name}-agreement",
        )
        head = f"closed loop {case.loop.name} of {case.name} at {case.point}"
        return Document(
            f"Agreement of loop {case.loop.name}",
            case.subject.line,
            sections=[
                Section("Differences", [figure, table, legend]),
                case.subject.provenance(f"{sizes[0].upper()}{sizes[1:]}."),
            ],
            brief=[
                f"{head}: nonlinear minus linear response",
                sizes,
                table,
                Details("", [legend]),
            ],
            data=self._data(),
            banner=Banner(text[0].upper() + text[1:], "good" if compared.holds else "bad"),
            changes=case.subject.changes,
        )

    def _draw(self) -> Figure:
        from bywire.report.response_figures import differences

        compared = self.differences
        sizes = {
            LABELS.get(cause, cause): (
                (compared.gain[cause], compared.phase[cause])
                if cause in LABELS
                else compared.beyond_limits(cause)
            )
            for cause in compared.gain
        }
        return differences(compared.frequencies, sizes, (GAIN, PHASE))

    def _data(self) -> dict[str, Any]:
        compared = self.differences
        names = {NOTHING: "nothing", EVERYTHING: "everything"}
        return {
            **self.case.heading,
            "amplitudes": {"small": self.small, "large": self.large},
            "frequency": compared.frequencies.tolist(),
            "differences": {
                names.get(cause, cause): {
                    "gain_dB": compared.gain[cause].tolist(),
                    "phase_deg": compared.phase[cause].tolist(),
                }
                for cause in compared.gain
            },
            "step": {
                "gain_dB": compared.step_gain.tolist(),
                "phase_deg": compared.step_phase.tolist(),
            },
            "largest": [cause or None for cause in compared.largest],
            "tolerance": {"gain_dB": GAIN, "phase_deg": PHASE},
            "holds": compared.holds,
        }


def compared_responses(
    case: LoopCase,
    frequencies: list[float],
    amplitudes: tuple[float, float],
    progress: Progress | None,
) -> LoopAgreement:
    """Compare a loop's two responses, one cause at a time.

    Parameters
    ----------
    case
        Loop at its operating point.
    frequencies, amplitudes
        Frequencies [Hz], and the small and the large amplitude [SI].
    progress
        Called with a label and the completed fraction, 0 to 1.

    Raises
    ------
    ParameterError
        If the loop is unstable or its output does not respond to the set point.
    """
    gain, closed = case.loop.gain_and_closed(case.par, case.value)
    require_stable(closed)
    if not LoopFigures(gain, closed).answers:
        raise ParameterError(
            f"loop {case.loop.name!r} at {case.point}: {NO_LOOP}, and the output does not respond "
            f"to the set point. Choose other gains with {option('overrides')}, or another "
            f"operating point with {option('at')}",
            name=f"loop {case.loop.name!r}",
            value=case.point,
        )
    compared = measuring.agreement(
        case.loop, case.par, case.value, frequencies, amplitudes, progress=progress
    )
    return LoopAgreement(case, compared, *amplitudes, case.input_unit)


def two_amplitudes(case: LoopCase, text: str) -> tuple[float, float]:
    """Return the small and the large amplitude [SI]. Default: those that the loop declares.

    Raises
    ------
    InputError
        If the text does not contain two amplitudes in increasing order.
    """
    if not text:
        return case.loop.amplitudes[0], case.loop.amplitudes[-1]
    sizes = spread(text, case.input_unit, "amplitudes")
    if len(sizes) != 2 or not sizes[0] < sizes[1]:
        raise ParameterError(
            f"{option('amplitudes')} {text} is not valid. Specify two amplitudes, the small one "
            "first. bywire measures the loop without nonlinear causes at the small amplitude, and "
            "each cause at the large amplitude",
            name=option("amplitudes"),
            value=text,
            valid="two amplitudes",
        )
    return sizes[0], sizes[1]


def verdict(compared: Agreement) -> str:
    """Return a text on whether the responses agree when no cause is active, with the limits."""
    state = "agree" if compared.holds else "DO NOT agree"
    gain = max(map(abs, compared.gain[NOTHING].tolist()))
    phase = max(map(abs, compared.phase[NOTHING].tolist()))
    return (
        f"with all causes off, both responses {state}: maximum differences {gain:.2g} dB and "
        f"{phase:.2g}° (limits {GAIN:g} dB and {PHASE:g}°)"
    )


def agreement_table(compared: Agreement) -> Table:
    """Return a table of differences by active cause, with the largest cause at each frequency."""
    heading = ["left on", *(amount(float(f), "Hz", 3) for f in compared.frequencies)]
    rows = [
        [LABELS.get(cause, cause), *map(_cell, compared.gain[cause], compared.phase[cause])]
        for cause in compared.gain
    ]
    rows.append([STEP, *map(_cell, compared.step_gain, compared.step_phase)])
    return text_table(heading, [*rows, ["largest", *(cause or "-" for cause in compared.largest)]])


def _cell(gain: float, phase: float) -> str:
    if not (math.isfinite(gain) and math.isfinite(phase)):
        return "-"
    return f"{round(gain, 3) + 0.0:+.3f} dB {round(phase, 2) + 0.0:+.2f}°"  # never -0
