"""What varies stays admissible: a study would silently answer another question."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from bywire.core.errors import ParameterError
from bywire.core.leaf import Leaf
from bywire.core.quantities import Unit
from bywire.core.units import shown
from bywire.studies.distribution import NEVER, Distribution
from bywire.studies.single_values import DISCRETE

_NEXT = {
    "tolerance": "take a narrower tolerance, or kind 'uniform' with ends within it",
    "uniform": "give 'low' and 'high' within it",
    "normal": "truncate it, with 'low' or 'high' within it",
    "log-normal": "take another 'median', or a smaller 'sd'",
    "triangular": "give 'low', 'mode' and 'high' within it",
}
"""what helps, by the kind of a distribution"""
_ROUNDING = 1e-12  # share of a range by which an end may miss a limit that it was meant to be at


def admitted(where: str, made: Distribution, leaf: Leaf, advice: str = "") -> Distribution:
    """Return a distribution that stays within the admissible range of its number.

    An end that rounding put beside a limit is at the limit. Where a distribution is truncated at a
    limit that is itself not admissible (``> 0``), it ends there but as one without an end: designs
    that go to the ends stop within it.

    Parameters
    ----------
    where
        What errors call it, for instance ``"[vary] motor.R_m"``.
    made, leaf
        How it varies, and what is known about it.
    advice
        What to do about a distribution that does not; by default what its kind has for that.

    Raises
    ------
    ParameterError
        With what is admissible, and the probability of what is not, or the end that is not.
    """
    if made.singles:
        _require_singles(where, made.singles, leaf)
        return made
    assert made.below is not None
    assert made.above is not None
    wanted, advice = leaf.range_text, advice or _NEXT[made.kind]
    beyond = made.below(leaf.low) + made.above(leaf.high)
    if beyond > NEVER:
        often = f", with a probability of {beyond:.2g}" if beyond < 1.0 else ""
        raise ParameterError(
            f"{where}: {made.text} leaves what is admissible, {wanted}{often}: {advice}"
        )
    low, high = (_at_limit(end, leaf, made.high - made.low) for end in (made.low, made.high))
    if made.kind == "normal":
        low = -math.inf if leaf.low_open and low == leaf.low else low
        high = math.inf if leaf.high_open and high == leaf.high else high
    for end in (low, high):
        if math.isfinite(end) and not leaf.admits(end):
            raise ParameterError(
                f"{where}: {made.text}: its end at {shown(end, leaf.unit.symbol)} is not "
                f"admissible, it must be {wanted}: {advice}"
            )
    return replace(made, low=low, high=high)


def require_single_values(where: str, kind: str, leaf: Leaf, nominal: float) -> None:
    """Refuse a distribution of a whole number that has any value between its ends.

    Parameters
    ----------
    where, kind
        What errors call it, and the kind of its distribution.
    leaf, nominal
        What is known about it, and what the bench has.

    Raises
    ------
    ParameterError
        With single values that it may have.
    """
    if not leaf.is_whole or kind == DISCRETE:
        return
    near = [x for x in (nominal - 1.0, nominal, nominal + 1.0) if leaf.admits(x)]
    raise ParameterError(
        f"{where} is a whole number, {leaf.range_text}, and kind {kind!r} has values in between: "
        f"vary it by kind = '{DISCRETE}', values = [{', '.join(f'{x:g}' for x in near)}] for "
        "instance"
    )


def whole(where: str, values: Sequence[float], leaf: Leaf) -> list[float]:
    """Return single values; of a whole number without the last digit that a share leaves.

    Raises
    ------
    ParameterError
        For those of a whole number that are not whole.
    """
    if not leaf.is_whole:
        return list(values)
    for value in values:
        if not math.isfinite(value) or abs(value - round(value)) > _ROUNDING * abs(value):
            raise ParameterError(
                f"{where}.values: {value:.10g} is not admissible: it must be a whole number, "
                f"{leaf.range_text}"
            )
    return [float(round(value)) for value in values]


def require_following(where: str, made: Distribution, leaf: Leaf, unit: Unit, ratio: float) -> None:
    """Refuse a distribution that takes what keeps its ratio to it out of the range of that.

    Parameters
    ----------
    where
        What errors call what follows.
    made, unit
        How the other one varies, and its unit.
    leaf
        What is known about the one that follows.
    ratio
        Its value over that of the other in the bench, not zero.

    Raises
    ------
    ParameterError
        As `admitted`, in the unit of the other one.
    """
    low, high = (leaf.low, leaf.low_open), (leaf.high, leaf.high_open)
    low, high = (low, high) if ratio > 0.0 else (high, low)
    admitted(where, made, Leaf(leaf.name, unit, low[0] / ratio, high[0] / ratio, low[1], high[1]))


def _require_singles(where: str, values: Sequence[float], leaf: Leaf) -> None:
    beyond = [value for value in values if not leaf.admits(value)]
    if beyond:
        texts = [", ".join(shown(x, leaf.unit.symbol) for x in each) for each in (values, beyond)]
        raise ParameterError(
            f"{where}: one of {texts[0]} leaves what is admissible, {leaf.range_text}: leave out "
            f"{texts[1]}"
        )


def _at_limit(end: float, leaf: Leaf, width: float) -> float:
    """Return an end, or the limit that it misses by rounding alone."""
    limits = [limit for limit in (leaf.low, leaf.high) if math.isfinite(limit)]
    room = _ROUNDING * width if math.isfinite(width) else 0.0
    return next((limit for limit in limits if abs(end - limit) <= room), end)
