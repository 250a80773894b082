"""The one legend of a figure whose panels share what their lines mean."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from matplotlib.artist import Artist
from matplotlib.figure import Figure

from bywire.report import style

_COLUMNS = 4  # that have room


def legend_outside(
    figure: Figure,
    handles: Sequence[Artist],
    place: Literal["left", "right"] = "left",
    *,
    columns: int = _COLUMNS,
) -> None:
    """Put one legend above all panels of a figure, at its left or right end."""
    figure.legend(
        handles=list(handles),
        ncols=columns,
        frameon=False,
        fontsize=style.TEXT_SIZE,
        loc="outside upper left" if place == "left" else "outside upper right",
    )
