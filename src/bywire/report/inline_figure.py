"""Figures for one HTML file: vector graphics with ids of their own, or pixels where smaller."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from html import escape

from matplotlib.figure import Figure

from bywire.report.files import figure_bytes
from bywire.report.wording import clean

BUDGET = 2_000_000
"""bytes that the figures of a page may take together while they are vector graphics"""


def inline_figures(figures: Sequence[tuple[Figure, str]], budget: int = BUDGET) -> list[str]:
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


def _svg(figure: Figure, text: str, prefix: str) -> str:
    """Return a figure as SVG element whose ids no other figure of the page has."""
    whole = figure_bytes(figure, "svg").decode("utf-8")
    svg = whole[whole.index("<svg") :].strip()
    svg = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>|<style.*?</style>", "", svg, flags=re.S)
    head, body = svg.split(">", 1)
    kept = " ".join(re.findall(r'(?:viewBox|font-family)="[^"]*"', head))
    body = re.sub(r"<[^>]*>", lambda tag: _tag(tag[0], prefix), body)
    body = re.sub(r"\s*\n\s*", "\n", body)
    return f'<svg {kept} role="img" aria-label="{_attribute(text)}">{body}'


def _tag(tag: str, prefix: str) -> str:
    """Return a tag with ids of its own, and coordinates that are no finer than the eye."""
    if "#" in tag or ' id="' in tag:
        tag = re.sub(r'\bid="', f'id="{prefix}', tag.replace("xlink:href=", "href="))
        tag = re.sub(r'(href="|url\()#', rf"\1#{prefix}", tag)
    return re.sub(r'\bd="[^"]*"', lambda m: re.sub(r"(\.\d)\d+", r"\1", m[0]), tag)


def _png(figure: Figure, text: str) -> str:
    data = base64.b64encode(figure_bytes(figure, "png")).decode("ascii")
    return f'<img src="data:image/png;base64,{data}" alt="{_attribute(text)}">'


def _attribute(text: str) -> str:
    return escape(clean(text).replace("\n", " "), quote=True)
