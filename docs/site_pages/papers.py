"""Page of each published source: its statements next to the computed values, with figures."""

from __future__ import annotations

from pathlib import Path

import bywire
from bywire.reproduction.reproduction import SOURCES
from site_pages.markdown import document_page


def sources() -> list[str]:
    """Return the names of all sources."""
    return list(SOURCES.all())


def page(source: str, folder: Path) -> str:
    """Compute and return the page of a source, and write its figures into the folder."""
    return document_page(bywire.reproduce(source).document(), folder / f"{source}-figures")
