"""Everything that has a name has its place on the site, and every page is led to."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Iterator
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

from site_pages import commands, markdown, pages, papers  # noqa: E402  beside what they describe

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
    for name in authoring.__all__:
        assert re.search(rf":: bywire\.authoring\.{name}$", made["authoring.rst"], re.M), name
    for words in commands.commands():
        assert f"## {words}\n" in made["commands.md"], words


def test_every_parameter_and_key_figure_is_described(made: dict[str, str]) -> None:
    notation = (DOCS / "notation.md").read_text(encoding="utf-8")
    for cited in PARAMETER_SETS.all().values():
        for name in leaf_fields(cited.parameter_class):
            assert f"`{name}`" in notation, name
            assert markdown.plain(name) in made["parameter-sets.md"], name
    for name in definitions():
        assert f"KPI {markdown.plain(name)}" in made["key-figures.md"], name


def led_to() -> set[str]:
    """Return all pages that a table of contents names, without their ending."""
    known: set[str] = set()
    for page in WRITTEN:
        for block in re.findall(r"```\{toctree\}\n(.*?)```", page.read_text(), re.S):
            for line in block.splitlines():
                if line and not line.startswith(":"):
                    target = (page.parent / line).resolve().relative_to(DOCS).as_posix()
                    known |= set(_matching(target))
    return known


def _matching(target: str) -> Iterator[str]:
    if "*" not in target:
        yield target
    elif target == "_generated/papers/*":
        yield from (f"_generated/papers/{source}" for source in papers.sources())
    else:
        for path in DOCS.glob(f"{target}.md"):
            yield path.relative_to(DOCS).with_suffix("").as_posix()


def test_every_page_is_led_to_and_is_there(made: dict[str, str]) -> None:
    written = {page.relative_to(DOCS).with_suffix("").as_posix() for page in WRITTEN}
    generated = {f"_generated/{Path(name).with_suffix('').as_posix()}" for name in made}
    generated |= {f"_generated/papers/{source}" for source in papers.sources()}
    elements = {name for name in generated if name.startswith("_generated/elements/bywire")}
    there = (written | generated) - elements | {"_generated/gallery/index"}
    assert led_to() ^ there == {"index"}
    for name in elements:
        assert name.removeprefix("_generated/elements/") in made["elements/index.rst"]


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
