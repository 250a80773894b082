"""Everything that has a name has its place on the site, and every page is led to."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import pytest

import bywire
from bywire import authoring
from bywire.bench.kpis.families import definitions
from bywire.cli.app import program
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.parameters import leaf_fields

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))

from site_pages import built, commands, markdown, pages, papers, search  # noqa: E402  beside what they describe

WRITTEN = [
    page
    for page in sorted(DOCS.rglob("*.md"))
    if not {"_build", "_generated", "trust"} & set(page.parts)
]


@pytest.fixture(scope="module")
def made() -> dict[str, str]:
    return dict(pages.texts())


def test_every_public_name_and_command_is_described(made: dict[str, str]) -> None:
    for name in bywire.__all__:
        assert re.search(rf":: bywire\.{name}$", made["python.rst"], re.M), name
    models = "".join(text for name, text in made.items() if name.startswith("authoring/"))
    for name in authoring.__all__:
        assert re.search(rf":: bywire\.authoring\.{name}$", models, re.M), name
    for words in commands.commands():
        assert f"## {words}\n" in made["commands.md"], words


def test_every_parameter_and_key_figure_is_described(made: dict[str, str]) -> None:
    notation = "".join(page.read_text("utf-8") for page in (DOCS / "notation").glob("*.md"))
    sets = "".join(text for name, text in made.items() if name.startswith("parameter-sets/"))
    for cited in PARAMETER_SETS.all().values():
        for name in leaf_fields(cited.parameter_class):
            assert f"`{name}`" in notation, name
            assert markdown.plain(name) in sets, name
    for name in definitions():
        assert f"KPI {markdown.plain(name)}" in made["key-figures.md"], name


def led_to(texts: dict[str, str]) -> set[str]:
    """Return all pages that a table of contents names, without their ending."""
    blocks = re.compile(
        r"^```\{toctree\}\n(.*?)```|^\.\. toctree::\n((?:   [^\n]*\n|\n)+)", re.S | re.M
    )
    known: set[str] = set()
    for page, text in texts.items():
        for line in "\n".join("".join(each) for each in blocks.findall(text)).splitlines():
            if (entry := line.strip()) and not entry.startswith(":"):
                entry = re.sub(r".*<(.*)>", r"\1", entry)
                target = ((DOCS / page).parent / entry).resolve().relative_to(DOCS).as_posix()
                known |= {name for name in texts if fnmatch(name, target)} or {target}
    return known


def test_every_page_is_led_to_and_is_there(made: dict[str, str]) -> None:
    texts = {
        page.relative_to(DOCS).with_suffix("").as_posix(): page.read_text("utf-8")
        for page in WRITTEN
    }
    texts |= {f"_generated/{name.rpartition('.')[0]}": text for name, text in made.items()}
    texts |= {f"_generated/papers/{source}": "" for source in papers.sources()}
    texts |= {"_generated/gallery/index": ""}
    assert led_to(texts) ^ texts.keys() == {"index"}
    assert led_to({**texts, "new": ""}) ^ texts.keys() == {"index"}  # one that nothing leads to


def blocks(page: Path, language: str) -> list[str]:
    """Return the code blocks of a page in a language."""
    return re.findall(
        rf"```{language}(?: run[^\n]*)?\n(.*?)```", page.read_text(encoding="utf-8"), re.S
    )


def command_lines(page: Path) -> Iterator[list[str]]:
    for block in blocks(page, "sh"):
        for line in block.replace("\\\n", "").splitlines():
            if line.startswith("bywire ") and "<TAB>" not in line:
                yield shlex.split(line, comments=True)[1:]
    for line in re.findall(r"^\| `bywire ([^`]+)` \|", page.read_text(encoding="utf-8"), re.M):
        yield shlex.split(line)


def parsed(words: list[str]) -> None:
    """Parse a command line as it would be started, and start nothing."""
    if words[0] == "--system":
        words = words[2:]
    command: Any = program()
    while hasattr(command, "commands") and words and words[0] in command.commands:
        command, words = command.commands[words[0]], words[1:]
    if words != ["--install-completion"]:
        taken = [w for k, w in enumerate(words) if "--system" not in words[max(k - 1, 0) : k + 1]]
        command.make_context("bywire", taken)


@pytest.mark.parametrize("page", [ROOT / "README.md", *WRITTEN], ids=lambda page: page.stem)
def test_every_command_that_is_shown_can_be_parsed(page: Path) -> None:
    for words in command_lines(page):
        parsed(words)


def test_a_command_with_an_option_that_does_not_exist_is_told() -> None:
    with pytest.raises(Exception, match="unheard"):
        parsed(["run", "hard-braking", "--unheard"])


def test_messages_of_the_page_of_troubleshooting_are_in_the_product() -> None:
    sources = [ROOT / "tasks.py", *sorted((ROOT / "src").rglob("*.py"))]
    product = "\n".join(path.read_text(encoding="utf-8") for path in sources)
    product = re.sub(r'"\s*\n\s*f?"', "", product)  # literals that follow each other are one text
    rows = re.findall(r"^\|([^|]*)\|", (DOCS / "troubleshooting.md").read_text("utf-8"), re.M)
    parts = [part for row in rows for part in re.findall(r"`([^`]+)`", row)]
    assert len(parts) > 30
    assert [part for part in parts if part not in product] == []


def test_letters_that_mean_something_in_markdown_are_escaped() -> None:
    assert markdown.plain("a_b *c* |d| <e>") == r"a\_b \*c\* \|d\| \<e\>"


def test_a_search_that_does_not_find_its_page_is_told() -> None:
    terms = '"terms":{"instal":[0,1],"window":1},"titleterms":{"maco":0}'
    index = f'Search.setIndex({{"docnames":["a","b"],{terms}}})'
    stem = {"windows": "window", "install": "instal", "macos": "maco"}.get
    queries = {"install windows": "b", "install": "a", "install macos": "a"}
    assert search.missed(index, stem, queries) == {}
    assert search.missed(index, stem, {"install windows": "a", "windows cat": "b"}) == {
        "install windows": "a",
        "windows cat": "b",
    }


def test_faults_of_a_built_site_are_told(tmp_path: Path) -> None:
    (tmp_path / "b.html").write_text('<h1 id="there">B</h1>')
    (tmp_path / "_modules").mkdir()
    (tmp_path / "_modules" / "m.html").write_text('<a href="gone.html">m</a>')
    links = '<a href="b.html#there">b</a> <a href="https://a.b/c">out</a> <img src="b.html?x=1">'
    page = tmp_path / "a.html"
    page.write_text(links)
    assert list(built.faults(tmp_path, {"a": 1})) == []
    page.write_text(f'{links} <a href="b.html#gone"></a> <a href="c.html"></a>')
    assert list(built.faults(tmp_path, {"a": 2})) == [
        "a does not show its 2 figures",
        "a has a dead link: b.html#gone",
        "a has a dead link: c.html",
    ]
    page.write_text('<script src="https://a.b/c.js"></script>')
    assert "loads from another host" in next(built.faults(tmp_path, {}))
