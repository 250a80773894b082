"""For tests that look at files but not at figures: drawing takes most of a command's time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import pytest
from matplotlib.figure import Figure

from bywire.report import drawing, page

_drawn = drawing.figure_bytes


@contextmanager
def undrawn() -> Iterator[None]:
    """Have figures made, and an empty one in their files."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawing, "figure_bytes", lambda figure, kind="png": _empty(kind))
        yield


@contextmanager
def drawn_once(laid_out: bool = False) -> Iterator[None]:
    """Have every figure drawn for its file, in few pixels, not again for a page.

    To lay out what is drawn takes twice as long.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawing, "PNG_DPI", 50)
        if not laid_out:
            patch.setattr(drawing, "settle", lambda figure: figure.set_layout_engine("none"))
        patch.setattr(page, "inline_figures", _inline)
        yield


@pytest.fixture
def drawn() -> None:
    """Have the figures of a test laid out and drawn: one test of each kind of them asks for it."""


@pytest.fixture(autouse=True)
def undrawn_unless_asked(request: pytest.FixtureRequest) -> Iterator[None]:
    """Have files of figures without what is in them; for the conftest of a folder."""
    with drawn_once() if "drawn" in request.fixturenames else undrawn():
        yield


def _inline(figures: list[tuple[Any, str]]) -> list[str]:
    return drawing.inline_figures([(Figure((1.0, 1.0)), text) for _, text in figures])


@cache
def _empty(kind: str) -> bytes:
    return _drawn(Figure((1.0, 1.0)), kind)
