"""Identity of a computation: everything that affects its figures, as stored in its folder."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any, Protocol


class Plan(Protocol):
    """Computation whose finished pieces can be reused, such as a study or a campaign."""

    @property
    def name(self) -> str:
        """Name in reports."""
        ...

    @property
    def digest(self) -> str:
        """Identity of the plan."""
        ...

    @property
    def identity(self) -> Mapping[str, Any]:
        """Everything that affects the figures of its pieces."""
        ...


_SHOWN = 3  # number of differing entries to list
_WORDS = {
    "version": "the version of bywire",
    "computed equations": "the equations of the model",
    "computed figures": "the computation of the runs or their key figures",
    "points": "the random points from the library",
}
"""entries whose values are not meaningful to a reader"""
_PARTS = {"varied": ("", "together", "quantiles"), "stimuli": ("", "parameters")}
"""entries whose values are lists, with the meaning of each element"""


def as_json(identity: Mapping[str, Any]) -> dict[str, Any]:
    """Return an identity with only JSON types, as it is stored."""
    kept: dict[str, Any] = json.loads(json.dumps(identity, sort_keys=True, default=str))
    return kept


def digest_of(identity: Mapping[str, Any]) -> str:
    """Return the digest of an identity."""
    text = json.dumps(identity, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def differing(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Describe the entries in which two identities differ; empty if the earlier one is unknown.

    Examples
    --------
    >>> differing({"seed": 1, "parameters": {"motor.R_m": 0.35}}, {"seed": 2, "parameters": {}})
    'parameters motor.R_m: 0.35, now nothing; seed: 1, now 2'
    """
    if not before:
        return ""
    if "brake" in before:  # the digest of its source, an earlier identity of studies
        return "an older version of bywire has written it"
    old, new = dict(_entries(before)), dict(_entries(now))
    differ = [name for name in sorted({*old, *new}) if old.get(name) != new.get(name)]
    names = [name for name in differ if not _is_said(name, old, new)]
    texts = [_difference(name, old, new) for name in names[:_SHOWN]]
    rest = [f"and {len(names) - _SHOWN} more"] if len(names) > _SHOWN else []
    return "; ".join(texts + rest)


def _is_said(name: str, old: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    """Return whether a difference follows from the difference of another entry.

    Quantiles differ if the text of a distribution differs, and so do all entries of newly varied
    numbers.
    """
    whole, _, part = name.rpartition(" ")
    if part == "quantiles":
        return old.get(whole) != new.get(whole)
    return part == "together" and (whole in old) != (whole in new)


def _difference(name: str, old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    if name in _WORDS:
        return _WORDS[name]
    before, now = _shown(old.get(name)), _shown(new.get(name))
    return f"{name}: {before}, now {now}" if before != now else f"{name}: other values"


def _shown(value: Any) -> str:
    if isinstance(value, list):
        value = ", ".join(map(str, value))
    text = "nothing" if value is None or value == "" else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _entries(identity: Mapping[str, Any], group: str = "") -> list[tuple[str, Any]]:
    """Return the entries, with readable names for those of groups."""
    entries: list[tuple[str, Any]] = []
    for key, value in identity.items():
        name = f"{group} {key}".strip()
        if isinstance(value, Mapping):
            entries += _entries(value, name)
        elif group in _PARTS and isinstance(value, list):
            entries += _entries(dict(zip(_PARTS[group], value, strict=False)), name)
        else:
            entries.append((name, value))
    return entries
