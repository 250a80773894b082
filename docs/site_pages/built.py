"""Checks of a built site: no dead links, nothing from other hosts, all figures present."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from html import unescape
from pathlib import Path
from urllib.parse import unquote

_LINK = re.compile(r"<[^>]+\s(?:href|src)=\"([^\"]*)\"")
_ID = re.compile(r"\s(?:id|name)=\"([^\"]*)\"")
_OTHER = re.compile(r"[a-z+.-]+:|//", re.IGNORECASE)
_NOT_OURS = ("_static/", "_modules/")  # files of the theme; sources, linked by viewcode
# A script, style sheet, picture or frame that a browser would load from another host.
_ELSEWHERE = re.compile(
    r"<(?:script|img|iframe|link(?![^>]*rel=\"(?:canonical|search|author)\"))[^>]*"
    r"(?:src|href)=\"(?:https?:)?//[^\"]*",
    re.IGNORECASE,
)


def faults(folder: Path, pictures: Mapping[str, int]) -> Iterator[str]:
    """Yield the faults of a site.

    Parameters
    ----------
    folder
        The site.
    pictures
        Page -> minimum number of figures that it must show.
    """
    for path in sorted(folder.rglob("*.html")):
        page = path.relative_to(folder).with_suffix("").as_posix()
        if page.startswith(_NOT_OURS):
            continue
        text = path.read_text(encoding="utf-8")
        if loaded := _ELSEWHERE.search(text):
            yield f"{page} loads from another host: {loaded.group()}"
        if page.startswith("live/"):
            continue  # a separate page, whose script creates its links
        if text.count("<img") < pictures.get(page, 0):
            yield f"{page} does not show its {pictures[page]} figures"
        for target in sorted(set(_LINK.findall(text))):
            if not _leads_somewhere(path, unquote(unescape(target))):
                yield f"{page} has a dead link: {target}"


def _leads_somewhere(path: Path, target: str) -> bool:
    if _OTHER.match(target):
        return True
    name, _, anchor = target.partition("#")
    name = name.partition("?")[0]
    file = (path.parent / name).resolve() if name else path
    if not file.is_file():
        return False
    return not anchor or file.suffix != ".html" or anchor in _anchors(file)


@cache
def _anchors(path: Path) -> frozenset[str]:
    return frozenset(map(unescape, _ID.findall(path.read_text(encoding="utf-8"))))
