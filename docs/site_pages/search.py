"""Check of the site's search: queries, and the page that each must find."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping

MUST_FIND = {
    "install windows": "install",
    "install macos": "install",
    "simulink": "coming-from",
    "hysteresis loop": "_generated/experiments/ramp",
    "fmu fmpy": "fmu",
    "wear pads": "life",
    "compiler": "install",
}


def missed(
    index: str, stem: Callable[[str], str], queries: Mapping[str, str] = MUST_FIND
) -> dict[str, str]:
    """Return the queries that do not lead to their page.

    Parameters
    ----------
    index
        Text of ``searchindex.js``.
    stem
        Function that returns the stem of a word, as in the index.
    queries
        Words -> the page that contains all of them.
    """
    read = json.loads(index[index.index("{") : index.rindex("}") + 1])
    pages = read["docnames"]

    def found(word: str) -> set[str]:
        numbers: set[int] = set()
        for terms in (read["terms"], read["titleterms"]):
            places = terms.get(stem(word), [])
            numbers |= {places} if isinstance(places, int) else set(places)
        return {pages[number] for number in numbers}

    return {
        query: page
        for query, page in queries.items()
        if not all(page in found(word) for word in query.split())
    }
