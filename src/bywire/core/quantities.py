"""Physical quantities with unit and valid range, which are declared only once.

A parameter's type defines unit and range: ``R_m: Resistance`` has the unit ``ohm`` and the range
``> 0``. Internal values are in SI units with radians. Files, commands and figures use ``display``
units.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field


@dataclass(frozen=True)
class Unit:
    """SI unit and usual magnitude of a quantity.

    Parameters
    ----------
    symbol
        Unit, for example ``"N*m/A"``; ``"1"`` for a pure number.
    nominal
        Usual magnitude in this unit, which scales tolerances and the samples of contract tests.
    """

    symbol: str
    nominal: float = 1.0


# Units in files, figures and on the command line; internal values are in SI units.
DISPLAY_UNITS = {
    "Pa": "bar",
    "Pa/A": "bar/A",
    "A*Pa": "A*bar",
    "m": "mm",
    "s": "s",
    "m**3": "ml",
    "m**2": "mm**2",
    "m/rad": "mm/rad",
    "N/Pa": "N/bar",
    "K": "degC",
    "delta_degC": "K",
    "delta_degC/s": "K/s",
    "Pa/s": "bar/s",
}


def display_unit(symbol: str) -> str:
    """Return the display unit for an SI unit."""
    return DISPLAY_UNITS.get(symbol, symbol)


BY_SIZE: dict[str, tuple[tuple[float, str], ...]] = {
    "s": ((0.0, "ms"), (1.0, "s")),
    "m": ((0.0, "um"), (1e-4, "mm"), (1.0, "m")),
    "N": ((0.0, "N"), (1e3, "kN")),
    "Pa": ((0.0, "Pa"), (1e2, "bar")),
    "Pa/s": ((0.0, "Pa/s"), (1e2, "bar/s")),
    "J": ((0.0, "J"), (1e3, "kJ"), (1e6, "MJ")),
    "W": ((0.0, "W"), (1e3, "kW")),
}
"""units by SI unit, each with the minimum magnitude in the SI unit for which it is used"""
_OF_NOTHING = {"s": "ms"}  # unit of zero, if it is not the display unit


def readable_unit(size: float, symbol: str) -> str:
    """Return the most readable unit for a number of a certain size.

    Terminals, reports, pages and figures all use this rule; see `BY_SIZE`. Other quantities have
    one unit for all sizes; see `DISPLAY_UNITS`.

    Parameters
    ----------
    size
        Largest magnitude to display, in ``symbol``.
    symbol
        SI unit, or ``"%"``.

    Examples
    --------
    >>> readable_unit(0.06, "s"), readable_unit(41.0, "m"), readable_unit(0.002, "m")
    ('ms', 'm', 'mm')
    >>> readable_unit(12500.0, "N"), readable_unit(2e6, "Pa"), readable_unit(2e-5, "m")
    ('kN', 'bar', 'um')
    """
    if not size or symbol not in BY_SIZE:
        return _OF_NOTHING.get(symbol, display_unit(symbol))
    # A number just below a boundary is treated as the boundary: 0.9999999 s is not 1000 ms.
    return next(u for least, u in reversed(BY_SIZE[symbol]) if abs(size) * (1 + 1e-6) >= least)


_POSITIVE = Field(gt=0, allow_inf_nan=False)
_NOT_NEGATIVE = Field(ge=0, allow_inf_nan=False)
_FINITE = Field(allow_inf_nan=False)

# Electrical
Resistance = Annotated[float, Unit("ohm", 0.5), _POSITIVE]
InternalResistance = Annotated[float, Unit("ohm", 0.02), _NOT_NEGATIVE]
Inductance = Annotated[float, Unit("H", 1e-4), _POSITIVE]
Voltage = Annotated[float, Unit("V", 12.0), _POSITIVE]
Current = Annotated[float, Unit("A", 10.0), _POSITIVE]
SignedCurrent = Annotated[float, Unit("A", 10.0), _FINITE]
CurrentRate = Annotated[float, Unit("A/s", 0.2), _POSITIVE]
TorqueConstant = Annotated[float, Unit("N*m/A", 0.03), _POSITIVE]
FluxLinkage = Annotated[float, Unit("V*s", 6e-3), _POSITIVE]
PolePairs = Annotated[float, Unit("1", 4.0), Field(ge=1, le=50, allow_inf_nan=False)]

# Mechanical
Mass = Annotated[float, Unit("kg", 0.01), _POSITIVE]
Inertia = Annotated[float, Unit("kg*m**2", 3e-5), _POSITIVE]
Torque = Annotated[float, Unit("N*m", 0.01), _NOT_NEGATIVE]
Force = Annotated[float, Unit("N", 10.0), _NOT_NEGATIVE]
Length = Annotated[float, Unit("m", 0.01), _POSITIVE]
Position = Annotated[float, Unit("m", 0.01), _FINITE]
Area = Annotated[float, Unit("m**2", 1e-4), _POSITIVE]
Volume = Annotated[float, Unit("m**3", 1e-6), _NOT_NEGATIVE]
GearRatio = Annotated[float, Unit("m/rad", 3e-4), _POSITIVE]
Stiffness = Annotated[float, Unit("N/m", 1e6), _POSITIVE]
Damping = Annotated[float, Unit("N*s/m", 2e4), _NOT_NEGATIVE]
RotaryDamping = Annotated[float, Unit("N*m*s/rad", 2e-7), _NOT_NEGATIVE]
InverseSpeed = Annotated[float, Unit("s/rad", 5.0), _POSITIVE]
TorquePerPressure = Annotated[float, Unit("N*m/Pa", 1e-8), _NOT_NEGATIVE]

# Hydraulic
Pressure = Annotated[float, Unit("Pa", 2e6), _POSITIVE]
SignedPressure = Annotated[float, Unit("Pa", 2e6), _FINITE]
Density = Annotated[float, Unit("kg/m**3", 1e3), _POSITIVE]
KinematicViscosity = Annotated[float, Unit("m**2/s", 5e-4), _POSITIVE]
Conductance = Annotated[float, Unit("m**3/(s*Pa)", 1e-11), _NOT_NEGATIVE]

# Thermal
Temperature = Annotated[float, Unit("K", 400.0), _POSITIVE]
"""absolute temperature, displayed in degrees Celsius; differences have the unit ``delta_degC``,
displayed in K"""
TemperatureCoefficient = Annotated[float, Unit("1/K", 2e-3), _NOT_NEGATIVE]
HeatCapacity = Annotated[float, Unit("J/K", 1e3), _POSITIVE]
HeatConductance = Annotated[float, Unit("W/K", 1.0), _NOT_NEGATIVE]

# Tables
Nodes = tuple[Annotated[float, _NOT_NEGATIVE], ...]
"""numbers of a table, in the field's unit"""

# Signals and control
Duration = Annotated[float, Unit("s", 1e-3), _POSITIVE]
TimeConstant = Annotated[float, Unit("s", 1e-3), _NOT_NEGATIVE]
Frequency = Annotated[float, Unit("Hz", 100.0), _POSITIVE]
Fraction = Annotated[float, Unit("1", 0.9), Field(gt=0, le=1, allow_inf_nan=False)]
Weight = Annotated[float, Unit("1", 1.0), Field(ge=0, le=1, allow_inf_nan=False)]
Factor = Annotated[float, Unit("1", 1.0), _POSITIVE]
Gain = Annotated[float, Unit("1", 1.0), _NOT_NEGATIVE]
BreakawayFactor = Annotated[float, Unit("1", 2.0), Field(ge=1, allow_inf_nan=False)]
CurrentPerPressure = Annotated[float, Unit("A/Pa", 1e-6), _NOT_NEGATIVE]
CurrentPerPressureTime = Annotated[float, Unit("A/(Pa*s)", 1e-5), _NOT_NEGATIVE]
CurrentTimePerPressure = Annotated[float, Unit("A*s/Pa", 1e-7), _NOT_NEGATIVE]
DutyPerCurrent = Annotated[float, Unit("1/A", 5e-3), _NOT_NEGATIVE]
DutyPerCurrentTime = Annotated[float, Unit("1/(A*s)", 10.0), _NOT_NEGATIVE]
