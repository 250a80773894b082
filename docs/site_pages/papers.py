"""Each published source: what it states beside what bywire computes, with its figures."""

from __future__ import annotations

from pathlib import Path

import bywire
from bywire.reproduction.reproduction import SOURCES
from site_pages.markdown import document_page


def sources() -> list[str]:
    """Return the names of all sources."""
    return list(SOURCES.all())


def page(source: str, folder: Path) -> str:
    """Return the page of a source, computed now; its figures go into the folder."""
    return document_page(bywire.reproduce(source).document(), folder / f"{source}-figures")
