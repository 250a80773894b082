"""The generated pages of the documentation say what the code says."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MAKER = runpy.run_path(str(ROOT / "docs" / "make_notation.py"))


@pytest.mark.parametrize("page", MAKER["PAGES"])
def test_page_is_current(page: str) -> None:
    written = (ROOT / "docs" / page).read_text(encoding="utf-8")
    assert written == MAKER["PAGES"][page](), "run: python docs/make_notation.py"


@pytest.mark.parametrize(
    ("name", "symbol"),
    [
        ("seal.f_cfr_p", "$f_{cfr,p}$"),
        ("gear.eta_g", r"$\eta_{g}$"),
        ("omega", r"$\Omega$"),
        ("i_star", "$i^*$"),
        ("s1", "$s_{1}$"),
        ("ecu.dither.gain", ""),
    ],
)
def test_symbols_follow_from_names(name: str, symbol: str) -> None:
    assert MAKER["symbol"](name) == symbol


PAGES = [
    page
    for page in sorted((ROOT / "docs").rglob("*.md"))
    if not {"_build", "_generated"} & set(page.parts)
]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)\)", text):
        if not target.startswith("http") and "_generated/" not in target:
            assert (page.parent / target).exists(), target
    for target in re.findall(r"`((?:src|docs|examples|benches|tests)/[\w/.-]+)`", text):
        assert (ROOT / target).exists(), target


def test_trust_page_says_what_the_studies_say() -> None:
    maker = runpy.run_path(str(ROOT / "docs" / "make_trust.py"))
    written = (ROOT / "docs" / "trust.md").read_text(encoding="utf-8")
    assert written == maker["page"](), "run: python docs/make_trust.py FOLDER"
