"""The wedge brake on a quarter car with a motor at its wheel. Own values are in the TOML file."""

from __future__ import annotations

from pathlib import Path

from bywire.brakes.wedge.rigs.electric_corner import ElectricCornerParameters
from bywire.brakes.wedge.sets import corner, roberts2003
from bywire.reproduction.source_file import SourceFile

_FILE = SourceFile(Path(__file__).with_suffix(".toml"), {"roberts2003": roberts2003.FILE.citation})
ENTRIES = _FILE.sets(ElectricCornerParameters, {**corner.ENTRIES[0].values, **_FILE.values()})
