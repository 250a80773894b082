"""Thumbnails of all figures on the site's pages, each with its command."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from PIL import Image

from site_pages.markdown import plain
from site_pages.results import Shown, Step, steps

MARKER = "<!-- pictures -->"
PAPER_MARKER = "<!-- pictures of the papers -->"
EXPERIMENTS = "_generated/experiments/"
_SIZE = (480, 360)  # px; a higher figure is cut off below
# An experiment is shown by the first of its figures whose name begins with one of these.
_FIRST = (
    "step-response",
    "hysteresis-loop",
    "stribeck",
    "brake-factor",
    "tracking",
    "sine-sweep",
    "road-marks",
    "overlaid-traces",
    "time-traces",
    "",
)


def lines(
    texts: Mapping[str, str], shown: Mapping[str, list[Shown]], folder: Path, place: str
) -> Iterator[str]:
    """Yield the cards by page, and write their thumbnails next to the figures.

    Parameters
    ----------
    texts
        Page -> its text.
    shown
        Page -> results of its marked blocks.
    folder
        Folder of all figures.
    place
        Path of that folder from the gallery's page.
    """
    groups: dict[str, list[str]] = {"Experiments": []}
    for page, results in shown.items():
        title = texts[page].partition("# ")[2].partition("\n")[0]
        cards = [
            _card(page, _command(step, path), folder / page / file, place)
            for step, result in zip(steps(texts[page]), results, strict=True)
            for path, file in _chosen(page, result.figures)
        ]
        is_experiment = page.startswith(EXPERIMENTS)
        heading = "Experiments" if is_experiment else f"[{title}]({page}.md)"
        groups.setdefault(heading, []).extend(cards)
    for heading, cards in groups.items():
        if cards:
            yield _group(heading, cards)


def _group(heading: str, cards: Iterable[str]) -> str:
    return f"## {heading}\n\n::::{{container}} gallery\n\n{''.join(cards)}::::\n"


def _chosen(page: str, figures: Mapping[str, str]) -> Iterable[tuple[str, str]]:
    if not page.startswith(EXPERIMENTS):
        return figures.items()

    def rank(figure: tuple[str, str]) -> int:
        name = Path(figure[0]).name
        return next(k for k, start in enumerate(_FIRST) if name.startswith(start))

    return sorted(figures.items(), key=rank)[:1]


def _command(step: Step, path: str) -> str:
    """Return the line of a block that wrote a figure."""
    folder = path.rpartition("/")[0]
    written = [line for line in step.text.splitlines() if folder in line]
    return (written or step.commands)[-1].partition("   #")[0]


def _card(page: str, command: str, file: Path, place: str) -> str:
    small = file.with_name(f"small-{file.name}")
    with Image.open(file) as image:
        part = image.crop((0, 0, image.width, min(image.height, image.width * 3 // 4)))
        part.thumbnail(_SIZE)
        part.convert("RGB").quantize(64).save(small)
    name = plain(file.stem.partition("-")[2].replace("-", " "))
    head = f":::{{figure}} {place}/{page}/{small.name}\n:target: {page}.html\n:alt: {name}\n"
    return f"{head}\n`{command}`\n:::\n\n"


def paper_lines(folder: Path, place: str) -> Iterator[str]:
    """Yield the cards of the papers' figures.

    Parameters
    ----------
    folder
        Folder of the pages of papers, with a folder of figures for each.
    place
        Path of that folder from the page of the cards.
    """
    for figures in sorted(folder.glob("*-figures")):
        source = figures.name.removesuffix("-figures")
        files = sorted(figures.iterdir(), key=lambda file: int(file.stem.rpartition("-")[2]))
        cards = (
            f":::{{figure}} {place}/{figures.name}/{file.name}\n"
            f":target: {place}/{source}.html\n:alt: {file.stem.rpartition('-')[0]}\n\n"
            f"{file.stem.rpartition('-')[0]}\n:::\n\n"
            for file in files
        )
        yield _group(f"`bywire reproduce {source}`", cards)
