"""Sphinx extension: generated pages, results, links that leave the folder, formulas, names."""

from __future__ import annotations

import builtins
import os
import re
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.errors import ExtensionError
from sphinx.util import logging
from sphinx_gallery.scrapers import figure_rst

from site_pages import built, gallery, pages, python_names, results, search

HERE = Path(__file__).parents[1]
GENERATED = HERE / "_generated"
GALLERY = HERE.parent / "examples" / "gallery"
FIGURES = GENERATED / "gallery-figures"
_log = logging.getLogger(__name__)
_shown: dict[str, list[results.Shown]] = {}  # page -> results of its marked blocks
_pictures: dict[str, list[str]] = {}  # marker in a page -> thumbnails that replace it

# Links that leave this folder in the repository -> the page that replaces them on the site.
_MOVED = {
    "../examples/emb_caliper": "_generated/example-emb_caliper.md",
    "../examples/emb_caliper/README.md": "_generated/example-emb_caliper.md",
    "../examples/one_box/README.md": "_generated/example-one_box.md",
    "../examples/truck_ebs/README.md": "_generated/example-truck_ebs.md",
    "../benches": "_generated/benches.md",
    "../src/bywire/plant": "_generated/elements/index.rst",
    "trust/": "trust.md",
}


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the generated pages, results, links, formulas and checks to Sphinx."""
    app.connect("builder-inited", _make_pages, priority=100)  # before the gallery
    app.connect("env-get-outdated", _pages_with_results)
    app.connect("source-read", _show_results)
    app.connect("source-read", _follow_links)
    app.connect("autodoc-process-signature", _own_result)
    app.connect("missing-reference", _public_name)
    app.connect("build-finished", _check_site)
    app.add_html_math_renderer("mathml", (_inline_math, None), (_displayed_math, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _make_pages(app: Sphinx) -> None:
    folder, sources = GENERATED / pages.RESULTS, pages.digest_of_sources()
    with ThreadPoolExecutor(os.cpu_count()) as pool:  # of processes
        texts = results.pages()
        started = results.start(pool, texts, folder, sources)
        pages.write(GENERATED, lambda what: _log.info("%s", what))
        texts |= (generated := results.pages(GENERATED))
        started |= results.start(pool, generated, folder, sources)
        for page, shown in started.items():
            try:
                _shown[page] = shown.result()
            except results.PageError as error:
                raise ExtensionError(f"{page}: {error}") from None
    place = f"_generated/{pages.RESULTS}"
    _pictures[gallery.MARKER] = list(gallery.lines(texts, _shown, folder, place))
    papers = gallery.paper_lines(GENERATED / "papers", "_generated/papers")
    _pictures[gallery.PAPER_MARKER] = list(papers)


def _pages_with_results(app: Sphinx, *changes: Any) -> list[str]:
    return [*_shown, "gallery", "papers"]


def _show_results(app: Sphinx, name: str, source: list[str]) -> None:
    if name in _shown:
        place = "../" * name.count("/") + f"_generated/{pages.RESULTS}/{name}"
        source[0] = results.with_results(source[0], _shown[name], place)
    for marker, lines in _pictures.items():
        source[0] = source[0].replace(marker, "\n".join(lines))


def _follow_links(app: Sphinx, name: str, source: list[str]) -> None:
    up = "../" * name.count("/")
    for target, page in _MOVED.items():
        source[0] = source[0].replace(f"]({up}{target})", f"]({up}{page})")


class FileScraper:
    """Scraper of the figures that an example writes into its ``--out`` folder."""

    def __call__(self, block: Any, block_vars: dict[str, Any], gallery_conf: Any) -> str:
        """Return the new figures as reStructuredText."""
        moved = []
        for file in sorted(FIGURES.glob("*.png")):
            target = Path(next(block_vars["image_path_iterator"]))
            file.replace(target)
            moved.append(str(target))
        return figure_rst(moved, gallery_conf["src_dir"])

    def __repr__(self) -> str:
        return "FileScraper()"


def name_script(gallery_conf: Any, script: str) -> None:
    """Set ``__file__`` for an example, as for a script."""
    vars(builtins)["__file__"] = str(GALLERY / Path(script).name)


def arguments(gallery_conf: Any, script: dict[str, Any]) -> list[str]:
    """Return the arguments of a gallery example."""
    FIGURES.mkdir(parents=True, exist_ok=True)
    return ["--out", str(FIGURES)]


def _own_result(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str, result: str
) -> tuple[str, str] | None:
    """Link the result of a public function to the class that users import from the same place."""
    face = name.rpartition(".")[0]
    return (signature, f"{face}.{result}") if f"{face}.{result}" in _classes() else None


@cache
def _classes() -> frozenset[str]:
    return frozenset(f"bywire.{name}" for name in python_names.public())


def _public_name(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.Element
) -> nodes.Node | None:
    """Link a type in a signature to the name that users import, or show it without a link."""
    if node.get("refdomain") != "py":
        return None
    target = node["reftarget"]
    public = python_names.homes().get(target, "")
    if public and public != target:
        found = env.domains["py"].resolve_xref(
            env, node["refdoc"], app.builder, "obj", public, node, content
        )
        if found is not None:
            return found
    is_written = node.get("refexplicit") or node.get("reftype") not in ("class", "obj")
    return None if is_written else content


def _math(text: str, node: nodes.Element, as_block: bool) -> str:
    try:
        return str(tex2mathml(text, as_block=as_block))
    except MathError as error:
        _log.warning("a formula that cannot be shown: %s: %s", text, error, location=node)
        return f"<code>{nodes.unescape(text)}</code>"


def _inline_math(writer: Any, node: nodes.Element) -> None:
    writer.body.append(_math(node.astext(), node, as_block=False))
    raise nodes.SkipNode


def _displayed_math(writer: Any, node: nodes.Element) -> None:
    for part in re.split(r"\n\s*\n", node.astext()):
        writer.body.append(f'<div class="math">{_math(part, node, as_block=True)}</div>')
    raise nodes.SkipNode


def _check_site(app: Sphinx, error: Exception | None) -> None:
    if error is not None or app.builder.format != "html":
        return
    folder = Path(app.outdir).resolve()
    pictures = {page: sum(len(each.figures) for each in shown) for page, shown in _shown.items()}
    faults = list(built.faults(folder, pictures))
    index = (folder / "searchindex.js").read_text(encoding="utf-8")
    missed = search.missed(index, app.builder.indexer.lang.stem)
    faults += [f"the search for {words!r} does not find {page}" for words, page in missed.items()]
    if faults:
        raise ExtensionError("\n".join(faults))
