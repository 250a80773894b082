"""Conversion of a measurement file to another format, or to a common time axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.core import units
from bywire.core.callers import option
from bywire.core.errors import not_valid
from bywire.report.answer import Answer
from bywire.report.document import Document, Section, TableBlock
from bywire.report.tables import Cell, Table, text_table
from bywire.report.wording import amount

if TYPE_CHECKING:
    import xarray as xr

    from bywire.data.channel_quality import AlignedChannel, AlignmentReport, Stretch

_LISTED = 20
"""maximum number of stretches that the JSON object lists for a channel; it counts all"""

_ROUNDING = 1e-9  # steps; smaller jitter comes from rounding, not from the clock


@dataclass(frozen=True)
class Conversion(Answer):
    """Converted measurement.

    Parameters
    ----------
    source, target
        The input file and the output file.
    recording
        Signals in SI units.
    alignment
        Resampling to a common time axis, or None if each signal keeps its own.
    remarks
        Notes from reading the file.
    """

    source: Path
    target: Path
    recording: xr.Dataset
    alignment: AlignmentReport | None = None
    remarks: tuple[str, ...] = ()

    @property
    def notes(self) -> list[str]:
        """Notes on the file's content that bywire omitted, did not find, or guessed."""
        return list(self.remarks)

    def document(self) -> Document:
        """Return the signals and the alignment's findings."""
        report = self.alignment
        table = TableBlock(self._signal_table() if report is None else _channel_table(report))
        head, foot = ([], []) if report is None else _around(report)
        written = f"written: {self.target}"
        return Document(
            f"Conversion of {self.source.name}",
            written,
            sections=[Section("Signals", [table])],
            brief=[*head, table, *foot, written],
            data=self._data(),
            is_paged=False,
        )

    def _signal_table(self) -> Table:
        rows = [
            (
                name,
                row["unit"],
                Cell(str(samples), value=samples, unit="1"),
                row["time"],
                row["column"],
            )
            for name, row in self._signals().items()
            for samples in (row["samples"],)
        ]
        return text_table(("signal", "unit", "samples", "instants", "column"), rows)

    def _signals(self) -> dict[str, dict[str, Any]]:
        return {
            str(name): {
                "unit": signal.attrs["units"],
                "samples": int(signal.size),
                "time": str(signal.dims[0]),
                "column": signal.attrs.get("column", str(name)),
            }
            for name, signal in self.recording.data_vars.items()
        }

    def _data(self) -> dict[str, Any]:
        report = self.alignment
        return {
            "source": str(self.source),
            "format": self.recording.attrs.get("format"),
            "signals": self._signals(),
            "alignment": None
            if report is None
            else {
                "interval": report.interval,
                "start": report.start,
                "stop": report.stop,
                "samples": report.samples,
                "method": report.method,
                "excluded": list(report.exclude),
                "folded": list(report.folded),
                "channels": {channel.name: _channel(channel) for channel in report.channels},
            },
            "notes": list(self.remarks),
            "files": [str(self.target)],
        }


def aligned(
    dataset: xr.Dataset,
    rate: str | float,
    method: str,
    exclude: Sequence[str] | None,
    max_gap: str,
) -> tuple[xr.Dataset, AlignmentReport]:
    """Return the signals on a common time axis, with a report (see `bywire.convert`).

    Raises
    ------
    ParameterError
        If the rate is invalid.
    """
    from bywire.data.alignment import resample

    frequency = units.parse(rate, "Hz", option("rate"))
    if not frequency > 0.0:
        raise not_valid(option("rate"), str(rate), "> 0 Hz")
    given = {"method": method, "max_gap": max_gap}
    options: dict[str, Any] = {key: value for key, value in given.items() if value}
    if exclude is not None:
        options["exclude"] = list(exclude)
    aligned = resample(dataset, 1.0 / frequency, **options)
    return aligned.dataset, aligned.report


def _channel(channel: AlignedChannel) -> dict[str, Any]:
    quality = channel.quality
    return {
        "samples": quality.samples,
        "rate": quality.rate,
        "jitter": quality.jitter,
        "start": quality.start,
        "stop": quality.stop,
        "delay": channel.delay,
        "excluded_samples": channel.excluded,
        "gaps": _stretches(quality.gaps),
        "missing": _stretches(quality.missing),
        "clipped": _stretches(quality.clipped),
    }


def _stretches(stretches: tuple[Stretch, ...]) -> dict[str, Any]:
    """Return count, total length and the longest stretches in time order."""
    longest = sorted(stretches, key=lambda stretch: -stretch.length)[:_LISTED]
    return {
        "count": len(stretches),
        "length": sum(stretch.length for stretch in stretches),
        "longest": [
            {"start": stretch.start, "length": stretch.length, "samples": stretch.samples}
            for stretch in sorted(longest, key=lambda stretch: stretch.start)
        ],
    }


def _around(report: AlignmentReport) -> tuple[list[str], list[str]]:
    """Return the lines above and below an alignment's table."""
    head = (
        f"{report.samples} samples every {units.shown(report.interval, 's')} from "
        f"{units.shown(report.start, 's')} to {units.shown(report.stop, 's')}, method "
        f"{report.method}; excluded: {', '.join(report.exclude) or 'nothing'}"
    )
    folded = (
        f"sampled faster than the time axis: {', '.join(report.folded)}. Content above half the "
        f"new sample rate aliases to low frequencies unless you use {option('method', 'average')}"
    )
    return [head], [folded] if report.folded else []


def _channel_table(report: AlignmentReport) -> Table:
    heading = ("signal", "rate", "jitter", "delay", "gaps", "missing", "clipped", "left out")
    return text_table(heading, [_row(channel) for channel in report.channels])


def _row(channel: AlignedChannel) -> tuple[str | Cell, ...]:
    quality = channel.quality
    jitter = amount(quality.jitter, "s", 3) if quality.jitter * quality.rate > _ROUNDING else "-"
    delay = amount(channel.delay, "s") if channel.delay else "-"
    return (
        channel.name,
        Cell(f"{quality.rate:.6g} Hz", value=quality.rate, unit="Hz"),
        Cell(jitter, value=quality.jitter, unit="s"),
        Cell(delay, value=channel.delay, unit="s"),
        *(_in_short(stretches) for stretches in (quality.gaps, quality.missing, quality.clipped)),
        Cell(str(channel.excluded), value=channel.excluded, unit="1"),
    )


def _in_short(stretches: tuple[Stretch, ...]) -> str:
    if not stretches:
        return "-"
    longest = max(stretches, key=lambda stretch: stretch.length)
    length, start = amount(longest.length, "s", 3), amount(longest.start, "s")
    return f"{len(stretches)}, longest {length} at {start}"
