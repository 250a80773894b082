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
    Ask("Signals to keep, e.g. 'p_mc, x_mc' or 'p_mc=Pressure [psi]'.", is_listing=True),
]
Rate = Annotated[str | float | None, Ask("Resample all signals to one time axis, e.g. '1 kHz'.")]
Method = Annotated[str, Ask("Resampling: linear (default), previous, nearest, average.")]
Exclude = Annotated[
    Sequence[str] | None,
    Ask("Leave out gaps, missing (both by default), clipped; or nothing.", is_listing=True),
]
MaxGap = Annotated[
    str, Ask("Pauses up to this length are not gaps, e.g. '50 ms'; 10 steps by default.")
]
Format = Annotated[str, Ask("Format to write, e.g. mat73; by default from the file name's ending.")]
Force = Annotated[bool, Ask("Replace an existing file.")]


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
    """Convert a measurement file: CSV, TSV, Parquet, MAT, MDF4, NetCDF.

    Parameters
    ----------
    source, target
        File to read, and file to write: CSV, TSV, Parquet, MAT, MDF4, NetCDF.
    mapping
        File with the meaning of the columns.
    signals
        Signals to keep, all by default: names, columns such as ``"Pressure [psi]"``, or columns
        with a new name, ``"p_mc=Pressure [psi]"``.
    time
        Time column, such as ``"Zeit [s]"``, or a sample rate. By default as the file declares it.
    rate
        Sample rate of the common time axis, for instance ``"1 kHz"`` [Hz]. By default every signal
        keeps its time axis.
    method
        Resampling method: ``linear`` (default), ``previous``, ``nearest`` or ``average``.
    exclude
        Samples to leave out: ``gaps`` and ``missing`` (both by default), ``clipped``.
    max_gap
        Pauses up to this length are not gaps, for instance ``"50 ms"``; 10 steps by default.
    format
        Format to write, for instance ``mat73``; by default from the file name's ending.
    force
        Whether to replace an existing file.
    progress
        Called with a label and the finished share, 0 to 1.

    Returns
    -------
    Conversion
        The signals read, resampled and written, with rates in Hz and gaps in s.

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
                f"{option(name)} {value} is only for resampling: also give the rate, as "
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
