"""Units as model descriptions have them: exponents of the SI's base units."""

from __future__ import annotations

import re
from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement

from bywire.core.quantities import display_unit
from bywire.core.units import base_powers, convert

_BASES = {"kg": "kg", "m": "m", "s": "s", "A": "A", "K": "K", "mol": "mol", "cd": "cd"}


def unit_definitions(units: Iterable[str]) -> Element:
    """Return the element ``UnitDefinitions`` of both versions.

    Each with the unit in which bywire shows it, where that is another one.
    """
    made = Element("UnitDefinitions")
    for unit in sorted(set(units)):
        if unit == "1":
            continue
        shown = SubElement(made, "Unit", name=unit)
        powers = base_powers(unit, tuple(_BASES))
        exponents = {name: str(int(p)) for name, p in zip(_BASES, powers, strict=True) if p}
        if "rad" in unit:  # `base_powers` of these bases leaves it out
            exponents["rad"] = str(_radians(unit))
        SubElement(shown, "BaseUnit", {k: v for k, v in exponents.items() if v != "0"})
        display = display_unit(unit)
        if display != unit and not unit.startswith("delta") and unit != "K":
            factor = 1.0 / convert(1.0, display, unit)
            SubElement(shown, "DisplayUnit", name=display, factor=repr(factor))
    return made


def _radians(unit: str) -> int:
    """Return the exponent of rad in a unit such as ``N*m/rad`` or ``kg*m**2/rad**2``."""
    above, _, below = unit.partition("/")
    return _turns(above) - _turns(below)


def _turns(product: str) -> int:
    return sum(int(power or 1) for power in re.findall(r"\brad\b(?:\*\*(\d))?", product))
