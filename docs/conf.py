"""Configuration of Sphinx for the site of these pages: ``python3 tasks.py docs``."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from site_pages.extension import FileScraper  # noqa: E402

from bywire import __version__  # noqa: E402  modules beside this file come first

project = "bywire"
author = copyright = "the bywire developers"
version = release = __version__
extensions = [
    "myst_parser",  # pages in Markdown
    "sphinx.ext.autodoc",
    "numpydoc",
    "sphinx.ext.viewcode",  # docstrings and sources
    "sphinx_gallery.gen_gallery",  # the examples, run
    "site_pages.extension",  # pages generated from the code
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = [
    "_build",
    "trust",
    "_generated/gallery-figures",
    "_generated/extra",
    "_generated/gallery/*.ipynb",
    "_generated/gallery/*.py",
]

myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
numpydoc_show_class_members = False
add_module_names = False
python_use_unqualified_type_names = True

sphinx_gallery_conf = {
    "examples_dirs": ["../examples/gallery"],
    "gallery_dirs": ["_generated/gallery"],
    "filename_pattern": r"\.py$",
    "image_scrapers": (FileScraper(),),
    "reset_argv": "site_pages.extension.arguments",
    "reset_modules": ("site_pages.extension.name_script",),
    "show_memory": False,
    "write_computation_times": False,
    "download_all_examples": False,
    "backreferences_dir": None,
}

smartquotes_action = "qe"  # -- is part of an option, not a dash

html_theme = "pydata_sphinx_theme"
html_title = "bywire"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = ["copy.js", "tables.js"]
html_extra_path = ["_generated/extra"]
(HERE / html_extra_path[0]).mkdir(parents=True, exist_ok=True)  # Sphinx checks for it early
html_math_renderer = "mathml"
html_show_sourcelink = False
html_sidebars = {name: [] for name in ("index", "start", "papers", "_generated/live")}
html_theme_options = {
    "logo": {"text": f"bywire {release}"},
    "show_prev_next": False,
    "navigation_with_keys": True,
    "show_toc_level": 2,
    "header_links_before_dropdown": 8,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": {"**": ["page-toc"], "cheat-sheet": []},
}
