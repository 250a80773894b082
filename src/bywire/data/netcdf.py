"""Recordings as NetCDF files, written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path

import xarray as xr

from bywire.core.errors import FileError


def write_recording(recording: xr.Dataset, path: Path) -> Path:
    """Write a recording.

    Raises
    ------
    FileError
        When the file cannot be written, for instance because the disk is full.
    """
    scratch = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    encoding = {str(name): {"zlib": True, "complevel": 1} for name in recording.data_vars}
    try:
        recording.to_netcdf(scratch, engine="netcdf4", encoding=encoding)
        os.replace(scratch, path)
    except (OSError, RuntimeError, ValueError) as error:  # RuntimeError: from the HDF library
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(
            f"cannot write {path}: {reason}: choose a folder that you may write to"
        ) from None
    finally:
        with contextlib.suppress(OSError):
            scratch.unlink(missing_ok=True)
    return path


def read_recording(path: str | Path) -> xr.Dataset:
    """Read a recording into memory.

    Raises
    ------
    FileError
        When the file cannot be read or is no NetCDF file.
    """
    try:
        with xr.open_dataset(path, engine="netcdf4") as opened:
            return opened.load()
    except (OSError, RuntimeError, ValueError) as error:
        raise FileError(f"cannot read recording {path}: {error}") from None
