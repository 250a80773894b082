"""Files of the repository that are worth a page: bench files, the third brake, what changed."""

from __future__ import annotations

import re
from pathlib import Path

from site_pages.markdown import plain

ROOT = Path(__file__).parents[2]
_LINK = re.compile(r"\[([^\]]*)\]\((?!https?:|#)[^)]*\)")


def benches_page() -> str:
    """Return the page of all bench and study files, each as it stands."""
    lines = [
        "# Bench and study files",
        "",
        "They stand in `benches/` and `studies/` of the repository. Every key: "
        "[](../bench-files.md), [](../studies.md).",
        "",
    ]
    for folder in ("benches", "studies"):
        for path in sorted((ROOT / folder).glob("*.toml")):
            text = path.read_text(encoding="utf-8").rstrip()
            lines += [f"## {plain(f'{folder}/{path.name}')}", "", "```toml", text, "```", ""]
    return "\n".join(lines)


def third_brake_page() -> str:
    """Return what the package of the third brake says of itself; its links lead to no page."""
    text = (ROOT / "examples" / "emb_caliper" / "README.md").read_text(encoding="utf-8")
    return _LINK.sub(r"`\1`", text)


def changes_page() -> str:
    """Return what changed, from version to version."""
    return _LINK.sub(r"`\1`", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))
