"""Tolerances of a replay: a figure with its limits, such as ``lag``: ``">= -1 ms and <= 5 ms"``.

Errors may go either way: an upper limit alone of a figure that has a sign bounds its magnitude.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Limit, Verdict, parted, read_limit, verdict_of
from bywire.core.callers import option
from bywire.core.errors import ParameterError, unknown_name

SIGNED = ("bias", "lag")
"""figures that may be negative"""
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
        name, compare, bound = parted(text)
        if compare is None or not name or not bound:
            raise ParameterError(
                f"{option('tolerances')} {text!r} cannot be read: write for instance 'nrmse <= 5 "
                "%' or 'p_mc.max_error <= 2 bar'"
            )
        limit = f"{compare} {bound}"
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
        verdict_of(limit, by_name[name])
        for name, key in wanted.items()
        for limit in _limits(key, tolerances[key], by_name[name])
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


def _limits(key: str, text: str, kpi: Kpi) -> list[Limit]:
    limits = [read_limit(key, limit, kpi.unit, "tolerance") for limit in _BOTH.split(text.strip())]
    if kpi.name not in SIGNED or not all(limit.is_upper for limit in limits):
        return limits
    for limit in limits:
        if limit.bound < 0.0:
            raise ParameterError(
                f"tolerance {limit} bounds the magnitude, which is never negative: give a "
                f"lower limit as well, such as '{key} >= ...', and both are taken with their sign"
            )
    return [replace(limit, of_magnitude=True) for limit in limits]
