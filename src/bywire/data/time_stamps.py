"""Times of day and dates in the cells of text tables, as nanoseconds.

Times of day continue past midnight (see `over_midnight`). bywire reads only unambiguous formats of
dates: 2026-11-26 and 26.11.2026, but not 11/26/2026.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

CLOCK, MOMENT, DAY, DIGITS = "time of day", "date and time", "date", "hhmmss"
"""kinds of time stamps; the last one is a number such as 91233.5 for 09:12:33.5"""

_SECOND = 10**9  # nanoseconds
_DAY = 86400 * _SECOND
_TIME = (
    r"(?P<h>[0-9]{1,2}):(?P<m>[0-9]{2})(?::(?P<s>[0-9]{2})(?:[.,:](?P<f>[0-9]{1,9})[0-9]*)?)?"
    r"(?: ?(?P<half>[AaPp])[.]?[Mm][.]?)?"
)
_DATE = (
    r"(?:(?P<Y>[0-9]{4})(?P<sep>[-/.])(?P<M>[0-9]{1,2})(?P=sep)(?P<D>[0-9]{1,2})"
    r"|(?P<D2>[0-9]{1,2})\.(?P<M2>[0-9]{1,2})\.(?P<Y2>[0-9]{4}))"
)
_ZONE = r"(?: ?(?P<zone>Z|UTC|[+-][0-9]{2}:?[0-9]{2}))?"
_CLOCK = re.compile(_TIME)
_MINUTES = re.compile(r"(?P<m>[0-9]{1,3}):(?P<s>[0-9]{2})[.,](?P<f>[0-9]{1,9})[0-9]*")
_MOMENT = re.compile(rf"{_DATE}(?:[T ] *|, *){_TIME}{_ZONE}")
_DAY_ALONE = re.compile(_DATE)
_UNCLEAR = re.compile(r"[0-9]{1,2}[/-][0-9]{1,2}[/-](?:[0-9]{4}|[0-9]{2})(?:[T ,]+[0-9].*)?")


def nanoseconds(cell: str, kind: str) -> int | None:
    """Return a stamp as nanoseconds since midnight, or since the year 1; None if it is not valid.

    Examples
    --------
    >>> nanoseconds("00:00:01.5", CLOCK), nanoseconds("0001-01-01T00:00:01", MOMENT)
    (1500000000, 86401000000000)
    """
    if kind == CLOCK:
        if match := _MINUTES.fullmatch(cell):
            return (60 * int(match["m"]) + int(match["s"])) * _SECOND + _fraction(match["f"])
        match = _CLOCK.fullmatch(cell)
        return None if match is None or match["s"] is None else _of_day(match)
    if kind == DAY:
        match = _DAY_ALONE.fullmatch(cell)
        return None if match is None else _of_date(match)
    match = _MOMENT.fullmatch(cell)
    if match is None:
        return None
    day, time = _of_date(match), _of_day(match)
    if day is None or time is None:
        return None
    return day + time - _offset(match["zone"])


def kind_of_stamps(cells: Sequence[str]) -> str:
    """Return the common kind of stamps in some cells; empty if there is none."""
    for kind in (CLOCK, MOMENT, DAY):
        if cells and all(nanoseconds(cell, kind) is not None for cell in cells):
            return kind
    return ""


def is_stamp(cell: str) -> bool:
    """Return whether a cell is a time or a date, including ambiguous dates."""
    return bool(
        _UNCLEAR.fullmatch(cell)
        or any(p.fullmatch(cell) for p in (_CLOCK, _MINUTES, _MOMENT, _DAY_ALONE))
    )


def over_midnight(seconds: NDArray[np.float64]) -> int:
    """Make times of day continue past midnight, in place; return the number of midnights."""
    there = np.flatnonzero(np.isfinite(seconds))
    steps = np.diff(seconds[there])
    passed = np.flatnonzero(steps < -43200.0)  # backward jumps of more than half a day
    days = np.zeros(seconds.size)
    days[there[passed + 1]] = 86400.0
    seconds += np.cumsum(days)
    return passed.size


def of_digits(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the seconds since midnight of numbers such as 91233.5 for 09:12:33.5."""
    hours = np.floor(numbers / 1e4)
    minutes = np.floor((numbers - 1e4 * hours) / 1e2)
    seconds = numbers - 1e4 * hours - 1e2 * minutes
    wrong = (hours > 24) | (minutes > 59) | (seconds >= 61.0)
    return np.where(wrong, np.nan, 3600.0 * hours + 60.0 * minutes + np.round(seconds, 9))


def _of_day(match: re.Match[str]) -> int | None:
    hours, minutes, seconds = int(match["h"]), int(match["m"]), int(match["s"] or 0)
    if match["half"]:
        if not 1 <= hours <= 12:
            return None
        hours = hours % 12 + 12 * (match["half"] in "Pp")
    if hours > 24 or minutes > 59 or seconds > 60:
        return None
    return (3600 * hours + 60 * minutes + seconds) * _SECOND + _fraction(match["f"])


def _fraction(digits: str | None) -> int:
    return int((digits or "").ljust(9, "0"))


def _of_date(match: re.Match[str]) -> int | None:
    if match["Y"]:
        return _ordinal(int(match["Y"]), int(match["M"]), int(match["D"]))
    return _ordinal(int(match["Y2"]), int(match["M2"]), int(match["D2"]))


@lru_cache(64)
def _ordinal(year: int, month: int, day: int) -> int | None:
    try:
        return date(year, month, day).toordinal() * _DAY
    except ValueError:
        return None


def _offset(zone: str | None) -> int:
    if not zone or zone in ("Z", "UTC"):
        return 0
    minutes = 60 * int(zone[1:3]) + int(zone[-2:])
    return (-1 if zone[0] == "-" else 1) * minutes * 60 * _SECOND
