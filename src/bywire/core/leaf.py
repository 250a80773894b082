"""What is known about one number of a parameter set: its name, unit and admissible range."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bywire.core.quantities import Unit
from bywire.core.units import convert


@dataclass(frozen=True)
class Leaf:
    """What is known about one number of a parameter set."""

    name: str
    unit: Unit
    low: float
    high: float
    low_open: bool
    high_open: bool
    is_whole: bool = False
    """whether only whole numbers are admissible"""

    def admits(self, value: float) -> bool:
        """Return whether a value [SI] lies in the admissible range."""
        above = value > self.low if self.low_open else value >= self.low
        return above and (value < self.high if self.high_open else value <= self.high)

    @property
    def range_text(self) -> str:
        """Admissible range as a user reads it, for instance ``> 0 ohm``."""
        return self.range_in(self.unit.symbol)

    def range_in(self, symbol: str) -> str:
        """Return the admissible range in a unit of the same dimension."""
        unit = "" if symbol == "1" else f" {symbol}"
        low, high = self.low, self.high
        if low == high:
            return f"exactly {convert(low, self.unit.symbol, symbol):g}{unit}"
        parts = []
        if not math.isinf(low):
            low = convert(low, self.unit.symbol, symbol)
            parts.append(f"{'>' if self.low_open else '>='} {low:g}{unit}")
        if not math.isinf(high):
            high = convert(high, self.unit.symbol, symbol)
            parts.append(f"{'<' if self.high_open else '<='} {high:g}{unit}")
        return " and ".join(parts) or f"any finite number{unit and ' in' + unit}"
