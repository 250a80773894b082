"""Detection of a measurement file's format by content and name."""

from __future__ import annotations

from pathlib import Path

from bywire.core.errors import FileError, quoted
from bywire.core.registry import Kind, instances
from bywire.core.scratch import NULL_CHARACTER
from bywire.data.file_format import FileFormat

_HEAD = 1024


# Known files that bywire does not read, by their first bytes: description and alternative.
_NOT_READ = (
    (b"TDSm", "a LabVIEW TDMS file", "Export it as CSV or LVM, or as MDF 4 with DIAdem"),
    (b"LOGG", "a Vector BLF file", "Export its signals as MDF 4 with CANoe or CANalyzer"),
    (b"TDEX", "a DIAdem TDX file", "Export it as CSV or MDF 4 with DIAdem"),
    (b"|CF,", "an imc FAMOS file", "Export it as CSV or MDF 4 with FAMOS"),
    (b"\xd0\xcf\x11\xe0", "an Excel workbook (.xls)", "Save its sheet as 'CSV UTF-8'"),
    (b"PK\x03\x04", "a ZIP archive (like .xlsx and .ods)", "Save its sheet as 'CSV UTF-8'"),
    (b"\x1f\x8b", "compressed with gzip", "Unpack it first"),
    (b"7z\xbc\xaf", "compressed with 7-Zip", "Unpack it first"),
    (b"#ROSBAG", "a ROS bag", "Export its topics as CSV"),
    (b"\x89MCAP", "a ROS 2 MCAP file", "Export its topics as CSV"),
    (b"SQLite format 3", "an SQLite database", "Export its table as CSV"),
    (b"%PDF", "a PDF file", "Request the source data"),
)
_ASC_OF_VECTOR = (b"date ", b"base ")  # first bytes of an ASC log of a bus

FORMATS = Kind("file format", ("formats",), instances(FileFormat), "bywire.data.formats")
"""every format of measurement files"""


def format_to_read(path: Path, name: str = "") -> FileFormat:
    """Return the format to read a file.

    Parameters
    ----------
    path
        The file.
    name
        Format that the user specifies; otherwise the extension selects among the formats that fit
        the content.

    Raises
    ------
    FileError
        When the file cannot be read, is empty, or does not match its extension or the name.
    UnknownNameError
        When there is no such format.
    """
    wanted = [FORMATS.find(name)] if name else _of_ending(path, to_read=True)
    head = head_of(path)
    if not head:
        raise FileError(
            f"{path} is empty (0 bytes). The recording or the copy may have been interrupted",
            name=str(path),
        )
    _require_readable(path, head)
    holds = [kind for kind in FORMATS.all().values() if kind.recognizes(head)]
    for kind in wanted or holds:
        if kind in holds:
            return kind
    if not wanted:
        raise FileError(
            f"{path} is not in a known format. Valid formats are {_names()}",
            name=str(path),
            valid=_names(),
        )
    said = f"format = {name!r}" if name else f"its extension {path.suffix!r}"
    if holds:
        content, hint = holds[0].title, f"Rename it, or specify format = {holds[0].name!r}"
    else:
        content = f"something else (it begins with {quoted(head[:8])})"
        hint = "Export it again from the program that recorded it"
        if wanted[0].name == "mat":
            hint = "If it is a MAT file of version 4, save it with '-v7' in MATLAB"
    raise FileError(
        f"{path} contains {content}, not {wanted[0].title} as {said} declares. {hint}",
        name=str(path),
    )


def _require_readable(path: Path, head: bytes) -> None:
    """Reject files that bywire cannot read, with an alternative."""
    for mark, what, way in _NOT_READ:
        if head.startswith(mark):
            raise FileError(f"{path} is {what}, which bywire does not read. {way}", name=str(path))
    if head[:5].lower() in _ASC_OF_VECTOR and b"base hex" in head.lower():
        raise FileError(
            f"{path} is an ASC log of bus messages, which bywire does not decode. Export its "
            "signals as MDF 4 with the program that recorded it",
            name=str(path),
        )


def format_to_write(path: Path, name: str = "") -> FileFormat:
    """Return the format to write a file, by its extension or by name.

    Raises
    ------
    FileError
        When the extension belongs to no format.
    UnknownNameError
        When there is no such format.
    """
    if name:
        return FORMATS.find(name)
    for kind in _of_ending(path):
        return kind
    endings = ", ".join(dict.fromkeys(e for kind in FORMATS.all().values() for e in kind.endings))
    raise FileError(
        f"{path}: {path.suffix!r} is not a known file extension. Use {endings}",
        name=str(path),
        value=path.suffix,
        valid=endings,
    )


def _of_ending(path: Path, *, to_read: bool = False) -> list[FileFormat]:
    ending = path.suffix.lower()
    return [
        kind
        for kind in FORMATS.all().values()
        if ending in kind.endings or (to_read and ending in kind.also_reads)
    ]


def _names() -> str:
    return ", ".join(FORMATS.all())


def head_of(path: Path) -> bytes:
    """Return the first bytes of a file, to recognize its format.

    Raises
    ------
    FileError
        When it is not a file or cannot be read.
    """
    try:
        if path.exists() and not path.is_file():
            raise FileError(
                f"{path} is not a file. Specify the path of a measurement file", name=str(path)
            )
        with path.open("rb") as stream:
            return stream.read(_HEAD)
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        reason = error.strerror if isinstance(error, OSError) else NULL_CHARACTER
        raise FileError(
            f"{path} cannot be read ({reason}). Check the path and its permissions", name=str(path)
        ) from None
