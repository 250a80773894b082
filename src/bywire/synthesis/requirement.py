"""Requirements on a loop: a figure with its limit, as text such as ``"phase_margin >= 60 deg"``."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from bywire.core import units
from bywire.core.errors import ParameterError, UnitError, quoted, unknown_name

GAINS = ("gain_margin", "lower_gain_margin")
"""figures that are factors, and may be given in dB"""
_TEXT = re.compile(r"\s*([A-Za-z][\w -]*?)\s*(<=|>=|<|>)\s*(.+?)\s*", re.DOTALL)
_ZERO = 1e-3
"""What counts as zero where the limit is zero; all figures that can be zero are in %."""

STEADY = 0.05
"""Steady-state error that counts as none where zero is required [%]; converters round."""


@dataclass(frozen=True)
class Kind:
    """What is known about a figure.

    Parameters
    ----------
    unit
        Its unit; ``"%"`` of the step.
    low, high
        What any loop can have at all.
    definition
        One line.
    """

    unit: str
    low: float
    high: float
    definition: str


FIGURES: Mapping[str, Kind] = {
    "bandwidth": Kind("Hz", 0.0, math.inf, "lowest frequency at which the closed loop is at -3 dB"),
    "crossover": Kind("Hz", 0.0, math.inf, "highest frequency at which the loop gain falls to 1"),
    "phase_margin": Kind("degree", 0.0, 180.0, "smallest phase margin of all gain crossovers"),
    "gain_margin": Kind("1", 1.0, math.inf, "factor by which the loop gain may grow; also in dB"),
    "lower_gain_margin": Kind(
        "1", 0.0, 1.0, "factor to which the loop gain may fall; also in dB, below 0"
    ),
    "delay_margin": Kind("s", 0.0, math.inf, "dead time that the loop can take in addition"),
    "disk_margin": Kind("1", 0.0, 2.0, "symmetric disk margin"),
    "sensitivity_peak": Kind("1", 1.0, math.inf, "largest magnitude of 1/(1 + L)"),
    "complementary_peak": Kind("1", 0.0, math.inf, "largest magnitude of L/(1 + L)"),
    "noise_gain": Kind(
        "1", 0.0, math.inf, "rms of the output over that of white noise of each measured sample"
    ),
    "overshoot": Kind("%", 0.0, math.inf, "of the unit step at the sampling instants"),
    "settling_time": Kind("s", 0.0, math.inf, "of the unit step, to 2 % of its height"),
    "steady_state_error": Kind(
        "%", 0.0, math.inf, "what is left of a unit step after ten periods of the bandwidth"
    ),
}
"""figures that can be required"""


LESS_IS_BETTER = frozenset({
    "lower_gain_margin", "sensitivity_peak", "complementary_peak", "noise_gain", "overshoot",
    "settling_time", "steady_state_error",
})  # fmt: skip
"""figures of which a smaller value is better"""


@dataclass(frozen=True)
class Requirement:
    """A figure and its limit.

    Parameters
    ----------
    figure
        One of `FIGURES`.
    sense
        1 where the figure must not be below the limit, -1 where it must not be above.
    limit
        In the figure's unit.
    text
        As the user wrote it.
    """

    figure: str
    sense: int
    limit: float
    text: str

    @property
    def unit(self) -> str:
        """Unit of figure and limit."""
        return FIGURES[self.figure].unit

    def slack(self, value: float) -> float:
        """Return how far a value is on the right side, as a share of the limit; NaN is not."""
        limit = self.limit or (STEADY if self.figure == "steady_state_error" else _ZERO)
        share = self.sense * (value - limit) / limit
        return -math.inf if math.isnan(share) else share


def read(texts: Sequence[str]) -> tuple[Requirement, ...]:
    """Return requirements written as text.

    Parameters
    ----------
    texts
        Such as ``"bandwidth >= 10 Hz"``; blanks and hyphens in a figure's name are let pass.

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


def _read(text: str) -> Requirement:
    match = _TEXT.fullmatch(text) if isinstance(text, str) else None
    if match is None:
        raise ParameterError(
            f"requirement {quoted(text)} cannot be read: write for instance 'bandwidth >= 10 Hz'"
        )
    figure = re.sub(r"[ -]+", "_", match[1])
    if figure not in FIGURES:
        raise unknown_name("figure of a loop", figure, FIGURES)
    kind, sense = FIGURES[figure], 1 if match[2][0] == ">" else -1
    limit = _limit(match[3], figure, kind)
    # A limit at the end of what is possible demands nothing, or what no loop has.
    possible = kind.low <= limit <= kind.high and not (sense > 0 and limit >= kind.high)
    if not possible or not math.isfinite(limit) or (sense > 0 and limit <= 0):
        reach = f"above {kind.low:g}" if kind.high == math.inf else f"{kind.low:g} to {kind.high:g}"
        raise ParameterError(
            f"requirement {quoted(text)}: every loop has a {figure} of {reach} {kind.unit}; "
            "ask for something in between"
        )
    return Requirement(figure, sense, limit, f"{figure} {match[2]} {match[3]}")


def _limit(text: str, figure: str, kind: Kind) -> float:
    name = f"requirement {figure}"
    if figure in GAINS and text.endswith("dB"):
        return float(10.0 ** (units.parse(text.removesuffix("dB").strip(), "1", name) / 20.0))
    if kind.unit == "%":
        if not text.endswith("%") and not re.fullmatch(r"0+\.?0*", text):
            raise UnitError(f"{name} = {quoted(text)} is no limit in percent: write '<= 15 %'")
        return 100.0 * units.parse(text, "1", name)
    if kind.unit == "degree":
        if re.fullmatch(r"[-+\d.eE]+", text):
            raise UnitError(f"{name} = {quoted(text)} has no unit: write '{text} deg'")
        return math.degrees(units.parse(text.replace("°", "deg"), "rad", name))
    return units.parse(text, kind.unit, name)


def _require_compatible(first: Requirement, second: Requirement) -> None:
    if first.figure != second.figure:
        return
    if first.sense == second.sense:
        raise ParameterError(
            f"{first.figure} is required twice, {first.text!r} and {second.text!r}: "
            "leave one of them"
        )
    low, high = (first, second) if first.sense > 0 else (second, first)
    if low.limit > high.limit:
        raise ParameterError(
            f"{low.text!r} and {high.text!r} contradict each other: no loop meets both; "
            "change one of the limits"
        )
