"""``bywire convert``."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.cli import output
from bywire.cli.progress import progress_bar
from bywire.core import units
from bywire.core.errors import ParameterError

if TYPE_CHECKING:
    import xarray as xr

    from bywire.data.alignment_report import AlignedChannel, AlignmentReport
    from bywire.data.channel_quality import Stretch

_SHOWN = 20
"""stretches of a kind that the JSON object lists for a channel; it counts all of them"""

_ROUNDING = 1e-9  # steps: the jitter of numbers, not of a clock


@dataclass(frozen=True)
class Wanted:
    """What is to be converted, and how; texts as on the command line, empty for the default."""

    mapping: Path | None
    signals: str
    rate: str
    method: str
    exclude: str
    max_gap: str
    format: str
    force: bool


def execute(source: Path, target: Path, wanted: Wanted, as_json: bool) -> None:
    """Read a measurement file, align its signals where a rate is given, write the other file."""
    from bywire.data.format_registry import format_to_write
    from bywire.data.measurement import read_measurement
    from bywire.data.writing import require_free, write_measurement

    format_to_write(target, wanted.format)
    require_free(target, overwrite=wanted.force)
    _require_rate(wanted)
    names = _listed(wanted.signals) or None
    with progress_bar() as progress:
        dataset = read_measurement(source, wanted.mapping, signals=names, progress=progress)
        report = None
        if wanted.rate:
            dataset, report = _aligned(dataset, wanted)
        write_measurement(
            dataset, target, format=wanted.format, overwrite=wanted.force, progress=progress
        )
    found = _as_object(source, target, dataset, report)
    output.result(json.dumps(found) if as_json else _text(found, report))


def _require_rate(wanted: Wanted) -> None:
    """Refuse options that say how to resample when nothing is resampled."""
    given = {"method": wanted.method, "exclude": wanted.exclude, "max-gap": wanted.max_gap}
    for option, value in given.items():
        if value and not wanted.rate:
            raise ParameterError(
                f"--{option} {value}: it says how to resample: give the rate too, as --rate '1 kHz'"
            )


def _aligned(dataset: xr.Dataset, wanted: Wanted) -> tuple[xr.Dataset, AlignmentReport]:
    from bywire.data.alignment import resample

    rate = units.parse(wanted.rate, "Hz", "--rate")
    if not rate > 0.0:
        raise ParameterError(f"--rate {wanted.rate}: it must be > 0 Hz")
    options: dict[str, Any] = {}
    if wanted.method:
        options["method"] = wanted.method
    if wanted.exclude:
        options["exclude"] = [] if wanted.exclude == "nothing" else _listed(wanted.exclude)
    if wanted.max_gap:
        options["max_gap"] = wanted.max_gap
    found = resample(dataset, 1.0 / rate, **options)
    return found.dataset, found.report


def _listed(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]


def _as_object(
    source: Path, target: Path, dataset: xr.Dataset, report: AlignmentReport | None
) -> dict[str, Any]:
    signals = {
        str(name): {
            "unit": signal.attrs["units"],
            "samples": int(signal.size),
            "time": str(signal.dims[0]),
            "column": signal.attrs.get("column", str(name)),
        }
        for name, signal in dataset.data_vars.items()
    }
    found: dict[str, Any] = {
        "source": str(source),
        "format": dataset.attrs.get("format"),
        "signals": signals,
        "alignment": None,
        "files": [str(target)],
    }
    if report is not None:
        found["alignment"] = {
            "interval": report.interval,
            "start": report.start,
            "stop": report.stop,
            "samples": report.samples,
            "method": report.method,
            "excluded": list(report.exclude),
            "folded": list(report.folded),
            "channels": {one.name: _channel(one) for one in report.channels},
        }
    return found


def _channel(one: AlignedChannel) -> dict[str, Any]:
    found = one.quality
    return {
        "samples": found.samples,
        "rate": found.rate,
        "jitter": found.jitter,
        "start": found.start,
        "stop": found.stop,
        "delay": one.delay,
        "excluded_samples": one.excluded,
        "gaps": _stretches(found.gaps),
        "missing": _stretches(found.missing),
        "clipped": _stretches(found.clipped),
    }


def _stretches(found: tuple[Stretch, ...]) -> dict[str, Any]:
    """Return count, total length, and the longest of some stretches in the order of time."""
    longest = sorted(found, key=lambda one: -one.length)[:_SHOWN]
    return {
        "count": len(found),
        "length": sum(one.length for one in found),
        "longest": [
            {"start": one.start, "length": one.length, "samples": one.samples}
            for one in sorted(longest, key=lambda one: one.start)
        ],
    }


def _text(found: dict[str, Any], report: AlignmentReport | None) -> str:
    from bywire.report.table_text import table_text
    from bywire.report.tables import text_table

    (target,) = found["files"]
    if report is None:
        rows = [
            (name, one["unit"], str(one["samples"]), one["time"], one["column"])
            for name, one in found["signals"].items()
        ]
        table = text_table(("signal", "unit", "samples", "instants", "column"), rows)
        return f"{table_text(table)}\nwritten: {target}"
    channels = [_row(one) for one in report.channels]
    heading = ("signal", "rate", "jitter", "delay", "gaps", "missing", "clipped", "left out")
    head = (
        f"{report.samples} samples every {units.shown(report.interval, 's')} from "
        f"{units.shown(report.start, 's')} to {units.shown(report.stop, 's')}, method "
        f"{report.method}; excluded: {', '.join(report.exclude) or 'nothing'}"
    )
    lines = table_text(text_table(heading, channels))
    if report.folded:
        lines += (
            f"\nfaster than the axis: {', '.join(report.folded)}; what they hold above half its "
            "rate folds into slow content, unless --method average"
        )
    return f"{head}\n{lines}\nwritten: {target}"


def _row(one: AlignedChannel) -> tuple[str, ...]:
    found = one.quality
    return (
        one.name,
        f"{found.rate:.6g} Hz",
        f"{1e3 * found.jitter:.3g} ms" if found.jitter * found.rate > _ROUNDING else "-",
        f"{1e3 * one.delay:.4g} ms" if one.delay else "-",
        *(_in_short(getattr(found, flaw)) for flaw in ("gaps", "missing", "clipped")),
        str(one.excluded),
    )


def _in_short(found: tuple[Stretch, ...]) -> str:
    if not found:
        return "-"
    longest = max(found, key=lambda one: one.length)
    return f"{len(found)}, longest {longest.length:.3g} s at {longest.start:.4g} s"
