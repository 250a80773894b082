"""What screenshots are taken of: pages of both brakes, a report, pages of the site."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bywire
from report.live_page.page_benches import BENCHES, VARIED
from screenshots.taken import PHONE, WIDTH

ROOT = Path(__file__).resolve().parents[2]
COMPUTED = "() => run !== null && !busy && place('loops').textContent.includes('phase margin')"
_SITE = """import sys
sys.path.insert(0, {docs!r})
from conf import *
extensions, html_math_renderer, suppress_warnings = ["myst_parser"], "mathjax", ["myst"]
html_static_path, html_extra_path = [{docs!r} + "/static"], []
"""
_TEXT = """# A page of the site

Text with `code` in it, and a [link](index.md).

```sh
bywire run benches/hard_braking.toml --out results
```

## A table

| | motorcycle | wedge |
|---|---|---|
| size | 60 kB | 75 kB |
| step | 20 us | 20 us |

- **Curves**: a list of things.
- **Levels** below them.

:::{note}
What a reader should know.
:::

![](figure.png)

<iframe class="bench" title="a bench"></iframe>
"""


@dataclass(frozen=True)
class Subject:
    """A page of which screenshots are stored, one of each theme.

    Parameters
    ----------
    write
        ``write(folder)``: writes it and returns its file.
    width
        Of the window [px].
    ready
        Script that tells whether the page is whole.
    """

    write: Callable[[Path], Path]
    width: int = WIDTH
    ready: str = "() => true"


def _page(name: str) -> Callable[[Path], Path]:
    return lambda folder: (
        bywire.page(BENCHES[name], folder / f"{name}.html", vary=VARIED[name]).file
    )


def _report(folder: Path) -> Path:
    bywire.run(BENCHES["motorcycle"], estimate_error=False).write(folder)
    return folder / "report.html"


def _site(folder: Path) -> Path:
    """Make a site of one page and an index, with the settings and style of ours."""
    source = folder / "source"
    source.mkdir()
    (source / "conf.py").write_text(_SITE.format(docs=str(ROOT / "docs")), encoding="utf-8")
    (source / "index.md").write_text("# bywire\n\n```{toctree}\npage\n```\n", encoding="utf-8")
    (source / "page.md").write_text(_TEXT, encoding="utf-8")
    shutil.copy(ROOT / "docs" / "images" / "hard_braking.png", source / "figure.png")
    call = [sys.executable, "-m", "sphinx", "-q", "-b", "html", str(source), str(folder / "site")]
    subprocess.run(call, check=True, timeout=120)
    return folder / "site" / "page.html"


def without_site() -> str:
    """Return why no page of the site can be made; empty where one can."""
    wanted = ("sphinx", "myst_parser", "pydata_sphinx_theme", "sphinx_gallery", "numpydoc")
    missing = [name for name in wanted if importlib.util.find_spec(name) is None]
    return f"the site takes {', '.join(missing)}: pip install 'bywire[docs]'" if missing else ""


SUBJECTS = {
    "page-motorcycle": Subject(_page("motorcycle"), ready=COMPUTED),
    "page-wedge": Subject(_page("wedge"), ready=COMPUTED),
    "page-motorcycle-phone": Subject(_page("motorcycle"), PHONE, COMPUTED),
    "report": Subject(_report),
    "site": Subject(_site),
}
"""name -> subject"""
