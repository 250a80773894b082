"""Pages that show files of the repository: bench files, the third brake, the changelog."""

from __future__ import annotations

import re
from pathlib import Path

from site_pages.markdown import plain

ROOT = Path(__file__).parents[2]
_LINK = re.compile(r"\[([^\]]*)\]\((?!https?:|#)[^)]*\)")


def benches_page() -> str:
    """Return the page of all bench, study and procedure files with their full text."""
    lines = [
        "# Bench, study and procedure files",
        "",
        "These files are in the repository's folders `benches/`, `studies/` and `procedures/`. "
        "[](../bench-files.md), [](../studies.md) and [](../procedures.md) describe all keys.",
        "",
    ]
    for folder in ("benches", "studies", "procedures"):
        for path in sorted((ROOT / folder).glob("*.toml")):
            text = path.read_text(encoding="utf-8").rstrip()
            lines += [f"## {plain(f'{folder}/{path.name}')}", "", "```toml", text, "```", ""]
    return "\n".join(lines)


def example_pages() -> dict[str, str]:
    """Return the READMEs of the example packages, without links, by the name of their folder."""
    readmes = sorted((ROOT / "examples").glob("*/README.md"))
    return {
        path.parent.name: _LINK.sub(r"`\1`", path.read_text(encoding="utf-8")) for path in readmes
    }


def changes_page() -> str:
    """Return the changelog, without links."""
    return _LINK.sub(r"`\1`", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))
