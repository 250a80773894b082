"""Piezoresistive absolute pressure sensor, with a reading that is a fraction of its span."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import SignedPressure
from bywire.core.signals import Signal
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.core.validity import first, outside, within_limits

AbsolutePressure = Annotated[float, Signal("Pa", "absolute pressure", 2e6)]
Reading = Annotated[float, Signal("1", "reading, fraction of the range", 0.5)]


class Parameters(ParameterSet):
    """Linear sensor without dynamics, which saturates at the ends of its range."""

    p_low: SignedPressure
    """minimum absolute pressure of the range"""
    p_high: SignedPressure
    """maximum absolute pressure of the range"""
    place: Literal["master-cylinder", "mid-pipeline"]
    """sensor position; mid-pipeline measures the mean of the pressures at both ends"""

    @model_validator(mode="after")
    def _ordered(self) -> Parameters:
        if not self.p_low < self.p_high:
            raise RuleError(
                "p_low", shown(self.p_low, "Pa"), f"< p_high = {shown(self.p_high, 'Pa')}"
            )
        return self


class Input(NamedTuple):
    """Absolute pressure at the sensor."""

    p: AbsolutePressure


def reading(p: AbsolutePressure, par: Parameters) -> Reading:
    """Return the reading, 0 to 1, for an absolute pressure."""
    return ops.clip((p - par.p_low) / (par.p_high - par.p_low), 0.0, 1.0)


def value(share: Reading, par: Parameters) -> AbsolutePressure:
    """Return the absolute pressure for a reading."""
    return par.p_low + share * (par.p_high - par.p_low)


@within_limits
def watch(t: Array, u: Input, par: Parameters) -> list[str]:
    """Warn if the pressure leaves the sensor's range, with the time when it first does."""
    span = f"{par.p_low / 1e5:g} to {par.p_high / 1e5:g} bar absolute"
    text = f"the pressure leaves the sensor's range, {span},"
    beyond = outside(u.p, par.p_low, par.p_high)
    return first(t, beyond, text, ": the measured value stays at the end of the range")
