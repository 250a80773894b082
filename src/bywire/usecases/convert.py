"""Conversion of measurement files."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bywire.core.callers import option
from bywire.usecases.asks import MeaningFile, Time
from bywire.usecases.declare import Ask, Command, use_case

if TYPE_CHECKING:
    from bywire.api.convert import Conversion
    from bywire.core.typing import Progress

SourceFile = Annotated[str | Path, Ask("Measurement file.", metavar="IN")]
TargetFile = Annotated[str | Path, Ask("File to write.", metavar="OUT")]
Signals = Annotated[
    Sequence[str],
    Ask("Signals to convert, e.g. 'p_mc, x_mc' or 'p_mc=Pressure [psi]'.", is_listing=True),
]
Rate = Annotated[
    str | float | None, Ask("Sample rate to which bywire resamples all signals, e.g. '1 kHz'.")
]
Method = Annotated[str, Ask("Resampling method: linear (default), previous, nearest or average.")]
Exclude = Annotated[
    Sequence[str] | None,
    Ask(
        "Samples to exclude: gaps, missing, clipped or nothing. Default: gaps, missing.",
        is_listing=True,
    ),
]
MaxGap = Annotated[
    str, Ask("Longest interval not treated as a gap, e.g. '50 ms'. Default: 10 steps.")
]
Format = Annotated[str, Ask("Output format, e.g. mat73. Default: inferred from the file name.")]
Force = Annotated[bool, Ask("Overwrite an existing file.")]


@use_case(Command("convert", writes=""))
def convert(
    source: SourceFile,
    target: TargetFile,
    *,
    mapping: MeaningFile = None,
    signals: Signals = (),
    time: Time = "",
    rate: Rate = None,
    method: Method = "",
    exclude: Exclude = None,
    max_gap: MaxGap = "",
    format: Format = "",
    force: Force = False,
    progress: "Progress | None" = None,
) -> "Conversion":
    """Convert a measurement file between CSV, TSV, Parquet, MAT, MDF4 and NetCDF.

    Parameters
    ----------
    source, target
        File to read and file to write, each in CSV, TSV, Parquet, MAT, MDF4 or NetCDF format.
    mapping
        File that maps columns to signals.
    signals
        Signals to convert: names, columns such as ``"Pressure [psi]"``, or columns with a new name
        such as ``"p_mc=Pressure [psi]"``. Default: all.
    time
        Time column, such as ``"Zeit [s]"``, or a sample rate. Default: the one that the file
        declares.
    rate
        Sample rate [Hz] of the common time axis, for example ``"1 kHz"``. By default, each signal
        keeps its own time axis.
    method
        Resampling method: ``linear`` (default), ``previous``, ``nearest`` or ``average``.
    exclude
        Samples to exclude: ``gaps``, ``missing``, ``clipped``. Default: ``gaps`` and ``missing``.
    max_gap
        Longest interval not treated as a gap, for example ``"50 ms"``. Default: 10 steps.
    format
        Output format, for example ``mat73``. Default: inferred from the file name's suffix.
    force
        Whether to overwrite an existing file.
    progress
        Called with a label and the completed fraction, 0 to 1.

    Returns
    -------
    Conversion
        The file's signals, resampled if requested, with sample rates in Hz and gaps in s.

    Raises
    ------
    InputError
        If the file cannot be read or written, or an argument is invalid.
    """
    from bywire.api.convert import Conversion, aligned
    from bywire.core.errors import ParameterError
    from bywire.core.typing import silent
    from bywire.data.format_registry import format_to_write
    from bywire.data.measurement import mapping_of
    from bywire.data.named_columns import read_wanted
    from bywire.data.writing import require_free, write_measurement

    shown = silent if progress is None else progress
    source, target = Path(source), Path(target)
    format_to_write(target, format)
    require_free(target, overwrite=force)
    left_out = None if exclude is None else ", ".join(exclude) or "nothing"
    for name, value in {"method": method, "exclude": left_out, "max_gap": max_gap}.items():
        if value and rate is None:
            raise ParameterError(
                f"{option(name)} {value} applies only to resampling. Add a sample rate, for "
                "example "
                f"{option('rate')} '1 kHz'",
                name=option(name),
                value=str(value),
            )
    dataset, notes = read_wanted(source, mapping_of(mapping), signals, time, shown)
    report = None
    if rate is not None:
        dataset, report = aligned(dataset, rate, method, exclude, max_gap)
    write_measurement(dataset, target, format=format, overwrite=force, progress=shown)
    return Conversion(source, target, dataset, report, notes)
