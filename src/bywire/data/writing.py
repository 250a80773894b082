"""Datasets written as measurement files, completely or not at all."""

from __future__ import annotations

import contextlib
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bywire.core.arguments import checked
from bywire.core.callers import option
from bywire.core.errors import FileError, InputError
from bywire.core.scratch import replacing
from bywire.core.typing import Progress, silent
from bywire.data.file_format import FileFormat
from bywire.data.format_registry import format_to_write

if TYPE_CHECKING:
    import xarray as xr


@checked
def write_measurement(
    dataset: xr.Dataset,
    path: str | Path,
    *,
    format: str = "",
    overwrite: bool = False,
    progress: Progress = silent,
) -> Path:
    """Write signals as a measurement file, in SI, with exact numbers.

    Parameters
    ----------
    dataset
        Variables with one dimension each, whose coordinate contains the times [s]; ``units`` are
        SI, and a variable without them is a pure number.
    path
        Target file; its extension selects the format.
    format
        Name of the format, if the extension does not define it: ``"mat73"`` for MAT 7.3.
    overwrite
        Whether to replace an existing file.
    progress
        Called with a label and the finished share.

    Returns
    -------
    pathlib.Path
        The file, which appears only when it is complete.

    Raises
    ------
    FileError
        When the format does not support the signals, the file exists, or it cannot be written.
    UnknownNameError
        When there is no such format.
    """
    target = Path(path)
    kind = format_to_write(target, format)
    require_free(target, overwrite=overwrite)
    _require_fit(dataset, target, kind)
    ready = _with_units(dataset)
    try:
        # Libraries must not print into our output.
        with replacing(target) as fresh, redirect_stdout(StringIO()):
            kind.write(ready, fresh, progress)
    except InputError:
        raise
    except MemoryError:
        raise FileError(
            f"cannot write {target}, because {kind.title} of this size does not fit into memory. "
            "Write fewer signals at a time",
            name=str(target),
        ) from None
    except Exception as error:  # libraries raise many kinds of errors
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())[:200]
        reason = reason or type(error).__name__
        raise FileError(
            f"cannot write {target}: {reason}. Free some space there, or choose a writable folder",
            name=str(target),
        ) from None
    return target


def _with_units(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset in which every signal and its times have a unit."""
    ready = dataset.copy()
    for name, signal in ready.data_vars.items():
        ready[name].attrs.setdefault("units", "1")
        ready[signal.dims[0]].attrs.setdefault("units", "s")
    return ready


def require_free(target: Path, *, overwrite: bool) -> None:
    """Reject a path that exists already, unless it may be replaced.

    Raises
    ------
    FileError
        When a file exists that may not be replaced, the path is a folder, or its folder is missing.
    """
    with contextlib.suppress(OSError, ValueError):  # writing will raise the error
        if target.is_dir():
            raise FileError(f"{target} is a folder. Specify a file in it", name=str(target))
        if target.exists() and not overwrite:
            raise FileError(
                f"{target} already exists. Specify another file, or use {option('force', True)}",
                name=str(target),
            )
        if not target.parent.is_dir():
            raise FileError(
                f"cannot write {target}: the folder {target.parent} does not exist. Create it",
                name=str(target),
            )


def _require_fit(dataset: xr.Dataset, target: Path, kind: FileFormat) -> None:
    if not dataset.data_vars:
        raise FileError(f"cannot write {target}: there is no signal to write", name=str(target))
    for name, signal in dataset.data_vars.items():
        if signal.ndim != 1 or signal.dims[0] not in dataset.coords:
            dims = ", ".join(map(str, signal.dims)) or "none"
            raise FileError(
                f"cannot write {target}: {name} has the dimensions {dims}, but a measurement file "
                "contains only signals over time. Select one case",
                name=str(name),
                value=str(dims),
            )
        if not np.issubdtype(signal.dtype, np.number) and signal.dtype != np.bool_:
            raise FileError(
                f"cannot write {target}: {name} contains {signal.dtype}, not numbers",
                name=str(name),
            )
        unit = dataset[signal.dims[0]].attrs.get("units", "s")
        if unit != "s":
            raise FileError(
                f"cannot write {target}: the times of {name} are in {unit!r}, not s",
                name=str(name),
                value=unit,
                valid="s",
            )
    axes = sorted({str(signal.dims[0]) for signal in dataset.data_vars.values()})
    if kind.has_many_axes or axes == ["time"]:
        return
    if len(axes) == 1:
        raise FileError(
            f"cannot write {target}: the signals' dimension is {axes[0]!r}. Rename it 'time'",
            name=str(target),
            value=str(axes[0]),
            valid="time",
        )
    raise FileError(
        f"cannot write {target}: the signals were measured at different times "
        f"({', '.join(axes)}), but a {kind.name} file has only one time axis. Resample them "
        "(bywire convert --rate, or resample), or use mat, mdf4 or netcdf",
        name=str(target),
    )
