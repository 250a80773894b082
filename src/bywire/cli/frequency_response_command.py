"""``bywire frequency-response``."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from bywire.analysis.response.dataset import Sweep
from bywire.analysis.response.large_signal import Variant, widths, with_widths
from bywire.api.loop_case import LoopCase, loop_case, spread
from bywire.cli import output
from bywire.cli.output_folder import require_folder
from bywire.cli.progress import progress_bar
from bywire.cli.response_variants import cases_over, measured, sustained
from bywire.cli.response_warnings import purity, warnings
from bywire.cli.width_text import (
    NOTE,
    figures_object,
    figures_table,
    figures_text,
    over_object,
    over_table,
    over_text,
)
from bywire.core.errors import unknown_name
from bywire.core.signals import signals_of
from bywire.report.wording import amount

if TYPE_CHECKING:
    from bywire.report.document import Block
    from bywire.report.tables import Table

_POINTS = 20
_EXCITATIONS = ("sine", "multisine", "chirp")


def execute(
    loop: str,
    parameters: str,
    at: str,
    changes: Mapping[str, str],
    frequencies: str,
    amplitudes: str,
    excitation: str,
    range_: str,
    out: Path | None,
    as_json: bool,
) -> None:
    """Measure a loop's response to sines, or to all frequencies at once, beside the linear one."""
    if excitation not in _EXCITATIONS:
        raise unknown_name("excitation", excitation, _EXCITATIONS)
    if out is not None:
        require_folder(out)
    chosen = loop_case(loop, parameters, at, changes)
    own = chosen.loop
    unit = _input_unit(chosen)
    wanted = (
        spread(frequencies, "Hz", "frequencies", logarithmic=True)
        if frequencies
        else [float(f) for f in np.geomspace(*own.band, _POINTS)]
    )
    sizes = spread(amplitudes, unit, "amplitudes") if amplitudes else list(own.amplitudes)
    base, note = sustained(chosen, changes)
    variants, varied = cases_over(base, chosen, range_)
    point = variants[0].point
    flags = [name for name in ("stuck", "sat_current", "sat_duty", "sat_rate")
             if name in point.model.Output._fields]  # fmt: skip
    sweep = Sweep(own.inputs, own.output, wanted, sizes, flags=flags, whole=own.whole(point.par),
                  saturations=own.saturations)  # fmt: skip
    with progress_bar() as progress:
        found = measured(variants, sweep, excitation, progress)
    found = with_widths(found, widths(variants, found))
    response = variants[0].linear(found["frequency"].values)
    notes = warnings(found, variants, unit, sweep.tolerance)
    files = []
    if out is not None:
        heed = [note, *notes] if note else notes
        case = _first(variants, varied, ", ")
        file = out / f"{own.name}-bandwidth.png"
        more, drawn = _figures(found, variants, varied, unit, file)
        files = [*_written(chosen, found, response, heed, more, out, case), *drawn]
    if note:
        output.message(note)
    for text in notes:
        output.message(f"warning: {text}")
    if as_json:
        shown = _as_object(chosen, found, response, files)
        shown["figures"] = figures_object(found, 0)
        shown |= over_object(found, variants, varied[0]) if range_ else {}
        output.result(json.dumps(shown))
    elif range_:
        output.result(f"{_head(chosen)}: {over_text(found, variants, varied, unit)}")
    else:
        text = _text(chosen, found, response, unit)
        output.result(f"{text}\n\n{figures_text(found, unit)}")
    for path in files:
        output.message(f"written: {path}")


def _input_unit(chosen: LoopCase) -> str:
    point = chosen.loop.point(chosen.par, chosen.value)
    return signals_of(point.model.Stimulus)[chosen.loop.inputs[0]].unit


def _figures(
    found: xr.Dataset,
    variants: Sequence[Variant],
    range_: tuple[str, str],
    unit: str,
    file: Path,
) -> tuple[list[Block], list[Path]]:
    """Return what a page says of bandwidths, and the file of their figure over a range."""
    from bywire.report.bandwidth_range import bandwidth_range
    from bywire.report.document import FigureBlock, TableBlock
    from bywire.report.files import save_figure

    note = f"{NOTE[0].upper()}{NOTE[1:]}.{_first(variants, range_, ' Of the first case: ', '.')}"
    blocks: list[Block] = [TableBlock(figures_table(found, unit), note)]
    if not range_[0]:
        return blocks, []
    figure = bandwidth_range(found, [one.label for one in variants], *range_)
    caption = "Bandwidth over the range; rings: worst cases. All else shows the first case."
    table = TableBlock(over_table(found, variants, range_, unit), "Bandwidth by amplitude.")
    return [*blocks, FigureBlock(figure, caption), table], [save_figure(figure, file)]


def _first(
    variants: Sequence[Variant], range_: tuple[str, str], before: str, after: str = ""
) -> str:
    """Return which case of a range is shown where only one is; empty without a range."""
    if not range_[0]:
        return ""
    return f"{before}{range_[0]} = {amount(variants[0].label, range_[1])}{after}"


def _written(
    chosen: LoopCase,
    found: xr.Dataset,
    linear: Any,
    notes: list[str],
    more: list[Block],
    out: Path,
    case: str,
) -> list[Path]:
    from bywire.data.netcdf import write_recording
    from bywire.report.bode import Response, bode
    from bywire.report.files import save_figure
    from bywire.report.response_report import write_response

    name = f"{chosen.loop.name}-frequency-response"
    f = found["frequency"].values
    lines = [Response(f"linear, without friction{case}", f, linear)]
    unit = found["amplitude"].attrs["units"]
    for k, size in enumerate(found["amplitude"].values):
        one = found.isel(variant=0, amplitude=k)
        value = one["gain"].values * np.exp(1j * np.radians(one["phase"].values))
        lines.append(Response(f"amplitude {amount(float(size), unit, 3)}", f, value, measured=True))
    figure = bode(lines)
    method = f"Excitation: {found.attrs['excitation']}. {purity(found)}."
    table = _table(found, linear, unit)
    return [
        write_recording(found, out / f"{name}.nc"),
        save_figure(figure, out / f"{name}.png"),
        write_response(out, chosen.subject, figure, table, notes, method, more),
    ]


def _as_object(
    chosen: LoopCase, found: xr.Dataset, linear: Any, files: list[Path]
) -> dict[str, Any]:
    def listed(name: str) -> list[list[float | None]]:
        rows = found[name].values[0].tolist()
        return [[v if math.isfinite(v) else None for v in row] for row in rows]

    names = [str(name) for name in found if found[name].ndim == 3]
    return {
        "loop": chosen.loop.name,
        "parameters": chosen.name,
        "operating_point": {chosen.loop.at.name: chosen.value, "unit": chosen.loop.at.unit},
        "excitation": found.attrs["excitation"],
        "inputs": list(chosen.loop.inputs),
        "output": chosen.loop.output,
        "frequency": found["frequency"].values.tolist(),
        "amplitude": found["amplitude"].values.tolist(),
        **{name: listed(name) for name in names},
        "linear": {
            "gain": np.abs(linear).tolist(),
            "phase": np.degrees(np.unwrap(np.angle(linear))).tolist(),
        },
        "files": [str(path) for path in files],
    }


def _text(chosen: LoopCase, found: xr.Dataset, linear: Any, unit: str) -> str:
    from bywire.report.table_text import table_text

    head = f"{_head(chosen)}: gain and phase by amplitude\n"
    if found.attrs["excitation"] != "sine":
        head += f"excitation: {found.attrs['excitation']}, amplitudes are its peaks\n"
    return f"{head}{table_text(_table(found, linear, unit))}\n{purity(found)}"


def _table(found: xr.Dataset, linear: Any, unit: str) -> Table:
    from bywire.report.tables import text_table

    sizes = found["amplitude"].values
    heading = ["frequency", "linear"]
    heading += [amount(float(size), unit, 3) for size in sizes]
    rows = []
    phases = np.degrees(np.unwrap(np.angle(linear)))
    for k, f in enumerate(found["frequency"].values):
        row = [amount(float(f), "Hz", 4), _cell(float(np.abs(linear[k])), float(phases[k]))]
        for j in range(len(sizes)):
            one = found.isel(variant=0, amplitude=j, frequency=k)
            row.append(_cell(float(one["gain"]), float(one["phase"])))
        rows.append(row)
    return text_table(heading, rows)


def _head(chosen: LoopCase) -> str:
    at = chosen.loop.at
    point = f"{at.name} = {amount(chosen.value, at.unit)}"
    return f"closed loop {chosen.loop.name} of {chosen.name} at {point}"


def _cell(gain: float, phase: float) -> str:
    if not math.isfinite(gain):
        return "sticks"
    decibel = round(20.0 * math.log10(gain), 2) + 0.0  # no negative zero
    return f"{decibel:.2f} dB {phase:.1f}°"
