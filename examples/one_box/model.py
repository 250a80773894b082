"""The brake without a vehicle."""

from __future__ import annotations

from typing import Any, ClassVar

from bywire.authoring import zeros
from one_box import ecu
from one_box.hydraulics import Hydraulics, released_memory, released_parts
from one_box.parameters import OneBoxParameters


class OneBox(Hydraulics[OneBoxParameters, ecu.Memory]):
    """The brake on a rig, with its valves at rest."""

    name: ClassVar[str] = "one-box"
    Memory: ClassVar = ecu.Memory

    def rest(self, par: OneBoxParameters) -> tuple[Any, ecu.Memory]:
        """Return the released brake."""
        return released(par)


def released(par: OneBoxParameters) -> tuple[Any, ecu.Memory]:
    """Return state and memory of the released brake."""
    return OneBox.state(**released_parts(par)), zeros(ecu.Memory)._replace(**released_memory(par))
