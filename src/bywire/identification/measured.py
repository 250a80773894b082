"""Measured records for methods and replays: SI, an evenly spaced time axis, all signals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray

from bywire.core.arguments import checked
from bywire.core.callers import option
from bywire.core.errors import ParameterError, UnitError, counted, unknown_name
from bywire.core.typing import Array, Progress, silent
from bywire.data.alignment import resample
from bywire.data.channel_quality import AlignmentReport
from bywire.data.column_units import measures, unit_of_symbol
from bywire.data.mapping import MeasurementMapping, read_mapping
from bywire.data.named_columns import NamedColumns, read_named, renamed

_ROUNDED = 0.05  # fraction of samples equal to the previous one if a converter quantizes
_LARGER = 1.5  # times the noise
_SURE = 2.5  # standard errors of a correlation
FAR = 4.0  # standard deviations: 1 in 16 000 samples of white noise is larger


def noise_of(values: Array) -> float:
    """Return the standard deviation of a measured signal's noise, quantization included.

    It uses the median of third-order differences, which are zero for slow signals and insensitive
    to slips.
    """
    third = np.diff(values, 3) / np.sqrt(20.0)
    scatter = 1.4826 * float(np.median(np.abs(third)))
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0]
    step = float(steps.min()) if steps.size else 0.0
    repeated = float(np.mean(np.diff(values) == 0.0))
    quantized = step / np.sqrt(12.0) if _ROUNDED < repeated < 1.0 and step > 3.0 * scatter else 0.0
    return max(scatter, quantized)


def determines_its_noise(values: Array) -> bool:
    """Return whether a signal's own samples determine its noise, by third differences.

    Neighboring differences have a correlation of -3/4 if the noise is white. Toward 1, the signal
    itself dominates. Toward -1, it alternates between samples: a coarse record, or dither near half
    the sample rate. The correlation follows from the fraction of neighbors with equal signs, so
    slips do not matter. The noise is undetermined if such a signal would inflate it by half.

    Parameters
    ----------
    values
        Shape (n,). A signal that a converter has rounded repeats values, which is accepted.
    """
    if float(np.mean(np.diff(values) == 0.0)) > _ROUNDED:
        return True
    third = np.diff(values, 3)
    product = np.sign(third[1:] * third[:-1])
    correlation = np.sin(0.5 * np.pi * float(np.mean(product)))  # of Gaussian neighbors
    reach = _SURE / np.sqrt(product.size)
    # A fraction 1 - a of noise, with a signal of correlation 1 or -1: too large by 1 / sqrt(1 - a).
    a = 1.0 - 1.0 / _LARGER**2
    low, high = -max(0.25 * a, reach), max(1.75 * a, reach)
    return bool(low <= correlation + 0.75 <= high)


def robust_scale(residuals: Array) -> float:
    """Return the standard deviation from the median magnitude, for a Gaussian distribution.

    Magnitudes are relative to zero, not to the median, since an offset is an error too.

    References
    ----------
    P. J. Huber, Robust Statistics, 1981, section 5.1 (median absolute deviation).
    """
    return 1.4826 * float(np.median(np.abs(residuals)))


def outliers(residuals: Array) -> NDArray[np.bool_]:
    """Return the outliers among residuals that are scaled by the assumed noise.

    Shape (n,). If all are larger than assumed, outliers are relative to the others.
    """
    return np.asarray(np.abs(residuals) > FAR * max(robust_scale(residuals), 1.0))


# --- Records
# Several records of one experiment follow one another in one measurement. The signal ``record``
# numbers them, 0, 1, ...; its attribute ``flag_meanings`` names them, as the Climate and Forecast
# conventions specify; ``begins`` contains, in memory only, the start of each on its own clock.
# Time continues from one record to the next, so any file format can store them.

RECORD = "record"
"""the signal that numbers the records"""


def require_signals(data: xr.Dataset, names: Iterable[str]) -> None:
    """Raise ``UnknownNameError`` if a signal is not measured, with the nearest names."""
    for name in names:
        if name not in data:
            raise unknown_name("measured signal", name, [str(k) for k in data.data_vars])


def joined(records: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Join records to one measurement; a single record is unchanged.

    Parameters
    ----------
    records
        By label; each over ``time`` [s], with the same signals.

    Raises
    ------
    ParameterError
        When there is no record, or their signals differ.
    """
    if not records:
        raise ParameterError("records is empty. Provide at least one record", name="records")
    first, *others = records
    if not others:
        return records[first]
    wanted = set(map(str, records[first].data_vars))
    parts, times, start = [], [], 0.0
    for number, (label, record) in enumerate(records.items()):
        if set(map(str, record.data_vars)) != wanted:
            differing = ", ".join(sorted(wanted ^ set(map(str, record.data_vars))))
            raise ParameterError(
                f"records {first} and {label} have different signals ({differing}), but records of "
                "one experiment need the same signals",
                name=label,
            )
        t = record["time"].values - record["time"].values[0]
        times.append(start + t)
        start = float(times[-1][-1] + (t[1] - t[0] if t.size > 1 else 1.0))
        parts.append(record.assign({RECORD: ("time", np.full(t.size, float(number)))}))
    whole = xr.concat(parts, "time", combine_attrs="override")
    axis = pd.Index(np.concatenate(times), name="time")
    whole = whole.assign_coords(time=("time", axis, {"units": "s", "long_name": "time"}))
    names = " ".join(label.replace(" ", "_") for label in records)
    begins = [float(record["time"].values[0]) for record in records.values()]
    whole[RECORD].attrs = {
        "units": "1",
        "long_name": "record",
        "flag_meanings": names,
        "begins": begins,
    }
    return whole


def split(data: xr.Dataset, own_clock: bool = False) -> dict[str, xr.Dataset]:
    """Return the records of a measurement by label, each with a time from zero.

    Without the signal ``record`` it is a single unnamed record.

    Parameters
    ----------
    data
        The measurement.
    own_clock
        Whether each record's time starts as before joining.
    """
    if RECORD not in data:
        return {"": data}
    numbers = data[RECORD].values
    names = str(data[RECORD].attrs.get("flag_meanings", "")).split()
    begins = np.atleast_1d(data[RECORD].attrs.get("begins", [])) if own_clock else np.empty(0)
    records = {}
    for number in np.unique(numbers[np.isfinite(numbers)]):
        k = int(number)
        record = data.isel(time=np.flatnonzero(numbers == number)).drop_vars(RECORD)
        begin = begins[k] if k < begins.size else 0.0
        t = record["time"].values - record["time"].values[0] + begin
        axis = pd.Index(np.round(t, 12), name="time")
        label = names[k] if 0 <= k < len(names) else f"record_{k}"
        clock = ("time", axis, {"units": "s", "long_name": "time"})
        records[label] = record.assign_coords(time=clock)
    return records


def after_one_another(times: Mapping[str, Array]) -> dict[str, Any]:
    """Return coordinates of joined records: continuous ``time``, and ``record`` with the names.

    Parameters
    ----------
    times
        By record: its times [s], shape (n_k,), ascending; samples may be missing. A single record
        without a name gets no ``record``.
    """
    begin, axis, names = 0.0, [], []
    for name, t in times.items():
        if t.size:
            axis.append(begin + t)
            begin = float(axis[-1][-1]) + (float(np.median(np.diff(t))) if t.size > 1 else 0.0)
        names += [name] * t.size
    attrs = {
        "units": "s",
        "long_name": "time, records joined" if len(times) > 1 else "time",
    }
    coordinates: dict[str, Any] = {"time": ("time", np.concatenate(axis), attrs)}
    if len(times) > 1:
        coordinates["record"] = ("time", np.array(names))
    return coordinates


# --- From measurement files

_UNEVEN = 1e-3  # of a step
_FEWEST = 10  # samples that determine the noise
_NOT_NAMED = NamedColumns()
NOISE_OF_SAMPLES = "noise_of_samples"
"""attribute of a resampled signal: noise of the original samples, SI"""


@dataclass(frozen=True)
class Measured:
    """A measurement with notes on its preparation.

    Parameters
    ----------
    data
        Signals over ``time`` [s], evenly spaced within every record.
    notes
        Notes for the user, such as on resampling and missing samples.
    """

    data: xr.Dataset
    notes: tuple[str, ...]


@checked
def measured(
    sources: Sequence[str | Path | xr.Dataset],
    mapping: str | Path | None = None,
    signals: Mapping[str, str] | None = None,
    *,
    optional: Mapping[str, str] | None = None,
    interval: float | None = None,
    multiple: float | None = None,
    gaps: bool = False,
    named: NamedColumns = _NOT_NAMED,
    progress: Progress = silent,
) -> Measured:
    """Read one measurement, or several records of it.

    Parameters
    ----------
    sources
        Files, or signals in memory; several become records, named by the files.
    mapping
        Mapping file for their columns.
    signals
        Required signals: name -> SI unit; all by default.
    optional
        Signals that are used if present.
    interval
        Requested step [s]; by default the record's median.
    multiple
        The step is rounded to multiples of this time [s] if the record must be resampled.
    gaps
        Whether samples may be missing.
    named
        Columns that the user specifies.
    progress
        Callback with a label and the finished share.

    Raises
    ------
    InputError
        When a file cannot be read, or a signal is missing or has another dimension.
    """
    meaning = MeasurementMapping() if mapping is None else read_mapping(mapping)
    records, notes = {}, []
    for number, source in enumerate(sources):
        if isinstance(source, xr.Dataset):
            data, where, label = renamed(source, named), "the measurement", f"record_{number}"
        else:
            data, remarks = read_named(Path(source), meaning, named, progress)
            where = str(source)
            notes += [f"{name_of(source)}: {remark}" for remark in remarks]
            label = Path(source).stem if Path(source).stem not in records else where
        if signals is not None:
            too = {n: unit for n, unit in (optional or {}).items() if n in data}
            data = data[list(require(data, {**signals, **too}, where))]
        even, said = as_even(data, interval, multiple)
        notes += [f"{name_of(source)}: {text}" for text in said]
        _require_whole(even, where, gaps)
        records[label] = even
    return Measured(joined(records), tuple(notes))


def name_of(source: str | Path | xr.Dataset) -> str:
    """Return the name of a measurement in reports: its file, or a text for signals in memory."""
    if isinstance(source, xr.Dataset):
        return str(source.attrs.get("source", "signals in memory"))
    return Path(source).name


def require(data: xr.Dataset, signals: Mapping[str, str], where: str) -> tuple[str, ...]:
    """Return the names of the requested signals, with ``record`` if present.

    Raises
    ------
    UnknownNameError
        When one is missing, with the nearest names.
    UnitError
        When one has another dimension.
    """
    there = [str(name) for name in data.data_vars]
    for name, unit in signals.items():
        if name not in there:
            kind = (
                f"signal (required in {where}; specify its column with {option('inputs')}, "
                f"{option('outputs')} or {option('mapping')})"
            )
            raise unknown_name(kind, name, there)
        given = str(data[name].attrs.get("units", "1"))
        if unit not in ("", given) and not measures(unit_of_symbol(given), unit):
            raise UnitError(
                f"{where}: {name} is in {given}, but must be in {unit}. Choose another "
                "column. If this column contains a scaled value, set its scale and unit with "
                f"{option('mapping')}",
                name=name,
                value=given,
                valid=unit,
            )
    return (*signals, *(("record",) if "record" in there and "record" not in signals else ()))


def as_even(
    data: xr.Dataset, interval: float | None = None, multiple: float | None = None
) -> tuple[xr.Dataset, list[str]]:
    """Return signals on an evenly spaced axis, unchanged if they are on one already.

    Parameters
    ----------
    data
        Result of ``read_measurement``.
    interval
        Requested step [s]; the median one by default.
    multiple
        The step is rounded to multiples of this time [s] if the signals must be resampled.
    """
    steps = {str(dim): np.diff(data[dim].values) for dim in data.dims}
    if "record" in data and set(steps) == {"time"} and interval is None:
        return data, []  # our own file: each record is evenly spaced, and time jumps between them
    middle = min(float(np.median(d)) for d in steps.values() if d.size)
    step = float(f"{middle if interval is None else interval:.9g}")
    if len(steps) == 1 and np.abs(next(iter(steps.values())) - step).max() <= _UNEVEN * step:
        (dim,) = steps
        return data if dim == "time" else data.rename({dim: "time"}), []
    if "record" in data:
        raise ParameterError(
            "bywire cannot resample several records in one file. Use one file per record",
            name="records",
        )
    if multiple is not None and interval is None:
        step = float(f"{max(round(step / multiple), 1) * multiple:.9g}")
    resampled = resample(data, step)
    for name, signal in resampled.dataset.data_vars.items():
        values = data[name].values[np.isfinite(data[name].values)]
        if values.size >= _FEWEST:
            signal.attrs.setdefault(NOISE_OF_SAMPLES, noise_of(values))
    return resampled.dataset, [_said(resampled.report)]


def _said(report: AlignmentReport) -> str:
    missing = max(channel.excluded for channel in report.channels)
    left_out = f". {missing} of them are in gaps and not used" if missing else ""
    return (
        f"resampled to {report.samples} samples every {1e3 * report.interval:.6g} ms, because its "
        f"samples are not evenly spaced{left_out}"
    )


def _require_whole(data: xr.Dataset, where: str, gaps: bool) -> None:
    if gaps:
        return
    for name, signal in data.data_vars.items():
        missing = np.flatnonzero(np.isnan(signal.values))
        if missing.size:
            at = float(data["time"].values[missing[0]])
            raise ParameterError(
                f"{where}: {name} is missing {counted(missing.size, 'sample')}, the first at "
                f"{at:.4g} s. Trim the record there, or fill the gap with 'bywire convert "
                "--exclude nothing'",
                name=str(name),
            )


@checked
def wrong_sign(signal: str, other: str, evidence: str) -> ParameterError:
    """Return the error for two signals, one of which has the wrong sign.

    Parameters
    ----------
    signal, other
        Signals, in words.
    evidence
        Evidence, with its value.
    """
    return ParameterError(
        f"{signal} moves against {other} ({evidence}). One of them has the wrong sign. Set "
        "sign = -1 for this one in the mapping",
        name=signal,
        value=evidence,
    )
