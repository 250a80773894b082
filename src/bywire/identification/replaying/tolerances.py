"""Tolerances of a replay: a figure with its limits, such as ``lag``: ``">= -1 ms and <= 5 ms"``.

Errors may go either way: an upper limit alone of a figure that has a sign bounds its magnitude.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Verdict
from bywire.bench.values import number
from bywire.core import units
from bywire.core.callers import option
from bywire.core.errors import ParameterError, UnitError, quoted, unknown_name

SIGNED = ("bias", "lag")
"""figures that may be negative"""
_SIGNS = ("<=", ">=", "<", ">")
_LIMIT = re.compile(r"\s*(<=|>=|<|>)\s*([^<>=]+?)\s*")
_BOTH = re.compile(r"\s+and\s+")


def read_tolerances(texts: Sequence[str]) -> dict[str, str]:
    """Return the limits of each figure, where one is named several times all of them.

    Raises
    ------
    ParameterError
        When a text has no figure, no sign or no limit.

    Examples
    --------
    >>> read_tolerances(["lag >= -1 ms", "nrmse <= 5 %", "lag <= 5 ms"])
    {'lag': '>= -1 ms and <= 5 ms', 'nrmse': '<= 5 %'}
    """
    limits: dict[str, str] = {}
    for text in texts:
        sign = next((s for s in _SIGNS if s in text), "")
        name, _, bound = (part.strip() for part in text.partition(sign or "<="))
        if not sign or not name or not bound:
            raise ParameterError(
                f"{option('tolerances')} {text!r} cannot be read: write for instance 'nrmse <= 5 "
                "%' or 'p_mc.max_error <= 2 bar'"
            )
        limit = f"{sign} {bound}"
        limits[name] = f"{limits[name]} and {limit}" if name in limits else limit
    return limits


def judge_fit(
    tolerances: Mapping[str, str], signal: str, kpis: Sequence[Kpi]
) -> tuple[Verdict, ...]:
    """Compare the figures of one signal with the limits that apply to it.

    Parameters
    ----------
    tolerances
        Figure, or ``SIGNAL.FIGURE``, which goes before it -> limits, joined by ``and``. An upper
        limit of ``bias`` or ``lag`` without a lower one bounds the magnitude.
    signal, kpis
        Name and figures.

    Raises
    ------
    ParameterError
        When a limit cannot be read, or no magnitude can meet it.
    UnitError
        When its unit measures something else than the figure.
    """
    by_name = {kpi.name: kpi for kpi in kpis}
    wanted = {key: key for key in tolerances if "." not in key}
    for key in tolerances:
        if key.startswith(f"{signal}."):
            wanted[key.removeprefix(f"{signal}.")] = key
    return tuple(
        verdict
        for name, key in wanted.items()
        for verdict in _verdicts(key, tolerances[key], by_name[name])
    )


def require_known(tolerances: Mapping[str, str], figures: Mapping[str, Sequence[Kpi]]) -> None:
    """Refuse tolerances of figures or signals that there are not.

    Parameters
    ----------
    figures
        Figures by signal.

    Raises
    ------
    UnknownNameError
        With the nearest names.
    """
    names = [f"{name}.{k.name}" for name, kpis in figures.items() for k in kpis]
    known = dict.fromkeys([*(name.rpartition(".")[2] for name in names), *names])
    for name in tolerances:
        if name not in known:
            raise unknown_name("figure", name, known)


def _verdicts(key: str, text: str, kpi: Kpi) -> list[Verdict]:
    limits = [_limit(key, limit, kpi.unit) for limit in _BOTH.split(text.strip())]
    magnitude = kpi.name in SIGNED and not any(sign.startswith(">") for sign, *_ in limits)
    value = abs(kpi.value) if magnitude else kpi.value
    verdicts = []
    for sign, bound, written in limits:
        if magnitude and bound < 0.0:
            raise ParameterError(
                f"tolerance {key} {written} bounds the magnitude, which is never negative: give a "
                f"lower limit as well, such as '{key} >= ...', and both are taken with their sign"
            )
        met = {"<=": value <= bound, ">=": value >= bound, "<": value < bound, ">": value > bound}
        is_decided = not (abs(value - bound) <= kpi.bound or math.isinf(kpi.bound))
        holds = is_decided and met[sign] and not math.isnan(value)
        verdicts.append(
            Verdict(key, written, kpi.value, kpi.unit, holds, kpi.note, kpi.bound, is_decided)
        )
    return verdicts


def _limit(key: str, text: str, unit: str) -> tuple[str, float, str]:
    """Return comparison, limit in the figure's unit, and both as text."""
    example = f"{key} <= {'5 %' if unit == '%' else units.example(unit)}"
    match = _LIMIT.fullmatch(text)
    if match is None:
        raise ParameterError(
            f"tolerance {key} = {quoted(text)} cannot be read: write for instance '{example}'"
        )
    sign, limit = match[1], match[2]
    written = f"{sign} {limit}"
    if unit == "%" and not limit.endswith("%"):  # 5 would be a share of 500 %
        raise UnitError(
            f"tolerance '{key} {written}' needs percent: write for instance '{example}'"
        )
    try:
        bound = number(limit, "1" if unit == "%" else unit, key)
    except UnitError:
        raise UnitError(
            f"tolerance '{key} {written}' is no limit in {unit}: write for instance '{example}'"
        ) from None
    return sign, (100.0 * bound if unit == "%" else bound), written
