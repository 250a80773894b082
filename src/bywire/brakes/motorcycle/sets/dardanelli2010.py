"""Parameter sets of Dardanelli et al. (2010), whose values are in the TOML file."""

from __future__ import annotations

from pathlib import Path

from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.reproduction.source_file import SourceFile

FILE = SourceFile(Path(__file__).with_suffix(".toml"))
ENTRIES = FILE.sets(MotorcycleParameters, FILE.values())
