"""``bywire replay``."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.cli import output
from bywire.cli.identify_text import finite
from bywire.cli.measured_bench import read_bench
from bywire.cli.output_folder import require_folder
from bywire.cli.progress import progress_bar
from bywire.core.errors import InputError, ParameterError

if TYPE_CHECKING:
    import xarray as xr

    from bywire.identification.replaying.segments import Segment
    from bywire.identification.replaying.tracking import Track
    from bywire.report.replay_report import Replay

_SIGNS = ("<=", ">=", "<", ">")


@dataclass(frozen=True)
class Wanted:
    """What is to be replayed, and how; texts as on the command line."""

    measurement: Path
    bench: Path
    mapping: Path | None
    changes: Mapping[str, str]
    inputs: Mapping[str, str]
    outputs: Sequence[str]
    case: str
    tolerances: Sequence[str]
    segments: str
    track: Sequence[str]


def execute(wanted: Wanted, out: Path | None, as_json: bool) -> int:
    """Replay a measurement and return the exit status: 1 when a tolerance is missed."""
    from bywire.identification.measured import measured
    from bywire.identification.replaying.bench_replay import replay
    from bywire.identification.replaying.fit import judged
    from bywire.identification.replaying.tracking import track
    from bywire.report.replay_report import Replay

    bench = read_bench(wanted.bench, wanted.changes)
    tolerances = _tolerances(wanted.tolerances)
    if out is not None:
        require_folder(out)
    with progress_bar() as progress:
        read = measured([wanted.measurement], wanted.mapping, gaps=True, progress=progress)
        progress("replay", 0.0)
        found = replay(
            bench, read.data, wanted.inputs or None, wanted.outputs or None, wanted.case
        )
        progress("replay", 1.0)
        fits = judged(found.outputs, _segments(wanted.segments, found.inputs, tolerances))
        tracks = [track(name, read.data, found.run.par) for name in wanted.track]
    one = Replay(
        bench, wanted.measurement.name, found, fits, read.notes, _figures(tracks, found.run.par)
    )
    files, trouble = _written(one, out)
    shown = _as_object(one, tracks, files)
    if out is not None and trouble is None:
        files += _kept(out, one, shown)
    for note in one.said:
        output.message(f"note: {note}")
    output.result(json.dumps(shown) if as_json else _text(one, tracks))
    if trouble is not None:
        raise trouble
    if out is not None:
        output.message(f"report: {out / 'report.html'}")
    return 0 if one.holds else 1


def _tolerances(texts: Sequence[str]) -> dict[str, str]:
    from bywire.identification.replaying.tolerances import joined

    found = []
    for text in texts:
        sign = next((s for s in _SIGNS if s in text), "")
        name, _, limit = text.partition(sign) if sign else (text, "", "")
        if not sign or not name.strip() or not limit.strip():
            raise ParameterError(
                f"--tolerance {text!r} cannot be read: write for instance 'nrmse <= 5 %' or "
                "'p_mc.max_error <= 2 bar'"
            )
        found.append((name.strip(), f"{sign} {limit.strip()}"))
    return joined(found)


def _segments(
    wanted: str, inputs: xr.Dataset, tolerances: Mapping[str, str]
) -> list[Segment]:
    from bywire.identification.replaying.segments import found_in, read_segments, whole_record

    if not wanted:
        return whole_record(inputs["time"].values, tolerances)
    if wanted == "auto":
        return found_in(next(iter(inputs.data_vars.values())), tolerances)
    return read_segments(wanted, tolerances)


def _figures(tracks: Sequence[Track], par: Any) -> dict[str, Any]:
    from bywire.report.track_figure import track_figure

    known = par.leaves()
    return {
        f"track-{one.relation.parameter}": (
            track_figure(one, known.get(one.relation.parameter)),
            f"{one.relation.parameter} tracked from {', '.join(one.relation.signals)}: "
            f"{one.relation.assumption}.",
        )
        for one in tracks
    }


def _written(one: Replay, out: Path | None) -> tuple[list[Path], InputError | None]:
    """Write figures and page; a full disk must not cost the numbers too."""
    if out is None:
        return [], None
    from bywire.report.replay_report import write_replay

    try:
        return write_replay(out, one), None
    except InputError as error:
        return [], error


def _kept(out: Path, one: Replay, shown: dict[str, Any]) -> list[Path]:
    """Write numbers and signals for other programs."""
    import xarray as xr

    from bywire.data.netcdf import write_recording
    from bywire.report.files import write_bytes

    signals = {
        f"{name}_{kind}": pair[kind]
        for name, pair in one.found.outputs.items()
        for kind in ("measured", "modeled")
    }
    data = xr.Dataset({**signals, **{f"{n}": v for n, v in one.found.inputs.items()}})
    files = [write_recording(data, out / "replay.nc"), out / "replay.json"]
    shown["files"] += [str(path) for path in files]
    write_bytes(files[1], (json.dumps(shown, indent=1) + "\n").encode())
    return files


def _as_object(one: Replay, tracks: Sequence[Track], files: Sequence[Path]) -> dict[str, Any]:
    made: dict[str, Any] = finite(
        {
            "bench": one.bench.name or one.bench.experiment,
            "measurement": one.source,
            "inputs": [str(name) for name in one.found.inputs.data_vars],
            "notes": list(one.said),
            "holds": one.holds,
            "segments": [
                {
                    "name": fit.segment.name, "signal": fit.signal,
                    "start": fit.segment.start, "stop": fit.segment.stop,
                    "figures": {k.name: {"value": k.value, "unit": k.unit} for k in fit.kpis},
                    "tolerances": [
                        {"figure": v.kpi, "limit": v.limit, "value": v.value, "met": v.met}
                        for v in fit.verdicts
                    ],
                }
                for fit in one.fits
            ],
            "tracked": {t.relation.parameter: _tracked(t) for t in tracks},
            "files": [str(path) for path in files],
        }
    )  # fmt: skip
    return made


def _tracked(one: Track) -> dict[str, Any]:
    data = one.data.isel(parameter=0)
    return {
        "unit": one.relation.units[0],
        "from": list(one.relation.signals),
        "assumption": one.relation.assumption,
        "time": data["time"].values.tolist(),
        **{n: data[n].values.tolist() for n in ("value", "low", "high")},
        "used": data["used"].values.tolist(),
    }


def _text(one: Replay, tracks: Sequence[Track]) -> str:
    from bywire.report.replay_report import fit_table
    from bywire.report.table_text import table_text
    from bywire.report.wording import amount

    inputs = ", ".join(map(str, one.found.inputs.data_vars))
    parts = [
        f"{one.source} drives {one.bench.experiment} of {one.bench.parameters} by {inputs}",
        table_text(fit_table(one.fits), 110),
    ]
    for each in tracks:
        data, unit = each.data.isel(parameter=0), each.relation.units[0]
        there = data["used"].values > 0
        ends = data.isel(time=there)
        if there.any():
            first, last = (
                f"{amount(float(ends['value'][k]), unit)} ({amount(float(ends['low'][k]), unit)} "
                f"to {amount(float(ends['high'][k]), unit)})"
                for k in (0, -1)
            )
            parts.append(f"{each.relation.parameter} tracked: at first {first}, at last {last}")
    return "\n\n".join(parts)
