"""What a dither must do, and the dithers to compare."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Factor, Fraction, Frequency, Pressure, Unit
from bywire.synthesis.study import require_ranges

Count = Annotated[int, Unit("1", 8.0), Field(ge=3, le=101)]
Node = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Pressures = Annotated[tuple[Node, ...], Unit("Pa", 2e6), Field(min_length=1, max_length=20)]

ASSUMPTIONS = (
    "Each dither is tried on the nonlinear brake with the pressure loop closed, which takes the "
    "pressure to the set point from below and from above.",
    "The amplitude is the gain times the ECU's own eqs. (18) and (19): it follows the pressure.",
    "Friction counts as overcome when the share of the time stuck and the dead band left (mean "
    "current from above less that from below, over the band in which the piston may rest) stay "
    "within their limits, at this gain and at all higher ones.",
    "The price is the copper power beside that of the mean current, mean over the pressures; "
    "figures between two gains of the grid are interpolated.",
    "Periods are even numbers of the ECU's sample times.",
    "Wear, noise and heat of motor and seals are left out.",
)


class Options(ParameterSet):
    """Pressures, dithers and limits."""

    pressures: Pressures
    """pressures at which friction is to be overcome"""
    gain_min: Factor
    """smallest gain of the dither's law"""
    gain_max: Factor
    """largest gain of the dither's law"""
    gains: Count
    """number of gains, evenly spread"""
    f_min: Frequency
    """lowest frequency"""
    f_max: Frequency
    """highest frequency"""
    frequencies: Count
    """number of frequencies, about evenly spread in their logarithm"""
    stuck_max: Fraction
    """largest share of the time stuck"""
    band_max: Fraction
    """largest share of the dead band left"""
    ripple_max: Pressure
    """largest ripple of the caliper's pressure, peak to peak"""
    approach: Pressure
    """distance from which each pressure is approached"""
    settle: Duration
    """time until the pressure loop has settled"""
    compare: Literal["waveforms", "none"]
    """whether waveforms and places of the low-pass filter are compared"""

    @model_validator(mode="after")
    def _ordered(self) -> Options:
        require_ranges(self, (("gain_min", "gain_max", "1"), ("f_min", "f_max", "Hz")))
        if any(not a < b for a, b in pairwise(self.pressures)):
            raise ValueError("pressures must be given in ascending order, none twice")
        lowest = min(self.pressures)
        if not self.approach < lowest:
            raise ValueError(
                f"approach = {self.approach / 1e5:g} bar must be below the lowest of the pressures,"
                f" {lowest / 1e5:g} bar: the approach from below starts there"
            )
        return self


DEFAULTS = Options(
    pressures=(5e5, 20e5, 35e5),
    gain_min=0.5,
    gain_max=2.25,
    gains=8,
    f_min=20.0,
    f_max=100.0,
    frequencies=8,
    stuck_max=0.1,
    band_max=0.05,
    ripple_max=0.5e5,
    approach=2e5,
    settle=4.0,
    compare="waveforms",
)
