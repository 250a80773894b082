"""Kinds of TOML files that commands take, told from each other by their keys."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.core.errors import FileError, ParameterError
from bywire.data.toml_file import read_toml

BENCH, STUDY, LIFE, CAMPAIGN = "bench", "study", "life", "campaign"
_COMMANDS = {
    BENCH: "bywire run",
    STUDY: "bywire study run",
    LIFE: "bywire life",
    CAMPAIGN: "bywire faults",
}
_WORDS = {BENCH: "a bench", STUDY: "a study", LIFE: "a life", CAMPAIGN: "a campaign of faults"}
HEADS = {BENCH: "experiment", STUDY: "bench", LIFE: "life", CAMPAIGN: "bench"}
"""the key that each cannot do without"""
_OF_CAMPAIGNS = ("campaign", "criteria")
_NEVER_IN_STUDIES = {*_OF_CAMPAIGNS, "values", "residuals", "rates", "reaction"}
_NEVER_IN_CAMPAIGNS = {"design", "correlation", "requirements"}


def kind_of(content: Mapping[str, Any]) -> str:
    """Return what the content of a file is, by its keys; nothing where they do not tell.

    Examples
    --------
    >>> kind_of({"experiment": "hard-braking"}), kind_of({"bench": "b.toml", "vary": {}})
    ('bench', 'study')
    """
    keys = content.keys()
    if "life" in keys:
        return LIFE
    if "bench" not in keys:
        return BENCH if "experiment" in keys else ""
    if not keys & _NEVER_IN_STUDIES:
        return STUDY if keys & {"vary", "measured", *_NEVER_IN_CAMPAIGNS} else ""
    is_campaign = any(key in keys for key in _OF_CAMPAIGNS) and not keys & _NEVER_IN_CAMPAIGNS
    return CAMPAIGN if is_campaign else ""


def kind_of_file(file: Path) -> str:
    """Return what a file is, see `kind_of`; nothing of one that cannot be read."""
    try:
        return kind_of(read_toml(file, "file"))
    except FileError:
        return ""


def require_kind(content: Mapping[str, Any], wanted: str, file: Path) -> None:
    """Refuse the content of a file that is of another kind, and say which command takes it.

    Parameters
    ----------
    content
        What the file holds.
    wanted
        `BENCH`, `STUDY`, `LIFE` or `CAMPAIGN`.
    file
        Where it is.

    Raises
    ------
    ParameterError
        Without the file's name in front.
    """
    kind = kind_of(content)
    head = HEADS[wanted]
    if not kind or kind == wanted or (head in content and head != HEADS[kind]):
        return
    raise ParameterError(
        f"this is {_WORDS[kind]} and not {_WORDS[wanted]}: '{_COMMANDS[kind]} {file}' takes it"
    )
