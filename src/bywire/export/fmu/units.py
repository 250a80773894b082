"""Units as model descriptions have them: exponents of the SI's base units."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement

from bywire.core.quantities import display_unit
from bywire.core.units import base_powers, convert

_BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


def unit_definitions(units: Iterable[str]) -> Element:
    """Return the element ``UnitDefinitions`` of both versions.

    Each with the unit in which bywire shows it, where that is another one.
    """
    made = Element("UnitDefinitions")
    for unit in sorted(set(units)):
        if unit == "1":
            continue
        shown = SubElement(made, "Unit", name=unit)
        powers = zip(_BASES, base_powers(unit, _BASES), strict=True)
        SubElement(shown, "BaseUnit", {name: str(int(power)) for name, power in powers if power})
        display = display_unit(unit)
        if display != unit and not unit.startswith("delta") and unit != "K":
            factor = 1.0 / convert(1.0, display, unit)
            SubElement(shown, "DisplayUnit", name=display, factor=repr(factor))
    return made
