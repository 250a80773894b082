"""TSV: text tables whose columns are separated by tabs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from bywire.core.typing import Progress
from bywire.data.formats import csv

if TYPE_CHECKING:
    import xarray as xr


def _write(dataset: xr.Dataset, path: Path, progress: Progress) -> None:
    csv.write_table(dataset, path, progress, "\t")


FORMAT = replace(csv.FORMAT, name="tsv", endings=(".tsv", ".tab"), write=_write)
