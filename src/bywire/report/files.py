"""Figures to bytes and files: the same input gives the same bytes, and no file is half written."""

from __future__ import annotations

import io
import os
import warnings
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from bywire.core.errors import FileError
from bywire.core.scratch import replacing

PNG_DPI = 160
"""pixels per inch of a PNG"""

_PIL = {"compress_level": 4}
"""zlib's default of 6 takes a third longer for a whole figure, to save 3 %"""
_METADATA: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None, "Format": None, "Type": None},
}


def figure_bytes(figure: Figure, kind: str = "png") -> bytes:
    """Return a figure as a PNG or SVG file.

    The first time, the layout of the figure is computed and then kept: computed again it would
    move by fractions of a pixel, and the same figure would give other bytes.

    ``figure``: figure to draw; ``kind``: ``"png"`` or ``"svg"``.

    Raises
    ------
    FileError
        For any other kind.
    """
    if kind not in _METADATA:
        raise FileError(f"figures are written as .png or .svg, not as {kind!r}: change the ending")
    buffer = io.BytesIO()
    settings = mpl.rc_context({"svg.hashsalt": "bywire", "svg.fonttype": "path"})
    with settings, warnings.catch_warnings():
        # A character that the font lacks is drawn as a box; that is no reason to fail.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        _settle(figure)
        packed: Any = {"pil_kwargs": _PIL} if kind == "png" else {}
        figure.savefig(buffer, format=kind, dpi=PNG_DPI, metadata=_METADATA[kind], **packed)
    return buffer.getvalue()


def _settle(figure: Figure) -> None:
    """Compute the layout of a figure once and for all.

    No engine is left: "none" would leave a placeholder for which savefig draws everything twice.
    """
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        with mpl.rc_context({"figure.autolayout": False, "figure.constrained_layout.use": False}):
            figure.set_layout_engine(None)


def save_figure(figure: Figure, path: str | os.PathLike[str]) -> Path:
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
