"""Requirements on a loop: limits of figures, as text such as ``"phase_margin >= 60 deg"``."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from itertools import combinations

from bywire.analysis.loop_figures import LOOP_FIGURES, LoopFigure
from bywire.bench.requirements import Limit, parted
from bywire.core import units
from bywire.core.errors import ParameterError, UnitError, quoted, unknown_name

_ZERO = 1e-3
"""What counts as zero where the limit is zero; all figures that can be zero are in %."""

STEADY = 0.05
"""Steady-state error that counts as none where zero is required [%]; converters round."""

_BY_WORD: Mapping[str, LoopFigure] = {
    **{figure.margin: figure for figure in LOOP_FIGURES.values() if figure.margin},
    **LOOP_FIGURES,
}
"""figures by what requirements may call them: their names, and those of `bywire margins --json`"""


def share_left(limit: Limit, value: float) -> float:
    """Return how far a value is on the right side, as a share of the limit; NaN is not."""
    bound = limit.bound or (STEADY if limit.figure == "steady_state_error" else _ZERO)
    share = (bound - value if limit.is_upper else value - bound) / bound
    return -math.inf if math.isnan(share) else share


def read(texts: Sequence[str]) -> tuple[Limit, ...]:
    """Return requirements written as text.

    Parameters
    ----------
    texts
        Such as ``"bandwidth >= 10 Hz"``; blanks and hyphens in a figure's name are let pass, and
        so are the names of `bywire.margins`, such as ``phase``.

    Raises
    ------
    UnknownNameError
        When a figure is unknown.
    ParameterError
        When a text cannot be read, a limit is beyond what any loop can have, or two texts
        contradict each other.
    UnitError
        When a limit's unit measures something else.
    """
    if not texts:
        raise ParameterError("no requirement is given: write for instance 'bandwidth >= 10 Hz'")
    requirements = tuple(_read(text) for text in texts)
    for first, second in combinations(requirements, 2):
        _require_compatible(first, second)
    return requirements


def _read(text: str) -> Limit:
    word, compare, written = parted(text) if isinstance(text, str) else ("", None, "")
    if not word or compare is None or not written:
        raise ParameterError(
            f"requirement {quoted(text)} cannot be read: write for instance 'bandwidth >= 10 Hz'"
        )
    word = re.sub(r"[ -]+", "_", word)
    if word not in _BY_WORD:
        raise unknown_name("figure of a loop", word, LOOP_FIGURES)
    figure, is_least = _BY_WORD[word], compare in (">=", ">")
    bound = _bound(written, figure)
    # A limit at the end of what is possible demands nothing, or what no loop has.
    possible = figure.low <= bound <= figure.high and not (is_least and bound >= figure.high)
    if not possible or not math.isfinite(bound) or (is_least and bound <= 0):
        low, high = figure.low, figure.high
        reach = f"above {low:g}" if high == math.inf else f"{low:g} to {high:g}"
        raise ParameterError(
            f"requirement {quoted(text)}: every loop has a {figure.name} of {reach} {figure.unit}; "
            "ask for something in between"
        )
    return Limit(figure.name, compare, bound, figure.unit, f"{compare} {written}")


def _bound(text: str, figure: LoopFigure) -> float:
    name = f"requirement {figure.name}"
    if figure.in_decibel and text.endswith("dB"):
        return float(10.0 ** (units.parse(text.removesuffix("dB").strip(), "1", name) / 20.0))
    if figure.unit == "%":
        if not text.endswith("%") and not re.fullmatch(r"0+\.?0*", text):
            raise UnitError(f"{name} = {quoted(text)} is no limit in percent: write '<= 15 %'")
        return 100.0 * units.parse(text, "1", name)
    if figure.unit == "deg":
        if re.fullmatch(r"[-+\d.eE]+", text):
            raise UnitError(f"{name} = {quoted(text)} has no unit: write '{text} deg'")
        return math.degrees(units.parse(text.replace("°", "deg"), "rad", name))
    return units.parse(text, figure.unit, name)


def _require_compatible(first: Limit, second: Limit) -> None:
    if first.figure != second.figure:
        return
    if first.is_upper == second.is_upper:
        raise ParameterError(
            f"{first.figure} is required twice, {str(first)!r} and {str(second)!r}: "
            "leave one of them"
        )
    low, high = (second, first) if first.is_upper else (first, second)
    if low.bound > high.bound:
        raise ParameterError(
            f"{str(low)!r} and {str(high)!r} contradict each other: no loop meets both; "
            "change one of the limits"
        )
