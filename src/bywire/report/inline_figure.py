"""Figures for one HTML file: vector graphics with ids of their own, or pixels where smaller."""

from __future__ import annotations

import base64
import json
import re
import struct
from collections.abc import Sequence
from html import escape

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bywire.report.files import figure_bytes
from bywire.report.picture import Picture
from bywire.report.wording import clean

_TIME = re.compile(r"time \[(m?s)\]")  # the label of an abscissa
_DECIMALS = re.compile(r"(\.\d)\d+")  # of a coordinate; what is kept of them
_SECONDS = {"s": 1.0, "ms": 1e-3}

BUDGET = 2_000_000
"""bytes that the figures of a page may take together while they are vector graphics"""


def inline_figures(
    figures: Sequence[tuple[Figure | Picture, str]], budget: int = BUDGET
) -> list[str]:
    """Return the HTML of figures with their captions as descriptions.

    All are SVG at first; while they exceed the budget, the largest becomes a PNG if that is
    smaller.

    ``figures``: figures and the texts that stand for them where they cannot be seen; ``budget``:
    bytes for all of them.
    """
    markup = [_svg(figure, text, f"f{k}-") for k, (figure, text) in enumerate(figures, 1)]
    largest_first = sorted(range(len(markup)), key=lambda k: -len(markup[k]))
    for k in largest_first:
        if sum(map(len, markup)) <= budget:
            break
        markup[k] = min(markup[k], _png(*figures[k]), key=len)
    return markup


def _svg(figure: Figure | Picture, text: str, prefix: str) -> str:
    """Return a figure as SVG element whose ids no other figure of the page has."""
    whole = figure_bytes(figure, "svg").decode("utf-8")
    svg = whole[whole.index("<svg") :].strip()
    svg = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>|<style.*?</style>", "", svg, flags=re.S)
    head, body = svg.split(">", 1)
    kept = " ".join(re.findall(r'(?:viewBox|font-family)="[^"]*"', head))
    body = re.sub(r"<[^>]*>", lambda tag: _tag(tag[0], prefix), body)
    # With a pattern that may begin with any blank this takes five times as long.
    body = re.sub(r"\n\s+", "\n", body.replace(" \n", "\n"))
    return f'<svg {kept} role="img" aria-label="{_attribute(text)}"{axes_of(figure)}>{body}'


def axes_of(figure: Figure | Picture) -> str:
    """Return an attribute that says where axes lie, as shares of the figure, and what they span."""
    if isinstance(figure, Picture):
        return figure.axes
    known = [
        {
            "box": [round(float(each), 5) for each in axes.get_position().extents],
            "x": _span(axes.get_xlim(), axes.get_xscale()),
            "y": _span(axes.get_ylim(), axes.get_yscale()),
            **_time(axes),
        }
        for axes in figure.axes
        if {axes.get_xscale(), axes.get_yscale()} <= {"linear", "log"} and axes.axison
    ]
    text = json.dumps(known, separators=(",", ":"))
    return f' data-axes="{escape(text, quote=True)}"' if known else ""


def _time(axes: Axes) -> dict[str, float]:
    """Return how long a unit of an abscissa over time is [s]; nothing of any other abscissa."""
    together = axes.get_shared_x_axes().get_siblings(axes)
    labels = (_TIME.fullmatch(each.get_xlabel()) for each in together)
    return next(({"t": _SECONDS[found[1]]} for found in labels if found), {})


def _span(limits: tuple[float, float], scale: str) -> list[float | bool]:
    return [*(float(f"{each:.8g}") for each in limits), scale == "log"]


def _tag(tag: str, prefix: str) -> str:
    """Return a tag with ids of its own, and coordinates that are no finer than the eye."""
    tag = tag.replace("xlink:href=", "href=").replace(' id="', f' id="{prefix}')
    tag = tag.replace('href="#', f'href="#{prefix}').replace("url(#", f"url(#{prefix}")
    # Put together from what is kept, in half the time that it takes to replace the rest.
    return re.sub(r' d="[^"]*"', lambda m: "".join(_DECIMALS.split(m[0])), tag)


def _png(figure: Figure | Picture, text: str) -> str:
    content = figure_bytes(figure, "png")
    width, height = struct.unpack(">II", content[16:24])  # of the header
    data = base64.b64encode(content).decode("ascii")
    return (
        f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{_attribute(text)}"'
        f"{axes_of(figure)}>"
        f'<image width="{width}" height="{height}" href="data:image/png;base64,{data}"/></svg>'
    )


def _attribute(text: str) -> str:
    return escape(clean(text).replace("\n", " "), quote=True)
