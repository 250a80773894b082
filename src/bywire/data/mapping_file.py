"""Mapping files: TOML in, mapping out; nothing in them is executed."""

from __future__ import annotations

from pathlib import Path

from bywire.core.errors import InputError
from bywire.data.mapping import MeasurementMapping
from bywire.data.mapping_tables import mapping_from
from bywire.data.toml_file import read_toml


def read_mapping(path: str | Path) -> MeasurementMapping:
    """Read a mapping file.

    Parameters
    ----------
    path
        TOML file with ``time`` or ``rate`` and a section ``[signals.NAME]`` for each signal.

    Raises
    ------
    FileError
        When the file cannot be read or is no TOML.
    InputError
        For anything in it that does not fit, with the file's name in front.
    """
    file = Path(path)
    content = read_toml(file, "mapping")
    try:
        return mapping_from(content)
    except InputError as error:
        raise type(error)(f"{file}: {error}") from None
