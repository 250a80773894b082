"""Hall-effect current sensor, whose reading is a fraction of its span."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import SignedCurrent
from bywire.core.signals import Signal
from bywire.core.typing import Array
from bywire.core.validity import first, outside, within_limits

MotorCurrent = Annotated[float, Signal("A", "motor current", 5.0)]
Reading = Annotated[float, Signal("1", "reading, fraction of the range", 0.5)]


class Parameters(ParameterSet):
    """Linear sensor without dynamics, which saturates at the ends of its range."""

    i_low: SignedCurrent
    """minimum current of the range"""
    i_high: SignedCurrent
    """maximum current of the range"""

    @model_validator(mode="after")
    def _ordered(self) -> Parameters:
        if not self.i_low < self.i_high:
            raise RuleError("i_low", f"{self.i_low:g} A", f"< i_high = {self.i_high:g} A")
        return self


class Input(NamedTuple):
    """Current through the sensor."""

    i: MotorCurrent


def reading(i: MotorCurrent, par: Parameters) -> Reading:
    """Return the reading, 0 to 1, for a current."""
    return ops.clip((i - par.i_low) / (par.i_high - par.i_low), 0.0, 1.0)


def value(share: Reading, par: Parameters) -> MotorCurrent:
    """Return the current for a reading."""
    return par.i_low + share * (par.i_high - par.i_low)


@within_limits
def watch(t: Array, u: Input, par: Parameters) -> list[str]:
    """Warn if the current leaves the sensor's range, with the time when it first does."""
    text = f"the current leaves the sensor's range, {par.i_low:g} to {par.i_high:g} A,"
    beyond = outside(u.i, par.i_low, par.i_high)
    return first(t, beyond, text, ": the measured value stays at the end of the range")
