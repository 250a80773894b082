"""All generated pages, and the check whether to generate them again."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

from site_pages import (
    catalog,
    commands,
    element_figures,
    elements,
    live_pages,
    papers,
    python_names,
    repository_files,
    results,
)

ROOT = Path(__file__).parents[2]
STAMP = "made-of"
RESULTS = "results"


def texts() -> Iterator[tuple[str, str]]:
    """Yield file and text of the pages that need no computation."""
    yield "brakes.md", catalog.brakes_page()
    yield from catalog.texts()
    yield "faults.md", catalog.faults_page()
    yield "loop-figures.md", catalog.loop_figures_page()
    yield "commands.md", commands.page()
    yield "python.rst", python_names.page()
    yield from python_names.authoring_pages()
    yield "errors.rst", python_names.errors_page()
    yield "elements/index.rst", elements.index()
    for inside in elements.modules().values():
        for module in inside.values():
            yield f"elements/{module.__name__}.rst", elements.page(module)
    yield "benches.md", repository_files.benches_page()
    for example, text in repository_files.example_pages().items():
        yield f"example-{example}.md", text
    yield "changes.md", repository_files.changes_page()
    yield "live.md", live_pages.page()


def write(folder: Path, said: Callable[[str], None]) -> None:
    """Write all pages, unless their sources are unchanged."""
    digest = digest_of_sources(Path(__file__).parent, ROOT / "CHANGELOG.md")
    stamp = folder / STAMP
    if stamp.exists() and stamp.read_text() == digest:
        return
    if stamp.exists():
        stamp.unlink()
    kept = {"gallery", RESULTS}  # they have their own records of changes
    for path in folder.iterdir() if folder.exists() else ():
        if path.name not in kept:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    said("pages of elements, commands and names")
    for name, text in texts():
        _write(folder / name, text)
    element_figures.write(folder / "elements" / element_figures.PLACE)
    for source in papers.sources():
        said(f"reproducing {source}")
        _write(folder / "papers" / f"{source}.md", papers.page(source, folder / "papers"))
    said("live benches")
    live_pages.write(folder / "extra" / "live")
    stamp.write_text(digest)


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def digest_of_sources(*more: Path) -> str:
    """Return a digest of the sources that commands run, and of more files and folders."""
    digest = hashlib.sha256()
    places = (*(ROOT / each for each in ("src", *results.FOLDERS)), *more)
    inside = (p for place in places for p in (place, *place.rglob("*")) if p.suffix != ".pyc")
    for path in sorted({p for p in inside if p.is_file()}):
        digest.update(path.relative_to(ROOT).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()
