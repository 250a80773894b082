"""A closed loop's response by amplitude as it is shown: tables, Bode plots, bandwidths."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.analysis.response.frequency_response import largest
from bywire.analysis.response.large_signal import (
    Variant,
)
from bywire.api.bandwidth_tables import (
    NOTE,
    figures_object,
    figures_table,
    over_object,
    over_table,
    worst_line,
)
from bywire.api.linear_texts import corner_notes
from bywire.api.loop_case import LoopCase
from bywire.api.response_warnings import purity, response_warnings
from bywire.report.answer import Answer
from bywire.report.document import (
    Block,
    Document,
    FigureBlock,
    Flat,
    Listing,
    Section,
    TableBlock,
    recording_file,
)
from bywire.report.tables import Table, text_table
from bywire.report.wording import amount

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class FrequencyResponse(Answer):
    """The measured response of a closed loop, beside the exact linear one.

    Parameters
    ----------
    case
        The loop, its parameters and its operating point.
    data
        Gain and phase over variant, amplitude and frequency, with bandwidths and shares of the
        time in saturation; variables with ``units`` and ``long_name``.
    linear
        The linear response of the first variant, complex, shape (frequencies,).
    variants
        The cases of the range; a single one without.
    range
        Name and SI unit of what varies; an empty name without a range.
    unit
        SI unit of the amplitudes.
    note
        What was set so that the loop can be shaken for as long as it takes; empty for nothing.
    tolerance
        Share within which a window had to repeat the one before.
    """

    case: LoopCase
    data: xr.Dataset
    linear: NDArray[np.complex128]
    variants: tuple[Variant, ...]
    range: tuple[str, str]
    unit: str
    note: str
    tolerance: float

    @property
    def notes(self) -> list[str]:
        """On which side of corners the linear models are."""
        models = (case.loop.closed(case.par, case.value) for case in self.variants)
        return corner_notes(model.corners for model in models)

    @property
    def warnings(self) -> list[str]:
        """What left the brake's range, what stuck, and what never repeated."""
        return response_warnings(self.data, self.variants, self.unit, self.tolerance)

    def document(self) -> Document:
        """Return gain and phase, bandwidths by amplitude, and the Bode plot."""
        loop, response = self.case.loop, self.data
        table = TableBlock(
            _table(response, self.linear, self.unit), "Gain and phase by frequency and amplitude."
        )
        heed = [self.note, *self.warnings] if self.note else self.warnings
        listing: list[Block] = [Listing(heed)] if heed else []
        bode = FigureBlock(
            self._bode,
            "Closed loop: the exact linear response without friction, and the nonlinear ones.",
            f"{loop.name}-frequency-response",
        )
        found = ". ".join(filter(None, [purity(response), largest(response)]))
        method = f"Excitation: {response.attrs['excitation']}. {found}."
        return Document(
            f"Frequency response of loop {loop.name}",
            self.case.subject.line,
            sections=lambda: [
                Section("Response", [*listing, bode]),
                Section("Bandwidth by amplitude", self._bandwidths()),
                Section("Numbers", [table]),
                self.case.subject.provenance(method),
            ],
            brief=self._brief(table),
            data=self._data(),
            attachments=[recording_file(f"{loop.name}-frequency-response.nc", response)],
            heed=[self.note] if self.note else [],
            changes=self.case.subject.changes,
        )

    def _brief(self, table: TableBlock) -> list[str | Flat]:
        case, response = self.case, self.data
        head = f"closed loop {case.loop.name} of {case.name} at {case.point}"
        if self.range[0]:
            over = TableBlock(over_table(response, self.variants, self.range, self.unit))
            worst = worst_line(response, self.variants, self.range, self.unit)
            return [f"{head}: bandwidth (-3 dB) by amplitude", over, worst]
        excitation = response.attrs["excitation"]
        peaks = [f"excitation: {excitation}, amplitudes are its peaks"]
        return [
            f"{head}: gain and phase by amplitude",
            *(peaks if excitation != "sine" else []),
            table,
            *filter(None, [purity(response), largest(response)]),
            "",
            TableBlock(figures_table(response, self.unit)),
            NOTE,
        ]

    def _bandwidths(self) -> list[Block]:
        """Return what a page says of bandwidths."""
        note = f"{NOTE[0].upper()}{NOTE[1:]}.{self._first(' Of the first case: ', '.')}"
        blocks: list[Block] = [TableBlock(figures_table(self.data, self.unit), note)]
        if not self.range[0]:
            return blocks
        caption = "Bandwidth over the range; rings: worst cases. All else shows the first case."
        over = TableBlock(
            over_table(self.data, self.variants, self.range, self.unit), "Bandwidth by amplitude."
        )
        name = f"{self.case.loop.name}-bandwidth"
        return [*blocks, FigureBlock(self._over_range, caption, name), over]

    def _first(self, before: str, after: str = "") -> str:
        """Return which case of a range is shown where only one is; empty without a range."""
        if not self.range[0]:
            return ""
        label = amount(self.variants[0].label, self.range[1])
        return f"{before}{self.range[0]} = {label}{after}"

    def _bode(self) -> Figure:
        from bywire.report.bode import Response, bode

        response = self.data
        f = response["frequency"].values
        lines = [Response(f"linear, without friction{self._first(', ')}", f, self.linear)]
        for k, size in enumerate(response["amplitude"].values):
            at = response.isel(variant=0, amplitude=k)
            value = at["gain"].values * np.exp(1j * np.radians(at["phase"].values))
            label = f"amplitude {amount(float(size), self.unit, 3)}"
            lines.append(Response(label, f, value, measured=True))
        return bode(lines)

    def _over_range(self) -> Figure:
        from bywire.report.response_figures import bandwidth_range

        return bandwidth_range(self.data, [v.label for v in self.variants], *self.range)

    def _data(self) -> dict[str, Any]:
        response, loop = self.data, self.case.loop
        names = [str(name) for name in response if response[name].ndim == 3]
        shown = {
            **self.case.heading,
            "excitation": response.attrs["excitation"],
            "inputs": list(loop.inputs),
            "output": loop.output,
            "frequency": response["frequency"].values.tolist(),
            "amplitude": response["amplitude"].values.tolist(),
            **{name: response[name].values[0].tolist() for name in names},
            "linear": {
                "gain": np.abs(self.linear).tolist(),
                "phase": np.degrees(np.unwrap(np.angle(self.linear))).tolist(),
            },
            "figures": figures_object(response, 0),
        }
        if self.range[0]:
            shown |= over_object(response, self.variants, self.range[0])
        return shown


def _table(response: xr.Dataset, linear: Any, unit: str) -> Table:
    sizes = response["amplitude"].values
    heading = ["frequency", "linear"]
    heading += [amount(float(size), unit, 3) for size in sizes]
    rows = []
    phases = np.degrees(np.unwrap(np.angle(linear)))
    for k, f in enumerate(response["frequency"].values):
        row = [amount(float(f), "Hz", 4), _cell(float(np.abs(linear[k])), float(phases[k]))]
        for j in range(len(sizes)):
            at = response.isel(variant=0, amplitude=j, frequency=k)
            row.append(_cell(float(at["gain"]), float(at["phase"])))
        rows.append(row)
    return text_table(heading, rows)


def _cell(gain: float, phase: float) -> str:
    if not math.isfinite(gain):
        return "sticks"
    if gain == 0.0:
        return "no answer"
    decibel = round(20.0 * math.log10(gain), 2) + 0.0  # no negative zero
    return f"{decibel:.2f} dB {phase:.1f}°"
