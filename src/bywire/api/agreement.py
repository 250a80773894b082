"""Differences between nonlinear and linear response of a loop, by cause."""

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
"""labels of the active causes"""
STEP = "step (computed)"
"""label of the numerical error from the simulation's step"""
LEGEND = (
    "Nonlinear response minus the exact linear one, by the active causes. All rows except the "
    "first use the large amplitude, at which limits of currents, voltages and rates also act. -: "
    "the output sticks or does not settle. Largest: the cause without a number, otherwise the "
    "cause with the largest effect; limits count by themselves, others by what they add to the "
    "limits. Step: linear model of the simulation's midpoint rule minus the exact one."
)
"""legend of the table"""


@dataclass(frozen=True)
class LoopAgreement(Answer):
    """Difference of a loop's nonlinear response from its exact linear one, by active cause.

    Parameters
    ----------
    case
        The loop, its parameters and its operating point.
    differences
        Nonlinear minus linear response, by cause and frequency.
    small, large
        Amplitudes [``unit``]: the small one without causes, the large one with each cause.
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
        """Side of corners of the linear model."""
        return corner_notes([self.case.loop.closed(self.case.par, self.case.value).corners])

    @property
    def holds(self) -> bool:
        """Whether both responses agree without any cause."""
        return self.differences.holds

    def document(self) -> Document:
        """Return table, verdict and figure."""
        case, compared = self.case, self.differences
        table = TableBlock(agreement_table(compared))
        legend, text = Paragraph(LEGEND), verdict(compared)
        small, large = amount(self.small, self.unit, 3), amount(self.large, self.unit, 3)
        sizes = f"small amplitude {small}, large amplitude {large}"
        figure = FigureBlock(
            self._draw,
            "Size of the differences from the exact linear response; for single causes, what they "
            "add to the limits. Values below the range are at the lower edge.",
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
                f"{head}: nonlinear response minus linear response",
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
    """Return the difference between both responses of a loop, by cause.

    Parameters
    ----------
    case
        The loop at its operating point.
    frequencies, amplitudes
        Frequencies [Hz], and the small and the large amplitude [SI].
    progress
        Called with a label and the finished share, 0 to 1.

    Raises
    ------
    ParameterError
        If the loop is unstable, or its output does not respond to the set point.
    """
    gain, closed = case.loop.gain_and_closed(case.par, case.value)
    require_stable(closed)
    if not LoopFigures(gain, closed).answers:
        raise ParameterError(
            f"loop {case.loop.name!r} at {case.point}: {NO_LOOP}, and the output does not respond "
            f"to the set point; choose other gains with {option('overrides')}, or another point "
            f"with {option('at')}",
            name=f"loop {case.loop.name!r}",
            value=case.point,
        )
    compared = measuring.agreement(
        case.loop, case.par, case.value, frequencies, amplitudes, progress=progress
    )
    return LoopAgreement(case, compared, *amplitudes, case.input_unit)


def two_amplitudes(case: LoopCase, text: str) -> tuple[float, float]:
    """Return the small and the large amplitude [SI], by default those of the loop.

    Raises
    ------
    InputError
        If these are not two, the small one first.
    """
    if not text:
        return case.loop.amplitudes[0], case.loop.amplitudes[-1]
    sizes = spread(text, case.input_unit, "amplitudes")
    if len(sizes) != 2 or not sizes[0] < sizes[1]:
        raise ParameterError(
            f"{option('amplitudes')} {text}: give two, the small one first; bywire measures the "
            "loop without nonlinear causes at the small one, and each cause at the large one",
            name=option("amplitudes"),
            value=text,
        )
    return sizes[0], sizes[1]


def verdict(compared: Agreement) -> str:
    """Return whether the responses agree without any cause, as a text with the limits."""
    state = "agree" if compared.holds else "DO NOT agree"
    gain = max(map(abs, compared.gain[NOTHING].tolist()))
    phase = max(map(abs, compared.phase[NOTHING].tolist()))
    return (
        f"with everything off both responses {state}: largest differences {gain:.2g} dB and "
        f"{phase:.2g}° (limits {GAIN:g} dB and {PHASE:g}°)"
    )


def agreement_table(compared: Agreement) -> Table:
    """Return the differences, a row for each active cause, and the largest cause by frequency."""
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
