"""``bywire frequency-response``."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
import xarray as xr

from bywire.analysis.broadband import Broadband, broadband_response
from bywire.analysis.frequency_response import frequency_response, require_stable
from bywire.analysis.response_dataset import Sweep
from bywire.cli import output
from bywire.cli.loop_choice import Chosen, choose, spread
from bywire.cli.output_folder import require_folder
from bywire.cli.progress import progress_bar
from bywire.core.errors import unknown_name
from bywire.core.signals import signals_of
from bywire.report.wording import amount
from bywire.simulation.run import Run

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
    out: Path | None,
    as_json: bool,
) -> None:
    """Measure a loop's response to sines, or to all frequencies at once, beside the linear one."""
    if excitation not in _EXCITATIONS:
        raise unknown_name("excitation", excitation, _EXCITATIONS)
    if out is not None:
        require_folder(out)
    chosen = choose(loop, parameters, at, changes)
    own = chosen.loop
    unit = _input_unit(chosen)
    wanted = (
        spread(frequencies, "Hz", "frequencies", logarithmic=True)
        if frequencies
        else [float(f) for f in np.geomspace(*own.band, _POINTS)]
    )
    sizes = spread(amplitudes, unit, "amplitudes") if amplitudes else list(own.amplitudes)
    linear = own.closed(chosen.par, chosen.value)
    require_stable(linear)
    point = own.point(chosen.par, chosen.value)
    flags = [name for name in ("stuck", "sat_current", "sat_duty", "sat_rate")
             if name in point.model.Output._fields]  # fmt: skip
    sweep = Sweep(own.inputs, own.output, wanted, sizes, flags=flags, whole=own.whole(point.par))
    with progress_bar() as progress:
        found = _measured(point.run(), sweep, excitation, progress)
    response = linear.response(found["frequency"].values)[:, 0, 0]
    files = [] if out is None else _written(chosen, found, response, out)
    for text in _warnings(found, unit, sweep.tolerance):
        output.message(f"warning: {text}")
    if as_json:
        output.result(json.dumps(_as_object(chosen, found, response, files)))
    else:
        output.result(_text(chosen, found, response, unit))
    for path in files:
        output.message(f"written: {path}")


def _measured(
    run: Run, sweep: Sweep, excitation: str, progress: Callable[[str, float], None]
) -> xr.Dataset:
    if excitation == "sine":
        return frequency_response(run, sweep, progress).assign_attrs(excitation=excitation)
    return broadband_response(run, sweep, Broadband(cast(Any, excitation)), progress)


def _input_unit(chosen: Chosen) -> str:
    point = chosen.loop.point(chosen.par, chosen.value)
    return signals_of(point.model.Stimulus)[chosen.loop.inputs[0]].unit


def _warnings(found: xr.Dataset, unit: str, tolerance: float) -> list[str]:
    """Return what the user should know: what stuck, and what never repeated."""
    texts = []
    for k, size in enumerate(found["amplitude"].values):
        one = found.isel(variant=0, amplitude=k)
        still, restless = np.isnan(one["gain"].values), one["settled"].values == 0
        label = f"amplitude {amount(float(size), unit, 3)}"
        if still.any():
            texts.append(f"{label}: the output sticks at {int(still.sum())} frequencies: no gain")
        shaken = restless & ~still
        if shaken.any():
            scatter = float(np.nanmax(one["scatter"].values[shaken]))
            texts.append(
                f"{label}: the response does not repeat itself within {100 * tolerance:g} % at "
                f"{int(shaken.sum())} frequencies (a limit cycle, a drift, or the encoder's "
                f"resolution): shown are means of the last windows, which scatter by up to "
                f"{100 * scatter:.2g} %"
            )
    if found["unsettled_substeps"].values.any():
        texts.append("some substeps hit the cap of the contact iteration: take a smaller step")
    return texts


def _written(chosen: Chosen, found: xr.Dataset, linear: Any, out: Path) -> list[Path]:
    from bywire.data.netcdf import write_recording
    from bywire.report.bode import Response, bode
    from bywire.report.files import save_figure

    name = f"{chosen.loop.name}-frequency-response"
    f = found["frequency"].values
    lines = [Response("linear, without friction", f, linear)]
    unit = found["amplitude"].attrs["units"]
    for k, size in enumerate(found["amplitude"].values):
        one = found.isel(variant=0, amplitude=k)
        value = one["gain"].values * np.exp(1j * np.radians(one["phase"].values))
        lines.append(Response(f"amplitude {amount(float(size), unit, 3)}", f, value))
    return [
        write_recording(found, out / f"{name}.nc"),
        save_figure(bode(lines), out / f"{name}.png"),
    ]


def _as_object(chosen: Chosen, found: xr.Dataset, linear: Any, files: list[Path]) -> dict[str, Any]:
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


def _text(chosen: Chosen, found: xr.Dataset, linear: Any, unit: str) -> str:
    from bywire.report.table_text import table_text
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
    at = chosen.loop.at
    head = (
        f"closed loop {chosen.loop.name} of {chosen.name} at {at.name} = "
        f"{amount(chosen.value, at.unit)}: gain and phase by amplitude\n"
    )
    if found.attrs["excitation"] != "sine":
        head += f"excitation: {found.attrs['excitation']}, amplitudes are its peaks\n"
    lowest = found["coherence"].min(dim="frequency").values[0]
    shares = ", ".join("-" if math.isnan(one) else f"{one:.3f}" for one in lowest)
    return head + table_text(text_table(heading, rows)) + f"\nlowest coherence: {shares}"


def _cell(gain: float, phase: float) -> str:
    if not math.isfinite(gain):
        return "sticks"
    return f"{20.0 * math.log10(gain):.2f} dB {phase:.1f}°"
