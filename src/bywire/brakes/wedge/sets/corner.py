"""The wedge brake on the front corner of a mid-size car. Its own values are in the TOML file."""

from __future__ import annotations

from pathlib import Path

from bywire.brakes.wedge.rigs.wedge_corner import WedgeCornerParameters
from bywire.brakes.wedge.sets import roberts2003
from bywire.core.catalog import derived
from bywire.plant.road import SURFACES
from bywire.reproduction.source_file import SourceFile

_ADHESION = {
    name: derived(value, "dry asphalt for car tires, commonly published values")
    for name, value in SURFACES["dry-asphalt"]._asdict().items()
}

_FILE = SourceFile(Path(__file__).with_suffix(".toml"), {"roberts2003": roberts2003.FILE.citation})
_VALUES = _FILE.values(groups={"dry_asphalt": _ADHESION})
ENTRIES = _FILE.sets(WedgeCornerParameters, {**roberts2003.ENTRIES[0].values, **_VALUES})
