"""Closed-loop response by amplitude, including friction, limits and sampling."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.margins import NO_LOOP
from bywire.analysis.response import frequency_response as by_sines
from bywire.analysis.response.frequency_response import (
    Broadband,
    broadband_response,
    largest,
    require_stable,
    with_step_errors,
)
from bywire.analysis.response.large_signal import (
    Variant,
    leaving,
    narrowest,
    variants_over,
    widths,
    with_widths,
)
from bywire.analysis.response.sweep import Sweep
from bywire.api.linear_texts import corner_notes
from bywire.api.loop_case import LoopCase
from bywire.bench.step_error import NO_ESTIMATE, OTHER_STEPS, of_difference
from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.parameters import leaf_fields
from bywire.core.typing import Progress
from bywire.core.units import shown
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
from bywire.report.tables import Table, amount_cell, measured_cell, text_table
from bywire.report.wording import amount, measured_amount

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def response_warnings(
    response: xr.Dataset, variants: Sequence[Variant], unit: str, tolerance: float
) -> list[str]:
    """Return warnings about exceeded ranges, sticking outputs and aperiodic windows.

    Parameters
    ----------
    response
        Response of the loop.
    variants
        Cases of the response.
    unit
        SI unit of the amplitudes.
    tolerance
        Relative tolerance within which successive windows must agree.
    """
    texts = []
    empty = [variant for variant in variants if not variant.has_loop]
    if empty:
        count = f" at {len(empty)} of {len(variants)} values" if len(variants) > 1 else ""
        texts.append(f"{NO_LOOP}{count}, so crossover and margins are not defined")
    for k, size in enumerate(response["amplitude"].values):
        row = response.isel(amplitude=k)
        label = f"amplitude {amount(float(size), unit, 3)}"
        reasons = (leaving(case.loop, case.par, case.value, float(size)) for case in variants)
        if reason := next(filter(None, reasons), ""):
            texts.append(f"{label}: set points leave the brake's range: {reason}")
        still, restless = np.isnan(row["gain"].values), row["settled"].values == 0
        if still.any():
            texts.append(
                f"{label}: the output sticks at {_cases(response, still)}, where it has no gain"
            )
        shaken = restless & ~still
        if shaken.any():
            scatter = float(np.nanmax(row["scatter"].values[shaken]))
            cases = _cases(response, shaken)
            texts.append(
                f"{label}: successive windows do not agree to within {100 * tolerance:g} % at "
                f"{cases} (limit cycle, drift, or encoder resolution). Results are means of the "
                "last "
                "windows. The windows' root-mean-square deviation from the mean is up to "
                f"{amount(100 * scatter, 'percent', 2)}"
            )
    if response.attrs.get("unestimated"):
        texts.append(
            "the response's numerical error is unknown, because bywire cannot measure the "
            f"response with half the step ({response.attrs['unestimated']})"
        )
    if response["unsettled_substeps"].values.any():
        texts.append("some substeps hit the contact iteration's limit. Use a smaller step")
    return texts


def purity(response: xr.Dataset) -> str:
    """Return a line about the minimum coherence at each amplitude, worded for the excitation.

    Parameters
    ----------
    response
        Response to single sines or to all frequencies together, averaged over windows.
    """
    lowest = response["coherence"].min(dim="frequency").values[0]
    shares = ", ".join("-" if np.isnan(share) else f"{share:.3f}" for share in lowest)
    if response.attrs["excitation"] == "sine":
        return (
            f"minimum fraction of output power at the sine's frequency: {shares} (the rest is "
            "harmonics, dither and ripple)"
        )
    return f"minimum coherence between set point and output: {shares}"


def _cases(response: xr.Dataset, which: NDArray[np.bool_]) -> str:
    count = int(which.sum())
    many = "frequency" if count == 1 else "frequencies"
    return f"{count} {many}" + (" of all cases" if response.sizes["variant"] > 1 else "")


# --- The answer


@dataclass(frozen=True)
class FrequencyResponse(Answer):
    """Measured response of a closed loop, and its exact linear response.

    Parameters
    ----------
    case
        The loop, its parameters and its operating point.
    data
        Gain and phase over variant, amplitude and frequency, with bandwidths and fractions of time
        in saturation. Its variables have ``units`` and ``long_name``.
    linear
        Complex linear response of the first variant, shape (frequencies,).
    variants
        Cases of the range, or a single case without a range.
    range
        Name and SI unit of the varied quantity. The name is empty without a range.
    unit
        SI unit of the amplitudes.
    note
        Settings that allow long excitation of the loop. May be empty.
    tolerance
        Relative tolerance within which successive windows must agree.
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
        """Notes on the side of a kink that the linear models use."""
        models = (case.loop.closed(case.par, case.value) for case in self.variants)
        return corner_notes(model.corners for model in models)

    @property
    def warnings(self) -> list[str]:
        """Warnings about exceeded ranges, sticking outputs and aperiodic windows."""
        return response_warnings(self.data, self.variants, self.unit, self.tolerance)

    def document(self) -> Document:
        """Return gain and phase, bandwidth by amplitude, and the Bode plot."""
        loop, response = self.case.loop, self.data
        table = TableBlock(
            _table(response, self.linear, self.unit), "Gain and phase by frequency and amplitude."
        )
        notices = [self.note, *self.warnings] if self.note else self.warnings
        listing: list[Block] = [Listing(notices)] if notices else []
        bode = FigureBlock(
            self._bode,
            "Closed loop: exact linear response without friction, and nonlinear responses.",
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
            notices=[self.note] if self.note else [],
            changes=self.case.subject.changes,
        )

    def _brief(self, table: TableBlock) -> list[str | Flat]:
        case, response = self.case, self.data
        head = f"closed loop {case.loop.name} of {case.name} at {case.point}"
        if self.range[0]:
            over = TableBlock(_over_table(response, self.variants, self.range, self.unit))
            worst = _worst_line(response, self.variants, self.range, self.unit)
            return [f"{head}: bandwidth (-3 dB) by amplitude", over, worst]
        excitation = response.attrs["excitation"]
        peaks = [f"excitation: {excitation}, amplitudes are peak values"]
        return [
            f"{head}: gain and phase by amplitude",
            *(peaks if excitation != "sine" else []),
            table,
            *filter(None, [purity(response), largest(response)]),
            "",
            TableBlock(_figures_table(response, self.unit)),
            _NOTE,
        ]

    def _bandwidths(self) -> list[Block]:
        """Return the tables and figures of bandwidths."""
        note = f"{_NOTE[0].upper()}{_NOTE[1:]}.{self._first(' For the first case: ', '.')}"
        blocks: list[Block] = [TableBlock(_figures_table(self.data, self.unit), note)]
        if not self.range[0]:
            return blocks
        caption = (
            "Bandwidth versus the varied quantity. Rings mark worst cases. Other figures show the "
            "first case."
        )
        over = TableBlock(
            _over_table(self.data, self.variants, self.range, self.unit), "Bandwidth by amplitude."
        )
        name = f"{self.case.loop.name}-bandwidth"
        return [*blocks, FigureBlock(self._over_range, caption, name), over]

    def _first(self, before: str, after: str = "") -> str:
        """Return a text on the first case of a range, or no text without a range."""
        if not self.range[0]:
            return ""
        label = amount(self.variants[0].label, self.range[1])
        return f"{before}{self.range[0]} = {label}{after}"

    def _bode(self) -> Figure:
        from bywire.report.response_figures import Response, bode

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
            "figures": _figures_object(response, 0),
        }
        if self.range[0]:
            shown |= _over_object(response, self.variants, self.range[0])
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
        return "no response"
    decibel = round(20.0 * math.log10(gain), 2) + 0.0  # no negative zero
    return f"{decibel:.2f} dB {phase:.1f}°"


# --- The response


def measured_response(
    case: LoopCase,
    overrides: Mapping[str, Any],
    frequencies: list[float],
    amplitudes: list[float],
    over: tuple[str, str, list[float]],
    excitation: str,
    progress: Progress,
    *,
    estimate_error: bool,
) -> FrequencyResponse:
    """Measure a loop's response, with its numerical error if requested.

    Parameters
    ----------
    case, overrides
        Loop at its operating point, and the user's changes.
    frequencies, amplitudes
        Frequencies [Hz] and amplitudes [SI] of the input.
    over
        Name, unit and values of the range for bandwidths. The name is empty without a range.
    excitation, progress, estimate_error
        See `bywire.frequency_response`.

    Raises
    ------
    ParameterError
        If the linear loop is unstable.
    """
    base, note = _sustained(case, overrides)
    variants = _variants(base, over)
    point = variants[0].point
    flags = [n for n in point.model.Output._fields if n == "stuck" or n.startswith("sat_")]
    sweep = Sweep(
        case.loop.inputs,
        case.loop.output,
        frequencies,
        amplitudes,
        flags=flags,
        whole=case.loop.whole(point.par),
        saturations=case.loop.saturations,
    )
    response = _measured(variants, sweep, excitation, progress)
    response = with_widths(response, widths(variants, response))
    if estimate_error:
        response = _with_step_errors(response, variants, sweep, excitation, progress)
    linear = variants[0].linear(response["frequency"].values)
    return FrequencyResponse(
        case,
        response,
        linear,
        tuple(variants),
        over[:2],
        case.input_unit,
        note,
        sweep.tolerance,
    )


def _sustained(case: LoopCase, changes: Mapping[str, Any]) -> tuple[Variant, str]:
    """Return the loop with settings for long excitation, and a note on these settings.

    The user's settings take precedence.
    """
    loop = case.loop
    par = case.par.replace({k: v for k, v in loop.sustained.items() if k not in changes})
    before, after = case.par.flat(), par.flat()
    units = {name: leaf.unit.symbol for name, leaf in leaf_fields(type(case.par)).items()}
    texts = [
        f"{name} = {shown(value, units[name]) if name in units else value}"
        for name, value in after.items()
        if value != before[name]
    ]
    note = (
        f"changed to allow long excitation: {', '.join(texts)}. To use other values, set them with "
        f"{option('overrides')}"
    )
    return Variant(loop, par, case.value), note if texts else ""


def _variants(base: Variant, over: tuple[str, str, list[float]]) -> list[Variant]:
    """Return the cases of a range, or a single case without a range.

    Raises
    ------
    ParameterError
        If the linear loop is unstable in one of them.
    """
    name, unit, values = over
    if not name:
        require_stable(base.loop.closed(base.par, base.value))
        return [base]
    variants = variants_over(base, name, values)
    for variant in variants:
        try:
            require_stable(base.loop.closed(variant.par, variant.value))
        except ParameterError as error:
            raise ParameterError(f"{name} = {amount(variant.label, unit)}: {error}") from None
    return variants


def _with_step_errors(
    response: xr.Dataset,
    variants: Sequence[Variant],
    sweep: Sweep,
    excitation: str,
    progress: Progress,
) -> xr.Dataset:
    """Return a response with its numerical errors, or with the reason that they are unknown."""
    share = OTHER_STEPS[0]
    try:
        finer = _measured(variants, sweep, excitation, progress, share)
    except NO_ESTIMATE as error:
        return response.assign_attrs(unestimated=str(error))
    finer = with_widths(finer, widths(variants, finer))
    return with_step_errors(response, finer, of_difference(share))


def _measured(
    variants: Sequence[Variant],
    sweep: Sweep,
    excitation: str,
    progress: Progress,
    share: float = 1.0,
) -> xr.Dataset:
    """Measure the response of all cases, each around its operating point.

    ``share`` is the ratio of the runs' step to the loop's step.
    """
    runs = [variant.point.run() for variant in variants]
    points = [replace(run, step=share * run.step) for run in runs]
    if excitation == "sine":
        response = by_sines.frequency_response(points[0], sweep, progress, points=points)
        return response.assign_attrs(excitation=excitation)
    kind = Broadband(cast(Any, excitation))
    return broadband_response(points[0], sweep, kind, progress, points=points)


# --- Bandwidth by amplitude for one case or a range, as tables and as JSON

_NOTE = (
    "bandwidth is at -3 dB. Crossover and margins come from the loop gain's describing function. "
    "Fractions of time are maximum values over all frequencies"
)


_WIDTHS = ("bandwidth", "crossover", "phase_margin", "gain_margin", "lower_gain_margin")


def shares(response: xr.Dataset) -> dict[str, str]:
    """Return a response's fractions of time, with their column headings."""
    names = [str(name) for name in response if str(name).startswith("share_")]
    return {name: _title(name.removeprefix("share_")) for name in names}


def _title(flag: str) -> str:
    """Return the heading of a mode, where ``sat_`` denotes a limit."""
    if flag.startswith("sat_"):
        return f"at {flag.removeprefix('sat_').replace('_', ' ')} limit"
    return flag.replace("_", " ")


def _figures_table(response: xr.Dataset, unit: str) -> Table:
    """Return the first variant's bandwidth, crossover, margins and limits by amplitude."""
    known = shares(response)
    heading = [
        "amplitude",
        "bandwidth",
        "crossover",
        "phase margin",
        "gain margin",
        "lower gain margin",
        *known.values(),
    ]
    rows = []
    for j, size in enumerate(response["amplitude"].values):
        case = response.isel(variant=0, amplitude=j)
        most = [f"{100.0 * float(case[name].max()):.3g} %" for name in known]
        margin = measured_cell(
            float(case["phase_margin"]), "deg", _step_error(case, "phase_margin"), 3
        )
        factors = [_factor(case, name) for name in ("gain_margin", "lower_gain_margin")]
        rows.append(
            [
                amount_cell(float(size), unit, 3),
                _frequency(case, "bandwidth"),
                _frequency(case, "crossover"),
                margin,
                *factors,
                *most,
            ]
        )
    return text_table(heading, rows)


def _worst_line(
    response: xr.Dataset, variants: Sequence[Variant], range_: tuple[str, str], unit: str
) -> str:
    """Return a line about each amplitude's worst case over a range (see `_over_table`)."""
    texts = []
    for j, size in enumerate(response["amplitude"].values):
        k = narrowest(response, j)
        width = _frequency(response.isel(variant=k, amplitude=j), "bandwidth")
        at = f"{range_[0]} = {amount(variants[k].label, range_[1])}"
        texts.append(f"{width} for {amount(float(size), unit, 3)} at {at}")
    return f"worst: {'; '.join(texts)}"


def _over_table(
    response: xr.Dataset, variants: Sequence[Variant], range_: tuple[str, str], unit: str
) -> Table:
    """Return a table of bandwidths over a range, by amplitude.

    Parameters
    ----------
    response
        Response with its bandwidths.
    variants
        Cases of the range.
    range_
        Name and unit of the varied quantity.
    unit
        SI unit of the amplitudes.
    """
    sizes = [amount(float(size), unit, 3) for size in response["amplitude"].values]
    rows = [
        [
            amount_cell(variant.label, range_[1]),
            *(
                _frequency(response.isel(variant=k, amplitude=j), "bandwidth")
                for j in range(len(sizes))
            ),
        ]
        for k, variant in enumerate(variants)
    ]
    return text_table([range_[0], *sizes], rows)


def _figures_object(response: xr.Dataset, variant: int) -> list[dict[str, Any]]:
    """Return a variant's figures by amplitude, null beyond the measured frequencies."""
    rows = []
    for j, size in enumerate(response["amplitude"].values):
        case = response.isel(variant=variant, amplitude=j)
        row: dict[str, Any] = {"amplitude": float(size)}
        row |= _bounded(case, "bandwidth") | _bounded(case, "crossover")
        row |= {
            name: _or_none(float(case[name]))
            for name in ("phase_margin", "gain_margin", "lower_gain_margin")
        }
        row |= {
            key: _or_none(float(case[key]))
            for key in map("{}_step_error".format, _WIDTHS)
            if key in case
        }
        row |= {f"largest_{name}": float(case[name].max()) for name in shares(response)}
        rows.append(row)
    return rows


def _over_object(response: xr.Dataset, variants: Sequence[Variant], name: str) -> dict[str, Any]:
    """Return the figures of all cases in a range, and each amplitude's worst case."""
    cases = [
        {
            name: variant.label,
            "figures": _figures_object(response, k),
            "gain": _listed(response["gain"].values[k]),
            "phase": _listed(response["phase"].values[k]),
        }
        for k, variant in enumerate(variants)
    ]
    worst = []
    for j, size in enumerate(response["amplitude"].values):
        k = narrowest(response, j)
        row = _bounded(response.isel(variant=k, amplitude=j), "bandwidth")
        worst.append({"amplitude": float(size), **row, name: variants[k].label})
    return {"over": name, "cases": cases, "worst": worst}


def _frequency(case: xr.Dataset, name: str) -> str:
    value, f = float(case[name]), case["frequency"].values
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return f"> {amount(float(f[-1]), 'Hz', 3)}"
    if value == 0.0:
        return f"< {amount(float(f[0]), 'Hz', 3)}"
    return measured_amount(value, "Hz", _step_error(case, name), 3)


def _factor(case: xr.Dataset, name: str) -> str:
    value = float(case[name])
    return "-" if math.isnan(value) else measured_amount(value, "1", _step_error(case, name), 3)


def _step_error(case: xr.Dataset, name: str) -> float:
    key = f"{name}_step_error"
    return float(case[key]) if key in case else math.nan


def _bounded(case: xr.Dataset, name: str) -> dict[str, float | None]:
    """Return a frequency, or null with a bound."""
    value, f = float(case[name]), case["frequency"].values
    if math.isinf(value):
        return {name: None, f"{name}_above": float(f[-1])}
    if value == 0.0:
        return {name: None, f"{name}_below": float(f[0])}
    return {name: _or_none(value)}


def _or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _listed(values: NDArray[np.float64]) -> list[list[float | None]]:
    return [[_or_none(value) for value in row] for row in values.tolist()]
