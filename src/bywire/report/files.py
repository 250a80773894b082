"""Figures to bytes and files: the same input gives the same bytes, and no file is half written."""

from __future__ import annotations

import os
from pathlib import Path
from weakref import WeakKeyDictionary

from matplotlib.figure import Figure

from bywire.core.errors import FileError
from bywire.core.scratch import replacing
from bywire.report.drawing import drawn
from bywire.report.picture import Picture

PNG_DPI = 160
"""pixels per inch of a PNG"""

_KINDS = ("png", "svg")
_drawn: WeakKeyDictionary[Figure, tuple[bytes, bytes]] = WeakKeyDictionary()


def figure_bytes(figure: Figure | Picture, kind: str = "png") -> bytes:
    """Return a figure as a PNG or SVG file; it is drawn as both, and again only when changed.

    ``figure``: figure to draw; ``kind``: ``"png"`` or ``"svg"``.

    Raises
    ------
    FileError
        For any other kind.
    """
    if kind not in _KINDS:
        raise FileError(f"figures are written as .png or .svg, not as {kind!r}: change the ending")
    if isinstance(figure, Picture):
        return figure.png if kind == "png" else figure.svg
    if figure.stale or figure not in _drawn:
        _drawn[figure] = drawn(figure, PNG_DPI)
    return _drawn[figure][_KINDS.index(kind)]


def save_figure(figure: Figure | Picture, path: str | os.PathLike[str]) -> Path:
    """Write a figure as PNG or SVG, whichever the ending of the path says.

    Raises
    ------
    FileError
        When the ending is another one or the file cannot be written.
    """
    target = Path(path)
    return write_bytes(target, figure_bytes(figure, target.suffix.removeprefix(".").lower()))


def write_bytes(path: str | os.PathLike[str], content: bytes) -> Path:
    """Write a file whole or not at all; an older file stays until the new one is complete.

    The folder is made where it does not exist.

    Raises
    ------
    FileError
        When the folder cannot be made or written to; names the file and the reason.
    """
    target = Path(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with replacing(target) as fresh:
            fresh.write_bytes(content)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(
            f"cannot write {target}: {reason}: make room there, or choose a folder that you may "
            "write to"
        ) from None
    return target
