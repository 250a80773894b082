"""Texts that are equal but for the last digits of their numbers."""

from __future__ import annotations

import math
import re

_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\d)", re.ASCII)
_RELATIVE = 2e-3
_NOISE = 1e-7
"""numbers below are what rounding left"""


def difference(old: str, new: str) -> str:
    """Return the first line that differs, old and new, or nothing."""
    before, after = old.splitlines(), new.splitlines()
    for number, (a, b) in enumerate(zip(before, after, strict=False), 1):
        if not _is_same(a, b):
            return f"line {number}:\n- {a}\n+ {b}"
    if len(before) != len(after):
        longer, sign = (before, "-") if len(before) > len(after) else (after, "+")
        number = min(len(before), len(after))
        return f"line {number + 1}:\n{sign} {longer[number]}"
    return ""


def _is_same(a: str, b: str) -> bool:
    if a == b:
        return True
    if _NUMBER.sub("#", a) != _NUMBER.sub("#", b):
        return False
    numbers = zip(_NUMBER.findall(a), _NUMBER.findall(b), strict=True)
    return all(
        math.isclose(float(x), float(y), rel_tol=_RELATIVE, abs_tol=_NOISE) for x, y in numbers
    )
