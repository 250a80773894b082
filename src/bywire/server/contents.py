"""Contents of a folder: bench files, studies, results, measurements."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bywire.bench.result_folder import RECORD
from bywire.core.errors import FileError
from bywire.data.format_registry import FORMATS
from bywire.data.toml_file import (
    BENCH,
    CAMPAIGN,
    HEADS,
    LARGEST,
    LIFE,
    PROCEDURE,
    STUDY,
    kind_of,
    read_toml,
)
from bywire.server.place import Place

_DEEP, _MOST = 4, 5000  # maximum depth of nested folders and number of files in a search
_LEFT_OUT = ("node_modules", "__pycache__", "venv", "chunks")
REPORT = ".html"


@dataclass
class Contents:
    """Contents of a folder, as paths relative to it.

    Parameters
    ----------
    benches
        Bench files with their experiments.
    studies
        Study files with their benches.
    campaigns
        Files of fault campaigns with their benches.
    lives
        Life files with their lives.
    procedures
        Procedure files with their titles.
    results
        Result folders of benches, latest first.
    reports
        Pages of results, latest first.
    measurements
        Measurement files.
    maps
        Other TOML files, which may map columns to signals.
    is_whole
        Whether the search covered all files.
    """

    benches: dict[str, str] = field(default_factory=dict)
    studies: dict[str, str] = field(default_factory=dict)
    campaigns: dict[str, str] = field(default_factory=dict)
    lives: dict[str, str] = field(default_factory=dict)
    procedures: dict[str, str] = field(default_factory=dict)
    results: list[str] = field(default_factory=list)
    reports: list[str] = field(default_factory=list)
    measurements: list[str] = field(default_factory=list)
    maps: list[str] = field(default_factory=list)
    is_whole: bool = True


def endings() -> tuple[str, ...]:
    """Return the file extensions of measurement files."""
    return tuple(
        dict.fromkeys(ending for kind in FORMATS.all().values() for ending in kind.endings)
    )


def contents(place: Place) -> Contents:
    """Return the contents of a folder, without hidden files and symbolic links."""
    there, known = Contents(), endings()
    ages, results = dict[str, float](), dict[str, float]()
    for count, path in enumerate(_files(place.root, _DEEP)):
        if count >= _MOST:
            there.is_whole = False
            break
        name, suffix = place.named(path), path.suffix.lower()
        if suffix == ".toml":
            _note_toml(there, path, name)
        elif suffix == REPORT:
            ages[name] = path.stat().st_mtime
        elif path.name == RECORD and path.parent != place.root:
            results[place.named(path.parent)] = path.stat().st_mtime
        elif suffix in known and not _is_result(path):
            there.measurements.append(name)
    there.reports = sorted(ages, key=lambda name: -ages[name])
    there.results = sorted(results, key=lambda name: -results[name])
    return there


def _is_result(path: Path) -> bool:
    """Return whether a file is a recording of a result, next to the result's record."""
    return path.suffix.lower() == ".nc" and any(path.parent.glob("*.json"))


def _files(folder: Path, depth: int) -> Iterator[Path]:
    """Yield the regular files of a folder and its subfolders, sorted by name."""
    try:
        with os.scandir(folder) as entries:
            sorted_entries = sorted(entries, key=lambda entry: entry.name)
    except OSError:
        return
    for entry in sorted_entries:
        if entry.name.startswith(".") or entry.is_symlink():
            continue
        if entry.is_file():
            yield Path(entry.path)
        elif depth and entry.is_dir() and entry.name not in _LEFT_OUT:
            yield from _files(Path(entry.path), depth - 1)


def _note_toml(there: Contents, path: Path, name: str) -> None:
    try:
        if path.stat().st_size > LARGEST:
            return
        content: dict[str, Any] = read_toml(path, "file")
    except (FileError, OSError):
        return
    kind = kind_of(content)
    subject = content.get(HEADS.get(kind, ""))
    if isinstance(subject, str):
        places = {
            BENCH: there.benches,
            STUDY: there.studies,
            CAMPAIGN: there.campaigns,
            LIFE: there.lives,
            PROCEDURE: there.procedures,
        }
        places[kind][name] = subject
    else:
        there.maps.append(name)
