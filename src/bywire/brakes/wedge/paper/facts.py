"""What Roberts et al. (2003) state, and our tolerances."""

from __future__ import annotations

from pathlib import Path

from bywire.brakes.wedge.sets import roberts2003
from bywire.reproduction.source_file import SourceFile

CITATION = roberts2003.FILE.citation
FILE = SourceFile(Path(__file__).with_name("roberts2003.toml"))
FACTS, ALLOWANCES = FILE.facts, FILE.allowances
