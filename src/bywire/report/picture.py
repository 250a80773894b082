"""A figure that was drawn elsewhere: its files, in place of what draws them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Picture:
    """A figure that was drawn elsewhere.

    Parameters
    ----------
    png, svg
        Its files.
    axes
        Where its axes lie; see `bywire.report.inline_figure.axes_of`.
    """

    png: bytes
    svg: bytes
    axes: str
